//! Models of one's own: a function written once over a generic number gets its Jacobian.
//!
//! Derivatives are exact (forward mode, `num-dual`): the function runs once per coordinate with a number that carries its derivative.

use crate::Error;
use fewbits_core::{Dynamics, GaussianDynamics, Sensing};
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_numerics::factored::Factored;
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;
pub use num_dual::DualNum;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// The numbers that a [`Differentiable`] function is written over: `f64`, and `f64` with a derivative.
///
/// They have the operators of `f64`, with `f64` on the right too, and the functions of [`DualNum`] (`sin`, `exp`, `sqrt`, `atan2`, ...).
pub trait Number: DualNum<Primitive = f64> + Copy {}

impl<T: DualNum<Primitive = f64> + Copy> Number for T {}

/// A smooth function from `R^D` to `R^M`, written once for all [`Number`]s.
///
/// The function must not branch on whether a number carries a derivative. Where it has a kink, the Jacobian is that of the branch taken.
pub trait Differentiable<const D: usize, const M: usize>: Send + Sync {
    /// The value at `x`.
    fn at<N: Number>(&self, x: &[N; D]) -> [N; M];

    /// The value at a vector of plain numbers.
    fn value(&self, x: &SVector<f64, D>) -> SVector<f64, M> {
        SVector::from(self.at(&(*x).into()))
    }

    /// The Jacobian, M x D.
    fn derivative(&self, x: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        let mut jacobian = SMatrix::zeros();
        for d in 0..D {
            let seeded = std::array::from_fn(|i| Dual64::new(x[i], if i == d { 1.0 } else { 0.0 }));
            for (k, y) in self.at(&seeded).iter().enumerate() {
                jacobian[(k, d)] = y.eps;
            }
        }
        jacobian
    }
}

/// Draws `N(mean, factor factor')`.
fn draw<const D: usize>(rng: &mut dyn Rng, mean: SVector<f64, D>, factor: &SMatrix<f64, D, D>) -> SVector<f64, D> {
    mean + factor * SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Dynamics `x' = f(x) + u`, `u ~ N(0, Q)`, of a [`Differentiable`] `f`.
///
/// A damped pendulum, as its equation of motion; [`Flow`] integrates it:
///
/// ```
/// use fewbits_core::{Dynamics, GaussianDynamics};
/// use fewbits_models::{AutoDynamics, Differentiable, Flow, Number};
/// use nalgebra::{Matrix2, Vector2};
///
/// struct Pendulum;
/// impl Differentiable<2, 2> for Pendulum {
///     fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
///         [x[1], -x[0].sin() * 9.81 - x[1] * 0.1]
///     }
/// }
/// let dynamics = AutoDynamics::new(Flow::new(Pendulum, 0.05, 2)?, Matrix2::identity() * 1e-4)?;
/// let hanging = Vector2::zeros();
/// assert_eq!(dynamics.mean(&hanging), hanging);
/// assert!((dynamics.jacobian(&hanging)[(1, 0)] + 0.05 * 9.81).abs() < 0.01);
/// # Ok::<(), fewbits_models::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoDynamics<F, const D: usize> {
    function: F,
    noise_covariance: SMatrix<f64, D, D>,
    noise_factor: SMatrix<f64, D, D>,
}

impl<F: Differentiable<D, D>, const D: usize> AutoDynamics<F, D> {
    /// The dynamics with mean `function` and process noise `Q` (D x D), which may be singular.
    ///
    /// # Errors
    /// If `Q` is not finite, symmetric and positive semidefinite.
    pub fn new(function: F, noise_covariance: SMatrix<f64, D, D>) -> Result<Self, Error> {
        let noise_factor = semidefinite_factor("noise_covariance", &noise_covariance)?;
        Ok(Self {
            function,
            noise_covariance,
            noise_factor,
        })
    }
}

impl<F: Differentiable<D, D>, const D: usize> Dynamics<D> for AutoDynamics<F, D> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, D> {
        self.function.value(state)
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, D> {
        draw(rng, self.function.value(state), &self.noise_factor)
    }
}

impl<F: Differentiable<D, D>, const D: usize> GaussianDynamics<D> for AutoDynamics<F, D> {
    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.function.derivative(state)
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        self.noise_covariance
    }
}

/// Sensing `z = h(x) + w`, `w ~ N(0, R)`, of a [`Differentiable`] `h`.
///
/// If `h` is an angle, say so with [`Periodic`](fewbits_core::circle::Periodic) about this model: where it jumps by a turn, residuals are a turn off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoSensing<F, const M: usize> {
    function: F,
    noise_covariance: SMatrix<f64, M, M>,
    noise_factor: SMatrix<f64, M, M>,
}

impl<F, const M: usize> AutoSensing<F, M> {
    /// The sensor of `function` in noise of covariance `R` (M x M).
    ///
    /// # Errors
    /// If `R` is not finite, symmetric and positive definite.
    pub fn new(function: F, noise_covariance: SMatrix<f64, M, M>) -> Result<Self, Error> {
        let noise_factor = Factored::new("noise_covariance", &noise_covariance)?.lower;
        Ok(Self {
            function,
            noise_covariance: symmetrised(&noise_covariance),
            noise_factor,
        })
    }
}

impl<F: Differentiable<D, M>, const D: usize, const M: usize> Sensing<D, M> for AutoSensing<F, M> {
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.function.value(state)
    }

    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        self.function.derivative(state)
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> SMatrix<f64, M, M> {
        self.noise_covariance
    }

    fn sample(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, M> {
        draw(rng, self.function.value(state), &self.noise_factor)
    }
}

/// The state after a time under `dx/dt = rate(x)`, by the classical Runge-Kutta rule of order four.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow<F> {
    rate: F,
    step: f64,
    steps: usize,
}

impl<F> Flow<F> {
    /// The flow over `seconds` in `steps` equal steps.
    ///
    /// # Errors
    /// If `seconds` is not positive and finite, or `steps` is zero.
    pub fn new(rate: F, seconds: f64, steps: usize) -> Result<Self, Error> {
        at_least_one("steps", steps)?;
        let step = positive("seconds", seconds)? / steps as f64;
        Ok(Self { rate, step, steps })
    }
}

impl<F: Differentiable<D, D>, const D: usize> Differentiable<D, D> for Flow<F> {
    fn at<N: Number>(&self, x: &[N; D]) -> [N; D] {
        let (h, mut x) = (self.step, *x);
        let ahead = |x: &[N; D], slope: &[N; D], by: f64| -> [N; D] { std::array::from_fn(|d| x[d] + slope[d] * by) };
        for _ in 0..self.steps {
            let first = self.rate.at(&x);
            let second = self.rate.at(&ahead(&x, &first, 0.5 * h));
            let third = self.rate.at(&ahead(&x, &second, 0.5 * h));
            let fourth = self.rate.at(&ahead(&x, &third, h));
            x = std::array::from_fn(|d| x[d] + (first[d] + second[d] * 2.0 + third[d] * 2.0 + fourth[d]) * (h / 6.0));
        }
        x
    }
}
