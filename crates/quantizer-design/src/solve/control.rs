//! Time limit and progress of a running design.

use crate::deadline::{Clock, Deadline, speed};
use std::ops::ControlFlow;
use std::time::Duration;

/// Is told of the progress between steps of the search, often several times at the same part. If it breaks, the search ends as at a time
/// limit: with the best design so far.
pub type Watch<'a> = dyn FnMut(Progress) -> ControlFlow<()> + Send + 'a;

/// Progress of a design, for a display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The present stage.
    pub stage: Stage,
    /// Number of finished parts of the stage.
    pub done: usize,
    /// Number of parts of the stage.
    pub parts: usize,
    /// Time since the start.
    pub elapsed: Duration,
}

/// A stage of a design. Each has a fraction of the time limit; time that one leaves is available to the next.
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
    /// The fraction of the time at which this stage ends.
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
    clock: Clock,
    started: Duration,
    limit: Option<Duration>,
    /// Multiplications per second; only a time limit needs them.
    speed: f64,
    deadline: Deadline,
    /// The fraction of the time limit that is used.
    portion: f64,
    progress: Option<&'a mut Watch<'a>>,
    /// Stage, finished parts and parts of the last report.
    last: (Stage, usize, usize),
    pub(super) is_cut_short: bool,
    pub(super) steps: usize,
}

impl<'a> Control<'a> {
    pub(super) fn new(clock: Clock, limit: Option<Duration>, progress: Option<&'a mut Watch<'a>>) -> Self {
        let speed = if limit.is_some() { speed(clock) } else { f64::INFINITY };
        let started = clock();
        Self {
            clock,
            started,
            limit,
            speed,
            deadline: Deadline::after(clock, started, limit, speed),
            portion: 1.0,
            progress,
            last: (Stage::SingleSensors, 0, 1),
            is_cut_short: false,
            steps: 0,
        }
    }

    /// From now on the stages share this fraction of the time limit.
    pub(super) fn end_with(&mut self, portion: f64) {
        self.portion = portion;
        self.enter(Stage::Certificate, 1);
    }

    /// Begins one of `parts` parts of a stage, which share the stage's remaining time equally.
    pub(super) fn enter(&mut self, stage: Stage, parts: usize) {
        let now = self.elapsed();
        let end = |limit: Duration| {
            let left = limit.mul_f64(self.portion * stage.end()).saturating_sub(now);
            now + left / parts as u32
        };
        self.deadline = Deadline::after(self.clock, self.started, self.limit.map(end), self.speed);
    }

    /// Time since the start.
    fn elapsed(&self) -> Duration {
        (self.clock)().saturating_sub(self.started)
    }

    /// The end of the present part.
    pub(super) fn deadline(&self) -> Deadline {
        self.deadline
    }

    /// Whether time is left in the present part, and the caller has not stopped the search.
    pub(super) fn go_on(&mut self) -> bool {
        self.tell();
        let is_over = self.deadline.is_over();
        self.is_cut_short |= is_over;
        !is_over
    }

    /// Counts a step of the search. Returns whether time is left.
    pub(super) fn step(&mut self) -> bool {
        self.steps += 1;
        self.go_on()
    }

    pub(super) fn report(&mut self, stage: Stage, done: usize, parts: usize) {
        self.last = (stage, done, parts);
        self.tell();
    }

    /// Tells the caller; if it stops the search, no time is left.
    fn tell(&mut self) {
        let ((stage, done, parts), elapsed) = (self.last, self.elapsed());
        let now = Progress {
            stage,
            done,
            parts,
            elapsed,
        };
        if self.progress.as_mut().is_some_and(|progress| progress(now).is_break()) {
            (self.progress, self.limit, self.speed) = (None, Some(Duration::ZERO), 0.0);
            self.deadline = Deadline::after(self.clock, self.started, self.limit, self.speed);
            self.is_cut_short = true;
        }
    }
}
