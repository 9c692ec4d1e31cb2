//! What a centre says on standard error: events of sensors, refused frames and troubles, at a limited rate; and how it went.

use crate::Ending;
use crate::error::Error;
use crate::notes::{Limiter, MOST_NAMED};
use crate::report::Report;
use crate::say::say;
use fewbits_core::Observation;
use fewbits_link::{Counts, Output, Station};
use fewbits_protocol::{Note, Receiver, Slot};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Refused frames are reported after a moment, then once a minute while there are any.
const FIRST: Duration = Duration::from_secs(1);
const EVERY: Duration = Duration::from_secs(60);
/// Slots without any report after which a run counts as failed.
const SILENT_SLOTS: u64 = 10;

pub(super) struct Log {
    numbers: Vec<u32>,
    kinds: Vec<Report>,
    period: f64,
    notes: Limiter,
    /// Counts at the last report of refused frames: of all, and of each sensor.
    all: Counts,
    of_sensors: Vec<Counts>,
    next: Instant,
    /// Count of the last slot.
    last: u64,
    slots: u64,
    passed: u64,
    reports: u64,
    /// Numbers of the sensors that reported.
    heard: BTreeSet<u32>,
    silence_said: bool,
}

/// The slot that a note names.
fn slot_of(note: &Note) -> Option<Slot> {
    match *note {
        Note::Late { slot } | Note::Duplicate { slot } | Note::Disagreement { slot } => Some(slot),
        _ => None,
    }
}

/// Says how many frames with the numbers of sensors were refused: of each sensor, or in one line if there are many.
fn refused(mut of: Vec<(u32, u64)>, what: &str) {
    of.retain(|(_, more)| *more > 0);
    if of.len() <= MOST_NAMED {
        of.iter()
            .for_each(|(number, more)| say!("sensor {number}: {more} frames {what} were refused"));
    } else if let Some((number, most)) = of.iter().max_by_key(|(_, more)| *more) {
        let (sensors, all) = (of.len(), of.iter().map(|(_, more)| more).sum::<u64>());
        say!("{all} frames {what} with the numbers of {sensors} sensors were refused, {most} of sensor {number}");
    }
}

impl Log {
    pub(super) fn new(numbers: Vec<u32>, kinds: Vec<Report>, period: f64) -> Self {
        Self {
            of_sensors: vec![Counts::default(); numbers.len()],
            numbers,
            kinds,
            period,
            notes: Limiter::default(),
            all: Counts::default(),
            next: Instant::now() + FIRST,
            last: 0,
            slots: 0,
            passed: 0,
            reports: 0,
            heard: BTreeSet::new(),
            silence_said: false,
        }
    }

    /// The count of a slot, as the rows have it: frames carry 24 bits of it.
    fn count(&self, slot: Slot) -> u64 {
        slot.nearest_count(self.last)
    }

    fn number(&self, sensor: usize) -> u32 {
        self.numbers.get(sensor).copied().unwrap_or_default()
    }

    /// Says what an output of the station tells about sensors and slots.
    pub(super) fn take<A>(&mut self, output: &Output<A>) {
        match output {
            Output::Step(step) => {
                self.slots += 1;
                self.last = step.slot;
                for (number, observed) in self.numbers.iter().zip(&step.observed) {
                    if matches!(observed, Observation::Received(_)) {
                        self.reports += 1;
                        self.heard.insert(*number);
                    }
                }
                if let Some(trouble) = &step.trouble {
                    self.notes.say("trouble", &format!("slot {}: {trouble}", step.slot));
                }
                for event in &step.events {
                    let (slot, name) = (step.slot, event.name());
                    match event.sensor().map(|sensor| self.number(sensor as usize)) {
                        Some(number) => {
                            self.notes
                                .say_of(name, number, &format!("slot {slot}: sensor {number} {name}"));
                        }
                        None => self.notes.say(name, &format!("slot {slot}: {name}")),
                    }
                }
                if self.slots == SILENT_SLOTS && self.reports == 0 {
                    self.silence_said = true;
                    say!(
                        "no report in the first {SILENT_SLOTS} slots: do the sensors run, and is this their centre's address?"
                    );
                }
                if self.reports > 0 && std::mem::take(&mut self.silence_said) {
                    say!("slot {}: the first report has come", step.slot);
                }
            }
            Output::Passed { slot, reason } => {
                self.passed += 1;
                self.last = *slot;
                self.notes.say("passed", &format!("slot {slot} passed: {reason}"));
            }
            Output::ClockBehind { wait } => {
                let seconds = *wait as f64 / 1e9;
                say!(
                    "no slot begins for {seconds:.0} s: the clock is behind the last slot, so it was ahead or is not set; set it, or start \
                     anew with --new-start"
                );
            }
            // Heartbeats are what sensors say when they have nothing to report.
            Output::Note {
                note: Note::Heartbeat { .. },
                ..
            } => {}
            Output::Note {
                sensor,
                note: Note::Malformed { slot },
            } => {
                let (number, slot) = (self.number(*sensor), self.count(*slot));
                let text = format!(
                    "sensor {number}: a report of another length, slot {slot}: `report` must be the same in its file and here"
                );
                self.notes.say_of("reports of another length", number, &text);
            }
            Output::Note {
                sensor,
                note: Note::OtherMeaning { slot, found },
            } => {
                let (number, slot) = (self.number(*sensor), self.count(*slot));
                let own = self.kinds.get(*sensor);
                let text = match own.and_then(|own| Some((own.word(), own.named(*found)?))) {
                    Some((own, other)) => format!(
                        "sensor {number}: it sends {other}, here it is `{own}`, so its reports are not used; `report` must be the same in \
                         its file and here"
                    ),
                    None => format!("sensor {number}: an answer to another question, slot {slot}"),
                };
                self.notes.say_of("another `report` than here", number, &text);
            }
            Output::Note { sensor, note } => {
                let (number, text) = (self.number(*sensor), note.to_string());
                let kind = text.split(',').next().unwrap_or_default();
                let text = match slot_of(note) {
                    Some(slot) => format!("{kind}, slot {}", self.count(slot)),
                    None => text.clone(),
                };
                self.notes.say_of(kind, number, &format!("sensor {number}: {text}"));
            }
            _ => {}
        }
    }

    /// Says how many frames were refused since the last time, and whose number they have.
    pub(super) fn look<R: Receiver, A: Clone + PartialEq + std::fmt::Display + std::str::FromStr>(
        &mut self,
        station: &Station<R, A>,
    ) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        let all = station.counts();
        self.next = now
            + if all.refused() == self.all.refused() {
                FIRST
            } else {
                EVERY
            };
        let (mut forged, mut replayed) = (Vec::new(), Vec::new());
        for (sensor, number) in self.numbers.iter().enumerate() {
            let counts = station.counts_of(sensor);
            let before = std::mem::replace(&mut self.of_sensors[sensor], counts);
            forged.push((*number, counts.forged - before.forged));
            replayed.push((*number, counts.replayed - before.replayed));
        }
        refused(forged, "under another key");
        refused(replayed, "that were used before");
        let before = std::mem::replace(&mut self.all, all);
        for (more, what) in [
            (all.unknown - before.unknown, "of unknown or revoked sensors"),
            (all.short - before.short, "that are no frames"),
        ] {
            if more > 0 {
                say!("{more} frames {what} were refused");
            }
        }
    }

    /// The last line, and how the run ended: a failure if no report came although there was time or something else came.
    pub(super) fn finish<R: Receiver, A: Clone + PartialEq + std::fmt::Display + std::str::FromStr>(
        mut self,
        station: &Station<R, A>,
        json: bool,
    ) -> Result<Ending, Error> {
        self.next = Instant::now();
        self.look(station);
        let counts = station.counts();
        let missing: Vec<u32> = self
            .numbers
            .iter()
            .filter(|number| !self.heard.contains(number))
            .copied()
            .collect();
        if json {
            let summary = serde_json::json!({
                "slots": self.slots,
                "passed": self.passed,
                "period": self.period,
                "reports": self.reports,
                "silent_sensors": missing,
                "envelopes": counts,
            });
            say!("{summary}");
        } else {
            let Self {
                slots, reports, passed, ..
            } = &self;
            let (heard, all, refused) = (self.heard.len(), self.numbers.len(), counts.refused());
            say!(
                "{slots} slots, {passed} passed; {reports} reports of {heard} of {all} sensors; {refused} frames refused"
            );
            if !missing.is_empty() && self.reports > 0 {
                let named: Vec<String> = missing.iter().take(20).map(u32::to_string).collect();
                say!("no report of sensors {}{}", named.join(", "), if missing.len() > 20 { ", ..." } else { "" });
            }
        }
        let nothing = self.reports == 0 && (self.slots >= SILENT_SLOTS || counts.refused() > 0);
        Ok(if nothing { Ending::Failed } else { Ending::Good })
    }
}
