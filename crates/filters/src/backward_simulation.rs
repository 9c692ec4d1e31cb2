//! Smoothing of particles by backward simulation.

use crate::Error;
use fewbits_core::columns::state_at;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_densities::{Categorical, Particles};
use fewbits_numerics::error::{at_least_one, refuse};
use nalgebra::SVector;
use rand::Rng;

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
    let last_weights = Categorical::new(last.weights());
    let mut drawn: Vec<_> = (0..paths)
        .map(|_| state_at(&last.columns(), last_weights.draw(rng)))
        .collect();
    let mut found = vec![equal(&drawn)?];
    for (dynamics, belief) in dynamics.iter().zip(filtered).rev() {
        let (columns, mut from) = (belief.columns(), Vec::with_capacity(belief.len()));
        for (i, log) in belief.log_weights().iter().enumerate() {
            let state = state_at(&columns, i);
            let law = Gaussian::from_trusted_parts(dynamics.mean(&state), dynamics.noise_covariance_at(&state));
            let Ok(law) = law.factored() else {
                return refuse("noise covariance", "singular", "a covariance of full rank in every step");
            };
            from.push((law, *log));
        }
        for state in &mut drawn {
            let mut logs: Vec<f64> = from.iter().map(|(law, log)| log + law.log_pdf(state)).collect();
            let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !highest.is_finite() {
                return Err(Error::Impossible);
            }
            logs.iter_mut().for_each(|log| *log = (*log - highest).exp());
            *state = state_at(&columns, Categorical::new(&logs).draw(rng));
        }
        found.push(equal(&drawn)?);
    }
    found.reverse();
    Ok(found)
}

fn equal<const D: usize>(states: &[SVector<f64, D>]) -> Result<Particles<D>, Error> {
    Particles::uniform(std::array::from_fn(|axis| states.iter().map(|state| state[axis]).collect()))
}
