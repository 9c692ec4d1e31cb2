//! Time limit and progress of a running design.

use crate::deadline::Deadline;
use std::time::{Duration, Instant};

/// How far a design has come, for a display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// Parts of the stage that are done.
    pub done: usize,
    /// Parts of the stage.
    pub parts: usize,
    /// Time since the start.
    pub elapsed: Duration,
}

/// A part of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Each sensor by itself.
    SingleSensors,
    /// All sensors together, from several starts.
    AllSensors,
    /// Finer breakpoints for the best few results.
    Refinement,
    /// Newton's method on the best few, with the certificate.
    Certificate,
}

/// A part of the time limit, in the order in which the parts are used up. What one part leaves, the next may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Share {
    Bits,
    SingleSensors,
    AllSensors,
    Refinement,
    All,
}

impl Share {
    /// The part of the limit after which this share ends.
    fn end(self) -> f64 {
        match self {
            Self::Bits => 0.4,
            Self::SingleSensors => 0.5,
            Self::AllSensors => 0.7,
            Self::Refinement => 0.85,
            Self::All => 1.0,
        }
    }
}

/// Time limit and progress of a running design.
pub(super) struct Control<'a> {
    started: Instant,
    limit: Option<Duration>,
    deadline: Deadline,
    last_share: Share,
    progress: Option<&'a mut dyn FnMut(Progress)>,
    pub(super) is_cut_short: bool,
    pub(super) steps: usize,
}

impl<'a> Control<'a> {
    pub(super) fn new(limit: Option<Duration>, progress: Option<&'a mut dyn FnMut(Progress)>) -> Self {
        let started = Instant::now();
        Self {
            started,
            limit,
            deadline: Deadline::after(started, limit),
            last_share: Share::All,
            progress,
            is_cut_short: false,
            steps: 0,
        }
    }

    /// What follows must end with this share of the time, whatever it enters.
    pub(super) fn end_with(&mut self, share: Share) {
        self.last_share = share;
        self.enter(share);
    }

    /// Goes on to another share of the time.
    pub(super) fn enter(&mut self, share: Share) {
        let share = share.min(self.last_share);
        self.deadline = Deadline::after(self.started, self.limit.map(|limit| limit.mul_f64(share.end())));
    }

    /// When the present share of the time ends.
    pub(super) fn deadline(&self) -> Deadline {
        self.deadline
    }

    /// Whether there is time left in the present share.
    pub(super) fn go_on(&mut self) -> bool {
        let is_over = self.deadline.is_over();
        self.is_cut_short |= is_over;
        !is_over
    }

    /// Counts a step of the search. Whether there is time left for it.
    pub(super) fn step(&mut self) -> bool {
        self.steps += 1;
        self.go_on()
    }

    pub(super) fn report(&mut self, stage: Stage, done: usize, parts: usize) {
        let elapsed = self.started.elapsed();
        if let Some(progress) = &mut self.progress {
            progress(Progress {
                stage,
                done,
                parts,
                elapsed,
            });
        }
    }
}
