//! Entries of `centre.toml`: model, prior and sensors.

use crate::report::Report;
use serde::Deserialize;

/// Largest number of sensors that one entry names.
const MAX_GROUP: u32 = 100_000;

#[derive(Debug, Deserialize, Clone, Copy)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Model {
    RandomWalk {
        density: f64,
    },
    OrnsteinUhlenbeck {
        mean: f64,
        time_constant: f64,
        variance: f64,
    },
    ConstantVelocity {
        density: f64,
    },
    ConstantVelocity2d {
        density: f64,
    },
}

impl Model {
    /// What the coordinates of the state are, if nothing names them.
    pub(super) fn names(self) -> &'static [&'static str] {
        match self {
            Self::RandomWalk { .. } | Self::OrnsteinUhlenbeck { .. } => &["level"],
            Self::ConstantVelocity { .. } => &["position", "velocity"],
            Self::ConstantVelocity2d { .. } => &["x", "velocity of x", "y", "velocity of y"],
        }
    }

    /// Number of coordinates of the state.
    pub(super) fn coordinates(self) -> usize {
        self.names().len()
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Prior {
    pub(super) mean: Vec<f64>,
    pub(super) deviation: Vec<f64>,
}

/// An entry `[[sensor]]`: one sensor, or several that are alike.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) number: Option<u32>,
    /// Numbers as `1-40,50`.
    pub(super) numbers: Option<String>,
    /// Without it the key follows from the fleet's.
    pub(super) key: Option<String>,
    /// Version of a key that follows from the fleet's.
    #[serde(default = "first")]
    pub(super) key_version: u32,
    /// Address of the sensor, if it is known beforehand.
    pub(super) address: Option<String>,
    /// Its name in the file of `settings`.
    pub(super) name: Option<String>,
    /// Index of the coordinate of the state that the sensor measures.
    #[serde(default)]
    pub(super) reads: usize,
    /// Standard deviation of its measurement noise.
    pub(super) deviation: Option<f64>,
    /// It measures `gain * coordinate + offset`, or as a switch whether the coordinate is above the threshold.
    pub(super) gain: Option<f64>,
    pub(super) offset: Option<f64>,
    pub(super) threshold: Option<f64>,
    pub(super) report: Report,
    /// Probability that a question or its report is lost.
    #[serde(default)]
    pub(super) loss: f64,
}

fn first() -> u32 {
    1
}

/// The numbers that an entry names.
pub(super) fn numbers(entry: &Entry) -> Result<Vec<u32>, String> {
    let text = match (entry.number, &entry.numbers) {
        (Some(number), None) => return Ok(vec![number]),
        (None, Some(text)) if entry.key.is_none() && entry.address.is_none() => text,
        (None, Some(_)) => return Err("`key` and `address` are those of one sensor: expected `number`".to_owned()),
        _ => return Err("expected either `number` or `numbers`".to_owned()),
    };
    let mut all = Vec::new();
    for part in text.split(',').map(str::trim) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        match (first.trim().parse::<u32>(), last.trim().parse::<u32>()) {
            (Ok(first), Ok(last)) if first <= last && last - first < MAX_GROUP => all.extend(first..=last),
            (Ok(first), Ok(last)) if first <= last => {
                return Err(format!(
                    "numbers is `{text}`: expected at most {MAX_GROUP} numbers in a range; give several"
                ));
            }
            _ => return Err(format!("numbers is `{text}`: expected numbers and ranges as `1-40,50`")),
        }
    }
    Ok(all)
}
