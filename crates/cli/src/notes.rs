//! Notes on standard error at a limited rate: what happens in each slot is said once a minute, with how often it happened.

use crate::say::say;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Notes of one kind are said at most once in this time.
const EVERY: Duration = Duration::from_secs(60);
/// Largest number of kinds: what a stranger causes may not take memory without limit.
const MAX_KINDS: usize = 4096;

/// Says notes of each kind at most once a minute.
#[derive(Debug, Default)]
pub(crate) struct Limiter(HashMap<String, (Instant, u64)>);

impl Limiter {
    /// Says the note, unless one of this kind was said within the last minute. Then the next one says how many there were.
    pub(crate) fn say(&mut self, kind: &str, note: &str) {
        if let Some(text) = self.text(kind, note, Instant::now()) {
            say!("{text}");
        }
    }

    fn text(&mut self, kind: &str, note: &str, now: Instant) -> Option<String> {
        if self.0.len() >= MAX_KINDS && !self.0.contains_key(kind) {
            self.0.clear();
        }
        match self.0.get_mut(kind) {
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
                self.0.insert(kind.to_owned(), (now, 0));
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
        assert!(notes.0.len() <= MAX_KINDS);
    }
}
