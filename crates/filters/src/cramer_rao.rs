//! Posterior Cramer-Rao recursions: a lower bound on the mean squared error of any filter.
//!
//! Tichavsky, Muravchik and Nehorai (1998) compute the inverse of the bound recursively. For dynamics with a
//! density, `J_k = D22 - D21 (J_{k-1} + D11)^-1 D12`. For linear dynamics and observations of Fisher information
//! `I_k = E[-d^2 ln p(observed | x) / dx^2]`, the same recursion is done on the bound itself ([`covariance_step`]). It needs no
//! inverse of the process noise, which may then be singular.

use crate::Error;
use fewbits_core::LinearDynamics;
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use nalgebra::{Cholesky, SMatrix};

/// One step of the bound: `P = F P F' + Q`, then `P - P L (1 + L' P L)^-1 L' P` with `L L' = information`.
///
/// `information` is the expected Fisher information about the state in all observations of this step.
///
/// # Errors
/// If a matrix is not symmetric positive semidefinite.
pub fn covariance_step<const D: usize>(
    dynamics: &impl LinearDynamics<D>,
    bound: &SMatrix<f64, D, D>,
    information: &SMatrix<f64, D, D>,
) -> Result<SMatrix<f64, D, D>, Error> {
    semidefinite_factor("bound", bound)?;
    let root = semidefinite_factor("information", information)?;
    let transition = dynamics.transition();
    let predicted = transition * bound * transition.transpose() + dynamics.noise_covariance();
    // The Kalman update of a measurement with H = L' and unit noise.
    let cross = predicted * root;
    let inner = SMatrix::<f64, D, D>::identity() + root.transpose() * cross;
    let factor = Cholesky::new(inner).ok_or(Error::SingularInnovation)?;
    Ok(symmetrised(&(predicted - cross * factor.solve(&cross.transpose()))))
}
