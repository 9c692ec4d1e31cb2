//! The laws of [`Scheme`].

use super::{STANDARD_ERRORS, Violation, agree, failed};
use crate::factor::Factor;
use crate::observation::{Link, Observation};
use crate::scheme::{Deterministic, Scheme};
use nalgebra::SVector;
use rand::Rng;

const TOTAL: &str = "the observations that a scheme can cause have total probability one";
const HONEST: &str = "reports have the frequencies that their factors say";

/// Law 1 for a scheme with finitely many reports: at every measurement, the probabilities of all `reports`, of
/// [`Observation::Nothing`] and of [`Observation::Lost`] sum to one. Where `Lost` cannot occur it must have the probability that
/// the sensor spoke.
///
/// # Errors
/// If `factor` fails, or at the first measurement at which the law fails.
pub fn total_probability<const M: usize, S: Scheme<M>>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    reports: impl IntoIterator<Item = S::Report>,
    measurements: &[SVector<f64, M>],
) -> Result<(), Violation> {
    let mut factors = Vec::new();
    for report in reports {
        factors.push(failed(TOTAL, scheme.factor(feedback, &Observation::Received(report), link))?);
    }
    let received = |m: &SVector<f64, M>| factors.iter().map(|factor| factor.log_likelihood(m).exp()).sum();
    total_probability_with(scheme, feedback, link, received, measurements, 1e-12)
}

/// Law 1 for a scheme with a continuous report. `received(m)` must return the integral of the factors of all received reports at `m`, by a
/// suitable quadrature; the probabilities of [`Observation::Nothing`] and [`Observation::Lost`] are added here.
///
/// # Errors
/// As [`total_probability`].
pub fn total_probability_with<const M: usize, S: Scheme<M>>(
    scheme: &S,
    feedback: &S::Feedback,
    link: &Link,
    received: impl Fn(&SVector<f64, M>) -> f64,
    measurements: &[SVector<f64, M>],
    tolerance: f64,
) -> Result<(), Violation> {
    const LOST: &str = "a loss that is known where the link knows of none has the probability that the sensor spoke";
    link_delivers_once(link)?;
    let nothing = failed(TOTAL, scheme.factor(feedback, &Observation::Nothing, link))?;
    let lost = failed(TOTAL, scheme.factor(feedback, &Observation::Lost, link))?;
    for m in measurements {
        // A link that knows of no losses never delivers `Lost`. It then has no place in the sum, and its factor is checked by itself.
        let (nothing, lost) = (nothing.log_likelihood(m).exp(), lost.log_likelihood(m).exp());
        let total = received(m) + nothing;
        if link.erasure() == 0.0 && (total - 1.0).abs() <= tolerance {
            // From `Nothing` = s + loss (1 - s).
            let spoke = (1.0 - nothing) / (1.0 - link.loss());
            agree(LOST, format!("{m:?}"), lost, spoke, tolerance, 1.0)?;
        } else {
            agree(TOTAL, format!("{m:?}"), total + lost, 1.0, tolerance, 0.0)?;
        }
    }
    Ok(())
}

/// A report sent over a link arrives, is lost without a trace, or is known to be lost. The three probabilities that schemes take from the
/// link ([`Link::delivery`]) sum to one. If the link has no known losses, `Lost` has the factor 1 and is left out of the sum.
///
/// # Errors
/// If the sum is not one.
fn link_delivers_once(link: &Link) -> Result<(), Violation> {
    const LAW: &str = "a report arrives, is lost, or is known to be lost";
    let of = |observation| link.delivery::<()>(&observation);
    let (arrives, nothing, lost) = (of(Observation::Received(())), of(Observation::Nothing), of(Observation::Lost));
    agree(LAW, "its `lost_given_sent`", link.lost_given_sent(), lost, 0.0, 0.0)?;
    if link.erasure() == 0.0 {
        agree(LAW, "a loss that the link does not know of", lost, 1.0, 0.0, 0.0)?;
        return agree(LAW, format!("{link:?}"), arrives + nothing, 1.0, 1e-15, 0.0);
    }
    agree(LAW, format!("{link:?}"), arrives + nothing + lost, 1.0, 1e-15, 0.0)
}

/// Law 2: at the noise-free measurement `m`, `draws` measurements from `measure` are encoded and sent through the link; the
/// share of them that `event` accepts must agree with `probability`, the sum (integral) of the factors over that event,
/// within four standard errors. [`frequencies`] does this for every report of a finite scheme.
///
/// # Errors
/// If encoding fails, or the frequency found.
#[allow(clippy::too_many_arguments, reason = "a law names everything that it is about")]
pub fn honesty<const M: usize, S: Scheme<M>, R: Rng>(
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
    // Standard error of a binomial frequency; the small constant forgives rounding if it is zero.
    let share = hits as f64 / draws as f64;
    let error = (probability * (1.0 - probability) / draws as f64).max(0.0).sqrt();
    if (share - probability).abs() <= STANDARD_ERRORS * error + 1e-12 {
        Ok(())
    } else {
        Err(Violation::new(HONEST, format!("a share of {share}"), format!("{probability} +- {error}")))
    }
}

/// Law 2 for every report of a scheme with finitely many reports, for `Nothing`, and for `Lost`, whose frequency must be one minus the
/// probabilities of all others.
///
/// # Errors
/// As [`honesty`].
#[allow(clippy::too_many_arguments, reason = "a law names everything that it is about")]
pub fn frequencies<const M: usize, S: Scheme<M>, R: Rng>(
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
    // All outcomes but `Lost` are compared with their own likelihoods; `Lost` with the remaining probability.
    let mut left = 1.0;
    for expected in observations.chain([Observation::Nothing]) {
        let factor = failed(HONEST, scheme.factor(feedback, &expected, link))?;
        let probability = factor.log_likelihood(m).exp();
        left -= probability;
        let measure = |rng: &mut R| m + noise(rng);
        honesty(scheme, feedback, link, rng, draws, measure, |seen| *seen == expected, probability)?;
    }
    let measure = |rng: &mut R| m + noise(rng);
    let lost = |seen: &Observation<S::Report>| *seen == Observation::Lost;
    honesty(scheme, feedback, link, rng, draws, measure, lost, left.clamp(0.0, 1.0))
}

/// The law of [`Deterministic`]: two sensors with differently seeded random sources send the same report, and neither source is drawn from.
///
/// # Errors
/// If encoding fails, or at the first measurement at which the law fails.
pub fn deterministic<const M: usize, S: Deterministic<M>, R: Rng + Clone + PartialEq>(
    scheme: &S,
    feedback: &S::Feedback,
    rngs: &[R; 2],
    measurements: &[SVector<f64, M>],
) -> Result<(), Violation>
where
    S::Report: PartialEq,
{
    const LAW: &str = "a deterministic scheme draws nothing";
    let mut drawn = rngs.clone();
    let (mut first, mut second) = (scheme.start(), scheme.start());
    for m in measurements {
        let one = failed(LAW, scheme.encode(&mut drawn[0], &mut first, m, feedback))?;
        let other = failed(LAW, scheme.encode(&mut drawn[1], &mut second, m, feedback))?;
        if one != other || drawn != *rngs {
            return Err(Violation::new(LAW, format!("a draw at {m:?}"), "none"));
        }
    }
    Ok(())
}
