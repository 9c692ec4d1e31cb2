//! Reports that come late.

use super::state::{Checkpoint, StoredSlot};
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::{Move, StateFilter, StateLikelihood};
use fewbits_numerics::error::finite;
use rand::Rng;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Takes in what was observed at an earlier `time`: the belief goes back to it, and all that came since is taken in again. Returns
    /// whether it did; reports older than the window are dropped and counted. Presence and health are not judged again.
    ///
    /// # Errors
    /// As [`receive`](Self::receive).
    pub fn late(&mut self, rng: &mut dyn Rng, time: f64, slots: &[Slot]) -> Result<bool, Error> {
        finite("time", time)?;
        let Some(from) = self.history.iter().rposition(|checkpoint| checkpoint.time <= time) else {
            self.dropped += slots.len() as u64;
            return Ok(false);
        };
        let mut replayed = self.history[from..].to_vec();
        let stored: Vec<StoredSlot> = slots.iter().map(|slot| self.stored(slot)).collect::<Result<_, _>>()?;
        let at = replayed.partition_point(|checkpoint| checkpoint.time <= time);
        let late = Checkpoint {
            time,
            belief: replayed[0].belief.clone(),
            slots: stored,
        };
        replayed.insert(at, late);
        let (mut belief, mut now) = (replayed[0].belief.clone(), replayed[0].time);
        for checkpoint in &mut replayed {
            self.moved(rng, &mut belief, checkpoint.time - now)?;
            now = checkpoint.time;
            checkpoint.belief = belief.clone();
            let mut likelihoods: Vec<Box<dyn StateLikelihood<D>>> = Vec::new();
            for slot in checkpoint.slots.iter().filter(|slot| slot.used) {
                // A sensor may have left since.
                if let Ok(member) = self.member(slot.sensor) {
                    likelihoods.push(member.sensor.likelihood(&slot.slot(), slot.working)?);
                }
            }
            let likelihoods: Vec<&dyn StateLikelihood<D>> = likelihoods.iter().map(|one| &**one).collect();
            self.filter.update(rng, &mut belief, &likelihoods)?;
        }
        self.moved(rng, &mut belief, self.now - now)?;
        self.history.truncate(from);
        self.history.extend(replayed);
        self.belief = belief;
        Ok(true)
    }

    /// Moves a belief over some time.
    pub(super) fn moved(&mut self, rng: &mut dyn Rng, belief: &mut F::Belief, seconds: f64) -> Result<(), Error> {
        if seconds > 0.0 {
            let motion = self.world.over(seconds)?;
            self.filter
                .predict(rng, Move::new(&*motion, self.noise_scale), belief)?;
        }
        Ok(())
    }

    fn stored(&self, slot: &Slot) -> Result<StoredSlot, Error> {
        let state = &self.member(slot.sensor)?.state;
        Ok(StoredSlot::new(slot, state.presence.working, !state.excluded))
    }

    /// Keeps the belief before an instant and its slots, as long as the window lasts.
    pub(super) fn remember(&mut self, before: F::Belief, slots: &[Slot]) {
        let stored = slots.iter().filter_map(|slot| self.stored(slot).ok()).collect();
        self.history.push(Checkpoint {
            time: self.now,
            belief: before,
            slots: stored,
        });
        // The last belief before the window is what a report from its beginning goes back to.
        let oldest = self.now - self.window;
        let first = self.history.partition_point(|checkpoint| checkpoint.time < oldest);
        self.history.drain(..first.saturating_sub(1));
    }
}
