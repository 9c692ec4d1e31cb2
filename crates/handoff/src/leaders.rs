//! A walk of leaders that hand over their belief as bits.

use crate::{Coded, HandoffFilter};
use fewbits_core::rand::Rng;
use fewbits_core::{Belief, BitString, Dynamics, Likelihood, Message};
use fewbits_densities::Mixture;
use fewbits_mixture_codec::wire::CodedMixture;
use fewbits_protocol::{BoxError, Lead, Leader};

/// A [`HandoffFilter`] whose belief is sent as the bits of its wire format.
///
/// The readings of a slot are given for every node that may lead in it. The sequence of leaders is fixed beforehand.
#[derive(Debug, Clone)]
pub struct Leaders<const D: usize, G, L> {
    /// The filter, with its wire format.
    pub filter: HandoffFilter<Coded<D>>,
    /// Dynamics of the state.
    pub dynamics: G,
    /// Belief before the first slot.
    pub start: Mixture<D>,
    /// `readings[k][i]`: the likelihood of node `i`'s measurement in slot `k + 1`.
    pub readings: Vec<Vec<L>>,
    /// `leaders[k]`: the node that leads in slot `k + 1`. The walk ends with the list.
    pub leaders: Vec<u32>,
}

impl<const D: usize, G: Dynamics<D>, L: Likelihood<D>> Leader for Leaders<D, G, L> {
    fn lead(&self, rng: &mut dyn Rng, slot: u64, node: u32, message: Option<&BitString>) -> Result<Lead, BoxError> {
        let coded = &self.filter.reducer;
        let received = match message {
            Some(bits) => CodedMixture::from_bits(&coded.format, bits)?.into_mixture(),
            None => self.start.clone(),
        };
        let at = usize::try_from(slot.saturating_sub(1))?;
        let reading = self.readings.get(at).and_then(|slot| slot.get(node as usize));
        let reading = reading.ok_or_else(|| format!("node {node} has no reading in slot {slot}"))?;
        let (handover, _) = self.filter.step(rng, &received, &self.dynamics, reading)?;
        Ok(Lead {
            estimate: handover.mixture().mean().as_slice().to_vec(),
            message: handover.message().cloned().ok_or("a coded belief has bits")?,
            next: self.leaders.get(at + 1).copied(),
        })
    }
}
