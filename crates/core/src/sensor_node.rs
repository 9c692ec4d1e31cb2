//! The sensor's half of a scheme over bits: what runs on the sensor.

use crate::bits::BitString;
use crate::error::Error;
use crate::message::Message;
use crate::scheme::{Deterministic, Scheme};
use fewbits_numerics::ArgumentError;
use nalgebra::SVector;
use rand::{Rng, TryRng};
use std::convert::Infallible;

/// A sensor as it sees itself: a measurement and the feedback's bits in, a report's bits or silence out. It needs no belief and no
/// model of the world. Object-safe, so that sensors of any kind stand in one list.
///
/// Any [`Scheme`] has one: [`SchemeNode`].
pub trait SensorNode<const M: usize> {
    /// What the sensor sends in this slot. `None` is silence: zero bits on air. `rng` is drawn from by randomised schemes only.
    ///
    /// # Errors
    /// If the measurement is not finite or the bits are no feedback of the scheme; the sensor's memory is then as it was.
    fn report(
        &mut self,
        rng: &mut dyn Rng,
        measurement: &SVector<f64, M>,
        feedback: &BitString,
    ) -> Result<Option<BitString>, Error>;

    /// Slots have passed in which the sensor was not asked. A sensor whose rule depends on the slot counts them; others do nothing.
    fn skip(&mut self, _slots: u64) {}

    /// What the sensor remembers, for a driver that stores it. `None` if this kind of sensor cannot be stored.
    fn stored(&self) -> Option<BitString> {
        None
    }

    /// Goes on from what [`stored`](Self::stored) returned.
    ///
    /// # Errors
    /// If this kind of sensor cannot be stored, or the bits are no memory of it.
    fn restore(&mut self, memory: &BitString) -> Result<(), Error> {
        let expected = "a kind of sensor that can be stored";
        Err(ArgumentError::new("memory", format!("{} bits", memory.bits()), expected).into())
    }
}

/// The sensor's half of a scheme, with its memory.
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

    /// What the sensor remembers.
    pub fn memory(&self) -> &C::State {
        &self.memory
    }

    /// The same sensor with a memory that was stored.
    #[must_use]
    pub fn with_memory(self, memory: C::State) -> Self {
        Self { memory, ..self }
    }
}

impl<C: Deterministic<M>, const M: usize> SchemeNode<C, M> {
    /// [`SensorNode::report`] without a random source.
    ///
    /// # Errors
    /// As there.
    pub fn answer(&mut self, measurement: &SVector<f64, M>, feedback: &BitString) -> Result<Option<BitString>, Error> {
        self.report(&mut Undrawn, measurement, feedback)
    }
}

/// The random source of those that draw nothing.
struct Undrawn;

impl TryRng for Undrawn {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok(0)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(0)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.fill(0);
        Ok(())
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
        let report = self.scheme.encode(rng, &mut self.memory, measurement, &feedback)?;
        let bits = report.map(|report| report.to_bits(&self.scheme.report_format()));
        Ok(bits
            .transpose()
            .map_err(|error| ArgumentError::new("report", error, "a report that fits its format"))?)
    }

    /// No bits, for a scheme without memory; `None` for others.
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
