//! The Monte-Carlo engine: runs many independent trials in parallel.
//!
//! Trials are grouped into chunks of fixed size. Each chunk is folded in trial order, and the chunks are merged in index
//! order, so the result is bitwise the same for any number of threads. A trial draws only from its own [`Stream`], so
//! a failed trial can be repeated alone.

use crate::parallel;
use crate::stream::Stream;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use thiserror::Error;

/// Number of trials per chunk. The result depends on it, so it must not be changed at run time.
const CHUNK: u64 = 64;

/// One trial: its number and its private random stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trial {
    /// Number of the trial, from 0.
    pub index: u64,
    /// Root of the trial's random streams.
    pub stream: Stream,
}

/// Why a run has no result. Of several failed trials the one of lowest index is reported, for any number of threads.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub enum MonteCarloError {
    /// A trial failed.
    #[error("trial {index} failed ({message}); run it alone with `MonteCarlo::single({index}, ..)`")]
    Trial {
        /// Number of the trial.
        index: u64,
        /// Its random stream.
        stream: Stream,
        /// Message of the trial's error.
        message: String,
    },
    /// A trial panicked; no other trial is affected.
    #[error("trial {index} panicked ({message}); run it alone with `MonteCarlo::single({index}, ..)`")]
    Panicked {
        /// Number of the trial.
        index: u64,
        /// Its random stream.
        stream: Stream,
        /// The panic's message.
        message: String,
    },
    /// The run was cancelled ([`MonteCarlo::cancel`]).
    #[error("cancelled")]
    Cancelled,
    /// MPI ranks could not exchange their results.
    #[cfg(feature = "mpi")]
    #[error("ranks cannot exchange results: {message}")]
    Exchange {
        /// What cannot be written, read or sent.
        message: String,
    },
}

/// Settings of a run: the number of independent trials, and the random stream of the experiment.
///
/// ```
/// use fewbits_monte_carlo::{MonteCarlo, Moments, Stream};
/// use rand::RngExt;
/// let run = MonteCarlo::new(Stream::new(1).named("mean of a uniform"), 10_000);
/// let moments = run.fold(
///     Moments::default,
///     |sum, trial| Ok::<_, std::convert::Infallible>(sum.add(trial.stream.rng().random())),
///     |total, chunk| total.merge(&chunk),
/// )?;
/// assert!(moments.estimate().z_score(0.5).abs() < 4.0);
/// # Ok::<(), fewbits_monte_carlo::MonteCarloError>(())
/// ```
#[derive(Clone, Copy)]
pub struct MonteCarlo<'a> {
    stream: Stream,
    trials: u64,
    /// Called with the number of trials just finished, from any thread.
    pub progress: Option<&'a (dyn Fn(u64) + Sync)>,
    /// Once it is set, the run stops between trials.
    pub cancel: Option<&'a AtomicBool>,
}

impl<'a> MonteCarlo<'a> {
    /// `trials` trials; trial `i` draws from `stream.indexed(i)`.
    pub fn new(stream: Stream, trials: u64) -> Self {
        Self {
            stream,
            trials,
            progress: None,
            cancel: None,
        }
    }

    /// The trial of the given index.
    pub fn trial(&self, index: u64) -> Trial {
        Trial {
            index,
            stream: self.stream.indexed(index),
        }
    }

    /// Runs one trial alone, exactly as in the full run. Its error may be of any type that implements `Display`.
    ///
    /// # Errors
    /// If the trial fails or panics.
    pub fn single<T, E: Display>(
        &self,
        index: u64,
        trial: impl FnOnce(Trial) -> Result<T, E>,
    ) -> Result<T, MonteCarloError> {
        let it = self.trial(index);
        let stream = it.stream;
        match catch_unwind(AssertUnwindSafe(|| trial(it))) {
            Ok(Ok(result)) => Ok(result),
            Ok(Err(error)) => Err(MonteCarloError::Trial {
                index,
                stream,
                message: error.to_string(),
            }),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let message = text.or_else(|| panic.downcast_ref::<&str>().copied());
                Err(MonteCarloError::Panicked {
                    index,
                    stream,
                    message: message.unwrap_or("no message").to_owned(),
                })
            }
        }
    }

    /// Runs all trials and returns their results in trial order.
    ///
    /// # Errors
    /// If a trial fails or panics, or the run is cancelled.
    pub fn run<T: Send, E: Display>(
        &self,
        trial: impl Fn(Trial) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, MonteCarloError> {
        self.fold(
            Vec::new,
            |results, it| {
                results.push(trial(it)?);
                Ok::<_, E>(())
            },
            |all, mut chunk| all.append(&mut chunk),
        )
    }

    /// Folds all trials into one accumulator: within chunks in trial order, then the chunks in index order. After a trial has failed,
    /// trials of higher index are not started.
    ///
    /// # Errors
    /// If a trial fails or panics, or the run is cancelled.
    pub fn fold<A: Send, E: Display>(
        &self,
        empty: impl Fn() -> A + Sync,
        trial: impl Fn(&mut A, Trial) -> Result<(), E> + Sync,
        merge: impl Fn(&mut A, A),
    ) -> Result<A, MonteCarloError> {
        let chunks = self.fold_chunks((0..self.chunks()).collect(), &empty, trial);
        let mut total = empty();
        for chunk in chunks {
            merge(&mut total, chunk?);
        }
        Ok(total)
    }

    pub(crate) fn chunks(&self) -> u64 {
        self.trials.div_ceil(CHUNK)
    }

    /// Folds the given chunks, in their order.
    pub(crate) fn fold_chunks<A: Send, E: Display>(
        &self,
        chunks: Vec<u64>,
        empty: impl Fn() -> A + Sync,
        trial: impl Fn(&mut A, Trial) -> Result<(), E> + Sync,
    ) -> Vec<Result<A, MonteCarloError>> {
        // The lowest index that has failed so far. Trials below it still run, so that the reported one does not depend on the threads.
        let failed = AtomicU64::new(u64::MAX);
        parallel::map(&chunks, |chunk| self.fold_chunk(*chunk, &failed, &empty, &trial))
    }

    fn fold_chunk<A, E: Display>(
        &self,
        chunk: u64,
        failed: &AtomicU64,
        empty: impl Fn() -> A,
        trial: impl Fn(&mut A, Trial) -> Result<(), E>,
    ) -> Result<A, MonteCarloError> {
        let mut accumulator = empty();
        let indices = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.trials);
        let finished = indices.end - indices.start;
        for index in indices {
            let stopped = failed.load(Ordering::Relaxed) < index;
            if stopped || self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
                return Err(MonteCarloError::Cancelled);
            }
            self.single(index, |it| trial(&mut accumulator, it)).inspect_err(|_| {
                failed.fetch_min(index, Ordering::Relaxed);
            })?;
        }
        if let Some(progress) = self.progress {
            progress(finished);
        }
        Ok(accumulator)
    }
}
