//! The update at one instant: the new belief, and what each slot shows about its sensor.

use super::gate::{Fate, Verdict};
use super::health::Health;
use super::judge::Shown;
use super::law::Law;
use super::one_wrong::OneIsWrong;
use super::reading::{BySlot, Content, Reading, Tested};
use super::state::{MemberState, StoredSlot};
use super::{Event, FusionCentre, Member, Received, Slot};
use crate::Error;
use crate::contract::{Info, StateFilter};
use fewbits_core::{Gaussian, Likelihood};
use rand::Rng;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Updates with the observations of the present instant. Their order does not matter. An equal second report of a sensor is dropped, also if it
    /// comes in a call of its own.
    /// A report that is impossible, or too unlikely given the prediction and all other reports ([`Health`]), is not used, and costs no other
    /// report; an [event](Event) names it.
    ///
    /// The log likelihood is that of the reports that were used. It is `-inf` if a report is impossible and none is rejected for being
    /// unlikely (`Health::Off` and `Health::Report`).
    ///
    /// # Errors
    /// If a sensor is unknown, or the feedback of a silent sensor does not decode. A report beside such feedback is rejected.
    pub fn receive(&mut self, rng: &mut dyn Rng, slots: &[Slot]) -> Result<Received, Error> {
        if let Some(received) = self.receive_one(rng, slots) {
            return received;
        }
        let mut predicted = self.estimate();
        let (readings, copied) = self.read(slots, self.now)?;
        let mut events: Vec<Event> = copied
            .iter()
            .map(|seat| Event::Copied(self.members[*seat].number))
            .collect();
        let mut law = self.law(&self.belief, &predicted);
        let mut verdicts = self.gate(&law, &predicted, &readings);
        let mut belief = self.belief.clone();
        let mut reopened = false;
        let mut alternative = None;
        if self.health == Health::Exclude {
            let found = self.alternative(&predicted, &readings, &verdicts);
            let jumped = found
                .filter(|(alternative, _)| alternative.is_believed() || self.is_held(alternative))
                .map(|(_, wide)| {
                    let again = self.gate(&Law::Moments(wide), &wide, &readings);
                    (wide, again)
                });
            alternative = found.map(|(alternative, _)| alternative);
            if let Some((wide, again)) = self.reopened(&predicted, &readings, &verdicts).or(jumped) {
                let start = self.acquisition.unwrap_or(wide);
                belief = self.filter.restart(rng, &start, &self.belief)?;
                (predicted, verdicts, reopened, alternative) = (wide, again, true, None);
                law = self.law(&belief, &predicted);
                if self.acquisition.is_some() {
                    predicted = start;
                    verdicts = self.gate(&law, &predicted, &readings);
                }
            }
        }
        let before = (self.window > 0.0).then(|| belief.clone());
        let in_order = self.take_in_order(&law, &predicted, &readings, &mut verdicts)?;
        let mut info = self.update_belief(rng, &mut belief, &predicted, &readings, &mut verdicts, &in_order)?;
        let sent = readings.iter().filter(|reading| reading.content != Content::Nothing);
        info.log_likelihood += sent
            .map(|reading| self.members[reading.seat].state.presence.log_working())
            .sum::<f64>();
        let is_rejected = |verdict: &Verdict| verdict.fate == Fate::Rejected;
        if self.health != Health::Exclude && verdicts.iter().any(is_rejected) {
            info.log_likelihood = f64::NEG_INFINITY;
        }
        // From here on the centre changes. Only the restart of a lost track can fail; then everything is put back.
        let earlier = self.acquisition.map(|_| {
            let states: Vec<MemberState> = self.members.iter().map(|member| member.state).collect();
            let rest = (self.outage, self.monitor, self.noise_scale, self.astray, self.alternative);
            (states, rest, self.history.clone(), self.belief.clone())
        });
        self.alternative = alternative;
        self.belief = belief;
        if let Some(before) = before {
            let stored = readings
                .iter()
                .zip(&verdicts)
                .map(|(reading, verdict)| self.stored(reading, verdict));
            let stored: Vec<StoredSlot> = stored.collect();
            if reopened {
                self.history.clear();
            }
            self.remember(before, stored);
        }
        copied.iter().for_each(|seat| self.members[*seat].state.copies += 1);
        if reopened {
            self.members.iter_mut().for_each(|member| member.state.forget_tests());
            self.monitor = Default::default();
            events.push(if self.acquisition.is_some() {
                Event::Reacquired
            } else {
                Event::Reopened
            });
        }
        match self.judge(rng, &readings, &verdicts, &in_order.shown) {
            Ok(found) => {
                events.extend(found);
                Ok(Received { info, events })
            }
            Err(error) => {
                if let Some((states, rest, history, belief)) = earlier {
                    self.members
                        .iter_mut()
                        .zip(states)
                        .for_each(|(member, state)| member.state = state);
                    (self.outage, self.monitor, self.noise_scale, self.astray, self.alternative) = rest;
                    (self.history, self.belief) = (history, belief);
                }
                Err(error)
            }
        }
    }

    /// The only report of an instant, if nothing tests it or stores it and moments are all that it changes: as [`receive`](Self::receive) in
    /// fewer steps. `None` in all other cases.
    fn receive_one(&mut self, rng: &mut dyn Rng, slots: &[Slot]) -> Option<Result<Received, Error>> {
        let [slot] = slots else { return None };
        if self.health != Health::Off || self.window > 0.0 || self.acquisition.is_some() {
            return None;
        }
        let seat = self.seat(slot.sensor, 0).ok()?;
        if self.is_copy(seat, slot, self.now) {
            return None;
        }
        let Member {
            sensor, group, state, ..
        } = &self.members[seat];
        if group.is_some() || !sensor.decodes(slot.observation.received()?) {
            return None;
        }
        let mut moments = self.estimate();
        self.filter.of_moments(&moments)?;
        let found = sensor.condition(slot, 1.0, &mut moments).ok()?;
        if !(found.log_likelihood > f64::NEG_INFINITY && moments.is_finite()) {
            return None;
        }
        let info = Info::new(found.log_likelihood + state.presence.log_working());
        self.belief = self.filter.of_moments(&moments)?;
        self.alternative = None;
        let reading = Reading {
            seat,
            slot,
            likelihood: None,
            content: Content::Report,
        };
        let verdict = Verdict {
            fate: Fate::Used,
            tested: Tested::without_residual(true),
        };
        let events = self.judge(rng, &[reading], &[verdict], &[Shown::Report(None)]);
        Some(events.map(|events| Received { info, events }))
    }

    /// The predictive law of a belief.
    pub(super) fn law(&self, belief: &F::Belief, moments: &Gaussian<D>) -> Law<D> {
        match self.filter.points(belief) {
            _ if self.health == Health::Off => Law::Moments(*moments),
            Some(points) => Law::Points(points),
            None => self.filter.mixture(belief).map_or(Law::Moments(*moments), Law::Mixture),
        }
    }

    /// Conditions the moments on the reports that are used, one after the other, and tests each given those before it. A report that cannot
    /// update them is rejected. Silence is tested given the prediction alone; otherwise, after several sensors died together, the silence
    /// of each would confirm that of the others.
    fn take_in_order(
        &self,
        law: &Law<D>,
        predicted: &Gaussian<D>,
        readings: &[Reading<'_, D>],
        verdicts: &mut [Verdict],
    ) -> Result<InOrder<D>, Error> {
        let is_by_moments = self.filter.of_moments(predicted).is_some();
        let mut found = InOrder {
            given: *predicted,
            log_likelihood: 0.0,
            shown: BySlot::new(),
        };
        let mut before: Vec<&Reading<'_, D>> = Vec::new();
        let mut silence = None;
        // A report that is the only one was tested given the prediction alone.
        let mut used = readings
            .iter()
            .zip(&*verdicts)
            .filter(|(reading, verdict)| reading.content != Content::Nothing && verdict.fate == Fate::Used);
        let is_only = used.next().is_some() && used.next().is_none();
        for (reading, verdict) in readings.iter().zip(verdicts) {
            let member = &self.members[reading.seat];
            let is_tested = self.health != Health::Off && reading.content == Content::Report;
            let shown = match (law, reading.content, reading.known()) {
                (Law::Points(_) | Law::Mixture(_), Content::Nothing, _) => {
                    Shown::Silence(match member.silence_by(reading, law) {
                        Some(silence) => silence,
                        None => member.silence(reading, predicted)?,
                    })
                }
                (Law::Moments(_), Content::Nothing, _) => {
                    // Silent sensors of a group that were told the same are silent with the same probability.
                    let same = silence.filter(|(one, _): &(&Reading<'_, D>, f64)| self.is_like(one, reading));
                    let probability = match same {
                        Some((_, probability)) => probability,
                        None => member.silence(reading, predicted)?,
                    };
                    silence = Some((reading, probability));
                    Shown::Silence(probability)
                }
                (Law::Points(_) | Law::Mixture(_), _, Some(_)) if verdict.fate == Fate::Used => {
                    let tested = is_tested.then(|| match is_only {
                        true => verdict.tested,
                        false => self.test_given(law, &before, reading),
                    });
                    before.push(reading);
                    Shown::Report(tested.and_then(|tested| tested.residual))
                }
                (Law::Moments(_), _, Some(known)) if verdict.fate == Fate::Used => {
                    let before = found.given;
                    match known.condition(&mut found.given) {
                        Ok(one) if one.log_likelihood > f64::NEG_INFINITY && found.given.is_finite() => {
                            found.log_likelihood += one.log_likelihood;
                            let residual = || match is_only {
                                true => verdict.tested.residual,
                                false => member.judged(reading, &before, one).residual,
                            };
                            Shown::Report(is_tested.then(residual).flatten())
                        }
                        failed => {
                            found.given = before;
                            // Other filters may use what moments cannot.
                            let is_hopeless = !matches!(failed, Err(Error::Argument(_) | Error::Unresolved { .. }));
                            if is_by_moments || is_hopeless {
                                verdict.fate = Fate::Rejected;
                            }
                            Shown::Report(None)
                        }
                    }
                }
                _ => Shown::Report(None),
            };
            found.shown.push(shown);
        }
        Ok(found)
    }

    /// Updates the belief with all readings that are used: reports first, then those that are contested, then silences.
    fn update_belief(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut F::Belief,
        predicted: &Gaussian<D>,
        readings: &[Reading<'_, D>],
        verdicts: &mut [Verdict],
        in_order: &InOrder<D>,
    ) -> Result<Info, Error> {
        let contested = contested(readings, verdicts);
        let silent: Vec<&Reading<'_, D>> = readings
            .iter()
            .zip(&*verdicts)
            .filter(|(reading, verdict)| reading.content == Content::Nothing && verdict.fate == Fate::Used)
            .map(|(reading, _)| reading)
            .collect();
        let parts = self.joined(silent.iter().map(|one| self.input_of(one)))?;
        // An impossible silence shows that the sensor failed, and nothing about the state.
        let missing = self
            .likelihoods(&silent, &parts)
            .into_iter()
            .filter(|known| known.as_constant() != Some(f64::NEG_INFINITY));
        let rest: Vec<&dyn Likelihood<D>> = contested
            .iter()
            .map(|one| one as &dyn Likelihood<D>)
            .chain(missing)
            .collect();
        let is_used = |i: &usize| verdicts[*i].fate == Fate::Used && readings[*i].content != Content::Nothing;
        let reports = (0..readings.len()).filter(is_used);
        let parts_of_reports = self.joined(reports.clone().map(|i| self.input_of(&readings[i])))?;
        let together = || {
            let used: Vec<&Reading<'_, D>> = reports.clone().map(|i| &readings[i]).collect();
            self.likelihoods(&used, &parts_of_reports)
        };
        if self.filter.of_moments(&in_order.given).is_some() {
            let (mut moments, mut log_likelihood) = (in_order.given, in_order.log_likelihood);
            // The reports of a group, at once in place of one after the other.
            let mut all = *predicted;
            if !parts_of_reports.is_empty()
                && let Ok(found) = together().as_slice().condition(&mut all)
                && all.is_finite()
            {
                (moments, log_likelihood) = (all, found.log_likelihood);
            }
            for one in rest {
                // A constant likelihood changes no moments.
                log_likelihood += match one.as_constant() {
                    Some(log) => log,
                    None => one.condition(&mut moments).map_or(0.0, |found| found.log_likelihood),
                };
            }
            if let Some(next) = self.filter.of_moments(&moments) {
                *belief = next;
            }
            return Ok(Info::new(log_likelihood));
        }
        let all = |reports: &[usize]| {
            let reports = reports.iter().filter_map(|i| readings[*i].known());
            reports.chain(rest.iter().copied()).collect::<Vec<_>>()
        };
        let at_once: Vec<&dyn Likelihood<D>> = together().iter().chain(&rest).copied().collect();
        let mut reports: Vec<usize> = reports.collect();
        match self.filter.update(rng, belief, &at_once) {
            Err(error) if is_of_reports(&error) => {}
            other => return other,
        }
        // Together they are impossible, or overflow. Those that fit best are kept, as many as are possible together.
        sort_by_depth(&mut reports, verdicts);
        let mut kept: Vec<usize> = Vec::new();
        for i in reports {
            kept.push(i);
            let likelihoods: Vec<_> = kept.iter().filter_map(|i| readings[*i].known()).collect();
            match self.filter.update(rng, &mut belief.clone(), &likelihoods) {
                Err(error) if is_of_reports(&error) => {
                    kept.pop();
                    verdicts[i].fate = Fate::Rejected;
                }
                other => drop(other?),
            }
        }
        match self.filter.update(rng, belief, &all(&kept)) {
            Err(error) if is_of_reports(&error) => {
                let likelihoods: Vec<_> = kept.iter().filter_map(|i| readings[*i].known()).collect();
                self.filter.update(rng, belief, &likelihoods)
            }
            other => other,
        }
    }
}

/// Sorts reports by how well they fit, the best first.
fn sort_by_depth(reports: &mut [usize], verdicts: &[Verdict]) {
    let depth = |report: &usize| verdicts[*report].tested.depth();
    reports.sort_by(|one, other| depth(one).total_cmp(&depth(other)));
}

/// Whether a belief may fail like this because of the reports.
pub(super) fn is_of_reports(error: &Error) -> bool {
    matches!(error, Error::Impossible | Error::NotANumber { .. })
}

/// The moments after the reports of an instant, taken one after the other.
struct InOrder<const D: usize> {
    given: Gaussian<D>,
    log_likelihood: f64,
    shown: BySlot<Shown>,
}

/// The likelihood of all reports that contradict each other.
fn contested<'a, const D: usize>(readings: &'a [Reading<'_, D>], verdicts: &[Verdict]) -> Option<OneIsWrong<'a, D>> {
    let parts = readings
        .iter()
        .zip(verdicts)
        .filter_map(|(reading, verdict)| match verdict.fate {
            Fate::Contested(log_wrong) => Some((reading.known()?, log_wrong)),
            _ => None,
        });
    let parts: Vec<_> = parts.collect();
    (!parts.is_empty()).then(|| OneIsWrong::new(parts))
}
