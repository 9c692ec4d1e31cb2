//! The fixed point of the Riccati recursion of a scalar, in closed form.

use crate::Error;
use fewbits_numerics::error::{finite, non_negative, positive, within};
use serde::{Deserialize, Serialize};

/// Steady variances of a scalar filter, in state units squared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScalarSteadyState {
    /// Variance `P` before a message.
    pub predicted_variance: f64,
    /// Variance `M` after a message.
    pub filtered_variance: f64,
}

/// The steady state of `P = a^2 M + q`, `M = P - c P^2/(P + r)`.
///
/// `information` is the fraction `c` of the variance reduction of an unquantized measurement that a message achieves: 1 for the Kalman
/// filter, `2/pi` for a sign bit at the prediction, `1 - distortion` for a Lloyd-Max cell. With `p = P/r` and `g = q/r` the result is the
/// positive root of `A p^2 + B p - g = 0`, `A = 1 - a^2 (1 - c)`, `B = 1 - g - a^2`, computed without cancellation.
///
/// # Errors
/// If `q < 0`, `r <= 0`, or `c` is outside `[0, 1]`; [`Error::NoSteadyState`] if the recursion diverges or a variance overflows.
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
    // hypot: the square of g may overflow even if the root does not.
    let root = linear.hypot(2.0 * (leading.max(0.0) * g).sqrt());
    let p = if linear > 0.0 {
        2.0 * g / (linear + root)
    } else {
        (root - linear) / (2.0 * leading)
    };
    let predicted_variance = r * p;
    if leading <= 0.0 || !predicted_variance.is_finite() {
        return Err(Error::NoSteadyState);
    }
    let kept = 1.0 + (1.0 - c) * p;
    let product = predicted_variance * kept;
    Ok(ScalarSteadyState {
        predicted_variance,
        filtered_variance: if product.is_finite() {
            product / (1.0 + p)
        } else {
            predicted_variance * (kept / (1.0 + p))
        },
    })
}

#[cfg(test)]
mod tests {
    use super::scalar_steady_state;
    use crate::Error;
    use proptest::prelude::*;

    #[test]
    fn an_unstable_state_with_lost_messages_has_no_steady_state() {
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
        // The variance before a message is finite, and its square is not.
        assert!((at(0.0, 1e200, 0.25).filtered_variance / 0.75e200 - 1.0).abs() < 1e-12);
        assert_eq!(scalar_steady_state(0.99, 1e307, 1e307, 0.0), Err(Error::NoSteadyState));
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
    }
}
