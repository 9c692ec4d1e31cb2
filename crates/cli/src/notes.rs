//! Notes on standard error at a limited rate: what happens in each slot is said once a minute, with how often it happened.

use crate::say::say;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Notes of one kind are said at most once in this time.
const EVERY: Duration = Duration::from_secs(60);
/// Largest number of kinds: what a stranger causes may not take memory without limit.
const MAX_KINDS: usize = 4096;
/// So many sensors are named with the same note within that time; the others are counted.
pub(crate) const MOST_NAMED: usize = 20;

/// Says notes of each kind at most once a minute.
#[derive(Debug, Default)]
pub(crate) struct Limiter {
    kinds: HashMap<String, (Instant, u64)>,
    groups: HashMap<String, Group>,
}

/// Notes that are alike, of different sensors.
#[derive(Debug)]
struct Group {
    since: Instant,
    named: usize,
    /// Notes that were not said.
    kept: u64,
}

impl Limiter {
    /// Says the note, unless one of this kind was said within the last minute. Then the next one says how many there were.
    pub(crate) fn say(&mut self, kind: &str, note: &str) {
        if let Some(text) = self.text(kind, note, Instant::now()) {
            say!("{text}");
        }
    }

    /// Says the note of a sensor, unless it or too many others had one of this kind within the last minute. In a fleet what happens to one
    /// sensor often happens to thousands.
    pub(crate) fn say_of(&mut self, kind: &str, sensor: u32, note: &str) {
        for text in self.texts_of(kind, sensor, note, Instant::now()) {
            say!("{text}");
        }
    }

    fn texts_of(&mut self, kind: &str, sensor: u32, note: &str, now: Instant) -> Vec<String> {
        let mut texts = Vec::new();
        if self.groups.len() >= MAX_KINDS && !self.groups.contains_key(kind) {
            self.groups.clear();
        }
        let new = || Group {
            since: now,
            named: 0,
            kept: 0,
        };
        let mut group = self.groups.remove(kind).unwrap_or_else(new);
        if now.duration_since(group.since) >= EVERY {
            if group.kept > 0 {
                texts.push(format!("{} more notes in the last minute: {kind}", group.kept));
            }
            group = new();
        }
        if group.named < MOST_NAMED {
            let text = self.text(&format!("{kind} {sensor}"), note, now);
            group.named += usize::from(text.is_some());
            texts.extend(text);
            if group.named == MOST_NAMED {
                texts.push(format!("further sensors are only counted for a minute: {kind}"));
            }
        } else {
            group.kept += 1;
        }
        self.groups.insert(kind.to_owned(), group);
        texts
    }

    fn text(&mut self, kind: &str, note: &str, now: Instant) -> Option<String> {
        if self.kinds.len() >= MAX_KINDS && !self.kinds.contains_key(kind) {
            self.kinds.clear();
        }
        match self.kinds.get_mut(kind) {
            Some((last, kept)) if now.duration_since(*last) < EVERY => {
                *kept += 1;
                None
            }
            Some((last, kept)) => {
                let more = std::mem::take(kept);
                *last = now;
                Some(match more {
                    0 => note.to_owned(),
                    more => format!("{note} (and {more} such notes since the last)"),
                })
            }
            None => {
                self.kinds.insert(kind.to_owned(), (now, 0));
                Some(note.to_owned())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_a_minute_and_none_is_forgotten() {
        let (mut notes, start) = (Limiter::default(), Instant::now());
        assert_eq!(notes.text("a", "late", start).as_deref(), Some("late"));
        assert!((1..60).all(|s| notes.text("a", "late", start + Duration::from_secs(s)).is_none()));
        assert_eq!(notes.text("b", "other", start).as_deref(), Some("other"));
        let later = notes.text("a", "late", start + EVERY);
        assert_eq!(later.as_deref(), Some("late (and 59 such notes since the last)"));
        (0..10_000).for_each(|i| drop(notes.text(&i.to_string(), "", start)));
        assert!(notes.kinds.len() <= MAX_KINDS);
    }

    /// Defect: 25,000 late sensors were 25,000 lines in every slot.
    #[test]
    fn a_fleet_is_not_named_one_by_one() {
        let (mut notes, start) = (Limiter::default(), Instant::now());
        let lines = |notes: &mut Limiter, seconds: u64| {
            let now = start + Duration::from_secs(seconds);
            let all =
                (0..25_000).flat_map(|sensor| notes.texts_of("late", sensor, &format!("sensor {sensor}: late"), now));
            all.collect::<Vec<_>>()
        };
        let first = lines(&mut notes, 0);
        assert_eq!((first.len(), first[0].as_str()), (MOST_NAMED + 1, "sensor 0: late"));
        assert!((1..6).all(|slot| lines(&mut notes, 10 * slot).is_empty()));
        let later = lines(&mut notes, 60);
        assert_eq!(later[0], format!("{} more notes in the last minute: late", 6 * 25_000 - MOST_NAMED));
        assert_eq!(later.len(), MOST_NAMED + 2);
        // A few sensors are named as before, each once a minute.
        assert_eq!(notes.texts_of("dead", 7, "sensor 7 dead", start), ["sensor 7 dead"]);
        assert!(notes.texts_of("dead", 7, "sensor 7 dead", start).is_empty());
        assert_eq!(notes.texts_of("dead", 8, "sensor 8 dead", start), ["sensor 8 dead"]);
    }
}
