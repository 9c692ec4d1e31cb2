//! What the fusion centre does with the symbols: estimate, decide, or test.

use crate::error::{Error, refuse};
use crate::problem::Reports;
use crate::scene::Feature;
use crate::system::System;
use crate::table::{JointTable, Layout};

/// Posterior mean and variance of the unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// `E[X | T = t]`, the estimate of least mean squared error.
    pub mean: f64,
    /// `var[X | T = t]`.
    pub variance: f64,
}

/// Look-up table of the posterior mean: exact, constant time, bounded in size.
///
/// Sensors of a group are counted, not told apart, so nine identical sensors of four levels take 220 entries.
///
/// ```
/// use fewbits_quantizer_design::{Quantizer, Scene, System, decoder::MmseDecoder};
/// let system = System::identical(Scene::gaussian(1.0, &[1.0; 9])?, Quantizer::symmetric(1.38)?)?;
/// let decoder = MmseDecoder::new(&system, 220)?;
/// let estimate = decoder.decode(&[3, 2, 2, 3, 1, 2, 3, 2, 2])?;
/// assert!((estimate.mean - 0.9).abs() < 0.1 && estimate.variance < 0.13);
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MmseDecoder {
    layout: Layout,
    /// Probability, mean and variance of each outcome.
    entries: Vec<[f64; 3]>,
}

impl MmseDecoder {
    /// Tabulates the posterior of every joint outcome, at most `limit` of them.
    ///
    /// # Errors
    /// [`Error::TooLarge`] beyond `limit`: decode such systems by a filter on the likelihoods instead.
    pub fn new(system: &System, limit: usize) -> Result<Self, Error> {
        if system.outcomes() > limit as u64 {
            return Err(Error::TooLarge {
                table: "decoder",
                needed: system.outcomes(),
                limit: limit as u64,
            });
        }
        let scene = system.scene();
        let reports = Reports::of(
            &system
                .clone()
                .with_outcome_limit(system.outcome_limit().max(limit as u64)),
        )?;
        let mut square = vec![0.0; scene.nodes()];
        for ((given, w), x) in scene.given.iter().zip(&scene.weights).zip(&scene.values) {
            for (i, p) in given.weights.iter().enumerate() {
                square[given.start + i] += w * x * x * p;
            }
        }
        let features = [
            scene.mass.clone(),
            scene.moment.clone(),
            Feature {
                start: 0,
                weights: square,
            },
        ];
        let entry = |m: &[f64]| {
            if m[0] > 0.0 {
                let mean = m[1] / m[0];
                [m[0], mean, (m[2] / m[0] - mean * mean).max(0.0)]
            } else {
                [0.0, scene.sample_mean(), scene.prior_variance()]
            }
        };
        let entries = reports.moments(&features).chunks_exact(3).map(entry).collect();
        Ok(Self {
            layout: Layout::new(system),
            entries,
        })
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no entry; never so.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The estimate when sensor `n` was heard as symbol `symbols[n]`.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one symbol a sensor or one is out of range; [`Error::ImpossibleOutcome`] if the
    /// outcome has probability 0 under the model, in which case the caller's belief should stand.
    pub fn decode(&self, symbols: &[usize]) -> Result<Estimate, Error> {
        let [probability, mean, variance] = self.entries[self.layout.index(symbols)?];
        if probability > 0.0 {
            Ok(Estimate { mean, variance })
        } else {
            Err(Error::ImpossibleOutcome)
        }
    }
}

/// The randomised Neyman-Pearson test between two values of the unknown on the joint outcome.
///
/// Outcomes are accepted for the second value in decreasing order of their likelihood ratio until the false-alarm budget is
/// spent; the outcome on which it runs out is accepted with a probability.
#[derive(Debug, Clone, PartialEq)]
pub struct NeymanPearson {
    table: JointTable,
    /// Probability of accepting the second value, an outcome.
    acceptance: Vec<f64>,
    detection: f64,
}

impl NeymanPearson {
    /// The most powerful test of the second value of the prior against the first with false-alarm probability `false_alarm`.
    ///
    /// # Errors
    /// Unless the prior has exactly two values and `false_alarm` is inside (0, 1); [`Error::TooLarge`] as [`JointTable::new`].
    pub fn new(system: &System, false_alarm: f64) -> Result<Self, Error> {
        if !(false_alarm > 0.0 && false_alarm < 1.0) {
            return refuse("false_alarm", false_alarm, "a probability inside (0, 1)");
        }
        if !system.scene().is_discrete() || system.scene().values().len() != 2 {
            return refuse("prior", "not two hypotheses", "a discrete prior on two values");
        }
        let table = JointTable::new(system)?;
        let mut order: Vec<usize> = (0..table.outcomes()).collect();
        // P1/P0 descending, without dividing by what may be 0.
        order.sort_by(|a, b| {
            let (p, q) = (table.likelihood(*a), table.likelihood(*b));
            (q[1] * p[0]).total_cmp(&(p[1] * q[0]))
        });
        let (mut acceptance, mut left, mut detection) = (vec![0.0; order.len()], false_alarm, 0.0);
        for outcome in order {
            let p = table.likelihood(outcome);
            let share = if p[0] <= left { 1.0 } else { left / p[0] };
            acceptance[outcome] = share;
            detection += share * p[1];
            left -= share * p[0];
            if share < 1.0 {
                break;
            }
        }
        Ok(Self {
            table,
            acceptance,
            detection,
        })
    }

    /// Probability of accepting the second value when it is true.
    pub fn detection_probability(&self) -> f64 {
        self.detection
    }

    /// Probability with which to accept the second value when sensor `n` was heard as `symbols[n]`: 0 or 1 but for one outcome.
    ///
    /// # Errors
    /// If there is not one symbol a sensor, or one is out of range.
    pub fn acceptance(&self, symbols: &[usize]) -> Result<f64, Error> {
        Ok(self.acceptance[self.table.outcome(symbols)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Criterion, Prior, Quantizer, Scene, scene::Noise};

    #[test]
    fn the_table_attains_the_mean_squared_error() {
        let scene = Scene::gaussian(1.0, &[1.0, 0.7]).unwrap();
        let q = Quantizer::symmetric(1.2).unwrap();
        let system = System::ideal(scene, vec![q.clone(), q]).unwrap();
        let decoder = MmseDecoder::new(&system, 16).unwrap();
        let mean_variance: f64 = decoder.entries.iter().map(|e| e[0] * e[2]).sum();
        assert!((mean_variance - system.value(Criterion::MeanSquaredError).unwrap()).abs() < 1e-13);
        let mirrored = decoder.decode(&[0, 0]).unwrap().mean + decoder.decode(&[3, 3]).unwrap().mean;
        assert!(mirrored.abs() < 1e-14);
        assert!(decoder.decode(&[0]).is_err());
        assert!(decoder.decode(&[0, 4]).is_err());
        assert!(matches!(MmseDecoder::new(&system, 15), Err(Error::TooLarge { needed: 16, .. })));
    }

    #[test]
    fn the_test_spends_its_budget_exactly() {
        let scene = Scene::new(Prior::binary(2.0, 0.5).unwrap(), Noise::independent(&[1.0; 3]).unwrap()).unwrap();
        let system = System::identical(scene, Quantizer::new(vec![0.0, 1.0, 2.0]).unwrap()).unwrap();
        let mut last: f64 = 0.0;
        for alpha in [1e-6, 0.01, 0.3, 0.9] {
            let test = NeymanPearson::new(&system, alpha).unwrap();
            let spent: f64 = (0..test.table.outcomes())
                .map(|t| test.acceptance[t] * test.table.likelihood(t)[0])
                .sum();
            assert!((spent - alpha).abs() < 1e-14);
            assert!(test.detection_probability() > last.max(alpha));
            last = test.detection_probability();
        }
        assert!(NeymanPearson::new(&system, 0.0).is_err());
        assert!(NeymanPearson::new(&system, 1.0).is_err());
    }

    #[test]
    fn equivocation_and_information_make_up_the_prior_entropy() {
        let scene = Scene::new(Prior::binary(1.0, 0.3).unwrap(), Noise::independent(&[1.0; 3]).unwrap()).unwrap();
        let system = System::identical(scene, Quantizer::new(vec![0.5]).unwrap()).unwrap();
        let table = JointTable::new(&system).unwrap();
        let entropy = -(0.3 * f64::ln(0.3) + 0.7 * f64::ln(0.7));
        let sum = table.equivocation().unwrap() + system.value(Criterion::MutualInformation).unwrap();
        assert!((sum - entropy).abs() < 1e-14);
        assert_eq!(table.outcome(&[0, 1, 0]), table.outcome(&[1, 0, 0]));
        assert_eq!(table.multiplicity(table.outcome(&[0, 1, 0]).unwrap()), 3.0);
    }
}
