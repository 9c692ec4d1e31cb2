//! What was a table among the figures: statements about systems beyond their papers, simulated and compared with the references.

#![allow(clippy::unwrap_used, clippy::panic)]

mod cfwmd;
mod dymbo;
mod handoff;

use fewbits_experiments::{Measured, reference};

/// A value agrees with the reference under `key`: within its tolerance and four of the standard errors together.
fn assert_agrees(key: &str, own: impl Into<Measured>) {
    let (own, known) = (own.into(), reference::find(key).unwrap_or_else(|| panic!("no reference {key}")));
    let error = own
        .standard_error
        .unwrap_or(0.0)
        .hypot(known.standard_error.unwrap_or(0.0));
    let allowed = known.tolerance + 4.0 * error;
    assert!(
        (own.value - known.value).abs() <= allowed,
        "{key}: {} instead of {} within {allowed}",
        own.value,
        known.value
    );
}

/// A number that was not simulated.
fn exact(value: f64) -> Measured {
    Measured::new(value, None)
}
