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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use crate::level::centre::centre;
    use crate::level::estimator::{Estimator, Revision, Use};
    use crate::level::options::{LevelOptions, PerSensor};
    use crate::level::settings::Settings;
    use crate::rows::Instants;
    use crate::rows::instant::Instant;

    fn row(k: usize) -> Instant {
        let value = 20.0 + (1.7 * k as f64).sin();
        Instant::new(k as u64 + 1, k as f64, &[Some(value), (k % 5 != 2).then_some(value + 0.1)])
    }

    /// The rows so far through a centre that can return.
    fn centre_of(rows: &[Instant]) -> Box<dyn Estimator> {
        let options = LevelOptions {
            noise: PerSensor::all(Some(0.5)),
            change: Some((0.1, 1.0)),
            prior: Some((20.0, 3.0)),
            smooth: true,
            ..LevelOptions::default()
        };
        let mut instants = Instants::listed(["a", "b"], rows.to_vec());
        let mut settings = Settings::find(&options, &mut instants).unwrap();
        settings.world.is_followed = true;
        let mut found = centre(&settings.world, Use::Measurements).unwrap();
        for (sensor, name) in ["a", "b"].iter().enumerate() {
            found.join(settings.seat(sensor, name)).unwrap();
        }
        rows.iter().for_each(|row| _ = found.step(row).unwrap());
        found
    }

    #[test]
    fn a_revision_that_fails_changes_nothing() {
        let rows: Vec<Instant> = (0..100).map(row).collect();
        let longer: Vec<Instant> = (0..140).map(row).collect();
        let mut swapped = rows.clone();
        swapped.swap(97, 98);
        let revision = |noise: f64, scale: f64, last| Revision {
            noises: vec![(1, noise)],
            scale: Some(scale),
            instants: 30,
            last,
        };
        // A noise, a change and rows that are none.
        for (noise, scale, last) in [(f64::NAN, 2.0, &rows), (0.8, -1.0, &rows), (0.8, 2.0, &swapped)] {
            let (mut revised, mut other) = (centre_of(&rows), centre_of(&rows));
            assert!(revised.revise(&revision(noise, scale, last)).is_err());
            // Also the way back from the last row.
            revised.undo();
            other.undo();
            for k in 99..140 {
                assert_eq!(revised.step(&row(k)).unwrap(), other.step(&row(k)).unwrap(), "row {k}");
            }
            let again = revision(0.8, 2.0, &longer);
            assert_eq!(revised.smoothed(None).unwrap(), other.smoothed(None).unwrap());
            assert_eq!(revised.revise(&again).unwrap(), other.revise(&again).unwrap());
        }
    }
}
