//! Time limit and progress of a running design.

use crate::deadline::Deadline;
use std::time::{Duration, Instant};

/// How far a design has come, for a display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The present stage.
    pub stage: Stage,
    /// Parts of the stage that are done.
    pub done: usize,
    /// Parts of the stage.
    pub parts: usize,
    /// Time since the start.
    pub elapsed: Duration,
}

/// A part of a design. Each has a share of the time limit; what one leaves, the next may use.
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

impl Stage {
    /// The part of the time after which this stage ends.
    fn end(self) -> f64 {
        match self {
            Self::SingleSensors => 0.2,
            Self::AllSensors => 0.5,
            Self::Refinement => 0.75,
            Self::Certificate => 1.0,
        }
    }
}

/// Time limit and progress of a running design.
pub(super) struct Control<'a> {
    started: Instant,
    limit: Option<Duration>,
    deadline: Deadline,
    /// The part of the limit that is used at all.
    portion: f64,
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
            portion: 1.0,
            progress,
            is_cut_short: false,
            steps: 0,
        }
    }

    /// The stages from here on end at this portion of the time limit.
    pub(super) fn end_with(&mut self, portion: f64) {
        self.portion = portion;
        self.enter(Stage::Certificate, 1);
    }

    /// Goes on to one of `parts` equal parts of the time that is left of a stage.
    pub(super) fn enter(&mut self, stage: Stage, parts: usize) {
        let now = self.started.elapsed();
        let end = |limit: Duration| {
            let left = limit.mul_f64(self.portion * stage.end()).saturating_sub(now);
            now + left / parts as u32
        };
        self.deadline = Deadline::after(self.started, self.limit.map(end));
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
