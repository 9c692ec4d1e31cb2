//! Sensors of a fusion centre: what each reads and sends, and its two halves.

use crate::error::{Outcome, refused};
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{FullValue, Gaussian, Link, NumberFormat, SchemeNode, SensorNode};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::centre::{RemoteSensor, Reporting};
use fewbits_models::LinearSensor;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// What a sensor sends.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Sends {
    Bit,
    Word(usize),
    Value,
    /// The sample if its innovation reaches so many standard deviations, otherwise silence.
    Silent(f64),
}

impl Sends {
    pub(crate) fn parsed(text: &str) -> Outcome<Self> {
        let (name, number) = text
            .split_once(':')
            .map_or((text, None), |(name, number)| (name, Some(number)));
        match (name, number) {
            ("bit", None) => return Ok(Self::Bit),
            ("value", None) => return Ok(Self::Value),
            ("word", Some(bits)) => {
                if let Ok(bits @ 2..=4) = bits.parse() {
                    return Ok(Self::Word(bits));
                }
            }
            ("silent", Some(threshold)) => {
                if let Some(threshold) = threshold.parse().ok().filter(|t: &f64| *t > 0.0 && t.is_finite()) {
                    return Ok(Self::Silent(threshold));
                }
            }
            _ => {}
        }
        refused(
            "send",
            format!("'{text}'"),
            "'value', 'bit', 'word:2' to 'word:4', or 'silent:1.5' (standard deviations)",
        )
    }
}

/// What a missing cell means.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Missing {
    /// The sensor was not asked, or nobody knows.
    Unknown,
    /// A report was due and nothing arrived.
    Silence,
}

/// What a sensor reads of the state.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Reads {
    /// A coordinate.
    Axis(usize),
    /// A sum of coordinates with these factors.
    Sum(Vec<f64>),
}

/// The sensor of a column.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Seat {
    pub(crate) name: String,
    pub(crate) reads: Reads,
    pub(crate) variance: f64,
    pub(crate) send: Sends,
    pub(crate) loss: f64,
    /// What the sensor shows too much.
    pub(crate) offset: f64,
    pub(crate) missing: Missing,
}

impl Seat {
    /// The receiver's half.
    pub(crate) fn remote<const D: usize>(&self) -> Outcome<Box<dyn RemoteSensor<D>>> {
        let link = Link::lossy(self.loss)?;
        if let Sends::Silent(threshold) = self.send {
            let ask = |state: &Gaussian<D>, _: &Gaussian<1>| *state;
            return Ok(Box::new(Reporting::new(self.sensing::<D>()?, self.censored::<D>(threshold)?, link, ask)));
        }
        self.reporting(self.sensing::<D>()?, link)
    }

    fn reporting<const D: usize>(&self, sensing: LinearSensor<D, 1>, link: Link) -> Outcome<Box<dyn RemoteSensor<D>>> {
        Ok(match self.send {
            Sends::Bit => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| m.mean()[0];
                Box::new(Reporting::new(sensing, SignBit::new(self.variance)?, link, ask))
            }
            Sends::Word(bits) => {
                let ask = |_: &Gaussian<D>, m: &Gaussian<1>| Prediction::from(m);
                Box::new(Reporting::new(sensing, InnovationWord::new(self.variance, bits)?, link, ask))
            }
            _ => Box::new(Reporting::values(sensing, FullValue::new(self.variance)?, link)),
        })
    }

    /// The sensor's half.
    pub(crate) fn node<const D: usize>(&self) -> Outcome<Box<dyn SensorNode<1>>> {
        self.sensing::<D>()?;
        Ok(match self.send {
            Sends::Bit => Box::new(SchemeNode::new(SignBit::new(self.variance)?)),
            Sends::Word(bits) => Box::new(SchemeNode::new(InnovationWord::new(self.variance, bits)?)),
            Sends::Value => Box::new(SchemeNode::new(FullValue::new(self.variance)?)),
            Sends::Silent(threshold) => Box::new(SchemeNode::new(self.censored::<D>(threshold)?)),
        })
    }

    /// What the sensor measures.
    fn sensing<const D: usize>(&self) -> Outcome<LinearSensor<D, 1>> {
        let direction = match &self.reads {
            Reads::Axis(axis) if *axis < D => SVector::from_fn(|i, _| if i == *axis { 1.0 } else { 0.0 }),
            Reads::Axis(axis) => return refused("reads", axis, format!("0 to {}, a coordinate of the model", D - 1)),
            Reads::Sum(factors) if factors.len() == D => SVector::from_column_slice(factors),
            Reads::Sum(factors) => return refused("reads", format!("{} factors", factors.len()), format!("{D}")),
        };
        Ok(LinearSensor::scalar(direction, self.variance)?)
    }

    fn censored<const D: usize>(&self, threshold: f64) -> Outcome<CovarianceFeedback<LinearSensor<D, 1>, D, 1>> {
        Ok(CovarianceFeedback::new(self.sensing::<D>()?, threshold, NumberFormat::Double)?)
    }
}
