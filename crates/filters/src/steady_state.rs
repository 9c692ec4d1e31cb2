//! Where the Riccati recursion settles: closed form for a scalar, doubling for a vector.

use crate::Error;
use fewbits_core::{LinearDynamics, LinearSensing};
use fewbits_numerics::error::{finite, non_negative, positive, within};
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{Cholesky, Const, DimMin, SMatrix};

/// Steady variances of a scalar filter, in state units squared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarSteadyState {
    /// Variance `P` before a message.
    pub predicted_variance: f64,
    /// Variance `M` after a message.
    pub filtered_variance: f64,
}

/// The steady state of `P = a^2 M + q`, `M = P - c P^2/(P + r)`.
///
/// `information` is the fraction `c` of the variance reduction of an unquantized measurement that a message brings: 1 is the
/// Kalman filter, `2/pi` a sign bit at the prediction, `1 - distortion` a Lloyd-Max cell. With `p = P/r` and `g = q/r` the
/// positive root of `A p^2 + B p - g = 0`, `A = 1 - a^2 (1 - c)`, `B = 1 - g - a^2`, in the form that does not cancel.
///
/// # Errors
/// Arguments out of range (`q < 0`, `r <= 0`, `c` outside `[0, 1]`); [`Error::NoSteadyState`] where the recursion diverges.
pub fn scalar_steady_state(
    coefficient: f64,
    process_variance: f64,
    noise_variance: f64,
    information: f64,
) -> Result<ScalarSteadyState, Error> {
    let a = finite("coefficient", coefficient)?;
    let r = positive("noise_variance", noise_variance)?;
    let g = non_negative("process_variance", process_variance)? / r;
    let c = within("information", information, 0.0, 1.0)?;
    let (leading, linear) = (1.0 - a * a * (1.0 - c), (1.0 - a) * (1.0 + a) - g);
    // hypot: the square of g may overflow where the root does not.
    let root = linear.hypot(2.0 * (leading.max(0.0) * g).sqrt());
    let p = if linear > 0.0 {
        2.0 * g / (linear + root)
    } else {
        (root - linear) / (2.0 * leading)
    };
    if leading <= 0.0 || !p.is_finite() {
        return Err(Error::NoSteadyState);
    }
    Ok(ScalarSteadyState {
        predicted_variance: r * p,
        filtered_variance: r * p * (1.0 + (1.0 - c) * p) / (1.0 + p),
    })
}

/// Steady covariances of a vector filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyState<const D: usize> {
    /// Covariance before a measurement: the stabilising root of the discrete algebraic Riccati equation.
    pub predicted_covariance: SMatrix<f64, D, D>,
    /// Covariance after a measurement.
    pub filtered_covariance: SMatrix<f64, D, D>,
}

/// Doublings after which a recursion that has not settled is given up: the equivalent of `2^60` Riccati steps.
const DOUBLINGS: usize = 60;
/// Relative change below which the doubling has settled.
const SETTLED: f64 = 1e-15;

/// The steady state of the Kalman filter, by structure-preserving doubling.
///
/// ```text
/// A = F',  G = H' R^-1 H,  P = Q
/// repeat  W = I + G P
///         P = P + A' P W^-1 A
///         G = G + A W^-1 G A'
///         A = A W^-1 A
/// until P settles                       (k rounds equal 2^k Riccati steps)
/// ```
///
/// # Errors
/// [`Error::NoSteadyState`] if the recursion diverges or does not settle.
pub fn steady_state<const D: usize, const M: usize>(
    dynamics: &impl LinearDynamics<D>,
    sensing: &impl LinearSensing<D, M>,
) -> Result<SteadyState<D>, Error>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    let matrix = sensing.matrix();
    let noise = Cholesky::new(*sensing.noise_covariance()).ok_or(Error::SingularInnovation)?;
    let mut a = dynamics.transition().transpose();
    let mut g = matrix.transpose() * noise.solve(matrix);
    let mut p = *dynamics.noise_covariance();
    let mut settled = false;
    for _ in 0..DOUBLINGS {
        let w = (SMatrix::<f64, D, D>::identity() + g * p).lu();
        let (Some(w_a), Some(w_g)) = (w.solve(&a), w.solve(&g)) else {
            return Err(Error::NoSteadyState);
        };
        let increment = a.transpose() * p * w_a;
        g = symmetrised(&(g + a * w_g * a.transpose()));
        a *= w_a;
        p = symmetrised(&(p + increment));
        if !p.amax().is_finite() {
            return Err(Error::NoSteadyState);
        }
        settled = increment.amax() <= SETTLED * p.amax();
        if settled {
            break;
        }
    }
    if !settled {
        return Err(Error::NoSteadyState);
    }
    let cross = p * matrix.transpose();
    let innovation = Cholesky::new(matrix * cross + sensing.noise_covariance()).ok_or(Error::SingularInnovation)?;
    Ok(SteadyState {
        predicted_covariance: p,
        filtered_covariance: symmetrised(&(p - cross * innovation.solve(&cross.transpose()))),
    })
}

#[cfg(test)]
mod tests {
    use super::{scalar_steady_state, steady_state};
    use crate::{Error, kalman};
    use fewbits_core::Gaussian;
    use fewbits_models::{Ar1, LinearGaussian, LinearSensor, constant_velocity_2d};
    use nalgebra::{Matrix1, Matrix2, Matrix2x4, SMatrix, SVector};
    use proptest::prelude::*;

    #[test]
    fn doubling_is_a_fixed_point_of_the_filter() {
        let dynamics = constant_velocity_2d(0.5, 0.2).unwrap();
        let h = Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.3, 0.0, 1.0, 0.1);
        let sensing = LinearSensor::new(h, Matrix2::new(1.0, 0.4, 0.4, 2.0)).unwrap();
        let steady = steady_state(&dynamics, &sensing).unwrap();
        let belief = Gaussian::new(SVector::zeros(), steady.filtered_covariance).unwrap();
        let predicted = kalman::predict(&dynamics, &belief);
        assert!((predicted.covariance() - steady.predicted_covariance).amax() < 1e-12);
        let (updated, _) = kalman::update(&sensing, &predicted, &SVector::zeros()).unwrap();
        assert!((updated.covariance() - steady.filtered_covariance).amax() < 1e-12);
    }

    #[test]
    fn an_unobserved_unstable_state_has_no_steady_state() {
        let dynamics = LinearGaussian::with_covariance(Matrix2::new(1.1, 0.0, 0.0, 0.5), SMatrix::identity()).unwrap();
        let sensing = LinearSensor::scalar([0.0, 1.0].into(), 1.0).unwrap();
        assert_eq!(steady_state(&dynamics, &sensing), Err(Error::NoSteadyState));
        assert_eq!(scalar_steady_state(1.0, 1.0, 1.0, 0.0), Err(Error::NoSteadyState));
        assert_eq!(scalar_steady_state(2.0, 1.0, 1.0, 0.6), Err(Error::NoSteadyState));
        // Unstable, but a perfect link holds it.
        assert!(scalar_steady_state(2.0, 1.0, 1.0, 1.0).is_ok());
    }

    #[test]
    fn edges_of_the_closed_form() {
        let at = |a: f64, q: f64, c: f64| scalar_steady_state(a, q, 1.0, c).unwrap();
        assert_eq!(at(1.0, 0.0, 0.5).predicted_variance, 0.0);
        assert!((at(0.0, 3.0, 0.25).filtered_variance - 3.0 * (1.0 + 0.75 * 3.0) / 4.0).abs() < 1e-15);
        // Four digits would be lost here without the second form of the root.
        let small = at(0.5, 1e-14, 1.0).predicted_variance;
        assert!((small / (1e-14 / 0.75) - 1.0).abs() < 1e-12);
        assert!((at(0.9, 1e200, 1.0).filtered_variance - 1.0).abs() < 1e-12);
        for bad in [
            (f64::NAN, 1.0, 1.0, 1.0),
            (0.5, -1.0, 1.0, 1.0),
            (0.5, 1.0, 0.0, 1.0),
            (0.5, 1.0, 1.0, 1.1),
        ] {
            assert!(matches!(scalar_steady_state(bad.0, bad.1, bad.2, bad.3), Err(Error::Argument(_))));
        }
    }

    proptest! {
        #[test]
        fn closed_form_is_the_riccati_limit(a in -1.0..1.0_f64, q in 1e-3..20.0_f64, r in 1e-2..10.0_f64, c in 0.05..1.0_f64) {
            let steady = scalar_steady_state(a, q, r, c).unwrap();
            let p = a * a * steady.filtered_variance + q;
            prop_assert!((p - steady.predicted_variance).abs() < 1e-10 * p);
            if c > 0.999 { return Ok(()); }
            let kalman = scalar_steady_state(a, q, r, 1.0).unwrap();
            prop_assert!(steady.filtered_variance >= kalman.filtered_variance * (1.0 - 1e-12));
        }

        #[test]
        fn doubling_agrees_with_the_closed_form(a in -1.0..1.0_f64, q in 1e-3..20.0_f64, r in 1e-2..10.0_f64) {
            let closed = scalar_steady_state(a, q, r, 1.0).unwrap();
            let doubled = steady_state(&Ar1::new(a, q).unwrap(), &LinearSensor::direct(r).unwrap()).unwrap();
            prop_assert!((doubled.predicted_covariance - Matrix1::new(closed.predicted_variance)).amax() < 1e-11 * closed.predicted_variance);
            prop_assert!((doubled.filtered_covariance - Matrix1::new(closed.filtered_variance)).amax() < 1e-11 * closed.predicted_variance);
        }
    }
}
