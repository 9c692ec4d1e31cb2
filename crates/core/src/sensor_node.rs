//! The part of a scheme that runs on the sensor, with feedback and reports as bits.

use crate::bits::BitString;
use crate::error::Error;
use crate::message::Message;
use crate::scheme::Scheme;
use fewbits_numerics::ArgumentError;
use nalgebra::SVector;
use rand::Rng;

/// A sensor: takes a measurement and the bits of the feedback, and returns the bits of a report, or silence. It needs no belief and no
/// model of the state. The trait is object-safe, so that sensors of different kinds can be in one list.
///
/// [`SchemeNode`] implements it for any [`Scheme`].
pub trait SensorNode<const M: usize>: Send + Sync {
    /// What the sensor sends in this slot. `None` is silence, which sends zero bits. Only randomised schemes draw from `rng`.
    ///
    /// # Errors
    /// If the measurement is not finite or the bits do not encode feedback of the scheme; the sensor's memory is then unchanged.
    fn report(
        &mut self,
        rng: &mut dyn Rng,
        measurement: &SVector<f64, M>,
        feedback: &BitString,
    ) -> Result<Option<BitString>, Error>;

    /// Tells the sensor that `slots` slots passed in which it was not asked. Only sensors whose rule depends on the slot number use it.
    fn skip(&mut self, _slots: u64) {}

    /// The sensor's memory, so that it can be stored. `None` if this kind of sensor cannot be stored.
    fn stored(&self) -> Option<BitString> {
        None
    }

    /// Restores the memory that [`stored`](Self::stored) returned.
    ///
    /// # Errors
    /// If this kind of sensor cannot be stored, or the bits do not encode its memory.
    fn restore(&mut self, memory: &BitString) -> Result<(), Error> {
        let expected = "a kind of sensor that can be stored";
        Err(ArgumentError::new("memory", format!("{} bits", memory.bits()), expected).into())
    }
}

/// A sensor that reports by a scheme, with its memory.
#[derive(Debug, Clone, PartialEq)]
pub struct SchemeNode<C: Scheme<M>, const M: usize> {
    scheme: C,
    memory: C::State,
}

impl<C: Scheme<M>, const M: usize> SchemeNode<C, M> {
    /// A sensor before its first measurement.
    pub fn new(scheme: C) -> Self {
        let memory = scheme.start();
        Self { scheme, memory }
    }
}

impl<C: Scheme<M>, const M: usize> SensorNode<M> for SchemeNode<C, M> {
    fn report(
        &mut self,
        rng: &mut dyn Rng,
        measurement: &SVector<f64, M>,
        feedback: &BitString,
    ) -> Result<Option<BitString>, Error> {
        let feedback = C::Feedback::from_bits(&self.scheme.feedback_format(), feedback)
            .map_err(|error| ArgumentError::new("feedback", error, "the bits of a feedback of this scheme"))?;
        // `encode` changes the memory only if it succeeds; what follows fails only for a scheme that breaks its format.
        let report = self.scheme.encode(rng, &mut self.memory, measurement, &feedback)?;
        let bits = report.map(|report| report.to_bits(&self.scheme.report_format()));
        Ok(bits
            .transpose()
            .map_err(|error| ArgumentError::new("report", error, "a report that fits its format"))?)
    }

    /// No bits for a scheme without memory; `None` for others.
    fn stored(&self) -> Option<BitString> {
        (size_of::<C::State>() == 0).then(BitString::default)
    }

    fn restore(&mut self, memory: &BitString) -> Result<(), Error> {
        match (size_of::<C::State>(), memory.bits()) {
            (0, 0) => Ok(()),
            (_, bits) => {
                Err(ArgumentError::new("memory", format!("{bits} bits"), "none, of a scheme without memory").into())
            }
        }
    }
}
