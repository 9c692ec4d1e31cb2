//! A belief in a message, before encoding.

use fewbits_mixture_codec::wire::RoundedMixture;

/// A belief and how the samples fitted so far.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedBelief {
    /// The belief.
    pub content: Content,
    /// Sum of squared residuals so far, rounded to single precision.
    pub chi_squared: f64,
    /// Number of samples in that sum.
    pub samples: usize,
}

/// The belief of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// A mixture over the position.
    Position(RoundedMixture<2>),
    /// A mixture over position and rate.
    WithRate(RoundedMixture<3>),
    /// The numbers of an added form.
    Added(AddedNumbers),
}

/// The numbers of an added form ([`AddedForm`](crate::form::AddedForm)).
#[derive(Debug, Clone, PartialEq)]
pub struct AddedNumbers {
    /// Number of components.
    pub components: usize,
    /// The form's own number, below 31.
    pub code: usize,
    /// Whether the rate is the third coordinate.
    pub with_rate: bool,
    /// All others.
    pub numbers: Vec<f64>,
}
