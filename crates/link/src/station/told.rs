//! What a station says about its clock, about slots that begin too late, and to sensors that only say where they are.

use super::{COUNTERS_PER_SLOT, Output, Station};
use fewbits_protocol::{CentreTimer, Feedback, Frame, Kind, Payload, Receiver, Slot};
use std::fmt::Display;
use std::str::FromStr;

/// A clock that is behind is reported once in so many nanoseconds.
const REPORT_CLOCK_EVERY: u64 = 60_000_000_000;
/// Heartbeats to one sensor in one slot: far below the counters of a slot.
const MOST_ANSWERS: u64 = COUNTERS_PER_SLOT / 64;

impl<R: Receiver, A: Clone + PartialEq + Display + FromStr> Station<R, A> {
    /// Says that no slot begins because the clock is at least two slots behind the last one.
    pub(super) fn look_at_clock(&mut self, now: u64, outputs: &mut Vec<Output<A>>) {
        let schedule = &self.centre.settings().schedule;
        if self.centre.slot() < schedule.count(now).saturating_add(2) {
            self.said_behind = None;
            return;
        }
        let is_new = |said: u64| now < said || now - said >= REPORT_CLOCK_EVERY;
        if self.said_behind.is_none_or(is_new) {
            self.said_behind = Some(now);
            let wait = schedule.start(self.centre.slot().saturating_add(1)).saturating_sub(now);
            tracing::warn!(seconds = wait / 1_000_000_000, "no slot begins: the clock is behind the last one");
            outputs.push(Output::ClockBehind { wait });
        }
    }

    /// Says that a slot did not begin because its timer, which was `due` earlier, fired too late. A station that was just made says
    /// nothing: it begins with the next slot.
    pub(super) fn look_at_start(&self, now: u64, due: u64, timer: CentreTimer, outputs: &mut Vec<Output<A>>) {
        let schedule = &self.centre.settings().schedule;
        let slot = schedule.count(now);
        if timer != CentreTimer::SlotBegins || due == 0 || self.centre.slot() >= slot {
            return;
        }
        let late = now.saturating_sub(schedule.start(slot)) as f64 / 1e9;
        let reason = format!("it was due {late:.3} s earlier, and too little time was left for reports");
        tracing::warn!(slot, "the slot passes: {reason}");
        outputs.push(Output::Passed { slot, reason });
    }

    /// Answers a heartbeat that answers no question, so that its sensor knows that it is heard although it may be asked much later, and a
    /// frame of a sensor whose reports mean something else than the centre was told. The answer says what the centre was told. Sensors that
    /// report by the clock would set it by the answer and get none.
    pub(super) fn answer_hello(&mut self, place: usize, frame: &[u8], answers: bool, outputs: &mut Vec<Output<A>>) {
        let settings = self.centre.settings();
        let kind = Frame::decode(frame, settings.check).ok().map(|frame| frame.kind);
        let is_hello = !answers && kind == Some(Kind::Heartbeat);
        let is_unlike = self.centre.is_unlike(place) && matches!(kind, Some(Kind::Report | Kind::Heartbeat));
        let is_told = settings
            .members
            .get(place)
            .is_some_and(|member| member.feedback == Feedback::Told);
        let is_free = self.remotes.get(place).is_some_and(|remote| remote.sent < MOST_ANSWERS);
        if (is_hello || is_unlike) && is_told && is_free && self.has_begun {
            let (slot, meaning) = (Slot::of_count(self.centre.slot()), settings.meaning(place));
            let answer = Frame::new(Kind::Heartbeat, slot, meaning, Payload::EMPTY);
            let bytes = answer.to_bytes(settings.check);
            self.send(place, &bytes, outputs);
        }
    }
}
