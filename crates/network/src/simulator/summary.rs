//! Summary of a run: cost, lifetime, faults and estimation error.

use super::ledger::{Faults, Ledger};
use crate::units::{Bits, Joules, Seconds, SensorId};
use fewbits_numerics::ArgumentError;
use std::fmt;

/// Cost, lifetime, faults and, after [`with_errors`](Self::with_errors), the estimation error of a run. `Display` prints it in a few lines.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Summary {
    /// Simulated time.
    pub time: Seconds,
    /// Number of messages; repetitions do not count.
    pub messages: u64,
    /// Payload bits.
    pub payload: Bits,
    /// Bits on air, with preambles, headers, acknowledgements and repetitions.
    pub air: Bits,
    /// Energy of all nodes, idle energy included.
    pub energy: Joules,
    /// The node whose battery is empty first, and when: the time of its death, or the extrapolation with the mean power of the run. `None`
    /// if no node has a battery.
    pub lifetime: Option<(Seconds, SensorId)>,
    /// Numbers of faults by kind.
    pub faults: Faults,
    /// Error of the estimates; `None` without [`with_errors`](Self::with_errors).
    pub error: Option<EstimateError>,
}

/// Error of the estimates of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct EstimateError {
    /// Number of slots with a truth and an estimate.
    pub slots: usize,
    /// Number of slots with a truth and without estimate.
    pub missing: usize,
    /// Root mean squared distance between estimate and truth, over the slots that have both.
    pub rmse: f64,
    /// Standard error of `rmse`; `None` for fewer than four slots.
    pub standard_error: Option<f64>,
}

impl Summary {
    pub(super) fn new(time: Seconds, ledger: &Ledger, energy: Joules, lifetime: Option<(Seconds, SensorId)>) -> Self {
        let messages = ledger.messages();
        Self {
            time,
            messages: messages.messages,
            payload: messages.payload,
            air: messages.air,
            energy,
            lifetime,
            faults: *ledger.faults(),
            error: None,
        }
    }

    /// The summary with the error of `estimates`, slot by slot. An empty estimate means that the slot has none.
    ///
    /// Errors of successive slots are dependent. The standard error is therefore that of `floor(sqrt(n))` means over consecutive slots.
    ///
    /// # Errors
    /// If a truth and its estimate have different lengths, or no slot has both.
    pub fn with_errors(mut self, truths: &[Vec<f64>], estimates: &[Vec<f64>]) -> Result<Self, ArgumentError> {
        let mut squares = Vec::with_capacity(truths.len());
        for (slot, truth) in truths.iter().enumerate() {
            let Some(estimate) = estimates.get(slot).filter(|estimate| !estimate.is_empty()) else {
                continue;
            };
            if estimate.len() != truth.len() {
                let expected = format!("{}, as many coordinates as its truth", truth.len());
                return Err(ArgumentError::new("estimates", estimate.len(), expected));
            }
            squares.push(truth.iter().zip(estimate).map(|(x, e)| (x - e) * (x - e)).sum::<f64>());
        }
        if squares.is_empty() {
            return Err(ArgumentError::new("estimates", "none", "at least one slot with truth and estimate"));
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let rmse = mean(&squares).sqrt();
        let batches = squares.len().isqrt();
        let standard_error = (batches >= 2 && rmse > 0.0).then(|| {
            let means: Vec<f64> = squares
                .chunks_exact(squares.len() / batches)
                .take(batches)
                .map(mean)
                .collect();
            let centre = mean(&means);
            let spread = means.iter().map(|m| (m - centre) * (m - centre)).sum::<f64>() / (batches - 1) as f64;
            // d rmse = d mse / (2 rmse).
            (spread / batches as f64).sqrt() / (2.0 * rmse)
        });
        self.error = Some(EstimateError {
            slots: squares.len(),
            missing: truths.len() - squares.len(),
            rmse,
            standard_error,
        });
        Ok(self)
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(error) = &self.error {
            write!(f, "RMSE {:.4}", error.rmse)?;
            if let Some(deviation) = error.standard_error {
                write!(f, " +- {deviation:.4}")?;
            }
            write!(f, " over {} slots", error.slots)?;
            if error.missing > 0 {
                write!(f, ", {} without estimate", error.missing)?;
            }
            writeln!(f)?;
        }
        writeln!(
            f,
            "{} messages, {} payload, {} on air in {:.3} s",
            self.messages,
            self.payload,
            self.air,
            self.time.value()
        )?;
        write!(f, "{:.6} J of all nodes", self.energy.value())?;
        if let Some((life, node)) = &self.lifetime {
            write!(f, "; the batteries of {node} end first, after {:.2} days", life.value() / 86_400.0)?;
        }
        let faults = &self.faults;
        write!(
            f,
            "\nlost {}, damaged {}, late {}, duplicates {}, given up {}, disagreements {}, resynchronisations {}, silence ignored {}, failed steps {}",
            faults.lost,
            faults.damaged,
            faults.late,
            faults.duplicates,
            faults.given_up,
            faults.disagreements,
            faults.resynchronisations,
            faults.silence_ignored,
            faults.failures
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_has_the_error_of_the_slots_that_have_both() {
        let ledger = Ledger::new(1);
        let summary = Summary::new(Seconds::ZERO, &ledger, Joules::ZERO, None);
        let truths = vec![vec![1.0, 0.0]; 5];
        let mut estimates = vec![vec![1.0, 2.0], vec![1.0, -2.0], Vec::new(), vec![3.0, 0.0]];
        let error = summary.clone().with_errors(&truths, &estimates).unwrap().error.unwrap();
        assert_eq!((error.slots, error.missing, error.rmse), (3, 2, 2.0));
        assert_eq!(error.standard_error, None);
        // Batches of two: mean squares 4 and 16, standard error 6 / (2 sqrt 10).
        estimates = vec![vec![1.0, 2.0], vec![1.0, 2.0], vec![5.0, 0.0], vec![1.0, 4.0]];
        let error = summary.clone().with_errors(&truths, &estimates).unwrap().error.unwrap();
        assert!((error.standard_error.unwrap() - 6.0 / (2.0 * 10.0_f64.sqrt())).abs() < 1e-12);
        assert!(summary.clone().with_errors(&truths, &[vec![1.0]]).is_err());
        assert!(summary.with_errors(&truths, &[]).is_err());
    }
}
