//! How finely a model is discretised.

/// Steps and half-widths of the quadrature rules, in units of those that are exact to 1e-12.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolution {
    pub(super) step: f64,
    pub(super) reach: f64,
}

impl Resolution {
    /// Exact to 1e-12.
    pub(crate) const FULL: Self = Self { step: 1.0, reach: 1.0 };
    /// To about 1e-5, for searches.
    pub(crate) const COARSE: Self = Self { step: 2.0, reach: 0.7 };
    /// To about one per cent, for searches over many joint symbols.
    pub(crate) const ROUGH: Self = Self { step: 3.0, reach: 0.42 };
}
