//! What is sent: a belief made small enough to travel.

use crate::Error;
use fewbits_core::Message;
use fewbits_densities::wire::{CodedMixture, RateControl, WireFormat};
use fewbits_densities::{KernelEstimate, Mixture, Reduction};

/// A belief as the next leader receives it, and its price.
#[derive(Debug, Clone, PartialEq)]
pub struct Handover<const D: usize> {
    /// What the next leader knows.
    pub mixture: Mixture<D>,
    /// Length of the message in bits; `None` where the mixture is handed over as real numbers.
    pub bits: Option<usize>,
}

/// A way to make a belief small enough to travel.
///
/// Law: the mixture is what a receiver can know from the message alone.
pub trait Reducer<const D: usize> {
    /// Reduces the estimate to what is sent.
    ///
    /// # Errors
    /// If the estimate does not fit the budget or format.
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error>;
}

impl<const D: usize, R: Reducer<D> + ?Sized> Reducer<D> for &R {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        (**self).reduce(estimate)
    }
}

impl<const D: usize, R: Reducer<D> + ?Sized> Reducer<D> for Box<R> {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        (**self).reduce(estimate)
    }
}

/// The whole estimate, one component per particle: what an unlimited link would carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole;

impl<const D: usize> Reducer<D> for Whole {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        Ok(Handover {
            mixture: estimate.to_mixture()?,
            bits: None,
        })
    }
}

/// At most so many components, as real numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Components {
    /// The most components.
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
        Ok(Handover {
            mixture: self.reduction.reduce(estimate, self.components)?,
            bits: None,
        })
    }
}

/// At most so many components, coded at one resolution of a wire format.
#[derive(Debug, Clone, PartialEq)]
pub struct Coded<const D: usize> {
    /// The most components.
    pub components: usize,
    /// How the estimate is reduced.
    pub reduction: Reduction,
    /// What both ends know beforehand.
    pub format: WireFormat<D>,
    /// Number of the resolution in the format.
    pub resolution: usize,
}

impl<const D: usize> Reducer<D> for Coded<D> {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        let mixture = self.reduction.reduce(estimate, self.components)?;
        let message = CodedMixture::new(&mixture, &self.format, self.resolution)?;
        let bits = message
            .to_bits(&self.format)
            .map_err(fewbits_densities::Error::from)?
            .bits();
        Ok(Handover {
            mixture: message.into_mixture(),
            bits: Some(bits),
        })
    }
}

/// The best of several sizes and resolutions within a budget of bits.
#[derive(Debug, Clone, PartialEq)]
pub struct RateLimited<const D: usize> {
    /// The choices.
    pub control: RateControl,
    /// What both ends know beforehand.
    pub format: WireFormat<D>,
    /// The most bits of a message.
    pub budget: usize,
}

impl<const D: usize> Reducer<D> for RateLimited<D> {
    fn reduce(&self, estimate: &KernelEstimate<D>) -> Result<Handover<D>, Error> {
        let rated = self.control.fit(estimate, &self.format, self.budget)?;
        Ok(Handover {
            bits: Some(rated.bits),
            mixture: rated.message.into_mixture(),
        })
    }
}
