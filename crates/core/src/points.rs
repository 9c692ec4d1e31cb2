//! A Gaussian update of weighted points: linear regression of the state on the noise-free measurement.
//!
//! Points stand for a Gaussian: those of an unscented or a cubature rule, or the members of an ensemble. Where the sensing model `h` is not
//! linear, the moments of `h` at the points replace its linearisation at the mean. The moments of the *factor* stay exact, since
//! [`Factor::tilted`] gives them: points are needed for `h` alone. With a linear `h` the update is that of
//! [`assumed_density::update`](crate::assumed_density::update).

use crate::circle::nearest;
use crate::columns::{Columns, ColumnsMut, columns_agree, count, set_state, state_at};
use crate::error::Error;
use crate::factor::Factor;
use crate::gaussian::Gaussian;
use crate::observed::Observed;
use crate::sensing::Sensing;
use fewbits_numerics::error::refuse;
use fewbits_numerics::linalg::{solve_semidefinite, triangular_factor};
use nalgebra::{SMatrix, SVector};

/// Mean and covariance of points whose weights sum to one.
pub fn moments<const D: usize>(states: &Columns<'_, D>, weights: &[f64]) -> Gaussian<D> {
    let sum = |column: &[f64]| weights.iter().zip(column).map(|(w, x)| w * x).sum::<f64>();
    let mean = SVector::<f64, D>::from_fn(|d, _| sum(states[d]));
    Gaussian::from_symmetric_parts(mean, cross(states, &mean, states, &mean, weights))
}

/// `sum w (x - mean x)(y - mean y)'`; symmetric to the last bit where both are the same points.
fn cross<const D: usize, const M: usize>(
    x: &Columns<'_, D>,
    mean_x: &SVector<f64, D>,
    y: &Columns<'_, M>,
    mean_y: &SVector<f64, M>,
    weights: &[f64],
) -> SMatrix<f64, D, M> {
    SMatrix::from_fn(|i, j| {
        let pairs = weights.iter().zip(x[i].iter().zip(y[j]));
        pairs.map(|(w, (a, b))| w * ((a - mean_x[i]) * (b - mean_y[j]))).sum()
    })
}

/// A matrix `A` with `A from A' = to` for covariances, where `from` has variance wherever `to` has. Triangular, and continuous in both.
fn between<const M: usize>(from: &SMatrix<f64, M, M>, to: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    let (from, to) = (triangular_factor(from), triangular_factor(to));
    // Row by row `a from = to`, from the last column on.
    let mut out = SMatrix::<f64, M, M>::zeros();
    for i in 0..M {
        for j in (0..=i).rev() {
            let rest: f64 = (j + 1..=i).map(|k| out[(i, k)] * from[(k, j)]).sum();
            if from[(j, j)] > 0.0 {
                out[(i, j)] = (to[(i, j)] - rest) / from[(j, j)];
            }
        }
    }
    out
}

/// Every point by a map; all or none, should one not be finite.
fn move_all<const D: usize>(
    states: &mut ColumnsMut<'_, D>,
    moved: impl Fn(usize, SVector<f64, D>) -> SVector<f64, D>,
) -> Result<(), Error> {
    let finite = |x: SVector<f64, D>| x.iter().all(|x| x.is_finite());
    if !(0..count(states)).all(|i| finite(moved(i, state_at(states, i)))) {
        return Err(Error::NotANumber {
            what: "a moved point (from the points, the sensing model or the factor)",
        });
    }
    for i in 0..count(states) {
        let next = moved(i, state_at(states, i));
        set_state(states, i, &next);
    }
    Ok(())
}

/// Moves points that have the moments of `from` so that they have those of `to`, by a linear map of their deviations.
///
/// # Errors
/// [`Error::NotANumber`] if a moved point is not finite; the points are then unchanged.
pub(crate) fn transport<const D: usize>(
    mut states: ColumnsMut<'_, D>,
    from: &Gaussian<D>,
    to: &Gaussian<D>,
) -> Result<(), Error> {
    let map = between(from.covariance(), to.covariance());
    move_all(&mut states, |_, x| to.mean() + map * (x - from.mean()))
}

/// Whether there is one weight per point.
pub(crate) fn check<const D: usize>(states: &mut ColumnsMut<'_, D>, weights: &[f64]) -> Result<(), Error> {
    if columns_agree(states) && states.iter().all(|column| column.len() == weights.len()) {
        return Ok(());
    }
    refuse("weights", format!("{} numbers", weights.len()), "one per point, and columns of equal length")
}

/// [`move_measured_points`] by what `observed` measures at the points.
///
/// # Errors
/// As there.
pub(crate) fn move_points<const D: usize, const M: usize>(
    mut states: ColumnsMut<'_, D>,
    weights: &[f64],
    observed: &Observed<impl Sensing<D, M>, impl Factor<M>, M>,
) -> Result<(f64, SVector<f64, M>), Error> {
    check(&mut states, weights)?;
    let mut measured: [Vec<f64>; M] = std::array::from_fn(|_| vec![0.0; weights.len()]);
    let shared: Columns<'_, D> = states.each_ref().map(|column| &**column);
    observed
        .sensing
        .mean_columns(&shared, measured.each_mut().map(Vec::as_mut_slice));
    unwrap(&mut measured, weights, &observed.sensing.periods(), observed.on_circle(&observed.sensing.periods()));
    move_measured_points(states, weights, &measured.each_ref().map(Vec::as_slice), &observed.factor)
}

/// Measurements on a circle: each nearest to the first, then all moved together, their mean nearest to the factor's `location`.
fn unwrap<const M: usize>(
    measured: &mut [Vec<f64>; M],
    weights: &[f64],
    periods: &[Option<f64>; M],
    location: Option<SVector<f64, M>>,
) {
    for (k, column) in measured.iter_mut().enumerate() {
        let (Some(period), Some(first)) = (periods[k], column.first().copied()) else {
            continue;
        };
        column.iter_mut().for_each(|m| *m = nearest(*m, first, period));
        let mean: f64 = weights.iter().zip(&*column).map(|(w, m)| w * m).sum();
        let turn = location.map_or(0.0, |location| nearest(mean, location[k], period) - mean);
        column.iter_mut().for_each(|m| *m += turn);
    }
}

/// Moves points whose weights sum to one so that they have the moments of the posterior. Returns the logarithm of the evidence and the
/// correction of the noise-free measurement.
///
/// ```text
/// y_i = h(x_i);  V = cov(y), C = cov(x, y)           (weighted)
/// T = tilted moments of y ~ N(mean y, V) given the observation
/// G = C V^-1,  A V A' = T.covariance
/// x_i += G (T.mean + A (y_i - mean y) - y_i)
/// ```
/// What `x` has beside its regression on `y` stays as it is, so the covariance of the moved points is a sum of squares: nothing is
/// subtracted from a covariance. With the points of a rule this is the square-root form of the unscented or cubature update, with the
/// members of an ensemble the two-step ensemble update of Anderson (2003) with the first two moments.
///
/// # Errors
/// [`Error::Impossible`] if the observation has probability zero; [`Error::NotANumber`] if a number overflows or is NaN; if there is not
/// one weight and one measurement per point. The points are then unchanged.
pub fn move_measured_points<const D: usize, const M: usize>(
    mut states: ColumnsMut<'_, D>,
    weights: &[f64],
    measured: &Columns<'_, M>,
    factor: &impl Factor<M>,
) -> Result<(f64, SVector<f64, M>), Error> {
    check(&mut states, weights)?;
    if let Some(other) = measured.iter().find(|column| column.len() != weights.len()) {
        return refuse("measured", format!("{} numbers", other.len()), "one per point");
    }
    let shared: Columns<'_, D> = states.each_ref().map(|column| &**column);
    let prior = moments(measured, weights);
    let state = moments(&shared, weights);
    if !(prior.is_finite() && state.is_finite()) {
        let what = "the predicted measurement (from the belief or the sensing model)";
        return Err(Error::NotANumber { what });
    }
    let tilted = factor.tilted(&prior)?;
    let together = cross(&shared, state.mean(), measured, prior.mean(), weights);
    let gain = solve_semidefinite(prior.covariance(), &together.transpose())?.transpose();
    let map = between(prior.covariance(), &tilted.covariance);
    if !tilted.log_evidence.is_finite() {
        return Err(Error::unlikely_or_no_number(tilted.log_evidence, "the evidence"));
    }
    move_all(&mut states, |i, x| {
        let y = state_at(measured, i);
        x + gain * (tilted.mean + map * (y - prior.mean()) - y)
    })?;
    Ok((tilted.log_evidence, tilted.mean - prior.mean()))
}
