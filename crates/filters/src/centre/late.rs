//! Reports that arrive late.

use super::state::{Checkpoint, StoredSlot};
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{Likelihood, ScaledNoise};
use fewbits_numerics::error::finite;
use rand::Rng;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Includes observations of an earlier `time`: restores the belief before that time and repeats all later updates. Returns
    /// whether it did. Reports older than the window are dropped and counted. Presence and health are not updated again.
    ///
    /// # Errors
    /// As [`receive`](Self::receive).
    pub fn late(&mut self, rng: &mut dyn Rng, time: f64, slots: &[Slot]) -> Result<bool, Error> {
        finite("time", time)?;
        let Some(from) = self.history.iter().rposition(|checkpoint| checkpoint.time <= time) else {
            self.dropped += slots.len() as u64;
            return Ok(false);
        };
        // Insert the late slots among the stored instants, in the order of time.
        let mut replayed = self.history[from..].to_vec();
        let stored: Vec<StoredSlot> = slots.iter().map(|slot| self.stored(slot)).collect::<Result<_, _>>()?;
        let at = replayed.partition_point(|checkpoint| checkpoint.time <= time);
        let late = Checkpoint {
            time,
            belief: replayed[0].belief.clone(),
            slots: stored,
        };
        replayed.insert(at, late);
        // Repeat prediction and update at each of these instants.
        let (mut belief, mut now) = (replayed[0].belief.clone(), replayed[0].time);
        for checkpoint in &mut replayed {
            self.moved(rng, &mut belief, checkpoint.time - now)?;
            now = checkpoint.time;
            checkpoint.belief = belief.clone();
            let mut likelihoods: Vec<Box<dyn Likelihood<D>>> = Vec::new();
            for slot in checkpoint.slots.iter().filter(|slot| slot.used) {
                // A sensor may have left in the meantime.
                if let Ok(member) = self.member(slot.sensor) {
                    likelihoods.push(member.sensor.likelihood(&slot.slot(), slot.working)?);
                }
            }
            let likelihoods: Vec<&dyn Likelihood<D>> = likelihoods.iter().map(|one| &**one).collect();
            self.filter.update(rng, &mut belief, &likelihoods)?;
        }
        self.moved(rng, &mut belief, self.now - now)?;
        self.history.truncate(from);
        self.history.extend(replayed);
        self.belief = belief;
        Ok(true)
    }

    /// Predicts a belief over `seconds`.
    pub(super) fn moved(&mut self, rng: &mut dyn Rng, belief: &mut F::Belief, seconds: f64) -> Result<(), Error> {
        if seconds > 0.0 {
            let dynamics = self.world.over(seconds)?;
            self.filter
                .predict(rng, &ScaledNoise::new(&*dynamics, self.noise_scale), belief)?;
        }
        Ok(())
    }

    fn stored(&self, slot: &Slot) -> Result<StoredSlot, Error> {
        let state = &self.member(slot.sensor)?.state;
        Ok(StoredSlot::new(slot, state.presence.working, !state.excluded))
    }

    /// Stores the belief before an instant and its slots, and drops those older than the window.
    pub(super) fn remember(&mut self, before: F::Belief, slots: &[Slot]) {
        let stored = slots.iter().filter_map(|slot| self.stored(slot).ok()).collect();
        self.history.push(Checkpoint {
            time: self.now,
            belief: before,
            slots: stored,
        });
        // The last belief before the window is kept, for reports from the beginning of the window.
        let oldest = self.now - self.window;
        let first = self.history.partition_point(|checkpoint| checkpoint.time < oldest);
        self.history.drain(..first.saturating_sub(1));
    }
}
