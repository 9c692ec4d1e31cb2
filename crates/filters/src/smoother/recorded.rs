//! A whole recording of filtered beliefs, smoothed at once or with a lag.

use super::smooth_step;
use fewbits_core::{Error, Evolution, Gaussian, ScaledNoise};
use fewbits_numerics::error::refuse;

/// Relative size of what times are rounded by, at most.
const ROUNDING: f64 = 1e-15;

/// A filtered belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filtered<const D: usize> {
    /// Time in seconds.
    pub seconds: f64,
    /// The belief after the observations of this time.
    pub belief: Gaussian<D>,
    /// Factor of the process noise from the time before to this one, as learnt.
    pub noise_scale: f64,
    /// Whether the belief was started anew at this time: nothing later says anything about what was before.
    pub is_new: bool,
}

/// The beliefs given all observations (fixed interval), or given those up to `lag` seconds later (fixed lag). One for each of `filtered`.
///
/// # Errors
/// If times do not rise, the lag is negative or not a number, or the dynamics over a step are refused.
pub fn smooth<const D: usize>(
    world: &impl Evolution<D>,
    filtered: &[Filtered<D>],
    lag: Option<f64>,
) -> Result<Vec<Gaussian<D>>, Error> {
    if let Some(pair) = filtered.windows(2).find(|pair| {
        pair[0]
            .seconds
            .partial_cmp(&pair[1].seconds)
            .is_none_or(|order| order.is_gt())
    }) {
        return refuse("seconds", pair[1].seconds, format!("{} or later", pair[0].seconds));
    }
    let Some(lag) = lag else {
        return back(world, filtered, filtered.len());
    };
    if lag.is_nan() || lag < 0.0 {
        return refuse("lag", lag, "a number of seconds, zero or more");
    }
    let mut found = Vec::with_capacity(filtered.len());
    let mut last = 0;
    for (k, one) in filtered.iter().enumerate() {
        last = last.max(k);
        // Times in decimals are rounded: what is just so much later counts.
        let end = one.seconds + lag + ROUNDING * (lag + one.seconds.abs());
        while last + 1 < filtered.len() && filtered[last + 1].seconds <= end {
            last += 1;
        }
        found.extend(back(world, &filtered[k..=last], 1)?);
    }
    Ok(found)
}

/// Goes back from the last belief to the first, and keeps the first `kept`.
fn back<const D: usize>(
    world: &impl Evolution<D>,
    filtered: &[Filtered<D>],
    kept: usize,
) -> Result<Vec<Gaussian<D>>, Error> {
    let Some(last) = filtered.last() else {
        return Ok(Vec::new());
    };
    let mut next = last.belief;
    let mut found = vec![next];
    for pair in filtered.windows(2).rev() {
        let [one, after] = pair else { continue };
        next = if after.is_new {
            one.belief
        } else {
            let dynamics = world.over(after.seconds - one.seconds)?;
            let dynamics = ScaledNoise::new(&*dynamics, after.noise_scale);
            smooth_step(&dynamics, &one.belief, &next)?
        };
        found.push(next);
    }
    found.reverse();
    found.truncate(kept);
    Ok(found)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use fewbits_core::{ArgumentError, Dynamics, GaussianDynamics};
    use nalgebra::{DMatrix, DVector, Matrix1, SMatrix, SVector, Vector1};
    use rand::Rng;

    /// A random walk whose variance grows by .5 a second.
    struct Walk;
    struct Stretch(f64);

    impl Dynamics<1> for Stretch {
        fn mean(&self, state: &SVector<f64, 1>) -> SVector<f64, 1> {
            *state
        }

        fn propagate(&self, _: &mut dyn Rng, state: &SVector<f64, 1>) -> SVector<f64, 1> {
            *state
        }
    }

    impl GaussianDynamics<1> for Stretch {
        fn jacobian(&self, _: &SVector<f64, 1>) -> SMatrix<f64, 1, 1> {
            Matrix1::new(1.0)
        }

        fn noise_covariance_at(&self, _: &SVector<f64, 1>) -> SMatrix<f64, 1, 1> {
            Matrix1::new(self.0)
        }
    }

    impl Evolution<1> for Walk {
        fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<1> + '_>, ArgumentError> {
            Ok(Box::new(Stretch(0.5 * seconds)))
        }
    }

    const TIMES: [f64; 5] = [0.0, 1.0, 1.5, 4.0, 4.0];
    const VALUES: [f64; 5] = [0.3, 1.1, -0.4, 2.0, 1.2];

    fn filtered(scales: [f64; 5]) -> Vec<Filtered<1>> {
        let (mut mean, mut variance, mut before) = (0.0, 2.0, 0.0);
        let one = |((seconds, value), noise_scale): ((f64, f64), f64)| {
            variance += 0.5 * noise_scale * (seconds - before);
            before = seconds;
            let gain: f64 = variance / (variance + 0.7);
            mean += gain * (value - mean);
            variance *= 1.0 - gain;
            let belief = Gaussian::new(Vector1::new(mean), Matrix1::new(variance)).unwrap();
            Filtered {
                seconds,
                belief,
                noise_scale,
                is_new: false,
            }
        };
        TIMES.into_iter().zip(VALUES).zip(scales).map(one).collect()
    }

    /// The joint law of all levels given the first `count` values, conditioned at once.
    fn joint(scales: [f64; 5], count: usize) -> (DVector<f64>, DMatrix<f64>) {
        let mut own = vec![2.0];
        for k in 1..5 {
            own.push(own[k - 1] + 0.5 * scales[k] * (TIMES[k] - TIMES[k - 1]));
        }
        let prior = DMatrix::from_fn(5, 5, |i, j| own[i.min(j)]);
        let h = DMatrix::from_fn(count, 5, |i, j| f64::from(u8::from(i == j)));
        let spread = &h * &prior * h.transpose() + DMatrix::identity(count, count) * 0.7;
        let gain = &prior * h.transpose() * spread.try_inverse().unwrap();
        let mean = &gain * DVector::from_row_slice(&VALUES[..count]);
        (mean, &prior - &gain * &h * &prior)
    }

    #[test]
    fn smoothed_beliefs_are_those_of_the_joint_law() {
        for scales in [[1.0; 5], [1.0, 1.0, 3.0, 0.2, 1.0]] {
            let filtered = filtered(scales);
            let all = smooth(&Walk, &filtered, None).unwrap();
            let (mean, covariance) = joint(scales, 5);
            for (k, found) in all.iter().enumerate() {
                assert!((found.mean()[0] - mean[k]).abs() < 1e-12, "{k}");
                assert!((found.covariance()[0] - covariance[(k, k)]).abs() < 1e-12, "{k}");
            }
            // Up to a second later: the first knows two values, the second three.
            let lagged = smooth(&Walk, &filtered, Some(1.0)).unwrap();
            for (k, count) in [2, 3, 3, 5, 5].into_iter().enumerate() {
                assert!((lagged[k].mean()[0] - joint(scales, count).0[k]).abs() < 1e-12, "{k}");
            }
        }
    }

    /// Defect: 0.1 + 0.2 is less than 0.3 by its rounding, so that a lag of 0.2 s did not reach the row that is so much later.
    #[test]
    fn a_lag_reaches_the_row_at_its_end() {
        let mut rows = filtered([1.0; 5]);
        for (seconds, row) in [0.7, 0.8, 0.9, 1.0, 1.1].into_iter().zip(&mut rows) {
            row.seconds = seconds;
        }
        let near = smooth(&Walk, &rows, Some(0.2)).unwrap();
        let beyond = smooth(&Walk, &rows, Some(0.25)).unwrap();
        assert_eq!(near, beyond);
    }

    #[test]
    fn nothing_is_told_across_a_new_start() {
        let mut filtered = filtered([1.0; 5]);
        filtered[3].is_new = true;
        let all = smooth(&Walk, &filtered, None).unwrap();
        assert_eq!(all[2], filtered[2].belief);
        assert!(smooth(&Walk, &filtered, Some(-1.0)).is_err());
        filtered.swap(0, 4);
        assert!(smooth(&Walk, &filtered, None).is_err());
        assert!(smooth(&Walk, &[], None).unwrap().is_empty());
    }
}
