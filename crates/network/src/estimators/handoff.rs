//! Leaders that follow a target by a coded mixture.

use crate::error::Error;
use crate::protocols::{Lead, Walker};
use crate::units::SensorId;
use fewbits_core::{BitString, Dynamics, Likelihood, Message};
use fewbits_densities::Mixture;
use fewbits_handoff::{Coded, HandoffFilter};
use fewbits_mixture_codec::wire::CodedMixture;
use rand_pcg::Pcg64Dxsm;

/// A [`HandoffFilter`] whose belief crosses the network as the bits of its wire format.
///
/// The readings of a slot are given for every node that may lead in it; who leads when is known beforehand.
#[derive(Debug, Clone)]
pub struct Leaders<const D: usize, G, L> {
    /// The filter, with its wire format.
    pub filter: HandoffFilter<Coded<D>>,
    /// How the world moves.
    pub dynamics: G,
    /// What is known before the first slot.
    pub start: Mixture<D>,
    /// `readings[k][i]`: what node `i` reads in slot `k + 1`, as a likelihood.
    pub readings: Vec<Vec<L>>,
    /// Who leads in slot `k + 1`; the walk ends with the list.
    pub leaders: Vec<SensorId>,
}

impl<const D: usize, G: Dynamics<D>, L: Likelihood<D>> Walker for Leaders<D, G, L> {
    fn lead(&self, rng: &mut Pcg64Dxsm, slot: u32, node: SensorId, message: Option<&BitString>) -> Result<Lead, Error> {
        let coded = &self.filter.reducer;
        let received = match message {
            Some(bits) => CodedMixture::from_bits(&coded.format, bits)?.into_mixture(),
            None => self.start.clone(),
        };
        let at = (slot as usize).saturating_sub(1);
        let reading = self.readings.get(at).and_then(|slot| slot.get(node.index()));
        let reading = reading.ok_or(Error::NoReading { node, slot })?;
        let (particles, _) = self
            .filter
            .posterior(rng, &received, &self.dynamics, reading)
            .map_err(of)?;
        let estimate = self.filter.estimate(&particles).map_err(of)?;
        let mixture = coded
            .reduction
            .reduce(&estimate, coded.components)
            .map_err(|error| Error::estimator("handoff", error))?;
        let message = CodedMixture::new(&mixture, &coded.format, coded.resolution)
            .map_err(|error| Error::estimator("handoff", error))?;
        Ok(Lead {
            estimate: message.mixture().mean().as_slice().to_vec(),
            message: message.to_bits(&coded.format)?,
            next: self.leaders.get(at + 1).copied(),
        })
    }
}

fn of(error: fewbits_handoff::Error) -> Error {
    match error {
        fewbits_handoff::Error::Density(fewbits_densities::Error::Core(error)) => error.into(),
        other => Error::estimator("handoff", other),
    }
}
