//! Parallel maps over a list, with results in order.

use std::sync::{Mutex, PoisonError};

/// Calls `one` with every item and returns the results in the items' order. With feature `rayon` the calls run on the threads of
/// the current pool. The result does not depend on the number of threads.
///
/// ```
/// let squares = fewbits_monte_carlo::parallel::map(&[1, 2, 3], |x| x * x);
/// assert_eq!(squares, [1, 4, 9]);
/// ```
pub fn map<I: Sync, T: Send>(items: &[I], one: impl Fn(&I) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = items.iter().map(|_| Mutex::new(None)).collect();
    for_all(items.len(), &|i| {
        let result = one(&items[i]);
        *results[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    let taken = results
        .into_iter()
        .map(|r| r.into_inner().unwrap_or_else(PoisonError::into_inner));
    taken.flatten().collect()
}

/// As [`map`], for calls that may fail.
///
/// # Errors
/// The error of the first item that fails. All other items are computed nevertheless.
pub fn try_map<I: Sync, T: Send, E: Send>(items: &[I], one: impl Fn(&I) -> Result<T, E> + Sync) -> Result<Vec<T>, E> {
    map(items, one).into_iter().collect()
}

/// Calls `body` with every index below `count`. It takes a trait object, so that the parallel loop is compiled only once.
fn for_all(count: usize, body: &(dyn Fn(usize) + Sync)) {
    #[cfg(feature = "rayon")]
    rayon::iter::ParallelIterator::for_each(rayon::iter::IntoParallelIterator::into_par_iter(0..count), body);
    #[cfg(not(feature = "rayon"))]
    (0..count).for_each(body);
}
