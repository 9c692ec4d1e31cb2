//! Forms of messages that figures compare with.

use super::laplace::Peak;
use super::series::polynomials::check_degree;
use super::series::{Lpg, LpgFit, Slice};
use fewbits_core::{Belief, Density, Gaussian, Likelihood};
use fewbits_densities::{Component, Mixture, systematic};
use fewbits_diffusive::form::{Added, AddedDensity, AddedForm, SliceMoments, Update};
use fewbits_diffusive::message::AddedNumbers;
use fewbits_diffusive::{Error, Form, Posterior, RateModel, SearchBox, SentBelief, SourceLikelihood, Travelling};
use fewbits_mixture_codec::{Clumps, MixtureFit};
use fewbits_numerics::error::{at_least_one, entries, refuse};
use nalgebra::{SMatrix, SVector, Vector2};
use std::fmt;
use std::sync::Arc;

/// Number of clumps that a mixture is fitted to.
const CLUMPS: usize = 200;
/// Factor of the covariances of the Gaussians of [`lpg`]: their tails must extend beyond the posterior's.
const WIDENING: f64 = 1.3;
/// A Gaussian times a polynomial is wider: its box is that of a Gaussian with this many times the variance.
const REACH: f64 = 1.7;
/// Half width, in standard deviations, of the box that is taken to contain a Gaussian.
const ENDS: f64 = 6.5;
/// Largest number of components in a message: it has five bits, of which the largest number stands for a mixture.
const MAX_COUNT: usize = 31;

/// Gaussians times polynomials ([`Lpg`]): at most `N` components of degree `K`.
pub const fn lpg<const N: usize, const K: usize>() -> Form {
    Form::Other(Added(&LpgForm::<N, K>))
}

/// `N` equally weighted points with one Gaussian kernel.
pub const fn particles<const N: usize>() -> Form {
    Form::Other(Added(&ParticlesForm::<N>))
}

/// Mode and inverse curvature, or mean and covariance if there is no peak. If it starts from a ring, the search converges to a wrong
/// place; the form exists to show that.
pub const LAPLACE: Form = Form::Other(Added(&LaplaceForm));

struct LpgForm<const N: usize, const K: usize>;

struct ParticlesForm<const N: usize>;

#[derive(Debug)]
struct LaplaceForm;

// Forms are equal if they are written alike, so the parameters are written.
impl<const N: usize, const K: usize> fmt::Debug for LpgForm<N, K> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Lpg {{ components: {N}, degree: {K} }}")
    }
}

impl<const N: usize> fmt::Debug for ParticlesForm<N> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Particles({N})")
    }
}

/// Refuses a rate that is part of the belief.
fn position_only(form: &impl fmt::Debug, rate: &RateModel) -> Result<(), Error> {
    match rate {
        RateModel::Joint(_) => refuse("form", format!("{form:?}"), "Raw, Gaussian, Mixture or Lpg with a joint rate"),
        _ => Ok(()),
    }
}

/// Whether a message can hold so many components.
fn check_components(count: usize) -> Result<(), Error> {
    at_least_one("components", count)?;
    if count > MAX_COUNT {
        return refuse("components", count, format!("at most {MAX_COUNT}, the largest number in a message"));
    }
    Ok(())
}

/// Numbers of one Gaussian of this dimension: its mean and the lower triangle of its Cholesky factor.
const fn gaussian_scalars(dimension: usize) -> usize {
    dimension + dimension * (dimension + 1) / 2
}

/// Numbers of one polynomial Gaussian over the position, or over position and rate: those of the Gaussian and the coefficients.
fn scalars(degree: usize, with_rate: bool) -> usize {
    let plane = (degree + 1) * (degree + 2) / 2;
    let coefficients = if with_rate { plane * (degree + 3) / 3 } else { plane };
    gaussian_scalars(if with_rate { 3 } else { 2 }) + coefficients
}

impl<const N: usize, const K: usize> AddedForm for LpgForm<N, K> {
    fn check(&self, _: &RateModel) -> Result<(), Error> {
        check_components(N)?;
        check_degree(K)?;
        Ok(())
    }

    fn scalars(&self, rate: &RateModel) -> usize {
        N * scalars(K, matches!(rate, RateModel::Joint(_)))
    }

    fn project(&self, posterior: &Posterior, rate: &RateModel, _: Option<&Update<'_>>) -> Result<Travelling, Error> {
        if matches!(rate, RateModel::Joint(_)) && posterior.rates.is_some() {
            let fit = lpg_with_rate(posterior, N, K, rate)?;
            return Ok(Travelling::WithRate(SentBelief::Other(Arc::new(fit.belief))));
        }
        let fit = lpg_of_position(posterior, N, K)?;
        Ok(Travelling::Position(SentBelief::Other(Arc::new(fit.belief))))
    }

    fn numbers(&self, components: usize, degree: usize, with_rate: bool) -> usize {
        components * scalars(degree, with_rate)
    }

    fn read(&self, added: &AddedNumbers) -> Result<Travelling, Error> {
        Ok(if added.with_rate {
            Travelling::WithRate(SentBelief::Other(Arc::new(read::<3>(added)?)))
        } else {
            Travelling::Position(SentBelief::Other(Arc::new(read::<2>(added)?)))
        })
    }
}

fn read<const D: usize>(added: &AddedNumbers) -> Result<Lpg<D>, Error> {
    let size = gaussian_scalars(D);
    let numbers = &added.numbers;
    let (gaussians, coefficients) = numbers.split_at(size.saturating_mul(added.components).min(numbers.len()));
    let gaussians: Vec<Component<D>> = gaussians.chunks(size).map(read_gaussian).collect::<Result<_, _>>()?;
    let lists = coefficients
        .chunks(scalars(added.code, D == 3) - size)
        .map(<[f64]>::to_vec);
    Lpg::new(&gaussians, added.code, &lists.collect::<Vec<_>>())
}

/// Appends the numbers of a Gaussian: its mean and its lower Cholesky factor, row by row.
fn push_gaussian<const D: usize>(c: &Component<D>, numbers: &mut Vec<f64>) {
    numbers.extend(c.mean().iter());
    for i in 0..D {
        numbers.extend((0..=i).map(|j| c.factor().lower[(i, j)]));
    }
}

/// The Gaussian of these numbers.
fn read_gaussian<const D: usize>(numbers: &[f64]) -> Result<Component<D>, Error> {
    entries("numbers", numbers.len(), gaussian_scalars(D))?;
    let (mean, mut rest) = numbers.split_at(D);
    let mut lower = SMatrix::<f64, D, D>::zeros();
    for i in 0..D {
        let (row, others) = rest.split_at(i + 1);
        (0..=i).for_each(|j| lower[(i, j)] = row[j]);
        rest = others;
    }
    Component::new(1.0, SVector::from_column_slice(mean), lower * lower.transpose())
}

/// Polynomial Gaussians about the position of a posterior: at most so many, of this degree.
///
/// # Errors
/// As [`Lpg::fit`].
pub fn lpg_of_position(posterior: &Posterior, components: usize, degree: usize) -> Result<LpgFit<2>, Error> {
    let clumps = posterior.clumps(CLUMPS)?;
    about_components(&clumps, components, |gaussians| Lpg::fit(&posterior.cells, gaussians, degree))
}

/// Polynomial Gaussians about position and rate of a posterior.
///
/// # Errors
/// As [`Lpg::fit_lifted`], or if the posterior has no rate.
pub fn lpg_with_rate(
    posterior: &Posterior,
    components: usize,
    degree: usize,
    rate: &RateModel,
) -> Result<LpgFit<3>, Error> {
    let Some((means, variances)) = &posterior.rates else {
        return refuse("posterior", "one without a rate", "a posterior of position and rate");
    };
    let clumps = posterior.clumps_with_rate(rate.typical(), CLUMPS)?;
    about_components(&clumps, components, |gaussians| {
        Lpg::fit_lifted(&posterior.cells, means, variances, gaussians, degree)
    })
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
            .map(|c| Component::new(c.weight(), *c.mean(), c.covariance() * WIDENING));
        fit(&widened.collect::<Result<Vec<_>, _>>()?)
    };
    Ok(match about(components) {
        Err(_) if components > 1 => about(1)?,
        other => other?,
    })
}

impl<const D: usize> AddedDensity<D> for Lpg<D>
where
    Self: Third,
{
    fn gaussian(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.mean(), self.covariance())
    }

    fn bounds(&self) -> SearchBox {
        let mut hull = SearchBox {
            lower: [f64::INFINITY; 2],
            upper: [f64::NEG_INFINITY; 2],
        };
        for part in self.gaussians() {
            for d in 0..2 {
                let reach = ENDS * (REACH * part.covariance()[(d, d)]).sqrt();
                hull.lower[d] = hull.lower[d].min(part.mean()[d] - reach);
                hull.upper[d] = hull.upper[d].max(part.mean()[d] + reach);
            }
        }
        hull
    }

    fn log_density(&self, x: &SVector<f64, D>) -> f64 {
        Density::log_density(self, x)
    }

    fn log_density_and_bound(&self, x: &SVector<f64, D>, half_width: f64, scratch: &mut Vec<f64>) -> (f64, f64) {
        self.log_density_and_bound(x, half_width, scratch)
    }

    fn rate(&self, place: &Vector2<f64>, half_width: f64, sums: [f64; 3], range: [f64; 2]) -> SliceMoments {
        self.along_the_rate(place, half_width, sums, range)
    }

    fn numbers(&self) -> (usize, usize, Vec<f64>) {
        let mut numbers = Vec::new();
        self.gaussians().for_each(|c| push_gaussian(c, &mut numbers));
        self.coefficients().for_each(|list| numbers.extend_from_slice(list));
        (self.gaussians().count(), self.degree(), numbers)
    }
}

/// What a series says of the rate at a place: nothing in the plane.
trait Third {
    fn along_the_rate(&self, place: &Vector2<f64>, half_width: f64, sums: [f64; 3], range: [f64; 2]) -> SliceMoments;
}

impl Third for Lpg<2> {
    fn along_the_rate(&self, _: &Vector2<f64>, _: f64, _: [f64; 3], range: [f64; 2]) -> SliceMoments {
        SliceMoments::nothing(range)
    }
}

impl Third for Lpg<3> {
    fn along_the_rate(&self, place: &Vector2<f64>, half_width: f64, sums: [f64; 3], range: [f64; 2]) -> SliceMoments {
        let mut slice = Slice::default();
        self.slice(place, half_width, &mut slice);
        slice.tilted(sums, range)
    }
}

impl<const N: usize> AddedForm for ParticlesForm<N> {
    fn check(&self, rate: &RateModel) -> Result<(), Error> {
        check_components(N)?;
        position_only(self, rate)
    }

    fn scalars(&self, _: &RateModel) -> usize {
        (N * (1 + gaussian_scalars(2))).saturating_sub(1)
    }

    /// Points at equal steps of the cumulative weight in the order of the cells, with a Gaussian kernel of the normal-reference width. The
    /// points are moved towards the mean, so that the covariance is unchanged.
    fn project(&self, posterior: &Posterior, _: &RateModel, _: Option<&Update<'_>>) -> Result<Travelling, Error> {
        let clumps = posterior.clumps(N)?;
        let g = posterior.gaussian();
        // The normal-reference width in the plane.
        let h2 = (N as f64).powf(-1.0 / 3.0);
        let shrink = (1.0 - h2).max(0.0).sqrt();
        let weights: Vec<f64> = clumps.clumps().iter().map(|c| c.weight).collect();
        let parts = systematic(&weights, N, 0.5).into_iter().map(|i| {
            let x = clumps.clumps()[i].mean;
            Component::new(1.0, g.mean() + (x - g.mean()) * shrink, g.covariance() * h2)
        });
        let mixture = Mixture::new(parts.collect::<Result<_, _>>()?)?;
        Ok(Travelling::Position(SentBelief::Mixture(mixture)))
    }
}

impl AddedForm for LaplaceForm {
    fn check(&self, rate: &RateModel) -> Result<(), Error> {
        position_only(self, rate)
    }

    fn scalars(&self, _: &RateModel) -> usize {
        gaussian_scalars(2)
    }

    fn project(
        &self,
        posterior: &Posterior,
        rate: &RateModel,
        update: Option<&Update<'_>>,
    ) -> Result<Travelling, Error> {
        let single = |gaussian: &Gaussian<2>| -> Result<Travelling, Error> {
            Ok(Travelling::Position(SentBelief::Mixture(Mixture::single(gaussian)?)))
        };
        let Some(update) = update else {
            return single(&posterior.gaussian());
        };
        let likelihood = SourceLikelihood::new(vec![update.record.clone()], *rate)?;
        let prior = update.prior.factored()?;
        let log = |x: &Vector2<f64>| prior.log_pdf(x) + likelihood.log_likelihood(x);
        // The mode among the cells.
        let cells = &posterior.cells;
        let weights = cells.weights().iter().enumerate();
        let best = weights.max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(i, _)| i);
        let [x, y] = cells.columns();
        let scale = Vector2::repeat(cells.width());
        match Peak::climb(&log, &Vector2::new(x[best], y[best]), &scale) {
            Ok(peak) => single(&peak.gaussian()),
            Err(_) => single(&posterior.gaussian()),
        }
    }
}
