//! Trials of an experiment, in parallel and on common random numbers.
//!
//! A trial runs *every* scheme on its own truth and noise, so schemes are compared on common random numbers. Trials are merged in
//! their order: the same bytes on any number of threads. A point of a sweep has a stream of its own, named after it, so that its
//! numbers do not depend on which other points are run.

use crate::error::Error;
use crate::figure::Context;
use fewbits_monte_carlo::{Moments, Stream, Trial};

impl Context<'_> {
    /// What every one of `count` trials on the streams of `stream` gave, in their order.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn trials<T: Send>(
        &self,
        stream: Stream,
        count: u64,
        trial: impl Fn(Trial) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        Ok(self.monte_carlo(stream, count).run(trial)?)
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
        match self.kept {
            Some(kept) => kept.once(name, make),
            None => make(),
        }
    }

    /// The moments of each number that a trial gives, over `count` trials on the streams of `stream`.
    ///
    /// # Errors
    /// If a trial fails or the run is cancelled.
    pub fn moments<N: AsRef<[f64]>>(
        &self,
        stream: Stream,
        count: u64,
        trial: impl Fn(Trial) -> Result<N, Error> + Sync,
    ) -> Result<Vec<Moments>, Error> {
        let add = |sums: &mut Vec<Moments>, it| {
            let numbers = trial(it)?;
            sums.resize(numbers.as_ref().len(), Moments::default());
            sums.iter_mut().zip(numbers.as_ref()).for_each(|(sum, x)| sum.add(*x));
            Ok::<_, Error>(())
        };
        let merge = |all: &mut Vec<Moments>, part: Vec<Moments>| {
            all.resize(part.len(), Moments::default());
            all.iter_mut().zip(&part).for_each(|(all, part)| all.merge(part));
        };
        Ok(self.monte_carlo(stream, count).fold(Vec::new, add, merge)?)
    }
}

/// The words of these with `by` between them.
pub fn joined<T: ToString>(words: impl IntoIterator<Item = T>, by: &str) -> String {
    let words: Vec<String> = words.into_iter().map(|word| word.to_string()).collect();
    words.join(by)
}

/// Every one of `first` with every one of `second`.
pub fn product<'a, A, B>(first: &'a [A], second: &'a [B]) -> Vec<(&'a A, &'a B)> {
    first.iter().flat_map(|a| second.iter().map(move |b| (a, b))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

    fn run(context: &Context<'_>) -> Result<Vec<Moments>, Error> {
        context.moments(context.stream("demo"), 200, |it| {
            let noise: f64 = it.stream.rng().random();
            Ok([1.0 + noise, 1.0 - noise])
        })
    }

    #[test]
    fn every_number_of_a_trial_has_its_moments() {
        let both = run(&Context::new(1)).unwrap();
        assert_eq!((both.len(), both[0].count()), (2, 200));
        assert!((both[0].mean() + both[1].mean() - 2.0).abs() < 1e-12);
        assert!(both[0].estimate().z_score(1.5).abs() < 4.0);
    }

    #[test]
    fn schemes_share_the_noise_of_a_trial() {
        let context = Context::new(1);
        let both = |it: Trial| Ok([1.0, 2.0].map(|scale| scale * it.stream.rng().random::<f64>()));
        let all = context.trials(context.stream("demo"), 100, both).unwrap();
        assert!(all.len() == 100 && all.iter().all(|[one, two]| *two == 2.0 * one));
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
        run(&context).unwrap();
        assert_eq!(seen.load(Ordering::Relaxed), 200);
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(run(&context), Err(Error::Cancelled)));
        assert!(context.check().is_err());
    }
}
