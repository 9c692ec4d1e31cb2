//! Resolution of the quadrature rules.

use crate::error::Error;

/// Largest number of nodes of a rule.
pub(super) const NODE_LIMIT: usize = 1 << 20;

/// Step and half-width of the quadrature rules, relative to those with errors of 1e-12.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolution {
    pub(super) step: f64,
    pub(super) reach: f64,
}

impl Resolution {
    /// Errors of about 1e-12.
    pub(crate) const FULL: Self = Self { step: 1.0, reach: 1.0 };
    /// Errors of about 1e-5, for searches.
    pub(crate) const COARSE: Self = Self { step: 2.0, reach: 0.7 };
    /// Errors of about one per cent, for searches over many joint symbols.
    pub(crate) const ROUGH: Self = Self { step: 3.0, reach: 0.42 };
}

/// `0, +-step, +-2 step, ...` as far as `reach`.
pub(super) fn grid(reach: f64, step: f64) -> Result<Vec<f64>, Error> {
    let half = (reach / step).floor();
    if !(half.is_finite() && half < NODE_LIMIT as f64 / 2.0) {
        return too_fine(2.0 * half);
    }
    let half = half as i64;
    Ok((-half..=half).map(|i| i as f64 * step).collect())
}

pub(super) fn too_fine<T>(needed: f64) -> Result<T, Error> {
    Err(Error::TooLarge {
        table: "quadrature rule",
        needed: needed.min(1e18) as u64,
        limit: NODE_LIMIT as u64,
    })
}
