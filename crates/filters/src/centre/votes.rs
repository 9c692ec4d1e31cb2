//! The votes for and against a [`Rival`].

use super::FusionCentre;
use super::gate::{FITS, Fate, Verdict, widened};
use super::reading::{Content, Reading, conditioned};
use super::rival::{DECISIVE, Rival};
use crate::contract::StateFilter;
use fewbits_core::Gaussian;

/// Most votes of one report.
const MAX_VOTES: f64 = 2.0 * DECISIVE;

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
