//! The laws of [`Scheme`].

use super::{STANDARD_ERRORS, Violation, agree, failed};
use crate::factor::Factor;
use crate::observation::{Link, Observation};
use crate::scheme::Scheme;
use nalgebra::SVector;
use rand::Rng;

const TOTAL: &str = "the observations that a scheme can cause have total probability one";
const HONEST: &str = "reports have the frequencies that their factors say";

/// Law 1 for a scheme with finitely many reports: at every measurement, the probabilities of all `reports` and of
/// [`Observation::Nothing`] sum to one; and an erased report has the factor 1 (law 3).
///
/// # Errors
/// If `factor` fails, or the measurement at which the law fails.
pub fn total_probability<const M: usize, S: Scheme<M>>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    reports: impl IntoIterator<Item = S::Report>,
    measurements: &[SVector<f64, M>],
) -> Result<(), Violation> {
    let observations = reports.into_iter().map(Observation::Received);
    let mut factors = Vec::new();
    for observation in observations.chain([Observation::Nothing]) {
        factors.push(failed(TOTAL, scheme.factor(feedback, &observation, link))?);
    }
    for m in measurements {
        let total: f64 = factors.iter().map(|factor| factor.log_likelihood(m).exp()).sum();
        agree(TOTAL, format!("{m:?}"), total, 1.0, 1e-12, 0.0)?;
    }
    erased_says_nothing(scheme, feedback, link, measurements)
}

/// Law 1 for a scheme with a continuous report: `density_total(m)` must be the integral of the received reports' densities
/// at `m`, by a quadrature that suits the scheme; it is completed by [`Observation::Nothing`].
///
/// # Errors
/// As [`total_probability`].
pub fn total_probability_with<const M: usize, S: Scheme<M>>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    density_total: impl Fn(&SVector<f64, M>) -> f64,
    measurements: &[SVector<f64, M>],
    tolerance: f64,
) -> Result<(), Violation> {
    let nothing = failed(TOTAL, scheme.factor(feedback, &Observation::Nothing, link))?;
    for m in measurements {
        let total = density_total(m) + nothing.log_likelihood(m).exp();
        agree(TOTAL, format!("{m:?}"), total, 1.0, tolerance, 0.0)?;
    }
    erased_says_nothing(scheme, feedback, link, measurements)
}

/// Law 3.
fn erased_says_nothing<const M: usize, S: Scheme<M>>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    measurements: &[SVector<f64, M>],
) -> Result<(), Violation> {
    const LAW: &str = "an erased report says nothing";
    let erased = failed(LAW, scheme.factor(feedback, &Observation::Lost, link))?;
    for m in measurements {
        agree(LAW, format!("{m:?}"), erased.log_likelihood(m), 0.0, 1e-15, 1.0)?;
    }
    Ok(())
}

/// Law 2: at the noise-free measurement `m`, `draws` measurements from `measure` are encoded and sent through the link; the
/// share of them that `event` accepts must agree with `probability`, the sum (integral) of the factors over that event,
/// within four standard errors. [`frequencies`] does this for every report of a finite scheme.
///
/// # Errors
/// If encoding fails, or the frequency found.
#[allow(clippy::too_many_arguments, reason = "a law names everything that it is about")]
pub fn honesty<const M: usize, S: Scheme<M>, R: Rng + ?Sized>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    rng: &mut R,
    draws: usize,
    mut measure: impl FnMut(&mut R) -> SVector<f64, M>,
    event: impl Fn(&Observation<S::Report>) -> bool,
    probability: f64,
) -> Result<(), Violation> {
    let format = scheme.report_format();
    let mut state = scheme.start();
    let mut hits = 0_usize;
    for _ in 0..draws {
        let z = measure(rng);
        let report = failed(HONEST, scheme.encode(rng, &mut state, &z, feedback))?;
        let observation = failed(HONEST, link.transmit(rng, report.as_ref(), &format))?;
        hits += usize::from(event(&observation));
    }
    let share = hits as f64 / draws as f64;
    let error = (probability * (1.0 - probability) / draws as f64).max(0.0).sqrt();
    if (share - probability).abs() <= STANDARD_ERRORS * error + 1e-12 {
        Ok(())
    } else {
        Err(Violation::new(HONEST, format!("a share of {share}"), format!("{probability} +- {error}")))
    }
}

/// Law 2 for every report of a scheme with finitely many, and for nothing.
///
/// # Errors
/// As [`honesty`].
#[allow(clippy::too_many_arguments, reason = "a law names everything that it is about")]
pub fn frequencies<const M: usize, S: Scheme<M>, R: Rng + ?Sized>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    rng: &mut R,
    draws: usize,
    m: &SVector<f64, M>,
    mut noise: impl FnMut(&mut R) -> SVector<f64, M>,
    reports: impl IntoIterator<Item = S::Report>,
) -> Result<(), Violation>
where
    S::Report: PartialEq,
{
    let observations = reports.into_iter().map(Observation::Received);
    for expected in observations.chain([Observation::Nothing]) {
        let factor = failed(HONEST, scheme.factor(feedback, &expected, link))?;
        let probability = factor.log_likelihood(m).exp();
        let measure = |rng: &mut R| m + noise(rng);
        honesty(scheme, feedback, link, rng, draws, measure, |seen| *seen == expected, probability)?;
    }
    Ok(())
}
