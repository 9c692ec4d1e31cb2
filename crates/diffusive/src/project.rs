//! Approximation of the exact posterior by the belief that is sent to the next node.

use crate::belief::{JointBelief, PositionBelief};
use crate::density::LpgFit;
use crate::density::polynomials::check_degree;
use crate::density::{Clumps, Lpg, MixtureFit};
use crate::message::COUNT_BITS;
use crate::posterior::Posterior;
use crate::{Error, RateModel};
use fewbits_core::Gaussian;
use fewbits_densities::{Component, Mixture, systematic};
use fewbits_numerics::error::{at_least_one, refuse};
use serde::{Deserialize, Serialize};

/// Number of clumps that a mixture is fitted to.
const CLUMPS: usize = 200;
/// Factor of the covariances of the Gaussians of [`Form::Lpg`]: their tails must extend beyond the posterior's.
const LPG_WIDENING: f64 = 1.3;

/// Form of the messages between nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Form {
    /// The samples of every node visited. Nothing is lost.
    Raw,
    /// A Gaussian: mean and covariance.
    Gaussian,
    /// A Gaussian mixture of at most this many components.
    Mixture(usize),
    /// Gaussians times polynomials ([`Lpg`]).
    Lpg {
        /// Largest number of components.
        components: usize,
        /// Highest degree of the polynomials.
        degree: usize,
    },
    /// This many equally weighted points with one Gaussian kernel.
    Particles(usize),
    /// Mode and inverse curvature, or mean and covariance if there is no peak. If it starts from a ring, the search converges to a wrong
    /// place; the form exists to show that.
    Laplace,
}

impl Form {
    /// Whether messages can hold this form with this rate.
    pub(crate) fn check(&self, rate: &RateModel) -> Result<(), Error> {
        match *self {
            Self::Mixture(n) | Self::Particles(n) => check_components(n)?,
            Self::Lpg { components, degree } => {
                check_components(components)?;
                check_degree(degree)?;
                if degree >= MAX_COUNT {
                    return refuse("degree", degree, format!("below {MAX_COUNT}, which stands for a mixture"));
                }
            }
            Self::Raw | Self::Gaussian | Self::Laplace => {}
        }
        if matches!(rate, RateModel::Joint(_)) && matches!(self, Self::Particles(_) | Self::Laplace) {
            let expected = "Raw, Gaussian, Mixture or Lpg with a joint rate";
            return refuse("form", format!("{self:?}"), expected);
        }
        Ok(())
    }

    /// Largest number of numbers in one message of this form, besides the two of the fit; `None` for raw records. Fewer are sent if the
    /// posterior needs fewer components.
    pub fn scalars(&self, rate: &RateModel) -> Option<usize> {
        let carried = matches!(rate, RateModel::Joint(_));
        match *self {
            Self::Raw => None,
            Self::Gaussian | Self::Laplace => Some(gaussian_scalars(carried)),
            // The first weight is not sent: they sum to one.
            Self::Mixture(n) | Self::Particles(n) => Some((n * (1 + gaussian_scalars(carried))).saturating_sub(1)),
            Self::Lpg { components, degree } => Some(components * lpg_scalars(degree, carried)),
        }
    }
}

/// Largest number of components and code of "no polynomials" in a message.
const MAX_COUNT: usize = (1 << COUNT_BITS) - 1;

fn check_components(count: usize) -> Result<(), Error> {
    at_least_one("components", count)?;
    if count > MAX_COUNT {
        return refuse("components", count, format!("at most {MAX_COUNT}, the largest number in a message"));
    }
    Ok(())
}

/// Numbers of one Gaussian over the position, or over position and rate: its mean and the lower triangle of its Cholesky factor.
pub(crate) fn gaussian_scalars(with_rate: bool) -> usize {
    if with_rate { 3 + 6 } else { 2 + 3 }
}

/// Numbers of one polynomial Gaussian over the position, or over position and rate: those of the Gaussian and the coefficients.
pub(crate) fn lpg_scalars(degree: usize, with_rate: bool) -> usize {
    let plane = (degree + 1) * (degree + 2) / 2;
    let coefficients = if with_rate { plane * (degree + 3) / 3 } else { plane };
    gaussian_scalars(with_rate) + coefficients
}

/// A belief in a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Travelling {
    /// A belief about the position.
    Position(PositionBelief),
    /// A belief about position and rate.
    WithRate(JointBelief),
}

impl Travelling {
    /// Mean and covariance of the position.
    pub fn gaussian(&self) -> Gaussian<2> {
        match self {
            Self::Position(belief) => belief.gaussian(),
            Self::WithRate(belief) => belief.position(),
        }
    }
}

/// Approximates a posterior by a belief of the given form. `None` for raw records, which are not projected.
///
/// # Errors
/// If the covariance of the posterior is singular.
pub fn project(posterior: &Posterior, form: Form, rate: &RateModel) -> Result<Option<Travelling>, Error> {
    let carried = matches!(rate, RateModel::Joint(_));
    let components = match form {
        Form::Raw => return Ok(None),
        Form::Lpg { components, degree } => return Ok(Some(lpg(posterior, components, degree, rate)?)),
        Form::Particles(count) => return Ok(Some(particles(posterior, count)?)),
        Form::Gaussian | Form::Laplace => 1,
        Form::Mixture(components) => components,
    };
    if carried {
        let clumps = posterior.clumps_with_rate(rate.typical(), if components == 1 { 1 } else { CLUMPS })?;
        return Ok(Some(joint(clumps.fit(&MixtureFit::new(components)?)?)));
    }
    if components == 1 {
        return Ok(Some(position(Mixture::single(&posterior.gaussian())?)));
    }
    Ok(Some(position(posterior.clumps(CLUMPS)?.fit(&MixtureFit::new(components)?)?)))
}

fn position(mixture: Mixture<2>) -> Travelling {
    Travelling::Position(PositionBelief::Mixture(mixture))
}

fn joint(mixture: Mixture<3>) -> Travelling {
    Travelling::WithRate(JointBelief::Mixture(mixture))
}

fn lpg(posterior: &Posterior, components: usize, degree: usize, rate: &RateModel) -> Result<Travelling, Error> {
    let cells = &posterior.cells;
    if let (RateModel::Joint(_), Some((means, variances))) = (rate, &posterior.rates) {
        let clumps = posterior.clumps_with_rate(rate.typical(), CLUMPS)?;
        let fit = about_components(&clumps, components, |gaussians| {
            Lpg::fit_lifted(cells, means, variances, gaussians, degree)
        })?;
        return Ok(Travelling::WithRate(JointBelief::Lpg(fit.belief)));
    }
    let fit = about_components(&posterior.clumps(CLUMPS)?, components, |g| Lpg::fit(cells, g, degree))?;
    Ok(Travelling::Position(PositionBelief::Lpg(fit.belief)))
}

/// Polynomial Gaussians about the widened components of a mixture. If these are nearly linearly dependent, it uses fewer.
fn about_components<const D: usize>(
    clumps: &Clumps<D>,
    components: usize,
    fit: impl Fn(&[Component<D>]) -> Result<LpgFit<D>, Error>,
) -> Result<LpgFit<D>, Error> {
    let about = |count: usize| {
        let mixture = clumps.fit(&MixtureFit::new(count)?)?;
        let widened = mixture
            .components()
            .iter()
            .map(|c| Component::new(c.weight(), *c.mean(), c.covariance() * LPG_WIDENING));
        fit(&widened.collect::<Result<Vec<_>, _>>()?)
    };
    Ok(match about(components) {
        Err(_) if components > 1 => about(1)?,
        other => other?,
    })
}

/// Points at equal steps of the cumulative weight in the order of the cells, with a Gaussian kernel of the normal-reference width. The
/// points are moved towards the mean, so that the covariance is unchanged.
fn particles(posterior: &Posterior, count: usize) -> Result<Travelling, Error> {
    let clumps = posterior.clumps(count)?;
    let g = posterior.gaussian();
    // The normal-reference width in the plane.
    let h2 = (count as f64).powf(-1.0 / 3.0);
    let shrink = (1.0 - h2).max(0.0).sqrt();
    let weights: Vec<f64> = clumps.clumps().iter().map(|c| c.weight).collect();
    let parts = systematic(&weights, count, 0.5).into_iter().map(|i| {
        let x = clumps.clumps()[i].mean;
        Component::new(1.0, g.mean() + (x - g.mean()) * shrink, g.covariance() * h2)
    });
    Ok(position(Mixture::new(parts.collect::<Result<_, _>>()?)?))
}
