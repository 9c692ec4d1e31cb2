//! The schemes of the sensors, at sensor and centre.

use crate::error::Error;
use fewbits_core::{
    ArgumentError, BitString, FullValue, Gaussian, Link, Message, NumberFormat, OnAxes, SchemeNode, SensorNode, Sign,
};
use fewbits_dymbo::{CellIndex, InnovationWord, Prediction, SignBit};
use fewbits_filters::centre::{RemoteSensor, Reporting};
use fewbits_models::LinearSensor;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Kind of a sensor's reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sends {
    Value,
    Bit,
    Word(u32),
}

/// Largest length of a word, because the centre's health test enumerates all words.
const MAX_BITS: u32 = 4;

impl Sends {
    pub(super) fn parse(text: &str) -> Result<Self, Error> {
        let refused =
            || Error::option("--send", text, "`value`, `bit`, or `word:2` to `word:4`; for one column as `column=bit`");
        match text {
            "value" => Ok(Self::Value),
            "bit" => Ok(Self::Bit),
            _ => {
                let bits = text.strip_prefix("word:").and_then(|bits| bits.parse().ok());
                bits.filter(|bits| (1..=MAX_BITS).contains(bits))
                    .map(Self::Word)
                    .ok_or_else(refused)
            }
        }
    }

    /// The receiver's half for a sensor that reads the first coordinate.
    pub(super) fn remote<const D: usize>(self, noise: f64, link: Link) -> Result<Box<dyn RemoteSensor<D>>, Failure> {
        let variance = noise * noise;
        let sensing = OnAxes::<_, D, 1>::new(LinearSensor::direct(variance)?, [0])?;
        Ok(match self {
            Self::Value => Box::new(Reporting::values(sensing, FullValue::new(variance)?, link)),
            Self::Bit => {
                let threshold = |_: &Gaussian<D>, m: &Gaussian<1>| m.mean()[0];
                Box::new(Reporting::new(sensing, SignBit::new(variance)?, link, threshold))
            }
            Self::Word(bits) => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| Prediction {
                    mean: m.mean()[0],
                    deviation: m.covariance()[0].sqrt(),
                };
                let scheme = InnovationWord::new(variance, bits as usize)?;
                Box::new(Reporting::new(sensing, scheme, link, ask))
            }
        })
    }

    /// The sensor's half.
    pub(super) fn node(self, noise: f64) -> Result<Box<dyn SensorNode<1>>, Failure> {
        let variance = noise * noise;
        Ok(match self {
            Self::Value => Box::new(SchemeNode::new(FullValue::new(variance)?)),
            Self::Bit => Box::new(SchemeNode::new(SignBit::new(variance)?)),
            Self::Word(bits) => Box::new(SchemeNode::new(InnovationWord::new(variance, bits as usize)?)),
        })
    }

    /// A report as it stands in a table.
    pub(super) fn bits(self, cell: f64) -> Result<BitString, Failure> {
        let wrong = |expected: String| ArgumentError::new("report", cell, expected);
        Ok(match self {
            Self::Value => Message::to_bits(&cell, &NumberFormat::Double)?,
            Self::Bit if cell == 0.0 || cell == -1.0 => Sign::Below.to_bits(&())?,
            Self::Bit if cell == 1.0 => Sign::Above.to_bits(&())?,
            Self::Bit => return Err(wrong("1, or 0 or -1: `--send bit` says that reports are bits".to_owned()).into()),
            Self::Word(bits) => {
                let largest = (1_u32 << bits) - 1;
                if !(0.0..=f64::from(largest)).contains(&cell) || cell.fract() != 0.0 {
                    return Err(wrong(format!("a whole number from 0 to {largest}, the lowest cell first")).into());
                }
                CellIndex(cell as u16).to_bits(&bits)?
            }
        })
    }
}

/// A threshold as feedback of a bit.
pub(super) fn threshold_bits(threshold: f64) -> Result<BitString, Failure> {
    Ok(Message::to_bits(&threshold, &NumberFormat::Double)?)
}
