//! Smoothing of recorded estimates: each belief is improved by what was observed after it (Rauch, Tung and Striebel).
//!
//! Only the filtered beliefs and the dynamics are needed, so it works behind every filter with Gaussian beliefs, whatever was observed: values,
//! bits, cells, silence. With linear dynamics and values it is exact.
//!
//! ```text
//! P+ = F P F' + Q,  C = P F' P+^-1
//! mean = mean + C (next mean - f(mean)),  P = (I - C F) P (I - C F)' + C (next P + Q) C'
//! ```

use fewbits_core::{Error, Evolution, Gaussian, GaussianDynamics};
use fewbits_numerics::error::refuse;
use fewbits_numerics::linalg::solve_semidefinite;
use nalgebra::SMatrix;

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
    if let Some(pair) = filtered.windows(2).find(|pair| !(pair[0].seconds <= pair[1].seconds)) {
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
        while last + 1 < filtered.len() && filtered[last + 1].seconds <= one.seconds + lag {
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
            step(world, one, after, &next)?
        };
        found.push(next);
    }
    found.reverse();
    found.truncate(kept);
    Ok(found)
}

fn step<const D: usize>(
    world: &impl Evolution<D>,
    one: &Filtered<D>,
    after: &Filtered<D>,
    smoothed: &Gaussian<D>,
) -> Result<Gaussian<D>, Error> {
    let dynamics = world.over(after.seconds - one.seconds)?;
    let (mean, covariance) = (one.belief.mean(), one.belief.covariance());
    let transition: SMatrix<f64, D, D> = dynamics.jacobian(mean);
    let noise = dynamics.noise_covariance_at(mean) * after.noise_scale;
    let predicted = transition * covariance * transition.transpose() + noise;
    let predicted = (predicted + predicted.transpose()) * 0.5;
    let gain = solve_semidefinite(&predicted, &(transition * covariance))?.transpose();
    // A sum of positive semidefinite terms, in which nothing cancels.
    let keep = SMatrix::<f64, D, D>::identity() - gain * transition;
    let future = smoothed.covariance() + noise;
    let found = keep * covariance * keep.transpose() + gain * future * gain.transpose();
    let next = mean + gain * (smoothed.mean() - dynamics.mean(mean));
    if !next.iter().chain(found.iter()).all(|number| number.is_finite()) {
        return Err(Error::NotANumber {
            what: "a smoothed moment",
        });
    }
    Ok(Gaussian::from_trusted_parts(next, (found + found.transpose()) * 0.5))
}
