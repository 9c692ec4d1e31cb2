//! Which reports of an instant are used: each is tested against the prediction and all the others.

use super::FusionCentre;
use super::health::Health;
use super::law::Law;
use super::reading::{BySlot, Content, Reading, Tested};
use crate::contract::StateFilter;
use fewbits_core::Gaussian;

/// Odds, in nats, at which one of two reports that contradict each other counts as the wrong one: one in 10^4.
const DECISIVE: f64 = 9.2;
/// The same of the only two sensors that report: only the prediction can decide, and it holds the earlier reports of both.
const DECISIVE_OF_TWO: f64 = 50.0;

/// Smallest `ln p` of a wrong report.
const LOWEST: f64 = -1e4;

/// What happens to a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fate {
    /// It updates the belief.
    Used,
    /// Its sensor is excluded. It is tested all the same.
    Excluded,
    /// It is impossible, or too unlikely.
    Rejected,
    /// It contradicts another, and nothing decides which of them is wrong. The number is `ln p` of it if it is wrong.
    Contested(f64),
}

/// The fate of a reading, and its test given the prediction and the other reports that are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict {
    pub fate: Fate,
    pub tested: Tested,
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Decides which readings are used.
    ///
    /// ```text
    /// test each report given the prediction and all others;  while one is below the gate:
    ///     the one that fits worst is rejected, and the others are tested again without it
    ///     if another fits about as badly, and without each other they agree with everything else about equally well, both are contested
    /// ```
    pub(super) fn gate(&self, law: &Law<D>, predicted: &Gaussian<D>, readings: &[Reading<'_, D>]) -> BySlot<Verdict> {
        let state = |reading: &Reading<'_, D>| &self.members[reading.seat].state;
        let first = |reading: &Reading<'_, D>| match (&reading.likelihood, state(reading).is_ignored()) {
            (None, _) => Fate::Rejected,
            (_, true) if self.health == Health::Exclude => Fate::Excluded,
            _ => Fate::Used,
        };
        let of = |reading| Verdict {
            fate: first(reading),
            tested: Tested::without_residual(true),
        };
        let mut verdicts: BySlot<Verdict> = readings.iter().map(of).collect();
        if self.health == Health::Off {
            return verdicts;
        }
        loop {
            let trusted: Vec<usize> = (0..readings.len())
                .filter(|i| readings[*i].content == Content::Report && verdicts[*i].fate == Fate::Used)
                .collect();
            let reports: Vec<&Reading<'_, D>> = trusted.iter().map(|i| &readings[*i]).collect();
            let found = self.test_all(law, &reports);
            trusted
                .iter()
                .zip(&found)
                .for_each(|(i, tested)| verdicts[*i].tested = *tested);
            if self.health != Health::Exclude {
                break;
            }
            let below = |k: &usize| found[*k].tail() < self.limits.gate;
            let decisive = if found.len() == 2 { DECISIVE_OF_TWO } else { DECISIVE };
            let Some(worst) = (0..found.len())
                .filter(below)
                .max_by(|one, other| found[*one].depth().total_cmp(&found[*other].depth()))
            else {
                break;
            };
            // Of two, each is the other's rival: their misfits differ by chance only.
            let is_rival = |k: &usize| *k != worst && (found.len() == 2 || below(k));
            let rivals = (0..found.len()).filter(is_rival).filter(|k| {
                let gap = found[worst].depth() - found[*k].depth();
                // Both may be infinite.
                gap.partial_cmp(&decisive) != Some(std::cmp::Ordering::Greater)
            });
            // A report without that of its rival, given all others.
            let without = |gone: usize, left: usize| {
                let others: Vec<_> = (0..reports.len())
                    .filter(|k| *k != gone && *k != left)
                    .map(|k| reports[k])
                    .collect();
                self.test_given(law, &others, reports[left])
            };
            let is_undecided = |k: &usize| {
                let (one, other) = (without(*k, worst), without(worst, *k));
                let gap = one.depth() - other.depth();
                gap.abs() <= decisive && one.tail().max(other.tail()) >= self.limits.gate
            };
            let rival = rivals
                .filter(is_undecided)
                .max_by(|one, other| found[*one].depth().total_cmp(&found[*other].depth()));
            if let Some(rival) = rival {
                for k in [worst, rival] {
                    verdicts[trusted[k]].fate = Fate::Contested(self.log_wrong(reports[k], predicted));
                }
            } else {
                verdicts[trusted[worst]].fate = Fate::Rejected;
            }
        }
        self.dispute(predicted, readings, &mut verdicts);
        // Reports that are not used are tested given those that are.
        let is_used = |i: &usize| readings[*i].content == Content::Report && verdicts[*i].fate == Fate::Used;
        if verdicts
            .iter()
            .any(|verdict| matches!(verdict.fate, Fate::Excluded | Fate::Rejected))
        {
            let used: Vec<_> = (0..readings.len()).filter(is_used).map(|i| &readings[i]).collect();
            for (reading, verdict) in readings.iter().zip(&mut verdicts) {
                if reading.content == Content::Report && matches!(verdict.fate, Fate::Excluded | Fate::Rejected) {
                    verdict.tested = self.test_given(law, &used, reading);
                }
            }
        }
        verdicts
    }

    /// Reports of sensors in dispute are contested at every instant, until the dispute ends.
    fn dispute(&self, predicted: &Gaussian<D>, readings: &[Reading<'_, D>], verdicts: &mut [Verdict]) {
        for (reading, verdict) in readings.iter().zip(verdicts) {
            let is_disputed = self.members[reading.seat].state.disputed && reading.content == Content::Report;
            if is_disputed && verdict.fate == Fate::Used && self.health == Health::Exclude {
                verdict.fate = Fate::Contested(self.log_wrong(reading, predicted));
            }
        }
    }

    /// `ln p` of a report if it is wrong: its probability under the prediction. Each of two reports in dispute is then the wrong one with the
    /// same probability. Other odds would come from a prediction that already holds earlier reports of both, and would count them again.
    fn log_wrong(&self, reading: &Reading<'_, D>, predicted: &Gaussian<D>) -> f64 {
        let evidence = reading.known().and_then(|known| known.evidence(predicted).ok());
        evidence.map_or(0.0, |evidence| evidence.log_likelihood).max(LOWEST)
    }

    /// Whether a value is as near to the last one of its sensor as the prediction allows, and no repetition of a sensor that hardly ever repeats itself.
    /// Words are not compared.
    fn follows_its_last(&self, reading: &Reading<'_, D>, predicted: &Gaussian<D>) -> bool {
        let member = &self.members[reading.seat];
        if reading.content != Content::Report || member.state.is_ignored() {
            return true;
        }
        let (Some((value, noise)), Some(spread)) =
            (member.sensor.value(reading.slot), member.sensor.value_variance(predicted))
        else {
            return true;
        };
        member
            .state
            .repeats
            .agrees(value, spread + noise, member.sensor.period())
    }

    /// A prediction wide enough that most of the reports that were rejected agree with it and with each other; `None` if there is none, or
    /// if it is too early to say.
    pub(super) fn reopened(
        &self,
        predicted: &Gaussian<D>,
        readings: &[Reading<'_, D>],
        verdicts: &[Verdict],
    ) -> Option<(Gaussian<D>, BySlot<Verdict>)> {
        let reports = |wanted: fn(Fate) -> bool, verdicts: &[Verdict]| {
            let those = readings.iter().zip(verdicts).filter(|(reading, verdict)| {
                reading.content == Content::Report && reading.likelihood.is_some() && wanted(verdict.fate)
            });
            those.count()
        };
        let judged = reports(|fate| fate != Fate::Excluded, verdicts);
        if judged == 0 || 2 * reports(|fate| fate == Fate::Rejected, verdicts) <= judged {
            return None;
        }
        // Most sensors that report at all must disagree with the prediction, in this instant or in their last report.
        let now = |seat: usize| {
            let here = readings.iter().zip(verdicts).find(|(reading, _)| reading.seat == seat);
            here.map(|(_, verdict)| verdict.fate == Fate::Rejected)
        };
        let in_use = self.members.iter().enumerate();
        let in_use = in_use.filter(|(_, member)| !member.state.is_ignored() && !member.state.presence.named_dead);
        let (all, astray) = in_use.fold((0, 0), |(all, astray), (seat, member)| {
            let is_astray = now(seat).unwrap_or(member.state.astray > 0);
            (all + 1, astray + usize::from(is_astray))
        });
        if 2 * astray <= all {
            return None;
        }
        // From a prediction with which each report agrees, wider ones change nothing but rounding, by which reports that contradict each other would
        // agree.
        let agrees = |(reading, verdict): (&Reading<'_, D>, &Verdict), wide: &Gaussian<D>| {
            reading.content != Content::Report
                || reading.likelihood.is_none()
                || verdict.fate == Fate::Excluded
                || self.members[reading.seat].test(reading, wide).tail() > FITS
        };
        let enough = widened(predicted).position(|wide| readings.iter().zip(verdicts).all(|one| agrees(one, &wide)));
        for wide in widened(predicted).take(enough.map_or(WIDENINGS, |enough| enough + 1 + FURTHER)) {
            let again = self.gate(&Law::Moments(wide), &wide, readings);
            let agree = reports(|fate| fate == Fate::Used, &again);
            let fits = readings.iter().zip(&again).all(|(reading, verdict)| {
                reading.content != Content::Report || verdict.fate != Fate::Used || verdict.tested.tail() > FITS
            });
            if fits && 2 * agree > judged {
                // One sensor alone may have sent wild values. It must be off several times in a row, and so often again if its values
                // do not agree with each other.
                let needed = match readings.iter().all(|reading| self.follows_its_last(reading, predicted)) {
                    true => INSTANTS_ASTRAY,
                    false => 2 * INSTANTS_ASTRAY,
                };
                return (agree > 1 || self.astray + 1 >= needed).then_some((wide, again));
            }
        }
        None
    }
}

/// The prediction with larger and larger covariances.
pub(super) fn widened<const D: usize>(predicted: &Gaussian<D>) -> impl Iterator<Item = Gaussian<D>> {
    let wider = |last: &Gaussian<D>| Gaussian::from_trusted_parts(*last.mean(), last.covariance() * WIDER);
    let all = std::iter::successors(Some(wider(predicted)), move |last| Some(wider(last)));
    all.take(WIDENINGS).take_while(|wide| wide.is_finite())
}

/// Factor of the covariance at each step of the search for a wide enough prediction, and number of steps.
const WIDER: f64 = 16.0;
const WIDENINGS: usize = 60;
/// Further steps, behind which the prediction pulls no report.
const FURTHER: usize = 3;
/// A report agrees with the wide prediction if at least this share of reports is as unlikely.
pub(super) const FITS: f64 = 0.05;
/// So many instants in a row must contradict the prediction before a single sensor is believed against it.
pub(super) const INSTANTS_ASTRAY: u32 = 4;
