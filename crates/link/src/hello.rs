//! When a sensor says where it is, and when nothing answers.

use std::time::{Duration, Instant};

const FIRST: Duration = Duration::from_secs(1);
/// Longest pause while nothing answers.
const UNHEARD: Duration = Duration::from_secs(8);
/// Longest pause while the centre answers, and longest wait for a question that is overdue.
const LONGEST: Duration = Duration::from_secs(300);
/// The program of a sensor is told after this time and so many heartbeats without an answer, and again after each further minute.
const UNANSWERED_AFTER: Duration = Duration::from_secs(10);
const UNANSWERED_HELLOS: u32 = 3;
const UNANSWERED_EVERY: Duration = Duration::from_secs(60);

/// The heartbeats of a sensor.
///
/// ```text
/// nothing answers                  after 1, 2, 4, 8, 8, ... s
/// answered, but not asked yet      after 1, 2, 4, ... 300 s
/// asked, not told                  as if it was not asked
/// asked and told                   when the next question is half an interval overdue, after 1 to 300 s
/// ```
/// A centre that asks knows the sensor's address. A sensor is told when a heartbeat was answered by what the centre takes its reports for:
/// one that is silent shows in no other way that they mean something else.
#[derive(Debug)]
pub(crate) struct Hellos {
    at: Instant,
    pause: Duration,
    /// Those since the last answer.
    unanswered: u32,
    answered_at: Instant,
    say_after: Duration,
    asked_at: Option<Instant>,
    /// Time between questions.
    interval: Option<Duration>,
}

impl Hellos {
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            at: now,
            pause: FIRST,
            unanswered: 0,
            answered_at: now,
            say_after: UNANSWERED_AFTER,
            asked_at: None,
            interval: None,
        }
    }

    /// Whether a heartbeat is to be sent now. Counts it.
    pub(crate) fn is_due(&mut self, now: Instant) -> bool {
        if now < self.at {
            return false;
        }
        self.at = now + self.pause;
        let longest = if self.unanswered == 0 { LONGEST } else { UNHEARD };
        self.pause = (self.pause * 2).min(longest);
        self.unanswered = self.unanswered.saturating_add(1);
        true
    }

    /// Time to the next heartbeat.
    pub(crate) fn wait(&self, now: Instant) -> Duration {
        self.at.saturating_duration_since(now)
    }

    /// A frame of the centre was accepted.
    pub(crate) fn on_answer(&mut self, now: Instant) {
        (self.unanswered, self.answered_at, self.say_after) = (0, now, UNANSWERED_AFTER);
    }

    /// The centre has asked.
    pub(crate) fn on_question(&mut self, now: Instant, is_told: bool) {
        if let Some(asked_at) = self.asked_at.replace(now) {
            let gap = now.saturating_duration_since(asked_at);
            // A centre that was away for a day does not ask once a day from then on.
            self.interval = Some(self.interval.map_or(gap, |interval| gap.min(interval * 2)));
        }
        if !is_told {
            return;
        }
        let overdue = self.interval.map_or(FIRST, |interval| interval + interval / 2);
        (self.at, self.pause) = (now + overdue.clamp(FIRST, LONGEST), FIRST);
    }

    /// For how long nothing was answered, if that is to be said now.
    pub(crate) fn unanswered(&mut self, now: Instant) -> Option<Duration> {
        let since = now.saturating_duration_since(self.answered_at);
        if since < self.say_after || self.unanswered < UNANSWERED_HELLOS {
            return None;
        }
        self.say_after = since + UNANSWERED_EVERY;
        Some(since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// The seconds from 1 to `last` in which a heartbeat is sent, and those in which it is said that nothing answers.
    fn run(last: u32, mut in_second: impl FnMut(u32, bool, &mut Hellos, Instant)) -> (Vec<u32>, Vec<u32>) {
        let start = Instant::now();
        let mut hellos = Hellos::new(start + SECOND);
        let (mut sent, mut said) = (Vec::new(), Vec::new());
        for second in 1..=last {
            let now = start + SECOND * second;
            let is_due = hellos.is_due(now);
            sent.extend(is_due.then_some(second));
            in_second(second, is_due, &mut hellos, now);
            said.extend(hellos.unanswered(now).map(|_| second));
        }
        (sent, said)
    }

    #[test]
    fn nothing_answers() {
        let (sent, said) = run(160, |_, _, _, _| {});
        assert_eq!(sent[..7], [1, 2, 4, 8, 16, 24, 32]);
        assert_eq!(said, [11, 71, 131]);
    }

    /// Slots of an hour: heartbeats are answered, and nothing is said. Heartbeats become rare.
    #[test]
    fn a_slow_centre_is_no_dead_one() {
        let (sent, said) = run(3 * 3600, |second, is_due, hellos, now| {
            if is_due || second % 3600 == 0 {
                hellos.on_answer(now);
            }
            if second % 3600 == 0 {
                hellos.on_question(now, true);
            }
        });
        assert!(said.is_empty() && sent.len() < 70, "{} heartbeats, {said:?}", sent.len());
    }

    /// Defect: a question of the centre ended the heartbeats of a sensor whose first one had not been answered. If it was silent, neither end
    /// could say that its reports mean something else.
    #[test]
    fn heartbeats_go_on_until_the_sensor_is_told() {
        let until = |told: u32| {
            run(100, |second, _, hellos, now| {
                hellos.on_answer(now);
                hellos.on_question(now, second >= told);
            })
            .0
        };
        assert_eq!(until(101), [1, 2, 4, 8, 16, 32, 64]);
        assert_eq!(until(8), [1, 2, 4, 8]);
        assert_eq!(until(9), [1, 2, 4, 8]);
    }

    /// Slots of ten seconds: no heartbeat while questions come, one when a question is missing, and the rest as before it was asked.
    #[test]
    fn questions_save_heartbeats() {
        let (sent, said) = run(200, |second, _, hellos, now| {
            if second % 10 == 5 && second < 100 && second != 55 {
                hellos.on_answer(now);
                hellos.on_question(now, true);
            }
        });
        // The first comes before any question, and after the first question the interval is not known.
        assert_eq!(sent[..10], [1, 2, 4, 6, 7, 9, 13, 60, 61, 63], "{sent:?}");
        // The question of second 65 came; after 95 none does.
        assert_eq!(sent[10..14], [110, 111, 113, 117], "{sent:?}");
        // Here heartbeats are not answered.
        assert_eq!(said, [63, 113, 173]);
    }
}
