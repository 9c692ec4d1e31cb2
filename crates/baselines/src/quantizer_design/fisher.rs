//! Fisher information in the symbols, and the Bayesian Cramer-Rao bound (van Trees, constant weight).
//!
//! The Cramer-Rao bound `1 / J(x)` is for unbiased estimators of a fixed `x`. The posterior mean is biased towards the prior
//! and can have a smaller error. For a random unknown use the van Trees inequality.

use fewbits_numerics::error::{positive, refuse};
use fewbits_quantizer_design::engine::Active;
use fewbits_quantizer_design::{Error, System};

/// Fisher information about `x` in the received symbols, averaged over the prior, for independent noise.
///
/// `J(x) = sum_sensors sum_t (dP_t(x)/dx)^2 / P_t(x)`; symbols of probability zero are left out.
///
/// # Errors
/// [`Error::Argument`] if the noise is correlated.
pub fn mean_fisher_information(system: &System) -> Result<f64, Error> {
    let model = system.model();
    if !model.noise().is_independent() {
        return refuse("noise", "correlated noise", "independent noise for a Fisher information");
    }
    let nodes = model.values().len();
    let mut information = vec![0.0; nodes];
    for (g, group) in system.groups().iter().enumerate() {
        let entry = Active::new(system, g)?;
        let densities = entry.densities(entry.breakpoints()).0;
        for (t, p) in entry.symbols(entry.breakpoints()).iter().enumerate() {
            for (k, total) in information.iter_mut().enumerate() {
                // Raising x by an amount has the same effect as lowering all breakpoints by it.
                let slope: f64 = entry
                    .exchange
                    .iter()
                    .zip(densities.iter())
                    .map(|(c, d)| c[t] * d[k])
                    .sum();
                if p[k] > 0.0 {
                    *total += group.sensors.len() as f64 * slope * (slope / p[k]);
                }
            }
        }
    }
    Ok(information.iter().zip(model.weights()).map(|(j, w)| w * j).sum())
}

/// `1 / (E J(X) + 1 / s_x^2)`: no estimator from these symbols has a smaller mean squared error (van Trees 1968). In squared units of `X`.
///
/// # Errors
/// [`Error::Argument`] if the noise is correlated or the prior is not Gaussian.
pub fn bayesian_cramer_rao(system: &System) -> Result<f64, Error> {
    let prior = system.model().prior();
    if !prior.is_normal() {
        return refuse("prior", "another prior", "a Gaussian prior");
    }
    let variance = positive("prior variance", prior.deviation() * prior.deviation())?;
    Ok(1.0 / (mean_fisher_information(system)? + 1.0 / variance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_quantizer_design::{ObservationModel, Quantizer};

    #[test]
    fn fine_quantizers_attain_the_information_of_the_sample() {
        let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0]).unwrap();
        let fine: Vec<f64> = (-600..=600).map(|i| f64::from(i) * 0.02).collect();
        let system = System::ideal(model, vec![Quantizer::new(fine).unwrap()]).unwrap();
        let j = mean_fisher_information(&system).unwrap();
        assert!(j < 1.0 && j > 0.9999, "{j}");
    }
}
