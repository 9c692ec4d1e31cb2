//! Several sensors with their quantizers and channels, and one fusion centre.

use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use crate::outcomes::counts::count;
use fewbits_numerics::error::{at_least_one, entries};
use fewbits_quantizers::{Channel, Quantizer, lloyd_max};
use serde::{Deserialize, Serialize};

/// Sensors of equal noise that share a quantizer design and a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorGroup {
    /// The quantizer of each sensor.
    pub quantizer: Quantizer,
    /// The channel behind each sensor, of which each has its own copy.
    pub channel: Channel,
    /// Indices of the sensors in the model.
    pub sensors: Vec<usize>,
}

impl SensorGroup {
    /// `P(received = t | sample in cell i)`.
    pub(crate) fn cell_transition(&self, t: usize, cell: usize) -> f64 {
        self.channel.probability(t, self.quantizer.labels()[cell])
    }

    /// Number of different joint reports of the group, if only the counts of symbols matter.
    pub(crate) fn outcomes(&self) -> u64 {
        count(self.sensors.len(), self.channel.outputs())
    }
}

/// Default for the largest number of joint outcomes that a computation may enumerate.
pub(crate) const OUTCOME_LIMIT: u64 = 1 << 20;

/// A model and, for each of its sensors, a quantizer and a channel.
///
/// ```
/// use fewbits_quantizer_design::{Criterion, Quantizer, ObservationModel, System};
/// let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 1.0])?;
/// let system = System::identical(model, Quantizer::symmetric(1.37)?)?;
/// assert!((system.value(Criterion::MeanSquaredError)? - 0.388_458_855_09).abs() < 1e-9);
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredSystem")]
pub struct System {
    model: ObservationModel,
    groups: Vec<SensorGroup>,
    outcome_limit: u64,
}

/// The stored form of [`System`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredSystem {
    model: ObservationModel,
    groups: Vec<SensorGroup>,
    outcome_limit: u64,
}

impl TryFrom<StoredSystem> for System {
    type Error = Error;

    fn try_from(parts: StoredSystem) -> Result<Self, Error> {
        Ok(System::new(parts.model, parts.groups)?.with_outcome_limit(parts.outcome_limit))
    }
}

impl System {
    /// A system of groups.
    ///
    /// # Errors
    /// If some sensor of the model is not in exactly one group, a group has no sensor, its sensors differ in noise, or its channel's number
    /// of inputs is not its quantizer's number of levels.
    pub fn new(model: ObservationModel, groups: Vec<SensorGroup>) -> Result<Self, Error> {
        let mut seen = vec![false; model.sensors()];
        for group in &groups {
            let (inputs, levels) = (group.channel.inputs(), group.quantizer.levels());
            if inputs != levels {
                return refuse("channel", format!("{inputs} inputs"), format!("one input a level, {levels}"));
            }
            at_least_one("sensors", group.sensors.len())?;
            for n in &group.sensors {
                match seen.get_mut(*n) {
                    None => return refuse("sensor", n, format!("a number below {}", model.sensors())),
                    Some(true) => return refuse("sensor", format!("{n} twice"), "each sensor in one group"),
                    Some(slot) => *slot = true,
                }
                if !model.interchangeable(group.sensors[0], *n) {
                    return refuse("group", format!("sensors {} and {n}", group.sensors[0]), "sensors of equal noise");
                }
            }
        }
        if let Some(n) = seen.iter().position(|s| !s) {
            return refuse("groups", format!("without sensor {n}"), "each sensor in one group");
        }
        Ok(Self {
            model,
            groups,
            outcome_limit: OUTCOME_LIMIT,
        })
    }

    /// A system with a quantizer and a channel for each sensor.
    ///
    /// # Errors
    /// If the numbers of sensors, quantizers and channels differ, or a channel does not fit its quantizer.
    pub fn distinct(
        model: ObservationModel,
        quantizers: Vec<Quantizer>,
        channels: Vec<Channel>,
    ) -> Result<Self, Error> {
        if quantizers.len() != channels.len() || quantizers.len() != model.sensors() {
            let given = format!("{} quantizers, {} channels", quantizers.len(), channels.len());
            return refuse("quantizers", given, format!("{} of each", model.sensors()));
        }
        let pairs = quantizers.into_iter().zip(channels).enumerate();
        let groups = pairs.map(|(n, (quantizer, channel))| SensorGroup {
            quantizer,
            channel,
            sensors: vec![n],
        });
        Self::new(model, groups.collect())
    }

    /// A system with a quantizer for each sensor and ideal channels.
    ///
    /// # Errors
    /// As [`System::distinct`].
    pub fn ideal(model: ObservationModel, quantizers: Vec<Quantizer>) -> Result<Self, Error> {
        let channels = quantizers
            .iter()
            .map(|q| Channel::ideal(q.levels()))
            .collect::<Result<_, _>>()?;
        Self::distinct(model, quantizers, channels)
    }

    /// A system with one quantizer for all sensors, which must have equal noise, and ideal channels. Outcomes are counts.
    ///
    /// # Errors
    /// If the sensors differ in noise.
    pub fn identical(model: ObservationModel, quantizer: Quantizer) -> Result<Self, Error> {
        let sensors = (0..model.sensors()).collect();
        let channel = Channel::ideal(quantizer.levels())?;
        let group = SensorGroup {
            quantizer,
            channel,
            sensors,
        };
        Self::new(model, vec![group])
    }

    /// A system in which each sensor has the Lloyd-Max quantizer of its own sample and an ideal channel: the usual start of a design.
    ///
    /// # Errors
    /// If `levels` is not in `2..=4096`.
    pub fn lloyd_max(model: ObservationModel, levels: usize) -> Result<Self, Error> {
        let standard = lloyd_max::gaussian(levels)?;
        let quantizers = (0..model.sensors())
            .map(|n| Ok(Quantizer::from(&standard.affine(model.prior().mean(), model.sample_deviation(n))?)))
            .collect::<Result<Vec<_>, Error>>()?;
        Self::ideal(model, quantizers)
    }

    /// The system of some of the sensors, in the given order.
    ///
    /// # Errors
    /// If `sensors` is empty, names a sensor that is not there, or one twice.
    pub fn subset(&self, sensors: &[usize]) -> Result<Self, Error> {
        let groups = self.groups.iter().filter_map(|g| {
            let kept: Vec<usize> = (0..sensors.len())
                .filter(|n| g.sensors.contains(&sensors[*n]))
                .collect();
            (!kept.is_empty()).then(|| SensorGroup {
                sensors: kept,
                ..g.clone()
            })
        });
        if let Some(n) = (1..sensors.len()).find(|n| sensors[..*n].contains(&sensors[*n])) {
            return refuse("sensor", format!("{} twice", sensors[n]), "each sensor once");
        }
        Ok(Self::new(self.model.subset(sensors)?, groups.collect())?.with_outcome_limit(self.outcome_limit))
    }

    /// Allows at most `limit` joint outcomes in any computation (default `2^20`).
    pub fn with_outcome_limit(mut self, limit: u64) -> Self {
        self.outcome_limit = limit;
        self
    }

    /// Prior and noise.
    pub fn model(&self) -> &ObservationModel {
        &self.model
    }

    /// The groups.
    pub fn groups(&self) -> &[SensorGroup] {
        &self.groups
    }

    /// Quantizer of each group.
    pub fn quantizers(&self) -> Vec<Quantizer> {
        self.groups.iter().map(|g| g.quantizer.clone()).collect()
    }

    /// Number of joint outcomes, if only the counts of symbols matter within a group.
    pub(crate) fn outcomes(&self) -> u64 {
        self.groups.iter().fold(1, |n: u64, g| n.saturating_mul(g.outcomes()))
    }

    /// Largest number of joint outcomes that a computation may enumerate.
    pub fn outcome_limit(&self) -> u64 {
        self.outcome_limit
    }

    /// An error if a table would have more outcomes than allowed.
    pub(crate) fn check_outcomes(&self) -> Result<(), Error> {
        Error::at_most("joint outcome table", self.outcomes(), self.outcome_limit)?;
        // Tables for fewer reports are computed as intermediate results.
        self.groups.iter().try_for_each(|group| {
            let needed = count(group.sensors.len(), group.channel.outputs() + 1);
            Error::at_most("table of counts", needed, self.outcome_limit)
        })
    }

    /// The same system with another quantizer in group `group`.
    ///
    /// # Errors
    /// If there is no such group or the quantizer has another number of levels than the channel takes.
    pub fn with_quantizer(&self, group: usize, quantizer: Quantizer) -> Result<Self, Error> {
        self.group(group)?;
        let mut groups = self.groups.clone();
        groups[group].quantizer = quantizer;
        self.with_groups(groups)
    }

    /// The same system with another quantizer in each group.
    ///
    /// # Errors
    /// As [`System::with_quantizer`], or if the number of quantizers is not the number of groups.
    pub fn with_quantizers(&self, quantizers: Vec<Quantizer>) -> Result<Self, Error> {
        entries("quantizers", quantizers.len(), self.groups.len())?;
        let mut groups = self.groups.clone();
        groups.iter_mut().zip(quantizers).for_each(|(g, q)| g.quantizer = q);
        self.with_groups(groups)
    }

    /// The same quantizers with other channels.
    ///
    /// # Errors
    /// If a channel does not fit its quantizer or their number differs from the groups'.
    pub fn with_channels(&self, channels: Vec<Channel>) -> Result<Self, Error> {
        entries("channels", channels.len(), self.groups.len())?;
        let mut groups = self.groups.clone();
        groups.iter_mut().zip(channels).for_each(|(g, c)| g.channel = c);
        self.with_groups(groups)
    }

    /// The same sensors in other groups.
    pub(crate) fn with_groups(&self, groups: Vec<SensorGroup>) -> Result<Self, Error> {
        Ok(Self::new(self.model.clone(), groups)?.with_outcome_limit(self.outcome_limit))
    }

    pub(crate) fn group(&self, group: usize) -> Result<&SensorGroup, Error> {
        match self.groups.get(group) {
            Some(g) => Ok(g),
            None => refuse("group", group, format!("a number below {}", self.groups.len())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Criterion;

    #[test]
    fn systems_that_do_not_fit_are_refused() {
        let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 0.5]).unwrap();
        let q = Quantizer::symmetric(1.0).unwrap();
        assert!(
            System::identical(model.clone(), q.clone())
                .unwrap_err()
                .to_string()
                .contains("equal noise")
        );
        assert!(System::ideal(model.clone(), vec![q.clone()]).is_err());
        let two = Channel::ideal(2).unwrap();
        assert!(System::distinct(model.clone(), vec![q.clone(); 2], vec![two.clone(), two]).is_err());
        let system = System::ideal(model, vec![q.clone(); 2]).unwrap();
        assert!(
            system
                .value(Criterion::BayesError)
                .unwrap_err()
                .to_string()
                .contains("prior")
        );
        let small = system.clone().with_outcome_limit(15);
        let error = small.value(Criterion::MutualInformation).unwrap_err();
        assert_eq!(
            error,
            Error::TooLarge {
                table: "joint outcome table",
                needed: 16,
                limit: 15
            }
        );
        assert!(system.with_quantizer(2, q).is_err());
    }
}
