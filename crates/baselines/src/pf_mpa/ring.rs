//! The exact error of drawing a range's message over the plane from a ring of uniform bearings.

use fewbits_numerics::error::refuse;
use fewbits_numerics::error::{finite, positive};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_pf_mpa::Error;

/// Radial densities of the message of a range in `[a, b)` with noise of constant deviation. `l(d) = P(d + v in [a, b))` for `d > 0`.
///
/// As printed, points are drawn with a uniform bearing and a radius of density `l`; over the plane this is `l(d) / d`. Correct is
/// `l(d)` over the plane, whose radial density is proportional to `d l(d)` (erratum `mpa-3`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RingBias {
    /// Mean radius as printed.
    pub printed: f64,
    /// Correct mean radius.
    pub exact: f64,
    /// Total variation distance between the two radial densities.
    pub total_variation: f64,
}

impl RingBias {
    /// The bias for the cell `[a, b)` and noise of the given deviation.
    ///
    /// # Errors
    /// If an end is not finite, `a < b` does not hold, `b` or the deviation is not positive, or a moment is not finite.
    pub fn new(a: f64, b: f64, deviation: f64) -> Result<Self, Error> {
        finite("a", a)?;
        positive("b", b)?;
        positive("deviation", deviation)?;
        if a >= b {
            return refuse("cell", format!("[{a}, {b})"), "a < b");
        }
        let likelihood = |d: f64| normal::interval((a - d) / deviation, (b - d) / deviation);
        let rule = gauss_legendre::<40>();
        let panels = |from: f64, f: &dyn Fn(f64) -> f64| {
            let mut breaks = vec![from.max(0.0)];
            for edge in [a, b] {
                breaks.extend([-9.0, -4.0, -1.5, 0.0, 1.5, 4.0, 9.0].map(|t| edge + t * deviation));
            }
            let first = breaks[0];
            breaks.retain(|x| *x >= first);
            breaks.sort_by(f64::total_cmp);
            breaks.windows(2).map(|e| rule.sum(e[0], e[1], f)).sum::<f64>()
        };
        let moment = |power: i32| panels(0.0, &|d: f64| d.powi(power) * likelihood(d));
        let (mass, first, second) = (moment(0), moment(1), moment(2));
        let printed = first / mass;
        // Beyond the printed mean the correct density is the larger one.
        let beyond = panels(printed, &|d: f64| likelihood(d) * (d / first - 1.0 / mass));
        if ![printed, second / first, beyond].iter().all(|x| x.is_finite()) {
            return refuse(
                "cell",
                format!("[{a}, {b})"),
                "a cell that a positive distance can cause, in numbers whose squares are in range",
            );
        }
        Ok(Self {
            printed,
            exact: second / first,
            total_variation: beyond,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::RingBias;

    #[test]
    fn without_noise_it_is_by_hand() {
        for scale in [1e-4, 1.0, 1e4] {
            let (a, b) = (1.0 * scale, 2.5 * scale);
            let ring = RingBias::new(a, b, 1e-6 * scale).unwrap();
            let exact = 2.0 / 3.0 * (b.powi(3) - a.powi(3)) / (b * b - a * a);
            assert!((ring.printed / (1.75 * scale) - 1.0).abs() < 1e-9);
            assert!((ring.exact / exact - 1.0).abs() < 1e-9);
            assert!((ring.total_variation - 0.107_142_857).abs() < 1e-6);
        }
        assert!(RingBias::new(2.0, 1.0, 0.1).is_err() && RingBias::new(-2.0, -1.0, 0.1).is_err());
        assert!(RingBias::new(1.0, 2.0, 0.0).is_err());
    }
}
