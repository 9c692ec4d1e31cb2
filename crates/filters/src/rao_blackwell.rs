//! A Rao-Blackwellised particle filter for linear Gaussian states and reports such as bits, cells and silence.

use crate::contract::{Info, StateFilter, predicted};
use crate::particle::weigh;
use crate::{Error, ResamplingRule};
use fewbits_core::columns::{change_each, count, set_state, state_at};
use fewbits_core::factor::Scalar;
use fewbits_core::value_update;
use fewbits_core::{Belief, Cell, FactoredGaussian, Gaussian, GaussianDynamics, Likelihood, LinearScalar};
use fewbits_densities::{GaussianCloud, systematic};
use fewbits_numerics::error::{at_least_one, refuse};
use fewbits_numerics::{LogSum, normal};
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};

/// A filter for linear Gaussian states that draws the measurements behind the reports (imputes them): bits, cells, silence, symbols.
///
/// Given the measurements the state is Gaussian, and its covariance does not depend on their values. A particle
/// is therefore a Kalman mean with imputed measurements, and all particles share one covariance ([`GaussianCloud`]). Far fewer
/// particles are needed than of states. An observed value needs no imputation: with values only, this is the Kalman filter.
///
/// ```text
/// update, with S = H P H' + R and K = P H' S^-1, for each particle mean m:
///     w *= p(observed | m) = integral N(z; H m, S) p(observed | z) dz
///     z ~ N(z; H m, S) p(observed | z)                                     (imputed)
///     m += K (z - H m)
/// P = (I - K H) P (I - K H)' + K R K'
/// ```
/// For a [`Scalar`] factor, `p(observed | z)` is piecewise constant and the draw is exact; other observations are refused. Likelihoods
/// that depend on the particle's own history (its auxiliary row) use [`impute`]. Dynamics that are not linear are linearised at the mean.
/// (Mixture Kalman filters: Chen and Liu 2000; here the imputation is drawn from the optimal proposal.)
///
/// The buffers are part of the filter, so that a step of the same size allocates little.
#[derive(Debug, Clone)]
pub struct RaoBlackwellised<const D: usize> {
    rule: ResamplingRule,
    count: usize,
    ancestors: Vec<u32>,
    log_weights: Vec<f64>,
    next: Option<GaussianCloud<D>>,
}

impl<const D: usize> RaoBlackwellised<D> {
    /// The filter that starts with `count` particles. `rule` says how and when the conditional means are resampled.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn new(rule: ResamplingRule, count: usize) -> Result<Self, Error> {
        Ok(Self {
            rule,
            count: at_least_one("count", count)?,
            ancestors: Vec::new(),
            log_weights: Vec::new(),
            next: None,
        })
    }
}

impl<const D: usize> StateFilter<D> for RaoBlackwellised<D> {
    type Belief = GaussianCloud<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<GaussianCloud<D>, Error> {
        GaussianCloud::agreed(prior, self.count)
    }

    /// Resamples if the rule says so and predicts every mean by the dynamics. Auxiliary rows are unchanged.
    ///
    /// [`Error::NotANumber`] if the covariance overflows, before anything has changed.
    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut GaussianCloud<D>,
    ) -> Result<(), Error> {
        // All particles share one covariance, since the Riccati recursion does not depend on the data.
        let shared = Gaussian::from_trusted_parts(belief.means.mean(), belief.shared_covariance);
        // Checked before resampling, so that a failed prediction leaves the belief as it was.
        let moved = predicted(dynamics, &shared)?;
        self.rule.resample(rng, &mut belief.means, &mut self.ancestors)?;
        change_each(belief.means.columns_mut(), |state| dynamics.mean(&state));
        belief.shared_covariance = *moved.covariance();
        Ok(())
    }

    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut GaussianCloud<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let mean = belief.means.mean();
        let scalars = observed.iter().map(|one| one.as_linear_scalar(&mean));
        let Some(scalars) = scalars.collect::<Option<Vec<_>>>() else {
            return refuse("observed", "another likelihood", "scalar factors through linear sensors");
        };
        let next = self.next.get_or_insert_with(|| belief.clone());
        next.clone_from(belief);
        let log_weights = &mut self.log_weights;
        log_weights.clear();
        log_weights.resize(belief.means.len(), 0.0);
        // Impute one measurement per observation, one after the other; each adds to the log weights.
        for LinearScalar {
            matrix,
            noise_covariance,
            factor,
        } in scalars
        {
            let imputation = Imputation::new(factor);
            impute(rng, next, &matrix, &noise_covariance, log_weights, |rng, innovation, predicted, _| {
                let (z, log_weight) = imputation.draw(rng, predicted[0], innovation.lower()[(0, 0)]);
                ([z].into(), log_weight)
            })?;
        }
        // ln w += sum of ln p(observed | m) over the observations; normalise.
        let info = weigh(&mut next.means, |_, logs| {
            logs.iter_mut()
                .zip(&*log_weights)
                .for_each(|(log, added)| *log += added);
        })?;
        // Everything has succeeded: the new belief replaces the old one.
        std::mem::swap(belief, next);
        Ok(info)
    }

    /// Of more than 500 particles, 500 of equal weight.
    fn mixture(&self, belief: &GaussianCloud<D>) -> Option<Vec<(f64, Gaussian<D>)>> {
        let (means, logs) = (&belief.means, belief.means.log_weights());
        let of = |i: usize| Gaussian::from_trusted_parts(state_at(&means.columns(), i), belief.shared_covariance);
        if logs.len() <= MAX_TESTED {
            return Some((0..logs.len()).map(|i| (logs[i], of(i))).collect());
        }
        let picked = systematic(means.weights(), MAX_TESTED, 0.5).into_iter();
        Some(picked.map(|i| (0.0, of(i))).collect())
    }
}

/// The core of an update, for any linear sensor `z = H x + w`, `w ~ N(0, R)`, and any likelihood: imputes a measurement
/// for every particle, updates each mean with it, and adds the log importance weights to `log_weights`, one per particle. The caller
/// reweighs when all sensors have been processed.
///
/// `draw(rng, innovation, predicted, row)` is given `N(0, S)`, a particle's `H m` and its auxiliary row, which it may change. It
/// returns a measurement `z` drawn from some density `q`, and `ln (N(z; H m, S) p(observed | z) / q(z))`.
///
/// # Errors
/// [`Error::SingularInnovation`] if `S` is singular; the belief is then unchanged.
pub fn impute<const D: usize, const M: usize, R: Rng + ?Sized>(
    rng: &mut R,
    belief: &mut GaussianCloud<D>,
    matrix: &SMatrix<f64, M, D>,
    noise_covariance: &SMatrix<f64, M, M>,
    log_weights: &mut [f64],
    mut draw: impl FnMut(&mut R, &FactoredGaussian<M>, &SVector<f64, M>, &mut [f64]) -> (SVector<f64, M>, f64),
) -> Result<(), Error> {
    let shared = Gaussian::from_trusted_parts(SVector::zeros(), belief.shared_covariance);
    // One Kalman gain for all particles.
    let nothing = SVector::zeros();
    let innovation = nothing - matrix * shared.mean();
    let (updated, info) = value_update::update(matrix, noise_covariance, &shared, &nothing, innovation)?;
    let innovation = Gaussian::from_trusted_parts(SVector::zeros(), info.innovation_covariance)
        .factored()
        .map_err(|_| Error::SingularInnovation)?;
    let width = belief.means.auxiliary_width();
    let (mut columns, side) = belief.means.parts_mut();
    for (i, log_weight) in log_weights.iter_mut().enumerate().take(count(&columns)) {
        let mean = state_at(&columns, i);
        let predicted = matrix * mean;
        // The measurement is drawn given the report and then used as if it had been received. The weight is multiplied by the
        // probability of the report.
        let (z, increment) = draw(rng, &innovation, &predicted, &mut side[i * width..(i + 1) * width]);
        *log_weight += increment;
        set_state(&mut columns, i, &(mean + info.gain * (z - predicted)));
    }
    belief.shared_covariance = *updated.covariance();
    Ok(())
}

/// Largest number of particles by which a centre tests reports.
const MAX_TESTED: usize = 500;

/// How measurements are drawn for a scalar factor.
enum Imputation {
    /// The value, and the logarithm of the constant that multiplies its density.
    Value(f64, f64),
    /// `p(observed | z)` as a piecewise constant function.
    Pieces(Vec<(Cell, f64)>),
}

impl Imputation {
    fn new(factor: Scalar) -> Self {
        match factor {
            Scalar::Value(value) => Self::Value(value.value()[0], value.log_scale()),
            Scalar::Levels(levels) => Self::Pieces(levels.pieces()),
        }
    }

    /// A drawn measurement, and the logarithm of the probability (density) of the observation.
    fn draw<R: Rng + ?Sized>(&self, rng: &mut R, predicted: f64, deviation: f64) -> (f64, f64) {
        match self {
            Self::Value(value, log_scale) => {
                let log = normal::log_pdf((value - predicted) / deviation) - deviation.ln();
                (*value, log + log_scale)
            }
            Self::Pieces(pieces) => {
                let total = log_shares(pieces, predicted, deviation).collect::<LogSum>().value();
                if total == f64::NEG_INFINITY {
                    return (predicted, total);
                }
                let (lower, upper) = choose(rng, pieces, predicted, deviation, total);
                // A piece of positive probability contains numbers, so the draw cannot fail.
                normal::sample_truncated(rng, (lower - predicted) / deviation, (upper - predicted) / deviation)
                    .map_or((predicted, total), |z| (predicted + deviation * z, total))
            }
        }
    }
}

/// `ln(share P(z in piece))` of each piece.
#[inline]
fn log_shares(pieces: &[(Cell, f64)], predicted: f64, deviation: f64) -> impl Iterator<Item = f64> + '_ {
    pieces
        .iter()
        .map(move |(cell, share)| cell.log_probability(predicted, deviation) + share.ln())
}

/// The ends of a piece drawn with probability proportional to its share. No random number is used if there is only one.
#[inline]
fn choose<R: Rng + ?Sized>(
    rng: &mut R,
    pieces: &[(Cell, f64)],
    predicted: f64,
    deviation: f64,
    total: f64,
) -> (f64, f64) {
    let mut chosen = 0;
    if pieces.len() > 1 {
        // A piece of share zero is never chosen, even if rounding leaves a rest of the uniform draw at the end.
        // Evaluated again and not stored: a particle then needs no memory for its pieces, and the search stops at the chosen one.
        let mut left = rng.random::<f64>();
        for (i, term) in log_shares(pieces, predicted, deviation).enumerate() {
            let share = (term - total).exp();
            if share > 0.0 {
                chosen = i;
                if left < share {
                    break;
                }
                left -= share;
            }
        }
    }
    pieces
        .get(chosen)
        .map_or((f64::NEG_INFINITY, f64::INFINITY), |p| (p.0.lower(), p.0.upper()))
}
