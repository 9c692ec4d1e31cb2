//! How finely a model is discretised.

/// How finely a model is discretised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Resolution {
    /// Exact to 1e-12.
    Full,
    /// To about 1e-5, for searches.
    Coarse,
    /// To about one per cent, for searches over many joint symbols.
    Rough,
}

impl Resolution {
    /// Steps in units of the steps of the full resolution.
    pub(super) fn step(self) -> f64 {
        match self {
            Self::Full => 1.0,
            Self::Coarse => 2.0,
            Self::Rough => 3.0,
        }
    }

    /// Half-widths in units of those of the full resolution.
    pub(super) fn reach(self) -> f64 {
        match self {
            Self::Full => 1.0,
            Self::Coarse => 0.7,
            Self::Rough => 0.42,
        }
    }
}
