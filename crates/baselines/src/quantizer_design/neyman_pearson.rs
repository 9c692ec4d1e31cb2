//! The most powerful test between two values of the unknown.

use super::gains::log_likelihoods;
use fewbits_core::Observation;
use fewbits_numerics::error::{entries, refuse};
use fewbits_quantizer_design::{Error, JointTable, Symbol, System};

/// The randomised Neyman-Pearson test between two values of the unknown, given the joint outcome.
///
/// The second value is accepted for the outcomes of largest likelihood ratio, as many as the false-alarm probability allows. For the
/// outcome at the limit it is accepted at random with a certain probability.
#[derive(Debug, Clone, PartialEq)]
pub struct NeymanPearson {
    table: JointTable,
    false_alarm: f64,
    /// Probability of accepting the second value, for each outcome.
    acceptance: Vec<f64>,
    detection: f64,
}

impl NeymanPearson {
    /// The most powerful test of the second value of the prior against the first, with the given false-alarm probability.
    ///
    /// # Errors
    /// If the prior does not have exactly two values or `false_alarm` is not inside (0, 1); [`Error::TooLarge`] as [`JointTable::new`].
    pub fn new(system: &System, false_alarm: f64) -> Result<Self, Error> {
        if !(false_alarm > 0.0 && false_alarm < 1.0) {
            return refuse("false_alarm", false_alarm, "a probability inside (0, 1)");
        }
        if system.model().prior().points().is_none() || system.model().values().len() != 2 {
            return refuse("prior", "not two hypotheses", "a discrete prior on two values");
        }
        let table = JointTable::new(system)?;
        // ln P1 - ln P0: finite even if the probabilities underflow.
        let logs = log_likelihoods(system)?;
        let key = |outcome: usize| logs[2 * outcome + 1] - logs[2 * outcome];
        let mut order: Vec<usize> = (0..table.outcomes()).filter(|t| !key(*t).is_nan()).collect();
        order.sort_by(|a, b| key(*b).total_cmp(&key(*a)));
        let (mut acceptance, mut left, mut detection) = (vec![0.0; table.outcomes()], false_alarm, 0.0);
        for outcome in order {
            let (p0, p1) = (logs[2 * outcome].exp(), logs[2 * outcome + 1].exp());
            let share = if p0 <= left { 1.0 } else { left / p0 };
            acceptance[outcome] = share;
            detection += share * p1;
            left -= share * p0;
            if share < 1.0 {
                break;
            }
        }
        Ok(Self {
            table,
            false_alarm,
            acceptance,
            detection: detection.min(1.0),
        })
    }

    /// Probability of accepting the second value if it is true.
    pub fn detection_probability(&self) -> f64 {
        self.detection
    }

    /// Probability of accepting the second value given one observation per sensor: 0 or 1 except for one outcome.
    ///
    /// If symbols are missing (the sensors always report, so a missing report carries no information), the most powerful test
    /// on the remaining sensors with the same false-alarm probability is computed and used.
    ///
    /// # Errors
    /// If there is not one observation per sensor, or a symbol is out of range.
    pub fn acceptance(&self, observations: &[Observation<Symbol>]) -> Result<f64, Error> {
        let system = self.table.system();
        entries("observations", observations.len(), system.model().sensors())?;
        let symbols: Vec<usize> = observations.iter().filter_map(|o| o.received().map(|s| s.0)).collect();
        if symbols.is_empty() {
            return Ok(self.false_alarm);
        }
        if symbols.len() == observations.len() {
            return Ok(self.acceptance[self.table.outcome(&symbols)?]);
        }
        let received: Vec<usize> = (0..observations.len())
            .filter(|n| observations[*n].received().is_some())
            .collect();
        let test = Self::new(&system.subset(&received)?, self.false_alarm)?;
        Ok(test.acceptance[test.table.outcome(&symbols)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_quantizer_design::{Noise, ObservationModel, Prior, Quantizer};

    #[test]
    fn likelihood_ratios_are_ordered_by_their_logarithms() {
        let five = |signal: f64, sensors: usize, b: Vec<f64>| {
            let noise = Noise::independent_with_deviations(&vec![1.0; sensors]).unwrap();
            let model = ObservationModel::new(Prior::binary(signal, 0.5).unwrap(), noise).unwrap();
            System::identical(model, Quantizer::new(b).unwrap()).unwrap()
        };
        // Products of probabilities are no total order here.
        let b: Vec<f64> = (1..8).map(|i| 4.0 * f64::from(i) / 8.0).collect();
        let test = NeymanPearson::new(&five(4.0, 5, b), 1e-3).unwrap();
        assert!(test.detection_probability() > 0.99 && test.detection_probability() <= 1.0);
        // And underflow here.
        let far = five(40.0, 3, vec![10.0, 20.0, 30.0]);
        let test = NeymanPearson::new(&far, 0.01).unwrap();
        assert!((test.detection_probability() - 1.0).abs() < 1e-12);
        let all = |t: usize| [Observation::Received(Symbol(t)); 3];
        assert_eq!(test.acceptance(&all(3)).unwrap(), 1.0);
        assert!(test.acceptance(&all(0)).unwrap() < 0.011);
    }

    #[test]
    fn the_test_spends_its_budget_exactly() {
        let model = ObservationModel::new(
            Prior::binary(2.0, 0.5).unwrap(),
            Noise::independent_with_deviations(&[1.0; 3]).unwrap(),
        )
        .unwrap();
        let system = System::identical(model, Quantizer::new(vec![0.0, 1.0, 2.0]).unwrap()).unwrap();
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
        // Averaged over what the first and the last sensor report, the test without the second spends the same.
        let test = NeymanPearson::new(&system, 0.3).unwrap();
        let given = JointTable::new(&system.subset(&[0]).unwrap()).unwrap();
        let received = |t: usize| Observation::Received(Symbol(t));
        let mut spent = 0.0;
        for a in 0..4 {
            for b in 0..4 {
                let accepted = test.acceptance(&[received(a), Observation::Lost, received(b)]).unwrap();
                spent += given.likelihood(a)[0] * given.likelihood(b)[0] * accepted;
            }
        }
        assert!((spent - 0.3).abs() < 1e-13);
        assert_eq!(test.acceptance(&[Observation::Nothing; 3]).unwrap(), 0.3);
        assert!(test.acceptance(&[Observation::Lost; 2]).is_err());
        assert!(NeymanPearson::new(&system, 0.0).is_err());
        assert!(NeymanPearson::new(&system, 1.0).is_err());
    }
}
