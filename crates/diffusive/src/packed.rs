//! A belief as the numbers of a message.

/// A belief as numbers, before encoding.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedBelief {
    /// Number of components.
    pub components: usize,
    /// Number of another form's own ([`AddedForm`](crate::form::AddedForm)), below 31; `None` for a mixture.
    pub code: Option<usize>,
    /// Whether the rate is the third coordinate.
    pub with_rate: bool,
    /// Of a mixture: all weights but the first, then means and lower Cholesky factors.
    pub numbers: Vec<f64>,
    /// Sum of squared residuals so far, rounded to single precision.
    pub chi_squared: f64,
    /// Number of samples in that sum.
    pub samples: usize,
}
