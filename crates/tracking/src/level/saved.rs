//! States of a centre to which it can return.

use crate::first::lasting::ErrorUnderLasting;
use crate::level::band::Pending;
use fewbits_filters::centre::CentreState;
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;

/// Instants between two marks, and number of marks.
const MARKED: usize = 16;
const MARKS: usize = 9;

/// A state before an instant.
#[derive(Clone)]
pub(crate) struct Mark<B> {
    /// Number of instants before it.
    pub(crate) instants: usize,
    pub(crate) state: CentreState<B>,
    /// The last value of each member.
    pub(crate) last: Vec<Option<f64>>,
    pub(crate) pending: Pending,
}

/// All that an instant changes.
pub(crate) struct Saved<B> {
    pub(crate) mark: Mark<B>,
    pub(crate) error: Option<ErrorUnderLasting>,
    pub(crate) rng: Pcg64Mcg,
    /// The mark that made room for that of the instant.
    pub(crate) dropped: Option<Mark<B>>,
}

/// Marks of the last instants.
#[derive(Clone)]
pub(crate) struct Marks<B>(VecDeque<Mark<B>>);

impl<B: Clone> Marks<B> {
    pub(crate) fn new() -> Self {
        Self(VecDeque::new())
    }

    /// Adds the state before an instant, if it is time.
    pub(crate) fn add(&mut self, saved: &mut Saved<B>) {
        if saved.mark.instants.is_multiple_of(MARKED) {
            self.0.push_back(saved.mark.clone());
            if self.0.len() > MARKS {
                saved.dropped = self.0.pop_front();
            }
        }
    }

    /// Takes out the last mark that is at least so many instants before `now`, or the first one. Those behind it are gone.
    pub(crate) fn take(&mut self, now: usize, instants: usize) -> Option<Mark<B>> {
        while self.0.len() > 1 && self.0.back()?.instants + instants > now {
            self.0.pop_back();
        }
        self.0.pop_back()
    }

    /// Takes out what [`add`](Self::add) added.
    pub(crate) fn undo(&mut self, saved: &mut Saved<B>) {
        while self.0.back().is_some_and(|mark| mark.instants >= saved.mark.instants) {
            self.0.pop_back();
        }
        if let Some(dropped) = saved.dropped.take() {
            self.0.push_front(dropped);
        }
    }
}
