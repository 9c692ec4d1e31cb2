//! The scheme of a sensor with a scalar quantizer: sample to word, and the likelihood of a received word.

use crate::error::Error;
use crate::labelling::{Labelling, Symbol};
use crate::quantizer::Quantizer;
use crate::refuse;
use fewbits_core::{Noise, Quantized};
use fewbits_numerics::error::positive;
use serde::{Deserialize, Serialize};

/// A sensor that reports the level of its scalar sample in every slot, as a [`Scheme`](fewbits_core::Scheme) that every filter accepts.
///
/// Over a [`Link`](fewbits_core::Link) of crossover `e` each bit of the word is inverted with probability `e`. A word without a level is a symbol
/// too, so every received word decodes. The sensor is never silent, so a missing report does not depend on the sample.
///
/// ```
/// use fewbits_core::factor::Factor;
/// use fewbits_core::{Gaussian, Link, Observation, Scheme};
/// use fewbits_quantizers::{Labelling, QuantizingSensor, Quantizer, Symbol, lloyd_max};
///
/// let quantizer = Quantizer::from(&lloyd_max::gaussian(4)?);
/// let level = Symbol(quantizer.encode(1.2)?);
/// let sensor = QuantizingSensor::with_variance(quantizer, Labelling::gray(4)?, 0.5)?;
/// let received = sensor.factor(&(), &Observation::Received(level), &Link::flipping(0.01)?)?;
/// let posterior = received.tilted(&Gaussian::scalar(0.0, 1.0)?)?;
/// assert!(posterior.mean[0] > 0.8 && posterior.covariance[0] < 0.6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct QuantizingSensor {
    quantizer: Quantizer,
    labelling: Labelling,
    noise_variance: f64,
}

/// The stored form of [`QuantizingSensor`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    quantizer: Quantizer,
    labelling: Labelling,
    noise_variance: f64,
}

impl TryFrom<Stored> for QuantizingSensor {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        QuantizingSensor::with_variance(parts.quantizer, parts.labelling, parts.noise_variance)
    }
}

impl QuantizingSensor {
    /// A sensor with this quantizer and these words, whose samples have noise of variance `noise_variance`.
    ///
    /// # Errors
    /// If the labelling does not have one word per level, or `noise_variance` is not a positive number.
    pub fn with_variance(quantizer: Quantizer, labelling: Labelling, noise_variance: f64) -> Result<Self, Error> {
        positive("noise_variance", noise_variance)?;
        if labelling.levels() != quantizer.levels() {
            let given = format!("{} words", labelling.levels());
            return refuse("labelling", given, format!("{} words, one per level", quantizer.levels()));
        }
        Ok(Self {
            quantizer,
            labelling,
            noise_variance,
        })
    }

    /// The words of the levels, which are the format of the reports.
    pub fn labelling(&self) -> &Labelling {
        &self.labelling
    }

    /// Variance of the noise in the samples.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }
}

impl Quantized for QuantizingSensor {
    type Feedback = ();
    type Report = Symbol;

    fn format_of_feedback(&self) {}

    fn format_of_report(&self) -> Labelling {
        self.labelling.clone()
    }

    fn measurement_noise(&self) -> Noise {
        self.noise_variance.into()
    }

    fn report_of(&self, measurement: f64, (): &()) -> Result<Symbol, fewbits_core::Error> {
        Ok(Symbol(self.quantizer.encode(measurement)?))
    }

    fn edges(&self, (): &()) -> Result<Vec<f64>, fewbits_core::Error> {
        Ok(self.quantizer.breakpoints().to_vec())
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        let labels = self.quantizer.labels().iter();
        labels.map(move |level| self.labelling.word(*level).unwrap_or_default().into())
    }

    fn word_of(&self, symbol: &Symbol) -> Result<u64, fewbits_core::Error> {
        self.labelling.word_of(*symbol)
    }

    fn word_bits(&self) -> u32 {
        self.labelling.bits()
    }
}
