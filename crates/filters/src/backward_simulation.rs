//! Smoothing of particles by backward simulation.

use crate::Error;
use fewbits_core::GaussianDynamics;
use fewbits_densities::Particles;
use fewbits_numerics::error::{at_least_one, refuse};
use nalgebra::SVector;
use rand::{Rng, RngExt};

/// Paths drawn from the law of all states given all observations, from the filtered particles of each time (Godsill, Doucet and West 2004).
///
/// ```text
/// last:        x_T ~ filtered_T
/// k = T-1..1:  x_k is particle i with probability proportional to  w_i N(x_{k+1}; f(x_i), Q(x_i))
/// ```
/// `dynamics[k]` moves from `filtered[k]` to `filtered[k + 1]`. One belief per time comes back: particle `j` of all of them together is path `j`,
/// of equal weights. Takes `paths` times the number of particles per time. Filtered particles must be those after an update and before
/// resampling, so that a time has as many different ones as it can.
///
/// # Errors
/// If there are not one dynamics fewer than beliefs, or no paths; if a noise covariance is singular, since two states then have no density
/// of moving from one to the other; [`Error::Impossible`] if no particle can have moved to a state that was drawn.
pub fn backward_simulation<const D: usize>(
    rng: &mut dyn Rng,
    dynamics: &[&dyn GaussianDynamics<D>],
    filtered: &[Particles<D>],
    paths: usize,
) -> Result<Vec<Particles<D>>, Error> {
    at_least_one("paths", paths)?;
    let Some(last) = filtered.last() else {
        return refuse("filtered", "no beliefs", "at least one");
    };
    if dynamics.len() + 1 != filtered.len() {
        return refuse("dynamics", dynamics.len(), format!("{}, one fewer than beliefs", filtered.len() - 1));
    }
    let mut drawn: Vec<SVector<f64, D>> = Vec::with_capacity(paths);
    for _ in 0..paths {
        drawn.push(picked(rng, last, last.weights())?);
    }
    let mut found = vec![equal(&drawn)?];
    let mut weights = Vec::new();
    for (dynamics, belief) in dynamics.iter().zip(filtered).rev() {
        let mut from = Vec::with_capacity(belief.len());
        for i in 0..belief.len() {
            let Some(state) = belief.point(i) else { continue };
            let Some(factor) = dynamics.noise_covariance_at(&state).cholesky() else {
                return refuse("noise covariance", "singular", "a covariance of full rank in every step");
            };
            let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|root| root.ln()).sum();
            from.push((dynamics.mean(&state), factor, belief.log_weights()[i] - log_determinant));
        }
        for state in &mut drawn {
            weights.clear();
            let mut highest = f64::NEG_INFINITY;
            for (mean, factor, log) in &from {
                let off = *state - mean;
                let log = log - 0.5 * off.dot(&factor.solve(&off));
                highest = highest.max(log);
                weights.push(log);
            }
            if !highest.is_finite() {
                return Err(Error::Impossible);
            }
            weights.iter_mut().for_each(|log| *log = (*log - highest).exp());
            *state = picked(rng, belief, &weights)?;
        }
        found.push(equal(&drawn)?);
    }
    found.reverse();
    Ok(found)
}

/// One particle with a probability proportional to its weight.
fn picked<const D: usize>(rng: &mut dyn Rng, belief: &Particles<D>, weights: &[f64]) -> Result<SVector<f64, D>, Error> {
    let total: f64 = weights.iter().sum();
    let mut left = rng.random::<f64>() * total;
    let mut chosen = None;
    for (i, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        chosen = Some(i);
        left -= weight;
        if left < 0.0 {
            break;
        }
    }
    chosen.and_then(|i| belief.point(i)).ok_or(Error::Impossible)
}

fn equal<const D: usize>(states: &[SVector<f64, D>]) -> Result<Particles<D>, Error> {
    Particles::uniform(std::array::from_fn(|axis| states.iter().map(|state| state[axis]).collect()))
}
