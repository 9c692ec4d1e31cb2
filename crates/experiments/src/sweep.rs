//! Sweeps: points x trials x schemes on common random numbers.
//!
//! A trial runs *every* scheme on its own truth and noise, so schemes are compared on common random numbers; it adds what it
//! saw to the tally of its point. Trials run in parallel and are merged in trial order: the same bytes on any number of threads.

use crate::error::Error;
use crate::figure::Context;
use fewbits_monte_carlo::{Moments, Stream, Trial};

/// What trials are added up in: [`Moments`], and lists, arrays and pairs of tallies.
pub trait Tally: Send {
    /// Adds all that another tally of the same shape saw.
    fn merge(&mut self, other: &Self);
}

impl Tally for Moments {
    fn merge(&mut self, other: &Self) {
        Moments::merge(self, other);
    }
}

impl<T: Tally> Tally for Vec<T> {
    fn merge(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(mine, theirs)| mine.merge(theirs));
    }
}

impl<T: Tally, const N: usize> Tally for [T; N] {
    fn merge(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(mine, theirs)| mine.merge(theirs));
    }
}

impl<A: Tally, B: Tally> Tally for (A, B) {
    fn merge(&mut self, other: &Self) {
        self.0.merge(&other.0);
        self.1.merge(&other.1);
    }
}

impl Context<'_> {
    /// What every one of `count` trials of an experiment gave, in their order.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn trials<T: Send>(
        &self,
        experiment: &str,
        count: u64,
        trial: impl Fn(Trial) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        Ok(self.monte_carlo(self.stream(experiment), count).run(trial)?)
    }

    /// What another figure of this run has put under this name, or what `make` returns. The name says all that it depends on.
    ///
    /// # Errors
    /// If `make` fails.
    pub fn once<T: Clone + Send + 'static>(
        &self,
        name: String,
        make: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        if let Some(known) = self.kept.and_then(|kept| kept.get(&name)) {
            return Ok(known);
        }
        let made = make()?;
        if let Some(kept) = self.kept {
            kept.put(name, made.clone());
        }
        Ok(made)
    }

    /// Runs `trials` trials at one point on the streams of `stream`, each adding to a tally that starts `empty`.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn tally<T, E>(
        &self,
        stream: Stream,
        trials: u64,
        empty: impl Fn() -> T + Sync,
        trial: impl Fn(&mut T, Trial) -> Result<(), E> + Sync,
    ) -> Result<T, Error>
    where
        T: Tally,
        E: std::fmt::Display,
    {
        Ok(self
            .monte_carlo(stream, trials)
            .fold(empty, trial, |all, part| all.merge(&part))?)
    }

    /// Runs `trials` trials at every point; the tallies in the order of the points. The streams of a point are those of
    /// `experiment` and the point's `name`, so that a point's numbers do not depend on which others are run.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn sweep<P: Sync, T, E>(
        &self,
        experiment: &str,
        trials: u64,
        points: &[P],
        name: impl Fn(&P) -> String,
        empty: impl Fn(&P) -> T + Sync,
        trial: impl Fn(&P, &mut T, Trial) -> Result<(), E> + Sync,
    ) -> Result<Vec<T>, Error>
    where
        T: Tally,
        E: std::fmt::Display,
    {
        let at = |point: &P| {
            let stream = self.stream(experiment).named(&name(point));
            self.tally(stream, trials, || empty(point), |tally, it| trial(point, tally, it))
        };
        points.iter().map(at).collect()
    }

    /// Runs every scheme on every trial of every point and keeps each trial's `K` numbers, for paired comparisons.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn compare<P: Sync, S: Sync, const K: usize, E>(
        &self,
        experiment: &str,
        trials: u64,
        points: &[P],
        name: impl Fn(&P) -> String,
        schemes: &[S],
        trial: impl Fn(&P, &S, Trial) -> Result<[f64; K], E> + Sync,
    ) -> Result<Vec<Comparison<K>>, Error>
    where
        E: std::fmt::Display,
    {
        let at = |point: &P| {
            let run = self.monte_carlo(self.stream(experiment).named(&name(point)), trials);
            let every = |it: Trial| {
                schemes
                    .iter()
                    .map(|scheme| trial(point, scheme, it))
                    .collect::<Result<Vec<_>, E>>()
            };
            Ok(Comparison {
                trials: run.run(every)?,
            })
        };
        points.iter().map(at).collect()
    }
}

/// The words of these with `by` between them.
pub fn joined<T: ToString>(words: impl IntoIterator<Item = T>, by: &str) -> String {
    words
        .into_iter()
        .map(|word| word.to_string())
        .collect::<Vec<_>>()
        .join(by)
}

/// The first row of which this holds.
pub fn first<R>(rows: &[R], is: impl Fn(&R) -> bool) -> Option<&R> {
    rows.iter().find(|row| is(row))
}

/// The rows of which this holds.
pub fn select<R>(rows: &[R], is: impl Fn(&R) -> bool) -> impl Iterator<Item = &R> {
    rows.iter().filter(move |row| is(row))
}

/// Distinct entries in order of appearance.
pub fn distinct<R, K: PartialEq>(rows: &[R], key: impl Fn(&R) -> K) -> Vec<K> {
    let mut seen = Vec::new();
    for key in rows.iter().map(key) {
        if !seen.contains(&key) {
            seen.push(key);
        }
    }
    seen
}

/// All trials of all schemes at one point: `K` numbers each.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison<const K: usize> {
    trials: Vec<Vec<[f64; K]>>,
}

impl<const K: usize> Comparison<K> {
    /// Number `of` of a scheme (both by their place in the lists).
    pub fn moments(&self, scheme: usize, of: usize) -> Moments {
        self.trials.iter().map(|schemes| schemes[scheme][of]).collect()
    }

    /// Number `of` of the first scheme minus that of the second, trial by trial.
    pub fn difference(&self, first: usize, second: usize, of: usize) -> Moments {
        self.trials
            .iter()
            .map(|schemes| schemes[first][of] - schemes[second][of])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

    fn run(context: &Context<'_>, points: &[f64]) -> Result<Vec<[Moments; 2]>, Error> {
        context.sweep(
            "demo",
            200,
            points,
            |p| format!("{p}"),
            |_| [Moments::default(); 2],
            |p, sums, it| {
                let noise: f64 = it.stream.rng().random();
                sums[0].add(p + noise);
                sums[1].add(p - noise);
                Ok::<_, Infallible>(())
            },
        )
    }

    #[test]
    fn a_point_has_its_own_streams_whichever_others_run() {
        let context = Context::new(1);
        let both = run(&context, &[1.0, 2.0]).unwrap();
        assert_eq!(run(&context, &[2.0]).unwrap()[0], both[1]);
        assert_eq!(both[0][0].count(), 200);
        assert!((both[0][0].mean() + both[0][1].mean() - 2.0).abs() < 1e-12);
        assert!(both[0][0].estimate().z_score(1.5).abs() < 4.0);
    }

    #[test]
    fn schemes_share_the_noise_of_a_trial() {
        let one =
            |p: &f64, scheme: &f64, it: Trial| Ok::<_, Infallible>([scheme * (p + it.stream.rng().random::<f64>())]);
        let all = Context::new(1)
            .compare("demo", 100, &[0.0], |p| format!("{p}"), &[1.0, 2.0, 1.0], one)
            .unwrap();
        assert_eq!(all[0].difference(0, 2, 0).variance(), 0.0);
        assert_eq!(all[0].difference(1, 0, 0), all[0].moments(0, 0));
    }

    #[test]
    fn progress_is_told_and_cancelling_ends_it() {
        let (seen, stop) = (AtomicU64::new(0), AtomicBool::new(false));
        let told = |trials: u64| {
            seen.fetch_add(trials, Ordering::Relaxed);
        };
        let context = Context {
            progress: Some(&told),
            cancel: Some(&stop),
            ..Context::new(1)
        };
        run(&context, &[1.0]).unwrap();
        assert_eq!(seen.load(Ordering::Relaxed), 200);
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(run(&context, &[1.0]), Err(Error::Cancelled)));
        assert!(context.check().is_err());
    }
}
