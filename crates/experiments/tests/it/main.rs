//! What was a table among the figures: statements about systems beyond their papers, simulated and compared with the references.

#![allow(clippy::unwrap_used, clippy::panic)]

mod cfwmd;
mod dymbo;
mod handoff;
mod network;

use fewbits_experiments::{Context, Error, Measured, reference};
use fewbits_monte_carlo::Trial;

/// A value agrees with the reference under `key`: within its tolerance and four of the standard errors together.
fn assert_agrees(key: &str, own: impl Into<Measured>) {
    let (own, known) = (own.into(), reference::find(key).unwrap_or_else(|| panic!("no reference {key}")));
    let error = own.error().hypot(known.standard_error.unwrap_or(0.0));
    let allowed = known.tolerance + 4.0 * error;
    assert!(
        (own.value - known.value).abs() <= allowed,
        "{key}: {} instead of {} within {allowed}",
        own.value,
        known.value
    );
}

/// The same where there is a reference.
fn assert_agrees_if_known(key: &str, own: impl Into<Measured>) {
    if reference::find(key).is_some() {
        assert_agrees(key, own);
    }
}

/// What every one of so many trials of this name gave.
fn trials<T: Send>(name: &str, count: u64, run: impl Fn(Trial) -> Result<T, Error> + Sync) -> Vec<T> {
    let context = Context::new(1);
    context.trials(context.stream(name), count, run).unwrap()
}

/// A number that was not simulated.
fn exact(value: f64) -> Measured {
    Measured::new(value, None)
}
