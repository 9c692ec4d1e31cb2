//! Alternating maximisation for one sensor (Algorithm 7, with its stopping rule corrected).
//!
//! ```text
//! b <- initial breakpoints;  I_old <- I(b)
//! repeat
//!     score(t, x) <- ln p(t | x) / p(t) under b                       # the decoder for the present cells
//!     D_z(y)      <- E[ sum_t C[t, z] score(t', t, X) ; Y = y ]       # gain of reporting y as z
//!     cells       <- { y : argmax_z D_z(y) }                          # edges to machine precision
//!     I_new       <- I(b)
//! until |I_new - I_old| <= tolerance * I_new and no breakpoint moved by more than breakpoint_tolerance
//! ```
//!
//! No half step can lower the criterion. Convergence is linear: 25 steps to 1e-12 for four levels in unit noise and 85
//! for eight, where Newton's method ([`joint`](fewbits_quantizer_design::design::joint)) takes five and seven. Its advantage is that it finds the cells by
//! itself, contiguous or not. The printed algorithm stops if the *un-normalised* objective `E ln p(x | z)` has a small relative
//! change. That objective is negative in common cases and depends on the unit of `x`, so mutual information
//! is used here (errata). Edges are found by root search; decisions cell by cell on a fixed grid of `y` stop up to 10 % short.

use super::gains::{LevelGains, single_sensor};
use fewbits_numerics::newton;
use fewbits_quantizer_design::outcomes::dot;
use fewbits_quantizer_design::{AllowedCells, Criterion, Error, System};
use fewbits_quantizers::Quantizer;

/// Range of the sample axis that is scanned, in standard deviations to either side, and number of steps.
const REACH: f64 = 7.0;
const SCAN: usize = 560;

/// Stopping rule of [`alternate`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternating {
    /// The iteration ends at this relative change of the criterion.
    pub tolerance: f64,
    /// Largest change of a breakpoint that is allowed at the end, in standard deviations of the sample.
    pub breakpoint_tolerance: f64,
    /// Largest number of steps.
    pub max_iterations: usize,
    /// Whether a level may have several intervals.
    pub cells: AllowedCells,
}

impl Default for Alternating {
    fn default() -> Self {
        Self {
            tolerance: 1e-12,
            breakpoint_tolerance: f64::INFINITY,
            max_iterations: 1000,
            cells: AllowedCells::Intervals,
        }
    }
}

/// Result of [`alternate`].
#[derive(Debug, Clone, PartialEq)]
pub struct Alternated {
    /// The system with the designed quantizer.
    pub system: System,
    /// Value of the criterion.
    pub value: f64,
    /// Number of steps.
    pub iterations: usize,
}

/// Designs the quantizer of the single sensor in group `group` by alternating maximisation; all others are fixed.
///
/// # Errors
/// [`Error::NotConverged`] at the iteration limit; [`Error::NotContiguous`] if contiguous cells were asked for but are not the
/// best; [`Error::VanishingCell`] if a level is the best one nowhere; [`Error::Argument`] if the group is not a single sensor.
pub fn alternate(system: &System, group: usize, criterion: Criterion, rule: &Alternating) -> Result<Alternated, Error> {
    let mut current = system.clone();
    let mut value = current.value(criterion)?;
    let mut change = f64::INFINITY;
    let spread = system
        .model()
        .sample_deviation(single_sensor(system, group)?.sensors[0]);
    for iteration in 1..=rule.max_iterations {
        let old = single_sensor(&current, group)?.quantizer.clone();
        let quantizer = alternating_step(&current, group, criterion)?;
        if rule.cells == AllowedCells::Intervals
            && quantizer
                .labels()
                .iter()
                .enumerate()
                .any(|(cell, level)| cell != *level)
        {
            return Err(Error::NotContiguous {
                labels: quantizer.labels().to_vec(),
            });
        }
        // Breakpoints can be compared only as long as the cells keep their labels.
        let moved = if old.labels() == quantizer.labels() {
            let pairs = old.breakpoints().iter().zip(quantizer.breakpoints());
            pairs.fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
        } else {
            f64::INFINITY
        };
        current = current.with_quantizer(group, quantizer)?;
        let next = current.value(criterion)?;
        change = (next - value).abs();
        value = next;
        if change <= rule.tolerance * value.abs() && moved <= rule.breakpoint_tolerance * spread {
            return Ok(Alternated {
                system: current,
                value,
                iterations: iteration,
            });
        }
    }
    Err(Error::NotConverged {
        algorithm: "alternating maximisation",
        iterations: rule.max_iterations,
        change,
    })
}

/// One step of [`alternate`]: the best cells for the decoder that belongs to the present cells.
///
/// # Errors
/// As [`alternate`].
pub fn alternating_step(system: &System, group: usize, criterion: Criterion) -> Result<Quantizer, Error> {
    let entry = single_sensor(system, group)?;
    let LevelGains {
        gains,
        means,
        deviation,
    } = LevelGains::new(system, group, criterion)?;
    let worth = Worth {
        gains: &gains,
        means: &means,
        deviation,
    };

    let model = system.model();
    let spread = model.sample_deviation(entry.sensors[0]);
    let start = model.prior().mean() - REACH * spread;
    let step = 2.0 * REACH * spread / SCAN as f64;
    let (mut labels, mut breakpoints) = (vec![worth.best(start)], Vec::new());
    for i in 1..=SCAN {
        let y = start + i as f64 * step;
        let best = worth.best(y);
        let last = labels[labels.len() - 1];
        if best != last {
            breakpoints.push(worth.crossing(last, best, y - step, y));
            labels.push(best);
        }
    }
    let levels = entry.quantizer.levels();
    if let Some(cell) = (0..levels).find(|z| !labels.contains(z)) {
        return Err(Error::VanishingCell {
            quantizer: group,
            cell,
            probability: 0.0,
        });
    }
    Quantizer::with_labels(breakpoints, labels)
}

/// The functions `D_z(y)`: sums over the nodes of gain times density of the sample. Far out, the density is available as a logarithm only.
struct Worth<'a> {
    gains: &'a [Vec<f64>],
    means: &'a [f64],
    deviation: f64,
}

impl Worth<'_> {
    /// Logarithm of the sample's density at `y` given a node's mean, up to a constant.
    fn log_density(&self, y: f64, mean: f64) -> f64 {
        let u = (y - mean) / self.deviation;
        -0.5 * u * u
    }

    fn best(&self, y: f64) -> usize {
        // Relative to the likeliest node, since far from all means every density underflows.
        let logs: Vec<f64> = self.means.iter().map(|m| self.log_density(y, *m)).collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let density: Vec<f64> = logs.iter().map(|l| (l - largest).exp()).collect();
        let mut best = (0, f64::NEG_INFINITY);
        for z in 0..self.gains.len() {
            let worth = dot(&density, &self.gains[z]);
            if worth > best.1 {
                best = (z, worth);
            }
        }
        best.0
    }

    /// The sample at which level `after` becomes better than level `before`, which is the better one at `low` and the worse one at `high`.
    ///
    /// The root of `ln A - ln B`, where `A` is the sum over the nodes at which `after` gains and `B` the sum over the nodes at
    /// which it loses. For two hypotheses this function is a straight line.
    fn crossing(&self, before: usize, after: usize, low: f64, high: f64) -> f64 {
        let pairs = self.gains[after].iter().zip(&self.gains[before]);
        let (mut gained, mut lost) = (Vec::new(), Vec::new());
        for ((a, b), mean) in pairs.zip(self.means) {
            match a - b {
                d if d > 0.0 => gained.push((*mean, d.ln())),
                d if d < 0.0 => lost.push((*mean, (-d).ln())),
                _ => {}
            }
        }
        let lead = |y: f64| {
            let ((a, slope_a), (b, slope_b)) = (self.log_sum(&gained, y), self.log_sum(&lost, y));
            (a - b, slope_a - slope_b)
        };
        let size = low.abs().max(high.abs()).max(self.deviation);
        newton::increasing(lead, low, high, 0.5 * (low + high), 1e-15 * size)
    }

    /// `ln sum d p(y | mean)` over pairs `(mean, ln d)`, and its derivative with respect to `y`.
    fn log_sum(&self, terms: &[(f64, f64)], y: f64) -> (f64, f64) {
        let log = |(mean, d): &(f64, f64)| d + self.log_density(y, *mean);
        let largest = terms.iter().map(log).fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return (largest, 0.0);
        }
        let (mut sum, mut slope) = (0.0, 0.0);
        for term in terms {
            let share = (log(term) - largest).exp();
            sum += share;
            slope -= share * (y - term.0) / (self.deviation * self.deviation);
        }
        (largest + sum.ln(), slope / sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_quantizer_design::observation_model::ObservationModel;
    use fewbits_quantizers::lloyd_max;

    /// Erratum `mi-2`.
    #[test]
    fn converges_to_the_stationary_point_of_newton() {
        let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0]).unwrap();
        let start = System::ideal(model, vec![Quantizer::from(&lloyd_max::gaussian(4).unwrap())]).unwrap();
        let criterion = Criterion::MutualInformation;
        let rule = Alternating {
            breakpoint_tolerance: 1e-12,
            ..Alternating::default()
        };
        let slow = alternate(&start, 0, criterion, &rule).unwrap();
        let fast =
            fewbits_quantizer_design::design::joint(&start, criterion, &fewbits_quantizer_design::Newton::default())
                .unwrap();
        let (a, b) = (slow.system.quantizers(), fast.system.quantizers());
        assert!((a[0].breakpoints()[2] - b[0].breakpoints()[2]).abs() < 1e-10);
        assert!(slow.iterations > 5 * fast.iterations, "{} {}", slow.iterations, fast.iterations);
        let short = Alternating {
            max_iterations: 3,
            ..rule
        };
        assert!(matches!(alternate(&start, 0, criterion, &short), Err(Error::NotConverged { iterations: 3, .. })));
    }

    /// The best cells of two equally likely hypotheses meet midway, by symmetry. From a signal of 14 on densities underflow, from
    /// 76 on the probabilities of wrong symbols.
    #[test]
    fn distant_hypotheses_are_parted_midway() {
        use fewbits_quantizer_design::observation_model::{Noise, Prior};
        for signal in [4.0, 14.0, 40.0, 100.0, 1000.0] {
            let noise = Noise::independent_with_deviations(&[1.0]).unwrap();
            let model = ObservationModel::new(Prior::binary(signal, 0.5).unwrap(), noise).unwrap();
            let start = Quantizer::new(vec![0.5 * signal + 0.1]).unwrap();
            let system = System::ideal(model, vec![start]).unwrap();
            for criterion in [Criterion::MutualInformation, Criterion::BayesError] {
                let step = alternating_step(&system, 0, criterion).unwrap();
                assert_eq!(step.labels(), [0, 1], "{signal} {criterion:?}");
            }
            let rule = Alternating {
                breakpoint_tolerance: 1e-9,
                ..Alternating::default()
            };
            let end = alternate(&system, 0, Criterion::MutualInformation, &rule)
                .unwrap()
                .system
                .quantizers();
            assert!((end[0].breakpoints()[0] / signal - 0.5).abs() < 1e-6, "{signal}: {}", end[0].breakpoints()[0]);
        }
    }

    #[test]
    fn one_step_for_squared_error_is_a_lloyd_sweep_on_the_sample() {
        // E[X|Y] is linear, so the best one-sensor cells are Lloyd-Max cells of the sample.
        let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0]).unwrap();
        let b = lloyd_max::gaussian(4)
            .unwrap()
            .affine(0.0, std::f64::consts::SQRT_2)
            .unwrap();
        let system = System::ideal(model, vec![Quantizer::from(&b)]).unwrap();
        let again = alternating_step(&system, 0, Criterion::MeanSquaredError).unwrap();
        for (a, b) in again.breakpoints().iter().zip(b.breakpoints()) {
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }
}
