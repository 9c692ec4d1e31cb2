//! How the filter starts without a belief: the first sample is sent finely rounded, and a prior may be combined with it.

use crate::Error;
use crate::plant::scalar;
use fewbits_core::factor::Levels;
use fewbits_core::{BitReader, BitWriter, Cell, CodecError, Factor, Gaussian, Message, Noise, Quantized};
use fewbits_numerics::error::{ArgumentError, finite, positive, refuse, within};
use serde::{Deserialize, Serialize};

/// The first message: the integer multiple of the resolution that is nearest to the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Multiple(pub i64);

impl Message for Multiple {
    /// Word length in bits; the multiple travels in two's complement.
    type Format = u32;

    fn encode(&self, bits: &u32, writer: &mut BitWriter) -> Result<(), CodecError> {
        let spare = 64_u32
            .checked_sub(*bits)
            .ok_or(CodecError::FieldTooWide { width: *bits })?;
        let word = (self.0 as u64).checked_shl(spare).unwrap_or(0);
        if (word as i64).checked_shr(spare).unwrap_or(0) != self.0 {
            return Err(CodecError::ValueTooLarge {
                value: self.0.unsigned_abs(),
                width: *bits,
            });
        }
        writer.write(word.checked_shr(spare).unwrap_or(0), *bits)
    }

    fn decode(bits: &u32, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let word = reader.read(*bits)?;
        // `read` has refused words above 64 bits.
        let spare = 64 - *bits;
        Ok(Self(
            (word.checked_shl(spare).unwrap_or(0) as i64)
                .checked_shr(spare)
                .unwrap_or(0),
        ))
    }
}

/// A sensor that reports its sample rounded to a multiple of the resolution `tau`, halves away from zero, in a word of fixed
/// length. Multiples beyond the word saturate, so the outermost cells are unbounded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct RoundedSample {
    noise_variance: f64,
    resolution: f64,
    bits: u32,
}

/// The stored form of [`RoundedSample`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    noise_variance: f64,
    resolution: f64,
    bits: u32,
}

impl TryFrom<Numbers> for RoundedSample {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        RoundedSample::new(parts.noise_variance, parts.resolution)?.with_bits(parts.bits)
    }
}

/// Largest word length whose cells are enumerated. A link that inverts bits needs the likelihood of every cell.
const MAX_NOISY_BITS: u32 = 12;

impl RoundedSample {
    /// A sensor with measurement variance `sigma^2 > 0`, resolution `tau > 0` in measurement units and words of 16 bits.
    ///
    /// # Errors
    /// If either is not positive and finite.
    pub fn new(noise_variance: f64, resolution: f64) -> Result<Self, Error> {
        Ok(Self {
            noise_variance: positive("noise_variance", noise_variance)?,
            resolution: positive("resolution", resolution)?,
            bits: 16,
        })
    }

    /// The same with words of 1 to 32 bits.
    ///
    /// # Errors
    /// If `bits` is outside `1..=32`.
    pub fn with_bits(self, bits: u32) -> Result<Self, Error> {
        within("bits", f64::from(bits), 1.0, 32.0)?;
        Ok(Self { bits, ..self })
    }

    /// Resolution `tau`, in measurement units.
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Smallest and largest multiple that the word can hold.
    fn range(&self) -> (i64, i64) {
        let half = 1_i64 << (self.bits - 1);
        (-half, half - 1)
    }

    fn twos_complement(&self, multiple: i64) -> u64 {
        multiple as u64 & ((1 << self.bits) - 1)
    }

    /// The multiple for a measurement.
    ///
    /// # Errors
    /// If the measurement is not finite.
    pub fn round(&self, measurement: f64) -> Result<Multiple, ArgumentError> {
        let (least, most) = self.range();
        let multiple = (finite("measurement", measurement)? / self.resolution).round() as i64;
        Ok(Multiple(multiple.clamp(least, most)))
    }

    /// The reconstructed sample: the multiple times `tau`.
    #[inline]
    pub(crate) fn value(&self, multiple: Multiple) -> f64 {
        self.resolution * multiple.0 as f64
    }

    /// The interval of samples that are rounded to this multiple.
    ///
    /// # Errors
    /// If the multiple does not fit the word, or is so large that neighbouring cells coincide.
    pub fn cell(&self, multiple: Multiple) -> Result<Cell, ArgumentError> {
        let (least, most) = self.range();
        if !(least..=most).contains(&multiple.0) {
            return Err(ArgumentError::new("multiple", multiple.0, format!("a number from {least} to {most}")));
        }
        let edge = |offset: f64| self.resolution * (multiple.0 as f64 + offset);
        // The outermost cells are open.
        let (is_first, is_last) = (multiple.0 == least, multiple.0 == most);
        let lower = if is_first { -f64::INFINITY } else { edge(-0.5) };
        Cell::new(lower, if is_last { f64::INFINITY } else { edge(0.5) })
    }

    /// The belief about the state after a first message and no other knowledge: `theta_hat(0) = m(0)`, variance `sigma^2 + tau^2/12`.
    ///
    /// The bound of Proposition 2, `(sigma + tau/2)^2`, must not serve as the start variance: it is up to twice too large, and the
    /// filter's first gains are then too large (erratum `dymbo-7`).
    ///
    /// # Errors
    /// If mean or variance overflow.
    pub fn belief(&self, message: Multiple) -> Result<Gaussian<1>, Error> {
        let variance = self.noise_variance + self.resolution * self.resolution / 12.0;
        Ok(scalar(finite("message", self.value(message))?, finite("resolution^2", variance)?))
    }

    /// The belief after a first message combined with a prior for `theta(0)`. If the prior is informative, this is far better than
    /// [`belief`](Self::belief): at `a = 0.9`, `gamma = 0.05` the message alone has a larger error than the prior alone.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the message has probability zero under the prior.
    pub fn belief_with_prior(&self, message: Multiple, prior: &Gaussian<1>) -> Result<Gaussian<1>, Error> {
        let posterior = Levels::certain(self.cell(message)?, self.noise_variance)?.tilted(prior)?;
        Ok(scalar(posterior.mean[0], posterior.covariance[0]))
    }
}

impl Quantized for RoundedSample {
    type Feedback = ();
    type Report = Multiple;

    fn format_of_feedback(&self) {}

    fn format_of_report(&self) -> u32 {
        self.bits
    }

    fn measurement_noise(&self) -> Noise {
        self.noise_variance.into()
    }

    fn report_of(&self, measurement: f64, (): &()) -> Result<Multiple, Error> {
        Ok(self.round(measurement)?)
    }

    /// Refuses words of more than 12 bits.
    fn edges(&self, (): &()) -> Result<Vec<f64>, Error> {
        if self.bits > MAX_NOISY_BITS {
            return refuse("bits", self.bits, "words of at most 12 bits over a link that inverts bits");
        }
        let (least, most) = self.range();
        Ok((least..most).map(|k| self.resolution * (k as f64 + 0.5)).collect())
    }

    /// Two's complement of `bits` bits, as the words travel.
    fn words(&self) -> impl Iterator<Item = u64> {
        let (least, most) = self.range();
        (least..=most).map(move |k| self.twos_complement(k))
    }

    fn word_of(&self, multiple: &Multiple) -> Result<u64, Error> {
        self.cell(*multiple)?;
        Ok(self.twos_complement(multiple.0))
    }

    fn word_bits(&self) -> u32 {
        self.bits
    }

    fn only_cell(&self, multiple: &Multiple, (): &()) -> Result<Option<Cell>, Error> {
        Ok(Some(self.cell(*multiple)?))
    }
}

#[cfg(test)]
mod tests {
    use super::{Multiple, RoundedSample};
    use fewbits_core::laws::message::round_trip;
    use fewbits_core::{Gaussian, Link, Message, Observation, Scheme};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn multiples_round_trip(multiple in -2048_i64..2048) {
            prop_assert_eq!(round_trip(&Multiple(multiple), &12).unwrap(), 12);
            prop_assert_eq!(Multiple(multiple).to_bits(&11).is_ok(), (-1024..1024).contains(&multiple));
            let scheme = RoundedSample::new(1.0, 0.25).unwrap();
            prop_assert_eq!(scheme.round(scheme.value(Multiple(multiple))), Ok(Multiple(multiple)));
        }
    }

    #[test]
    fn halves_round_away_from_zero_and_words_saturate() {
        let scheme = RoundedSample::new(1.0, 1.0).unwrap();
        assert_eq!((scheme.round(0.5), scheme.round(-0.5)), (Ok(Multiple(1)), Ok(Multiple(-1))));
        assert_eq!((scheme.round(1e9), scheme.round(-1e9)), (Ok(Multiple(32767)), Ok(Multiple(-32768))));
        assert_eq!(scheme.cell(Multiple(32767)).unwrap().upper(), f64::INFINITY);
        assert!(scheme.cell(Multiple(32768)).is_err() && scheme.round(f64::NAN).is_err());
        assert!(RoundedSample::new(1.0, 0.0).is_err() && RoundedSample::new(1.0, f64::NAN).is_err());
        assert!(scheme.with_bits(0).is_err() && scheme.with_bits(33).is_err());
        let received = Observation::Received(Multiple(0));
        assert!(scheme.factor(&(), &received, &Link::flipping(0.1).unwrap()).is_err());
        assert!(Multiple(0).to_bits(&65).is_err());
        assert_eq!(Multiple(i64::MIN).to_bits(&64).unwrap().bits(), 64);
        assert_eq!(Multiple(0).to_bits(&0).unwrap().bits(), 0);
        let json = serde_json::to_string(&scheme).unwrap();
        assert_eq!(serde_json::from_str::<RoundedSample>(&json).unwrap(), scheme);
        assert!(serde_json::from_str::<RoundedSample>(&json.replace("16", "40")).is_err());
    }

    #[test]
    fn a_prior_can_only_help() {
        let scheme = RoundedSample::new(1.0, 1.0).unwrap();
        let prior = Gaussian::scalar(0.0, 0.05 / 0.19).unwrap();
        let message = Multiple(1);
        let alone = scheme.belief(message).unwrap();
        let both = scheme.belief_with_prior(message, &prior).unwrap();
        assert!(both.covariance()[0] < prior.covariance()[0] && alone.covariance()[0] > prior.covariance()[0]);
    }
}
