//! What a fusion centre finds out about its sensors and its model.

use serde::{Deserialize, Serialize};

/// An event that a fusion centre reports to its caller. Sensors are named by a number: the one under which they joined, unless it is said
/// otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Event {
    /// The sensor is declared dead because of its silence, which carries no information from now on.
    Dead(u32),
    /// A report came from a sensor that had been declared dead.
    Alive(u32),
    /// The reports of this sensor contradict the others'. They are no longer used, but still tested.
    Excluded(u32),
    /// An excluded sensor has agreed with the others for long enough and is used again.
    Readmitted(u32),
    /// The model does not hold for all sensors together: observations are too unlikely, or residuals repeat. The track is lost, or a stated
    /// noise is too small.
    Lost,
    /// Observations are likelier than predicted, or residuals alternate: a stated noise is too large.
    NoiseOverstated,
    /// The report of this sensor was not used at this instant: it is impossible, or too unlikely given the prediction and the others'
    /// reports.
    Rejected(u32),
    /// This sensor contradicts another, and nothing decides which of them is wrong. The belief covers what either says.
    Disputed(u32),
    /// A second, equal report of this sensor at the same instant was dropped.
    Copied(u32),
    /// Most reports did not agree with the prediction, but with each other, or again and again. The belief was replaced by a wider one.
    Reopened,
    /// The belief was replaced by the prior that the centre was given for this case.
    Reacquired,
}

/// Makes an event of one kind from the number of a sensor.
type OfSensor = fn(u32) -> Event;

impl Event {
    /// The name; and the number of the sensor, if it is about one, with what makes such an event from another number.
    fn parts(self) -> (&'static str, Option<(u32, OfSensor)>) {
        match self {
            Self::Dead(sensor) => ("dead", Some((sensor, Self::Dead))),
            Self::Alive(sensor) => ("alive", Some((sensor, Self::Alive))),
            Self::Excluded(sensor) => ("excluded", Some((sensor, Self::Excluded))),
            Self::Readmitted(sensor) => ("readmitted", Some((sensor, Self::Readmitted))),
            Self::Rejected(sensor) => ("rejected", Some((sensor, Self::Rejected))),
            Self::Disputed(sensor) => ("disputed", Some((sensor, Self::Disputed))),
            Self::Copied(sensor) => ("copied", Some((sensor, Self::Copied))),
            Self::Lost => ("lost", None),
            Self::NoiseOverstated => ("noise overstated", None),
            Self::Reopened => ("reopened", None),
            Self::Reacquired => ("reacquired", None),
        }
    }

    /// The name of this kind of event, in lower case.
    pub fn name(self) -> &'static str {
        self.parts().0
    }

    /// The number of the sensor that it is about; `None` if it is about the whole centre.
    pub fn sensor(self) -> Option<u32> {
        self.parts().1.map(|(sensor, _)| sensor)
    }

    /// The same event with the sensor's number replaced; `None` if there is no other number for it.
    pub fn renumbered(self, number: impl FnOnce(u32) -> Option<u32>) -> Option<Self> {
        match self.parts().1 {
            None => Some(self),
            Some((sensor, of)) => number(sensor).map(of),
        }
    }
}
