//! Reducers: make a belief small enough to be sent.

use crate::Error;
use fewbits_core::{BitString, CodecError, Message};
use fewbits_densities::{KernelEstimate, Mixture};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::{CodedMixture, RateControl, WireFormat};
use std::ops::Deref;

/// A belief as the next leader receives it, and the message in which it was received.
///
/// A belief that is sent as bits is always decoded from these bits, so that it equals what the receiver gets.
#[derive(Debug, Clone, PartialEq)]
pub struct Handover<const D: usize> {
    mixture: Mixture<D>,
    message: Option<BitString>,
}

impl<const D: usize> Handover<D> {
    /// A mixture that is handed over as real numbers, without counting bits.
    pub(crate) fn real(mixture: Mixture<D>) -> Self {
        Self { mixture, message: None }
    }

    /// The belief that a receiver decodes from the message.
    ///
    /// # Errors
    /// If `decode` fails.
    pub fn received<E>(
        message: BitString,
        decode: impl FnOnce(&BitString) -> Result<Mixture<D>, E>,
    ) -> Result<Self, E> {
        Ok(Self {
            mixture: decode(&message)?,
            message: Some(message),
        })
    }

    fn coded(message: &CodedMixture<D>, format: &WireFormat<D>) -> Result<Self, Error> {
        let bits = message.to_bits(format)?;
        let decode = |bits: &BitString| Ok::<_, CodecError>(CodedMixture::from_bits(format, bits)?.into_mixture());
        Ok(Self::received(bits, decode)?)
    }

    /// The belief of the next leader.
    pub fn mixture(&self) -> &Mixture<D> {
        &self.mixture
    }

    /// The belief of the next leader.
    pub fn into_mixture(self) -> Mixture<D> {
        self.mixture
    }

    /// The message; `None` if the mixture is handed over as real numbers.
    pub fn message(&self) -> Option<&BitString> {
        self.message.as_ref()
    }
}

/// A method that makes a belief small enough to be sent.
pub trait Reducer<const D: usize> {
    /// Reduces the estimate to the belief that is sent.
    ///
    /// # Errors
    /// If the estimate does not fit the budget or format.
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error>;
}

/// References and boxes, as what they point to.
impl<const D: usize, P: Deref<Target: Reducer<D>>> Reducer<D> for P {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        (**self).reduce(estimate)
    }
}

/// No reduction: the whole estimate, one component per particle, as real numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole;

impl<const D: usize> Reducer<D> for Whole {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        Ok(Handover::real(estimate.to_mixture()?))
    }
}

/// Reduces to at most a number of components, as real numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Components {
    /// Largest number of components.
    pub components: usize,
    /// How the estimate is reduced.
    pub reduction: Reduction,
}

impl Components {
    /// At most `components` components by the recommended reduction.
    pub fn new(components: usize) -> Self {
        Self {
            components,
            reduction: Reduction::default(),
        }
    }
}

impl<const D: usize> Reducer<D> for Components {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        Ok(Handover::real(self.reduction.reduce(estimate, self.components)?))
    }
}

/// Reduces to at most a number of components, and codes them at one resolution of a wire format.
#[derive(Debug, Clone, PartialEq)]
pub struct Coded<const D: usize> {
    /// Largest number of components.
    pub components: usize,
    /// How the estimate is reduced.
    pub reduction: Reduction,
    /// The format that sender and receiver know beforehand.
    pub format: WireFormat<D>,
    /// Index of the resolution in the format.
    pub resolution: usize,
}

impl<const D: usize> Reducer<D> for Coded<D> {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        let mixture = self.reduction.reduce(estimate, self.components)?;
        let message = CodedMixture::new(&mixture, &self.format, self.resolution)?;
        Handover::coded(&message, &self.format)
    }
}

/// The best of several numbers of components and resolutions within a number of bits.
#[derive(Debug, Clone, PartialEq)]
pub struct RateLimited<const D: usize> {
    /// The numbers of components and resolutions to try, and how to reduce.
    pub control: RateControl,
    /// The format that sender and receiver know beforehand.
    pub format: WireFormat<D>,
    /// Largest number of bits of a message.
    pub budget: usize,
}

impl<const D: usize> Reducer<D> for RateLimited<D> {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        let rated = self.control.fit(estimate, &self.format, self.budget)?;
        Handover::coded(&rated.message, &self.format)
    }
}
