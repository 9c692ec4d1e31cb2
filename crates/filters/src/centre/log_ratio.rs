//! What the reports of an instant say for and against an [`Alternative`].

use super::FusionCentre;
use super::alternative::{Alternative, DECISIVE};
use super::gate::{FITS, Fate, INSTANTS_ASTRAY, Verdict, widened};
use super::reading::{Content, Reading, conditioned};
use crate::contract::StateFilter;
use fewbits_core::Gaussian;

/// So many rejected reports in a row, all near the alternative, are no spikes.
const HELD: u32 = 3 * INSTANTS_ASTRAY;
/// Log ratio, in nats, above which they are then believed.
const LIKELIER: f64 = 1.0;
/// Largest part of one report, in nats.
const MAX_PART: f64 = 2.0 * DECISIVE;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Whether the sensor of an alternative has held to it for long, and the others are for it as far as they can tell: those that are much less
    /// accurate say little, and each of its reports would be rejected until they decide.
    pub(super) fn is_held(&self, alternative: &Alternative<D>) -> bool {
        let astray = self.member(alternative.sensor).map_or(0, |member| member.state.astray);
        alternative.log_ratio > LIKELIER && astray + 1 >= HELD
    }

    /// The alternative hypothesis after the reports of this instant, and the belief from which it is updated by them.
    pub(super) fn alternative(
        &self,
        predicted: &Gaussian<D>,
        readings: &[Reading<'_, D>],
        verdicts: &[Verdict],
    ) -> Option<(Alternative<D>, Gaussian<D>)> {
        let is_suspect = |(reading, fate): &(&Reading<'_, D>, Fate)| {
            let monitor = &self.members[reading.seat].state.monitor;
            *fate == Fate::Rejected || monitor.contradiction(&self.limits.sensor) >= 1.0
        };
        let all = readings.iter().zip(verdicts.iter().map(|verdict| verdict.fate));
        if self.alternative.is_none() && !all.clone().any(|one| is_suspect(&one)) {
            return None;
        }
        let judged: Vec<(&Reading<'_, D>, Fate)> = all
            .filter(|(reading, fate)| {
                reading.content == Content::Report && reading.likelihood.is_some() && *fate != Fate::Excluded
            })
            .collect();
        let number = |reading: &Reading<'_, D>| self.members[reading.seat].number;
        let test = |reading: &Reading<'_, D>, given: &Gaussian<D>| self.members[reading.seat].test(reading, given);
        let is_open = |alternative: &&Alternative<D>| {
            let state = self.member(alternative.sensor).ok().map(|member| member.state);
            let mut own = judged
                .iter()
                .filter(|(reading, _)| number(reading) == alternative.sensor);
            state.is_some_and(|state| !state.is_ignored() && !state.presence.named_dead) && own.all(is_suspect)
        };
        let last = self.alternative.as_ref().filter(is_open);
        let own =
            |alternative: &Alternative<D>| judged.iter().find(|(reading, _)| number(reading) == alternative.sensor);
        let (sensor, before, log_ratio) = match last {
            // Reports of the sensor may contradict the alternative too.
            Some(alternative)
                if own(alternative).is_none_or(|(own, _)| test(own, &alternative.belief).tail() > FITS) =>
            {
                (alternative.sensor, alternative.belief, alternative.log_ratio)
            }
            _ => {
                let farthest = judged
                    .iter()
                    .filter(|one| is_suspect(one))
                    .max_by(|(one, _), (other, _)| {
                        test(one, predicted).depth().total_cmp(&test(other, predicted).depth())
                    });
                let reading = last.and_then(own).or(farthest)?.0;
                let log_ratio = last.map_or(0.0, |last| last.log_ratio.min(0.0));
                (number(reading), widened(predicted).find(|wide| test(reading, wide).tail() > FITS)?, log_ratio)
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
        let part = |one: &Reading<'_, D>| test(one, predicted).depth() - test(one, &right).depth();
        let log_ratio = log_ratio
            + others
                .clone()
                .map(part)
                .filter(|part| !part.is_nan())
                .map(|part| part.clamp(-MAX_PART, MAX_PART))
                .sum::<f64>();
        let agreeing: Vec<_> = others.filter(|one| test(one, &right).tail() > FITS).collect();
        let alternative = Alternative {
            sensor,
            belief: conditioned(&right, &agreeing),
            // What was said against it long ago must not outweigh what is said after a jump.
            log_ratio: log_ratio.max(-DECISIVE),
        };
        alternative.belief.is_finite().then_some((alternative, before))
    }
}
