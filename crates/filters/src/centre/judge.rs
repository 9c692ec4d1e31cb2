//! Updates of presence, health and process noise after the observations of one instant.

use super::gate::{Fate, Verdict};
use super::health::{self, Alarm, CLIP, Health, Residual, SEQUENCES};
use super::reading::{Content, Reading};
use super::repeats::Repeated;
use super::{Event, FusionCentre};
use crate::Error;
use crate::contract::StateFilter;
use rand::Rng;

/// An excluded sensor is used again after this many observations without an alarm.
const READMISSION: u32 = 100;
/// A sensor is excluded if no other is suspect: the sums of all others are below this share of the limit.
const SUSPECT: f64 = 0.5;
/// A dispute ends when the sums have fallen below this share of the limit, after so many observations without another contradiction.
const SETTLED: f64 = 0.25;
const CALM: u32 = 20;
/// Or its reports of late are less likely than any other sensor's by this much, in nats.
const DECISIVE: f64 = 15.0;
/// Share of the past that counts for that, at each report.
const MEMORY: f64 = 0.98;
/// Largest depth of a single report that counts, in nats.
const MAX_DEPTH: f64 = 1e3;
/// Mean depth of the reports of a right model: half a squared standard normal variable.
const USUAL_DEPTH: f64 = 0.5;

/// What came in a slot.
pub(super) enum Shown {
    /// Nothing, and the probability of that if the sensor works.
    Silence(f64),
    /// A report, and its residual given the prediction and the reports of sensors of smaller numbers. A report that is lost was sent too.
    Report(Option<Residual>),
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Updates presence, health and learnt process noise from what each slot showed.
    pub(super) fn judge(
        &mut self,
        rng: &mut dyn Rng,
        readings: &[Reading<'_, D>],
        verdicts: &[Verdict],
        shown: &[Shown],
    ) -> Result<Vec<Event>, Error> {
        // 1. Each sensor: its presence and its own test.
        let mut events = Vec::new();
        let mut pooled = [(0.0, 0_u32); SEQUENCES];
        let (mut products, mut together, mut is_any_used, mut is_any_rejected) = (0.0, 0.0, false, false);
        let (mut alarmed, mut repeating) = (Vec::new(), Vec::new());
        for ((reading, Verdict { fate, tested }), shown) in readings.iter().zip(verdicts).zip(shown) {
            let (seat, apart) = (reading.seat, &tested.residual);
            let member = &mut self.members[seat];
            let (number, state) = (member.number, &mut member.state);
            let in_order = match shown {
                Shown::Silence(silence) => {
                    let (ratio, dead) = state.presence.silent(*silence, &self.failures);
                    together += ratio;
                    if dead {
                        events.push(Event::Dead(number));
                    }
                    continue;
                }
                Shown::Report(in_order) => in_order,
            };
            state.latest = Some((self.now, reading.slot.digest()));
            state.unreadable += u64::from(reading.is_unreadable());
            let (ratio, alive) = state.presence.report_arrived();
            together += ratio;
            if alive {
                events.push(Event::Alive(number));
            }
            if *fate == Fate::Rejected {
                state.rejected += 1;
                state.astray = state.astray.saturating_add(1);
                events.push(Event::Rejected(number));
                is_any_rejected = true;
            } else if *fate != Fate::Excluded {
                state.astray = 0;
                is_any_used = true;
            }
            if self.health == Health::Off {
                continue;
            }
            let is_report = reading.content == Content::Report;
            if let Some((value, variance)) = is_report.then(|| member.sensor.value(reading.slot)).flatten() {
                match state.repeats.add(value, variance, self.limits.rate) {
                    Repeated::Suspect if !state.repeats.is_stuck => repeating.push(seat),
                    Repeated::MovesAgain if !state.excluded => {
                        state.forget_tests();
                        events.push(Event::Readmitted(number));
                    }
                    _ => {}
                }
            }
            if apart.is_none() && *fate != Fate::Rejected {
                continue;
            }
            let product = |last: &mut Option<f64>, residual: f64| {
                let product = last.map(|last| last * residual);
                *last = Some(residual);
                product
            };
            // A report that is impossible has no residual, but it is a surprise.
            let terms = match apart {
                Some(found) => {
                    let product = product(&mut state.last_residual, found.residual);
                    [Some(found.surprise), Some(found.residual), product]
                }
                None => [Some(CLIP), None, None],
            };
            let depth = apart.map_or(MAX_DEPTH, |found| found.depth.min(MAX_DEPTH));
            state.depth = MEMORY * state.depth + depth - USUAL_DEPTH;
            let is_alarm = state.monitor.add(terms, &self.limits.sensor) == Some(Alarm::Contradiction);
            // A report that is too unlikely beside another begins a dispute of both at once.
            let is_contested = matches!(fate, Fate::Contested(_));
            let is_unlikely = is_contested && apart.is_some_and(|one| one.tail < self.limits.gate);
            state.quiet = if is_alarm || is_unlikely || state.repeats.is_stuck {
                0
            } else {
                state.quiet.saturating_add(1)
            };
            if is_contested && !std::mem::replace(&mut state.disputed, true) {
                state.quiet = 0;
                events.push(Event::Disputed(number));
            }
            if *fate == Fate::Excluded || state.excluded {
                if state.excluded && state.quiet >= READMISSION {
                    state.excluded = false;
                    events.push(Event::Readmitted(number));
                }
                continue;
            }
            let is_calm = state.quiet >= CALM && state.monitor.contradiction(&self.limits.sensor) < SETTLED;
            if state.disputed && is_calm {
                state.disputed = false;
            }
            if is_alarm {
                alarmed.push((seat, *fate));
            }
            // The centre's own test leaves out residuals: in a lost track those of different sensors have different signs.
            // Surprises and products do not.
            let Some(found) = in_order.or(*apart) else { continue };
            if member.always_speaks && reading.slot.observation.received().is_some_and(|bits| bits.bits() == 1) {
                state.rate.add(found.residual);
            }
            let product = product(&mut state.last_in_order, found.residual);
            for (sum, term) in pooled.iter_mut().zip([Some(found.surprise), None, product]) {
                if let Some(term) = term {
                    *sum = (sum.0 + term, sum.1 + 1);
                }
            }
            products += product.unwrap_or(0.0).clamp(-CLIP, CLIP);
        }
        match (is_any_used, is_any_rejected) {
            (true, _) => self.astray = 0,
            (false, true) => self.astray = self.astray.saturating_add(1),
            (false, false) => {}
        }
        // 2. Exclusion: of those that are stuck while another moves, and of at most half of the sensors for what they say.
        for seat in repeating {
            self.hold(seat, &mut events);
        }
        for (seat, fate) in alarmed {
            self.exclude(seat, fate, &mut events);
        }
        // 3. A common failure: the evidence of all sensors together.
        let sensors = self.members.iter_mut().map(|member| &mut member.state.presence);
        self.outage.weigh(together, sensors);
        // 4. Process noise: larger if residuals repeat, smaller if they alternate.
        if let Some(learning) = &self.learning {
            let [low, high] = learning.range;
            self.noise_scale = (self.noise_scale * (learning.gain * products).exp()).clamp(low, high);
        }
        // 5. The centre's own test, with terms pooled over the sensors. A lost track restarts from the prior, if one is set.
        let terms = pooled.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count).sqrt()));
        let alarm = self.monitor.add(terms, &self.limits.centre);
        if alarm.is_some() {
            self.monitor = health::Monitor::default();
        }
        if alarm == Some(Alarm::Overstatement) {
            events.push(Event::NoiseOverstated);
        }
        if alarm == Some(Alarm::Contradiction) {
            events.push(Event::Lost);
            if let Some(prior) = self.acquisition {
                self.belief = self.filter.restart(rng, &prior, &self.belief)?;
                self.history.clear();
                self.alternative = None;
                self.members.iter_mut().for_each(|member| member.state.forget_tests());
                events.push(Event::Reacquired);
            }
        }
        Ok(events)
    }

    /// Decides about a sensor that repeats one value: it is stuck if another still moves.
    fn hold(&mut self, seat: usize, events: &mut Vec<Event>) {
        let is_moving = |(other, member): &(usize, &super::Member<D>)| {
            *other != seat && !member.state.presence.named_dead && member.state.repeats.runs.repetitions == 0
        };
        let moving = self.members.iter().enumerate().filter(is_moving);
        let moving: Vec<(usize, bool)> = moving.map(|(other, member)| (other, member.state.excluded)).collect();
        if moving.is_empty() {
            return;
        }
        events.push(Event::Excluded(self.members[seat].number));
        self.members[seat].state.repeats.is_stuck = true;
        if self.health != Health::Exclude {
            return;
        }
        // The others were judged against it. If none of them is in use, they were excluded for what this one said.
        if moving.iter().all(|(_, is_excluded)| *is_excluded) {
            for (other, _) in moving {
                self.members[other].state.excluded = false;
                events.push(Event::Readmitted(self.members[other].number));
            }
        }
        self.forget_all_tests();
    }

    /// Forgets the tests of all sensors, which were made against one that was wrong, and the centre's own.
    fn forget_all_tests(&mut self) {
        for member in &mut self.members {
            let astray = member.state.astray;
            member.state.forget_tests();
            member.state.astray = astray;
        }
        self.monitor = health::Monitor::default();
    }

    /// Decides about a sensor whose test raised an alarm. It is excluded if it alone is suspect, or by far the most. If another is about as
    /// suspect, both are in dispute: their reports contradict each other, and nothing says which is wrong.
    fn exclude(&mut self, seat: usize, fate: Fate, events: &mut Vec<Event>) {
        let own = self.members[seat].state;
        let excluded = self.members.iter().filter(|member| member.state.is_ignored()).count();
        // The prediction may be wrong instead. The reports of the others decide, from the first rejected report on, or from the next report
        // on. There is no alternative in which an impossible report is right.
        let is_against = self
            .alternative
            .and_then(|alternative| alternative.is_against(self.members[seat].number));
        let is_early = self.health == Health::Exclude && !is_against.unwrap_or(fate == Fate::Rejected);
        if own.is_ignored() || is_early || self.health == Health::Off {
            return;
        }
        let suspicion = |state: &super::state::MemberState| state.monitor.contradiction(&self.limits.sensor);
        let others = || {
            let all = self.members.iter().enumerate();
            all.filter(|(other, member)| {
                *other != seat && !member.state.is_ignored() && !member.state.presence.named_dead
            })
        };
        let is_alone = others().all(|(_, member)| suspicion(&member.state) < SUSPECT);
        let deepest = others()
            .map(|(_, member)| member.state.depth)
            .fold(f64::NEG_INFINITY, f64::max);
        let is_deepest = own.depth - deepest > DECISIVE;
        let number = self.members[seat].number;
        if is_alone || is_deepest {
            if excluded < self.members.len() / 2 && others().count() > 0 {
                if self.health == Health::Exclude {
                    // The others were judged against it.
                    self.forget_all_tests();
                    self.members[seat].state.excluded = true;
                } else {
                    self.members[seat].state.monitor = health::Monitor::default();
                    self.monitor = health::Monitor::default();
                }
                events.push(Event::Excluded(number));
            }
            return;
        }
        // If another is by far the worst, it is the one to be excluded, in its own time.
        let rivals: Vec<usize> = others()
            .filter(|(_, member)| {
                suspicion(&member.state) >= SUSPECT && (member.state.depth - own.depth).abs() <= DECISIVE
            })
            .map(|(other, _)| other)
            .collect();
        if rivals.is_empty() || deepest - own.depth > DECISIVE {
            return;
        }
        for seat in rivals.into_iter().chain([seat]) {
            let member = &mut self.members[seat];
            if !std::mem::replace(&mut member.state.disputed, true) {
                events.push(Event::Disputed(member.number));
            }
        }
    }
}
