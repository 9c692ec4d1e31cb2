//! Returning of a centre to a state before, and revising of what it made of the last instants.

use crate::error::Failure;
use crate::level::centre::Centre;
use crate::level::estimator::{Estimator, LevelRow, Revision};
use crate::level::remote::remote;
use crate::level::saved::{Mark, Saved};
use fewbits_filters::StateFilter;

impl<const D: usize, F: StateFilter<D>> Centre<D, F> {
    /// The present state.
    pub(super) fn saved(&self) -> Saved<F::Belief> {
        Saved {
            mark: Mark {
                instants: self.instants,
                state: self.centre.state(),
                last: self.members.iter().map(|member| member.last).collect(),
                pending: self.pending,
            },
            error: self.error.clone(),
            rng: self.rng.clone(),
            dropped: None,
        }
    }

    /// Returns to a state of the same sensors.
    pub(super) fn return_to(&mut self, mut saved: Saved<F::Belief>) {
        self.marks.iter_mut().for_each(|marks| marks.undo(&mut saved));
        (self.error, self.rng) = (saved.error, saved.rng);
        self.restore(saved.mark);
    }

    /// Returns to a marked state. Whether it is one of the present sensors.
    pub(super) fn restore(&mut self, mark: Mark<F::Belief>) -> bool {
        if self.centre.restore(mark.state).is_err() {
            return false;
        }
        self.members
            .iter_mut()
            .zip(mark.last)
            .for_each(|(member, last)| member.last = last);
        (self.instants, self.pending) = (mark.instants, mark.pending);
        if let Some(kept) = &mut self.kept {
            kept.truncate(mark.instants);
            self.wider.truncate(mark.instants);
        }
        true
    }

    /// Revises the last instants, or changes nothing.
    pub(super) fn revised(&mut self, revision: &Revision<'_>) -> Result<Option<LevelRow>, Failure> {
        let (saved, before) = (self.saved(), self.before.take());
        let kept = (self.kept.clone(), self.wider.clone(), self.marks.clone());
        let known = |(sensor, _): &(usize, f64)| (*sensor, self.members[*sensor].seat.noise);
        let noises: Vec<(usize, f64)> = revision.noises.iter().map(known).collect();
        let found = self.revise_from(revision);
        if found.is_err() {
            // These noises were valid before.
            let _ = self.set_noises(&noises);
            self.return_to(saved);
            (self.kept, self.wider, self.marks) = kept;
            self.before = before;
        }
        found
    }

    fn revise_from(&mut self, revision: &Revision<'_>) -> Result<Option<LevelRow>, Failure> {
        self.set_noises(&revision.noises)?;
        let count = self.back(revision.instants).unwrap_or(0);
        if let Some(scale) = revision.scale {
            self.centre.set_noise_scale(scale)?;
        }
        let mut row = None;
        for instant in revision.last.iter().skip(revision.last.len().saturating_sub(count)) {
            row = Some(self.step(instant)?);
        }
        Ok(row)
    }

    fn set_noises(&mut self, noises: &[(usize, f64)]) -> Result<(), Failure> {
        for (sensor, noise) in noises {
            let member = &mut self.members[*sensor];
            member.seat.noise = *noise;
            member.node = member.seat.sends.node(noise * noise)?;
            self.centre.join_boxed(*sensor as u32, remote(&member.seat)?)?;
        }
        Ok(())
    }

    /// Returns to a state that is at least so many instants back, as far as they are kept: the number of instants since then.
    fn back(&mut self, instants: usize) -> Option<usize> {
        let now = self.instants;
        let mark = self.marks.as_mut()?.take(now, instants)?;
        let instants = mark.instants;
        self.restore(mark).then(|| now - instants)
    }
}
