//! The belief that is right if a rejected report is, and the prediction is not: the level has jumped.
//!
//! ```text
//! begins with a report that is rejected, or of a sensor whose test raises an alarm, from a prediction wide enough for it;
//!     is predicted and updated as the belief is
//! votes = sum over reports of the other sensors from then on:  ln p(report | rival) - ln p(report | belief)
//! votes >= ln 100:  the belief is replaced by the rival
//! votes <= -3:      the sensor with which it began may be excluded
//! ends when a report of that sensor agrees with the belief, or the sensor is excluded or dead
//! ```
//! Each probability is measured from that of the likeliest report. A sensor that is much less accurate than the prediction says little,
//! whatever it reports.

use super::FusionCentre;
use super::gate::{FITS, Fate, Verdict, widened};
use super::reading::{Content, Reading, conditioned};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_numerics::error::{finite, refuse};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Votes at which the rival is believed: one wrong sensor in 100 is.
const DECISIVE: f64 = 4.6;
/// Votes at which the sensor with which it began may be excluded: one right sensor in 20 has as few at some instant.
const AGAINST: f64 = -3.0;
/// Most votes of one report.
const MAX_VOTES: f64 = 2.0 * DECISIVE;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rival<const D: usize> {
    /// Number of the sensor with whose report it began.
    sensor: u32,
    belief: Gaussian<D>,
    votes: f64,
}

impl<const D: usize> Rival<D> {
    pub(crate) fn is_believed(&self) -> bool {
        self.votes >= DECISIVE
    }

    pub(crate) fn moved(self, dynamics: &dyn GaussianDynamics<D>, noise_scale: f64) -> Option<Self> {
        let belief = dynamics.predict(&self.belief, noise_scale);
        belief.is_finite().then_some(Self { belief, ..self })
    }

    /// Whether the others have spoken against the sensor with which it began; `None` if it began with another.
    pub(crate) fn is_against(&self, sensor: u32) -> Option<bool> {
        (self.sensor == sensor).then_some(self.votes <= AGAINST)
    }
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// The rival after the reports of this instant, and the belief from which it is updated by them.
    pub(super) fn rival(
        &self,
        predicted: &Gaussian<D>,
        readings: &[Reading<'_, D>],
        verdicts: &[Verdict],
    ) -> Option<(Rival<D>, Gaussian<D>)> {
        let is_suspect = |(reading, fate): &(&Reading<'_, D>, Fate)| {
            let monitor = &self.members[reading.seat].state.monitor;
            *fate == Fate::Rejected || monitor.contradiction(&self.limits.sensor) >= 1.0
        };
        let all = readings.iter().zip(verdicts.iter().map(|verdict| verdict.fate));
        if self.rival.is_none() && !all.clone().any(|one| is_suspect(&one)) {
            return None;
        }
        let judged: Vec<(&Reading<'_, D>, Fate)> = all
            .filter(|(reading, fate)| {
                reading.content == Content::Report && reading.likelihood.is_some() && *fate != Fate::Excluded
            })
            .collect();
        let number = |reading: &Reading<'_, D>| self.members[reading.seat].number;
        let test = |reading: &Reading<'_, D>, given: &Gaussian<D>| self.members[reading.seat].test(reading, given);
        let is_open = |rival: &&Rival<D>| {
            let state = self.member(rival.sensor).ok().map(|member| member.state);
            let mut own = judged.iter().filter(|(reading, _)| number(reading) == rival.sensor);
            state.is_some_and(|state| !state.is_ignored() && !state.presence.named_dead) && own.all(is_suspect)
        };
        let last = self.rival.as_ref().filter(is_open);
        let own = |rival: &Rival<D>| judged.iter().find(|(reading, _)| number(reading) == rival.sensor);
        let (sensor, before, votes) = match last {
            // Reports of the sensor may contradict the rival too.
            Some(rival) if own(rival).is_none_or(|(own, _)| test(own, &rival.belief).tail() > FITS) => {
                (rival.sensor, rival.belief, rival.votes)
            }
            _ => {
                let farthest = judged
                    .iter()
                    .filter(|one| is_suspect(one))
                    .max_by(|(one, _), (other, _)| {
                        test(one, predicted).depth().total_cmp(&test(other, predicted).depth())
                    });
                let reading = last.and_then(own).or(farthest)?.0;
                let votes = last.map_or(0.0, |last| last.votes.min(0.0));
                (number(reading), widened(predicted).find(|wide| test(reading, wide).tail() > FITS)?, votes)
            }
        };
        let of_own: Vec<_> = judged
            .iter()
            .map(|(reading, _)| *reading)
            .filter(|one| number(one) == sensor)
            .collect();
        let right = conditioned(&before, &of_own);
        let others = judged
            .iter()
            .map(|(reading, _)| *reading)
            .filter(|one| number(one) != sensor);
        let vote = |one: &Reading<'_, D>| test(one, predicted).depth() - test(one, &right).depth();
        let votes = votes
            + others
                .clone()
                .map(vote)
                .filter(|vote| !vote.is_nan())
                .map(|vote| vote.clamp(-MAX_VOTES, MAX_VOTES))
                .sum::<f64>();
        let agreeing: Vec<_> = others.filter(|one| test(one, &right).tail() > FITS).collect();
        let rival = Rival {
            sensor,
            belief: conditioned(&right, &agreeing),
            // What was said against it long ago must not outweigh what is said after a jump.
            votes: votes.max(-DECISIVE),
        };
        rival.belief.is_finite().then_some((rival, before))
    }
}

/// A rival as it is stored: the covariance column by column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredRival {
    sensor: u32,
    votes: f64,
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

impl<const D: usize> From<&Rival<D>> for StoredRival {
    fn from(rival: &Rival<D>) -> Self {
        Self {
            sensor: rival.sensor,
            votes: rival.votes,
            mean: rival.belief.mean().as_slice().to_vec(),
            covariance: rival.belief.covariance().as_slice().to_vec(),
        }
    }
}

impl StoredRival {
    pub(crate) fn read<const D: usize>(&self) -> Result<Rival<D>, Error> {
        if (self.mean.len(), self.covariance.len()) != (D, D * D) {
            return refuse("rival", format!("{} coordinates", self.mean.len()), format!("{D}"));
        }
        let mean = SVector::from_column_slice(&self.mean);
        let covariance = SMatrix::from_column_slice(&self.covariance);
        Ok(Rival {
            sensor: self.sensor,
            belief: Gaussian::new(mean, covariance)?,
            votes: finite("votes", self.votes)?,
        })
    }
}
