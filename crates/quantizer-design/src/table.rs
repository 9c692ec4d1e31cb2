//! The table of joint outcomes of a system, for inspection and for decisions.

use crate::criterion::{equivocation, most_probable};
use crate::error::{Error, refuse};
use crate::law::report_tables;
use crate::observation_model::ObservationModel;
use crate::outcomes::counts::rank;
use crate::outcomes::moments;
use crate::system::System;
use fewbits_numerics::error::entries;

/// Largest number of entries of a table (outcomes times values of the unknown).
const ENTRY_LIMIT: u64 = 1 << 25;

/// Index of a joint report in the tables of a system: the rank of each group's count vector, with the first group varying slowest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    groups: Vec<(Vec<usize>, usize, usize)>,
    sensors: usize,
}

impl Layout {
    pub(crate) fn new(system: &System) -> Self {
        let groups = system.groups();
        let entries = groups
            .iter()
            .map(|g| (g.sensors.to_vec(), g.channel.outputs(), g.outcomes() as usize));
        Self {
            groups: entries.collect(),
            sensors: system.model().sensors(),
        }
    }

    /// Index of the outcome in which `symbols[n]` was received from sensor `n`.
    pub(crate) fn index(&self, symbols: &[usize]) -> Result<usize, Error> {
        entries("symbols", symbols.len(), self.sensors)?;
        let mut index = 0;
        for (sensors, outputs, size) in &self.groups {
            let mut counts = [0; 64];
            let mut large;
            let counts: &mut [usize] = if *outputs <= counts.len() {
                &mut counts[..*outputs]
            } else {
                large = vec![0; *outputs];
                &mut large
            };
            for n in sensors {
                match counts.get_mut(symbols[*n]) {
                    Some(count) => *count += 1,
                    None => return refuse("symbol", symbols[*n], format!("a number below {outputs}")),
                }
            }
            index = index * size + rank(counts);
        }
        Ok(index)
    }
}

/// `P(outcome | x)` for every value of the unknown and every joint outcome. An outcome is given by the counts of symbols in each group.
#[derive(Debug, Clone, PartialEq)]
pub struct JointTable {
    system: System,
    layout: Layout,
    /// Outcomes by values.
    likelihood: Vec<f64>,
}

impl JointTable {
    /// Computes the table of a system.
    ///
    /// # Errors
    /// [`Error::TooLarge`] beyond the system's outcome limit or 33 million entries.
    pub fn new(system: &System) -> Result<Self, Error> {
        let needed = system.outcomes().saturating_mul(system.model().values().len() as u64);
        Error::at_most("joint outcome table", needed, ENTRY_LIMIT)?;
        Ok(Self {
            layout: Layout::new(system),
            system: system.clone(),
            likelihood: moments(&report_tables(system)?, &system.model().given),
        })
    }

    /// The system whose outcomes are tabulated.
    pub fn system(&self) -> &System {
        &self.system
    }

    fn model(&self) -> &ObservationModel {
        self.system.model()
    }

    /// Number of outcomes.
    pub fn outcomes(&self) -> usize {
        self.likelihood.len() / self.model().values().len()
    }

    /// Index of the outcome in which `symbols[n]` was received from sensor `n`.
    ///
    /// # Errors
    /// If there is not one symbol per sensor, or one is out of range.
    pub fn outcome(&self, symbols: &[usize]) -> Result<usize, Error> {
        self.layout.index(symbols)
    }

    /// `P(outcome | x_k)` for all `k`; sums to 1 over outcomes. An outcome does not say which sensor of a group sent what.
    pub fn likelihood(&self, outcome: usize) -> &[f64] {
        let values = self.model().values().len();
        self.likelihood.chunks_exact(values).nth(outcome).unwrap_or_default()
    }

    /// Prior probability of an outcome.
    pub fn probability(&self, outcome: usize) -> f64 {
        self.model()
            .weights()
            .iter()
            .zip(self.likelihood(outcome))
            .map(|(w, q)| w * q)
            .sum()
    }

    /// Maximum a posteriori value of the unknown, as an index into [`ObservationModel::values`]; the first if several are equal.
    pub fn decide(&self, outcome: usize) -> usize {
        most_probable(self.model().weights(), self.likelihood(outcome))
    }

    /// Entropy of the unknown given the outcome, `H(X | T)` in nats, for a finite prior.
    ///
    /// `H(X) - I(X; T)` loses all digits if the decision is almost certain; this sum of small positive terms does not.
    ///
    /// # Errors
    /// If the prior is continuous.
    pub fn equivocation(&self) -> Result<f64, Error> {
        if self.model().prior().points().is_none() {
            return refuse("prior", "a continuous prior", "a discrete prior for a conditional entropy");
        }
        let outcomes = self.likelihood.chunks_exact(self.model().values().len());
        Ok(outcomes.map(|q| equivocation(self.model().weights(), q)).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Criterion, Noise, Prior, Quantizer};

    /// If the probability of the wrong value is among the smallest numbers, its term of the entropy is zero, not infinite.
    #[test]
    fn equivocation_is_finite_where_probabilities_are_subnormal() {
        for tenth in 700..800 {
            let signal = f64::from(tenth) * 0.1;
            let noise = Noise::independent_with_deviations(&[1.0]).unwrap();
            let model = ObservationModel::new(Prior::binary(signal, 0.5).unwrap(), noise).unwrap();
            let system = System::identical(model, Quantizer::new(vec![0.5 * signal]).unwrap()).unwrap();
            let equivocation = JointTable::new(&system).unwrap().equivocation().unwrap();
            assert!((0.0..1e-200).contains(&equivocation), "{equivocation} at {signal}");
        }
    }

    #[test]
    fn equivocation_and_information_make_up_the_prior_entropy() {
        let model = ObservationModel::new(
            Prior::binary(1.0, 0.3).unwrap(),
            Noise::independent_with_deviations(&[1.0; 3]).unwrap(),
        )
        .unwrap();
        let system = System::identical(model, Quantizer::new(vec![0.5]).unwrap()).unwrap();
        let table = JointTable::new(&system).unwrap();
        let entropy = -(0.3 * f64::ln(0.3) + 0.7 * f64::ln(0.7));
        let sum = table.equivocation().unwrap() + system.value(Criterion::MutualInformation).unwrap();
        assert!((sum - entropy).abs() < 1e-14);
        assert_eq!(table.outcome(&[0, 1, 0]), table.outcome(&[1, 0, 0]));
        assert!(table.likelihood(usize::MAX).is_empty() && table.probability(usize::MAX) == 0.0);
    }
}
