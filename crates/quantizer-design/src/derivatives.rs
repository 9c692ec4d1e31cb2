//! A value with its derivatives.

/// A value with its first and second derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Derivatives {
    /// The value.
    pub value: f64,
    /// First derivatives.
    pub gradient: nalgebra::DVector<f64>,
    /// Second derivatives.
    pub hessian: nalgebra::DMatrix<f64>,
}
