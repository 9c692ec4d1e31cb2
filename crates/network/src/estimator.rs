//! What an estimator must offer to run over a network.

use crate::error::Error;
use fewbits_core::{BitReader, BitString, BitWriter, CodecError, Gaussian, Message, NumberFormat, Observation};
use rand_pcg::Pcg64Dxsm;

/// Sensors that report, and a receiver that estimates: slot by slot.
///
/// ```text
/// slot k:  predicted = predict(belief)
///          for each sensor:  question = question(predicted);  report = report(measurement, question)   at the sensor
///          belief = update(predicted, observations)
/// ```
///
/// Laws: all methods are functions of their arguments, so that two ends that share belief, slot and stream stay equal; a failed
/// `update` changes nothing.
pub trait Estimator {
    /// What the receiver knows of the state.
    type Belief: Clone;
    /// What a sensor measures in a slot.
    type Measurement;
    /// What a sensor is told before it measures.
    type Question: Message;
    /// What a sensor may report.
    type Report: Message;
    /// What a sensor remembers.
    type Memory: Clone;

    /// Number of sensors, at least one.
    fn sensors(&self) -> usize;

    /// The belief before the first slot, known at both ends.
    fn start(&self) -> Self::Belief;

    /// A sensor's memory before its first slot.
    fn memory(&self, sensor: usize) -> Self::Memory;

    /// Time update into slot `slot` (the first is 1).
    ///
    /// # Errors
    /// Those of the filter.
    fn predict(&self, rng: &mut Pcg64Dxsm, slot: u32, belief: &Self::Belief) -> Result<Self::Belief, Error>;

    /// What `sensor` is told before it measures, made from the prediction.
    ///
    /// # Errors
    /// Those of the scheme.
    fn question(&self, slot: u32, predicted: &Self::Belief, sensor: usize) -> Result<Self::Question, Error>;

    /// How questions travel.
    fn question_format(&self, sensor: usize) -> <Self::Question as Message>::Format;

    /// How reports travel.
    fn report_format(&self, sensor: usize) -> <Self::Report as Message>::Format;

    /// How the end of a report is found where several reports travel in one message, as in the echo of a slot.
    fn report_end(&self) -> ReportEnd {
        ReportEnd::InReport
    }

    /// The sensor's half; `None` is silence.
    ///
    /// # Errors
    /// Those of the scheme.
    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        sensor: usize,
        memory: &mut Self::Memory,
        measurement: &Self::Measurement,
        question: &Self::Question,
    ) -> Result<Option<Self::Report>, Error>;

    /// The receiver's half: for each sensor one observation, or `None` if it was not asked or what it did cannot be used. A sensor
    /// without observation changes nothing, neither by a report nor by silence.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observations have probability zero; others of the filter.
    fn update(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        predicted: &Self::Belief,
        observations: &[Option<Observation<Self::Report>>],
    ) -> Result<Self::Belief, Error>;

    /// The estimate: one number per coordinate.
    fn mean(&self, belief: &Self::Belief) -> Vec<f64>;
}

/// How the end of a report is found where other bits follow it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum ReportEnd {
    /// Decoding reads as many bits as the report has, whatever follows.
    #[default]
    InReport,
    /// Decoding reads all bits that there are. Where several reports travel together, a length of 16 bits goes before each.
    OfMessage,
}

/// An estimator whose belief can itself be sent, so that replicas can be brought together again.
pub trait Replicable: Estimator {
    /// The belief as bits, exactly.
    ///
    /// # Errors
    /// If a number is not finite.
    fn belief_bits(&self, belief: &Self::Belief) -> Result<BitString, Error>;

    /// The belief that bits hold. Total.
    ///
    /// # Errors
    /// If the bits are no belief.
    fn belief_of(&self, bits: &BitString) -> Result<Self::Belief, Error>;
}

/// The observations of sensors that always speak: to them a known loss, as no observation, says nothing about the state.
#[cfg(any(feature = "dymbo", feature = "look-up"))]
pub(crate) fn always_spoken<R: Clone>(observations: &[Option<Observation<R>>]) -> Vec<Observation<R>> {
    let known = |o: &Option<Observation<R>>| o.clone().unwrap_or(Observation::Lost);
    observations.iter().map(known).collect()
}

/// A belief that is sent whole: `D` means and `D (D + 1)/2` covariances in double precision.
///
/// # Errors
/// If a number is not finite.
pub fn gaussian_bits<const D: usize>(belief: &Gaussian<D>, writer: &mut BitWriter) -> Result<(), CodecError> {
    belief.encode(&NumberFormat::Double, writer)
}

/// Reads what [`gaussian_bits`] wrote.
///
/// # Errors
/// If bits are missing, a number is not finite, or the covariance is none.
pub fn gaussian_of<const D: usize>(reader: &mut BitReader<'_>) -> Result<Gaussian<D>, CodecError> {
    Gaussian::decode(&NumberFormat::Double, reader)
}

/// [`Replicable`] for an estimator whose belief is a Gaussian.
macro_rules! gaussian_replica {
    ([$($generics:tt)*] $type:ty $(where $($bounds:tt)*)?) => {
        impl<$($generics)*> $crate::estimator::Replicable for $type $(where $($bounds)*)? {
            fn belief_bits(&self, belief: &Self::Belief) -> Result<fewbits_core::BitString, $crate::Error> {
                let mut writer = fewbits_core::BitWriter::new();
                $crate::estimator::gaussian_bits(belief, &mut writer)?;
                Ok(writer.finish())
            }

            fn belief_of(&self, bits: &fewbits_core::BitString) -> Result<Self::Belief, $crate::Error> {
                let mut reader = fewbits_core::BitReader::new(bits);
                let belief = $crate::estimator::gaussian_of(&mut reader)?;
                reader.finish()?;
                Ok(belief)
            }
        }
    };
}
pub(crate) use gaussian_replica;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_belief_comes_back_to_the_bit() {
        let belief = Gaussian::new([0.1, -7e-9].into(), [[2.0, 0.03], [0.03, 1e-3]].into()).unwrap();
        let mut writer = BitWriter::new();
        gaussian_bits(&belief, &mut writer).unwrap();
        let bits = writer.finish();
        assert_eq!(bits.bits(), 5 * 64);
        assert_eq!(gaussian_of::<2>(&mut BitReader::new(&bits)).unwrap(), belief);
        assert!(gaussian_of::<2>(&mut BitReader::new(&bits.with_flipped(2 * 64))).is_err());
    }
}
