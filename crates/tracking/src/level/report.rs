//! What sensors send, with both halves, at sensor and centre.

use crate::error::{Error, Failure};
use fewbits_core::{
    ArgumentError, BitString, FullValue, Gaussian, Link, Message, NumberFormat, OnAxes, SchemeNode, SensorNode, Sign,
};
use fewbits_dymbo::{CellIndex, InnovationWord, Prediction, SignBit};
use fewbits_filters::centre::{RemoteSensor, Reporting};
use fewbits_models::LinearSensor;

/// Smallest and largest length of a word. The largest one, because the centre's health test enumerates all words.
const BITS: std::ops::RangeInclusive<u32> = 2..=4;

/// What a sensor sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Report {
    /// Every measurement.
    #[default]
    Value,
    /// One bit: whether the measurement is at or above the prediction, or a threshold.
    Sign,
    /// The cell of the innovation.
    Word {
        /// Length in bits, from 2 to 4.
        bits: u32,
    },
}

impl Report {
    pub(crate) fn check(self) -> Result<(), Error> {
        match self {
            Self::Word { bits } if !BITS.contains(&bits) => Err(Error::Argument {
                argument: "send",
                value: format!("word of {bits} bits"),
                expected: "words of 2 to 4 bits",
            }),
            _ => Ok(()),
        }
    }

    /// The centre's half of a sensor with noise of this variance.
    pub(crate) fn remote<const D: usize>(self, variance: f64, link: Link) -> Result<Box<dyn RemoteSensor<D>>, Failure> {
        let sensing = OnAxes::<_, D, 1>::new(LinearSensor::direct(variance)?, [0])?;
        Ok(match self {
            Self::Sign => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| m.mean()[0];
                Box::new(Reporting::new(sensing, SignBit::new(variance)?, link, ask))
            }
            Self::Word { bits } => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| Prediction {
                    mean: m.mean()[0],
                    deviation: m.covariance()[0].sqrt(),
                };
                let scheme = InnovationWord::new(variance, bits as usize)?;
                Box::new(Reporting::new(sensing, scheme, link, ask))
            }
            Self::Value => Box::new(Reporting::values(sensing, FullValue::new(variance)?, link)),
        })
    }

    /// The sensor's half.
    pub(crate) fn node(self, variance: f64) -> Result<Box<dyn SensorNode<1>>, Failure> {
        Ok(match self {
            Self::Sign => Box::new(SchemeNode::new(SignBit::new(variance)?)),
            Self::Word { bits } => Box::new(SchemeNode::new(InnovationWord::new(variance, bits as usize)?)),
            Self::Value => Box::new(SchemeNode::new(FullValue::new(variance)?)),
        })
    }

    /// A report as it stands in a table.
    pub(crate) fn bits(self, cell: f64) -> Result<BitString, Failure> {
        let wrong = |expected: String| ArgumentError::new("report", cell, expected);
        Ok(match self {
            Self::Value => double(cell)?,
            Self::Sign if cell == 0.0 || cell == -1.0 => Sign::Below.to_bits(&())?,
            Self::Sign if cell == 1.0 => Sign::Above.to_bits(&())?,
            Self::Sign => {
                return Err(wrong("1, or 0 or -1: `--send bit` says that reports are bits".to_owned()).into());
            }
            Self::Word { bits } => {
                let largest = (1_u32 << bits) - 1;
                if !(0.0..=f64::from(largest)).contains(&cell) || cell.fract() != 0.0 {
                    return Err(wrong(format!("a whole number from 0 to {largest}, the lowest cell first")).into());
                }
                CellIndex(cell as u16).to_bits(&bits)?
            }
        })
    }
}

/// A number in double precision: a value, or a threshold as feedback of a bit.
pub(crate) fn double(number: f64) -> Result<BitString, Failure> {
    Ok(Message::to_bits(&number, &NumberFormat::Double)?)
}
