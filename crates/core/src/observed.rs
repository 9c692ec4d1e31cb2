//! A factor of the measurements of a sensor.

/// A factor composed with a sensing model `h`: `p(observation | x) = p(observation | m = h(x))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed<S, F, const M: usize> {
    /// The sensing model, `h`.
    pub sensing: S,
    /// The likelihood of the observation as a function of `h(x)`.
    pub factor: F,
}

impl<S, F, const M: usize> Observed<S, F, M> {
    /// The likelihood of `factor` at the noise-free measurement of `sensing`.
    pub fn new(sensing: S, factor: F) -> Self {
        Self { sensing, factor }
    }
}
