//! Rate control: the best mixture within a given number of bits.

use super::{CodedMixture, WireFormat};
use crate::plug_in::{Cubature, CubatureTarget};
use crate::{Error, Reduction};
use fewbits_core::Message;
use fewbits_densities::KernelEstimate;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::at_least_one;
use serde::{Deserialize, Serialize};

/// Searches over numbers of components and resolutions for the smallest KL within a number of bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RateControl {
    /// Numbers of components to try.
    pub components: Vec<usize>,
    /// How estimates are reduced.
    pub reduction: Reduction,
    /// The points at which the KL is estimated.
    pub cubature: Cubature,
}

impl Default for RateControl {
    /// 1, 2, 3, 5, 8, 10 and 16 components, the recommended reduction, Gauss-Hermite points.
    fn default() -> Self {
        Self {
            components: vec![1, 2, 3, 5, 8, 10, 16],
            reduction: Reduction::default(),
            cubature: Cubature::GaussHermite,
        }
    }
}

/// A message with its length and its error.
#[derive(Debug, Clone, PartialEq)]
pub struct Rated<const D: usize> {
    /// The message.
    pub message: CodedMixture<D>,
    /// Length in bits.
    pub bits: usize,
    /// Cubature estimate of `KL[estimate, decoded mixture]` in nats.
    pub kl: f64,
}

impl RateControl {
    /// A message for every combination of number of components and resolution, with its length and error.
    ///
    /// # Errors
    /// If there is no number of components, one is 0 or above 63, or the estimate does not fit the format.
    pub fn table<const D: usize>(
        &self,
        estimate: &KernelEstimate<D>,
        format: &WireFormat<D>,
    ) -> Result<Vec<Rated<D>>, Error> {
        at_least_one("components", self.components.len())?;
        let target = CubatureTarget::new(estimate, self.cubature);
        let mut rated = Vec::new();
        for components in &self.components {
            let mixture = self.reduction.reduce(estimate, *components)?;
            for resolution in 0..format.resolutions().len() {
                let message = CodedMixture::new(&mixture, format, resolution)?;
                let bits = message.to_bits(format)?.bits();
                let kl = target.plug_in(message.mixture()).kl_plugin;
                rated.push(Rated { message, bits, kl });
            }
        }
        Ok(rated)
    }

    /// The message of smallest KL among those of at most `budget` bits.
    ///
    /// # Errors
    /// As [`table`](Self::table), or if no message is within the budget.
    pub fn fit<const D: usize>(
        &self,
        estimate: &KernelEstimate<D>,
        format: &WireFormat<D>,
        budget: usize,
    ) -> Result<Rated<D>, Error> {
        let table = self.table(estimate, format)?;
        let shortest = table.iter().map(|r| r.bits).min().unwrap_or(0);
        let within = table.into_iter().filter(|r| r.bits <= budget);
        within
            .min_by(|a, b| a.kl.total_cmp(&b.kl).then(a.bits.cmp(&b.bits)))
            .ok_or_else(|| {
                ArgumentError::new("budget", format!("{budget} bits"), format!("at least {shortest} bits")).into()
            })
    }
}
