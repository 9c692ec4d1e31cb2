//! Reports that arrive late.

use super::gate::{Fate, Verdict};
use super::one_wrong::OneIsWrong;
use super::reading::{Content, Reading};
use super::receive::is_of_reports;
use super::state::{Checkpoint, StoredSlot};
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{Belief, Gaussian, Likelihood, Observation, ScaledNoise};
use fewbits_numerics::error::finite;
use rand::Rng;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Includes observations of an earlier `time`: restores the belief before that time and repeats all later updates. Returns
    /// whether it did. Reports older than the window are dropped and counted, and so are copies of reports that were received before. A
    /// report that is impossible, or too unlikely given the prediction to its time, is not used. Presence and health are not updated again.
    ///
    /// # Errors
    /// As [`receive`](Self::receive). The centre is then unchanged.
    pub fn late(&mut self, rng: &mut dyn Rng, time: f64, slots: &[Slot]) -> Result<bool, Error> {
        finite("time", time)?;
        let Some(from) = self.history.iter().rposition(|checkpoint| checkpoint.time <= time) else {
            self.dropped += slots.len() as u64;
            return Ok(false);
        };
        let (readings, copied) = self.read(slots, time)?;
        let is_copy = |reading: &Reading<'_, D>| {
            let same_time = self.history[from..].iter().filter(|checkpoint| checkpoint.time == time);
            let mut stored = same_time.flat_map(|checkpoint| &checkpoint.slots);
            reading.content != Content::Nothing && stored.any(|one| one.is_copied_by(reading.slot))
        };
        let (copies, readings): (Vec<_>, Vec<_>) = readings.into_iter().partition(is_copy);
        let copied: Vec<usize> = copied.into_iter().chain(copies.iter().map(|one| one.seat)).collect();
        if readings.is_empty() {
            copied.iter().for_each(|seat| self.members[*seat].state.copies += 1);
            return Ok(false);
        }
        // Insert the late slots among the stored instants, in the order of time.
        let mut replayed = self.history[from..].to_vec();
        let at = replayed.partition_point(|checkpoint| checkpoint.time <= time);
        let late = Checkpoint {
            time,
            belief: replayed[0].belief.clone(),
            slots: Vec::new(),
        };
        replayed.insert(at, late);
        // Repeat prediction and update at each of these instants.
        let (mut belief, mut now) = (replayed[0].belief.clone(), replayed[0].time);
        let mut rejected = Vec::new();
        for (k, checkpoint) in replayed.iter_mut().enumerate() {
            self.moved(rng, &mut belief, checkpoint.time - now)?;
            now = checkpoint.time;
            checkpoint.belief = belief.clone();
            if k == at {
                let moments = Gaussian::from_trusted_parts(belief.mean(), belief.covariance());
                let law = self.law(&belief, &moments);
                let verdicts = self.gate(&law, &moments, &readings);
                let judged = readings.iter().zip(&verdicts);
                checkpoint.slots = judged
                    .clone()
                    .map(|(reading, verdict)| self.stored(reading, verdict))
                    .collect();
                rejected.extend(
                    judged
                        .filter(|(_, one)| one.fate == Fate::Rejected)
                        .map(|(reading, _)| reading.seat),
                );
            }
            self.replay(rng, &mut belief, &mut checkpoint.slots)?;
        }
        self.moved(rng, &mut belief, self.now - now)?;
        self.history.truncate(from);
        self.history.extend(replayed);
        self.belief = belief;
        let unreadable = readings.iter().filter(|reading| reading.is_unreadable());
        unreadable.for_each(|reading| self.members[reading.seat].state.unreadable += 1);
        copied.iter().for_each(|seat| self.members[*seat].state.copies += 1);
        rejected.iter().for_each(|seat| self.members[*seat].state.rejected += 1);
        Ok(true)
    }

    /// Updates a belief with the stored slots of one instant that were used. If they are impossible now, none of their reports is used.
    pub(super) fn replay(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut F::Belief,
        slots: &mut [StoredSlot],
    ) -> Result<(), Error> {
        let plain: Vec<Slot> = slots.iter().map(StoredSlot::slot).collect();
        let mut contested = Vec::new();
        let (mut reports, mut silent) = (Vec::new(), Vec::new());
        for (slot, plain) in slots.iter().zip(&plain) {
            // A sensor may have left in the meantime.
            let Ok(seat) = self.seated(slot.sensor, 0) else {
                continue;
            };
            match (slot.log_wrong, plain.observation == Observation::Nothing) {
                (None, _) if !slot.used => {}
                (Some(log_wrong), _) => {
                    contested.push((self.members[seat].sensor.likelihood(plain, slot.working)?, log_wrong));
                }
                (None, true) => silent.push((seat, plain, slot.working)),
                (None, false) => reports.push((seat, plain, slot.working)),
            }
        }
        let (reports, mut missing) = (self.all_of(&reports)?, self.all_of(&silent)?);
        missing.retain(|one| one.as_constant() != Some(f64::NEG_INFINITY));
        let parts: Vec<_> = contested.iter().map(|(one, log_wrong)| (&**one, *log_wrong)).collect();
        let wrong = (!parts.is_empty()).then(|| OneIsWrong::new(parts));
        let wrong = wrong.iter().map(|one| one as &dyn Likelihood<D>);
        let missing = || missing.iter().map(|one| &**one);
        let all: Vec<&dyn Likelihood<D>> = reports.iter().map(|one| &**one).chain(wrong).chain(missing()).collect();
        match self.filter.update(rng, belief, &all) {
            Err(error) if is_of_reports(&error) => {
                slots.iter_mut().for_each(StoredSlot::drop_report);
                self.filter.update(rng, belief, &missing().collect::<Vec<_>>())?;
            }
            other => drop(other?),
        }
        Ok(())
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

    pub(super) fn stored(&self, reading: &Reading<'_, D>, verdict: &Verdict) -> StoredSlot {
        let (_, _, working) = self.input_of(reading);
        let log_wrong = match verdict.fate {
            Fate::Contested(log_wrong) => Some(log_wrong),
            _ => None,
        };
        StoredSlot::new(reading.slot, working, verdict.fate == Fate::Used, log_wrong)
    }

    /// Stores the belief before an instant and its slots, and drops those older than the window.
    pub(super) fn remember(&mut self, before: F::Belief, slots: Vec<StoredSlot>) {
        self.history.push(Checkpoint {
            time: self.now,
            belief: before,
            slots,
        });
        // The last belief before the window is kept, for reports from the beginning of the window.
        let oldest = self.now - self.window;
        let first = self.history.partition_point(|checkpoint| checkpoint.time < oldest);
        self.history.drain(..first.saturating_sub(1));
    }
}
