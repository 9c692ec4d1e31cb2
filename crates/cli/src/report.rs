//! Kinds of reports with their two halves, at sensor and centre.

use crate::error::Failure;
use crate::measured::Measured;
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{FullValue, Gaussian, Link, NumberFormat, SchemeNode, SensorNode};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::centre::{RemoteSensor, Reporting};
use fewbits_models::LinearSensor;
use fewbits_protocol::ReportLength;
use nalgebra::SVector;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// Where in a meaning the kind stands, and the bits of a word.
const KIND_AT: u32 = 28;
const WORD_AT: u32 = 24;

/// Kind of a sensor's reports: `bit`, `word:3`, `value` or `silent:1.5`, or as a table `{ kind = "word", bits = 3 }`. The files of sensor
/// and centre must state the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Report {
    /// One bit: whether the sample is at or above the prediction.
    Sign,
    /// The cell of the innovation, in 2 to 4 bits.
    Word {
        /// Bits of a report.
        bits: u32,
    },
    /// Every sample, in double precision.
    Value,
    /// The sample if its innovation reaches `threshold` standard deviations, otherwise silence.
    Censored {
        /// Standard deviations.
        threshold: f64,
    },
}

/// The form of a table.
#[derive(Deserialize)]
#[serde(remote = "Report", tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Table {
    #[serde(alias = "bit")]
    Sign,
    Word {
        bits: u32,
    },
    Value,
    #[serde(alias = "silent")]
    Censored {
        threshold: f64,
    },
}

impl<'de> Deserialize<'de> for Report {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match toml::Value::deserialize(deserializer)? {
            toml::Value::String(word) => Self::of_word(&word).map_err(D::Error::custom),
            table => Table::deserialize(table).map_err(|error| D::Error::custom(error.message())),
        }
    }
}

impl Report {
    /// The words of `track --send`.
    fn of_word(word: &str) -> Result<Self, String> {
        let (name, number) = word
            .split_once(':')
            .map_or((word, None), |(name, number)| (name, Some(number)));
        let kind = match (name, number) {
            ("bit", None) => Some(Self::Sign),
            ("value", None) => Some(Self::Value),
            ("word", Some(bits)) => bits.parse().ok().map(|bits| Self::Word { bits }),
            ("silent", Some(threshold)) => threshold.parse().ok().map(|threshold| Self::Censored { threshold }),
            _ => None,
        };
        let expected = "`bit`, `word:2` to `word:4`, `value`, or `silent:1.5` (standard deviations)";
        kind.ok_or_else(|| format!("report is `{word}`: expected {expected}"))
    }

    /// The words that [`of_word`](Self::of_word) reads.
    pub(crate) fn word(self) -> String {
        match self {
            Self::Sign => "bit".to_owned(),
            Self::Word { bits } => format!("word:{bits}"),
            Self::Value => "value".to_owned(),
            Self::Censored { threshold } => format!("silent:{threshold}"),
        }
    }

    /// Length of a report. A report of another length is of a sensor whose file says another kind.
    pub(crate) fn length(self) -> ReportLength {
        match self {
            Self::Sign => ReportLength::Fixed(1),
            Self::Word { bits } => ReportLength::Fixed(bits),
            Self::Value => ReportLength::Fixed(64),
            Self::Censored { .. } => ReportLength::Varying,
        }
    }

    /// What both ends must agree about, as a number: the kind, and what the words and the silence of a sensor depend on besides. `place` is
    /// the number of coordinates of the state, and which one the sensor reads.
    pub(crate) fn meaning(self, deviation: f64, place: (usize, usize)) -> u32 {
        let numbers = |numbers: &[u64], bits: u32| {
            let bytes = numbers.iter().flat_map(|number| number.to_be_bytes());
            let hash = bytes.fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
            (hash ^ hash >> bits) & ((1 << bits) - 1)
        };
        match self {
            Self::Sign => 1 << KIND_AT,
            Self::Word { bits } => 2 << KIND_AT | (bits & 15) << WORD_AT | numbers(&[deviation.to_bits()], WORD_AT),
            Self::Value => 3 << KIND_AT,
            Self::Censored { threshold } => {
                let (coordinates, reads) = place;
                let all = [
                    threshold.to_bits(),
                    deviation.to_bits(),
                    coordinates as u64,
                    reads as u64,
                ];
                4 << KIND_AT | numbers(&all, KIND_AT)
            }
        }
    }

    /// What the other end was told, from its [`meaning`](Self::meaning); nothing if the number is none.
    pub(crate) fn named(self, found: u32) -> Option<String> {
        let rest = found & ((1 << KIND_AT) - 1);
        let word = match found >> KIND_AT {
            1 if rest == 0 => "bit".to_owned(),
            2 if (2..=4).contains(&(rest >> WORD_AT)) => format!("word:{}", rest >> WORD_AT),
            3 if rest == 0 => "value".to_owned(),
            4 => "silent".to_owned(),
            _ => return None,
        };
        let own = self.word();
        let differs = match self {
            Self::Word { .. } if own == word => " with another `deviation`",
            Self::Censored { .. } if word == "silent" => {
                " with another threshold, `deviation`, `coordinates` or `reads`"
            }
            _ => "",
        };
        Some(format!("`{word}`{differs}"))
    }

    /// Whether the sensor is told the covariance of the state.
    pub(crate) fn needs_coordinates(self) -> bool {
        matches!(self, Self::Censored { .. })
    }

    /// The centre's half of a sensor.
    pub(crate) fn remote<const D: usize>(
        self,
        measured: Measured,
        link: Link,
    ) -> Result<Box<dyn RemoteSensor<D>>, Failure> {
        let variance = measured.variance;
        measured.check::<D>()?;
        Ok(match self {
            Self::Sign => {
                let ask = move |_: &Gaussian<D>, m: &Gaussian<1>| measured.asked(m.mean()[0]);
                Box::new(Reporting::new(measured, SignBit::new(variance)?, link, ask))
            }
            Self::Word { bits } => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| Prediction {
                    mean: m.mean()[0],
                    deviation: m.covariance()[0].sqrt(),
                };
                let scheme = InnovationWord::new(variance, bits as usize)?;
                Box::new(Reporting::new(measured, scheme, link, ask))
            }
            Self::Value => Box::new(Reporting::values(measured, FullValue::new(variance)?, link)),
            Self::Censored { threshold } => {
                let ask = move |state: &Gaussian<D>, _: &Gaussian<1>| measured.told(state);
                let scheme = censored::<D>(measured.reads, variance, threshold)?;
                Box::new(Reporting::new(measured, scheme, link, ask))
            }
        })
    }

    /// The sensor's half. Only that of censored reports uses `D` and `reads`, because it is told the covariance of the state.
    pub(crate) fn node<const D: usize>(self, reads: usize, variance: f64) -> Result<Box<dyn SensorNode<1>>, Failure> {
        Ok(match self {
            Self::Sign => Box::new(SchemeNode::new(SignBit::new(variance)?)),
            Self::Word { bits } => Box::new(SchemeNode::new(InnovationWord::new(variance, bits as usize)?)),
            Self::Value => Box::new(SchemeNode::new(FullValue::new(variance)?)),
            Self::Censored { threshold } => Box::new(SchemeNode::new(censored::<D>(reads, variance, threshold)?)),
        })
    }
}

/// The scheme of a censored report.
fn censored<const D: usize>(
    reads: usize,
    variance: f64,
    threshold: f64,
) -> Result<CovarianceFeedback<LinearSensor<D, 1>, D, 1>, Failure> {
    Measured::of(reads, variance).check::<D>()?;
    let direction = SVector::from_fn(|i, _| if i == reads { 1.0 } else { 0.0 });
    let sensing = LinearSensor::scalar(direction, variance)?;
    Ok(CovarianceFeedback::new(sensing, threshold, NumberFormat::Double)?)
}
