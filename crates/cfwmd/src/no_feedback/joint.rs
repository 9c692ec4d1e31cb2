//! The assumed-density filter for the state and every sensor's own estimate together.

use super::{advance, check};
use crate::Error;
use crate::ellipsoid::EllipsoidMoments;
use crate::missing::Missing;
use crate::network::Network;
use crate::rule::{CensoringRule, OwnRecursion, OwnStep};
use fewbits_core::{Gaussian, LinearDynamics, LinearSensing, Observation};
use fewbits_filters::Info;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::linalg::{semidefinite_factor, symmetrised};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, Const, DMatrix, DVector, Dyn, OMatrix, SMatrix, SVector};

/// A Gaussian belief of the state and of every sensor's own estimate: `D (sensors + 1)` components. Block 0 is the state, block
/// `i + 1` the estimate of sensor `i`.
///
/// The covariance is stored as a square root. Updates append columns to it, and an orthogonal triangularisation shortens it again. It
/// therefore stays positive semidefinite for any ratio of the variances.
#[derive(Debug, Clone, PartialEq)]
pub struct JointBelief<const D: usize> {
    own: Vec<OwnRecursion<D>>,
    mean: DVector<f64>,
    /// `L` with `C = L L'`.
    root: DMatrix<f64>,
}

/// If the sensor would have been silent with a probability above this, a received value is fused without the rule: conditioning on a
/// rarer event would amplify the error of the Gaussian belief in its tails.
const IMPLAUSIBLE: f64 = 0.999;
/// Eigenvalues below this share of the innovation's count as zero.
const NEGLIGIBLE: f64 = 1e-12;

/// One row of the measurement equation per component, one column per column of the root.
type Rows<const M: usize> = OMatrix<f64, Const<M>, Dyn>;
/// Regression coefficients of the joint state on a measurement.
type Gains<const M: usize> = OMatrix<f64, Dyn, Const<M>>;
/// Covariance of a measurement, the factor of it, and the regression of the joint state on the measurement.
type Regression<const M: usize> = (SMatrix<f64, M, M>, Cholesky<f64, Const<M>>, Gains<M>);

impl<const D: usize> JointBelief<D> {
    /// The belief before the first step: every sensor's estimate is the mean of `start`.
    ///
    /// # Errors
    /// If the covariance of `start` is not positive semidefinite.
    pub fn new(start: &Gaussian<D>, sensors: usize) -> Result<Self, Error> {
        let size = (sensors + 1) * D;
        let factor = semidefinite_factor("start", start.covariance())?;
        let mut root = DMatrix::zeros(size, D);
        root.fixed_rows_mut::<D>(0).copy_from(&factor);
        Ok(Self {
            own: vec![OwnRecursion::new(start); sensors],
            mean: DVector::from_fn(size, |i, _| start.mean()[i % D]),
            root,
        })
    }

    /// Mean and covariance of the state.
    pub fn state(&self) -> Gaussian<D> {
        self.block(0)
    }

    /// Mean and covariance of sensor `i`'s estimate; `None` if there is no such sensor.
    pub fn estimate(&self, i: usize) -> Option<Gaussian<D>> {
        (i < self.own.len()).then(|| self.block(i + 1))
    }

    fn block(&self, block: usize) -> Gaussian<D> {
        let root = self.root.fixed_rows::<D>(block * D);
        Gaussian::from_trusted_parts(self.block_mean(block), root * root.transpose())
    }

    fn block_mean(&self, block: usize) -> SVector<f64, D> {
        self.mean.fixed_rows::<D>(block * D).into_owned()
    }

    fn predict(&mut self, dynamics: &impl LinearDynamics<D>) -> Result<(), Error> {
        let (transition, noise) =
            (dynamics.transition(), semidefinite_factor("noise_covariance", dynamics.noise_covariance())?);
        for block in (0..self.mean.len()).step_by(D) {
            let mean = transition * self.mean.fixed_rows::<D>(block);
            self.mean.fixed_rows_mut::<D>(block).copy_from(&mean);
            let root = transition * self.root.fixed_rows::<D>(block);
            self.root.fixed_rows_mut::<D>(block).copy_from(&root);
        }
        let mut columns = DMatrix::zeros(self.mean.len(), D);
        columns.fixed_rows_mut::<D>(0).copy_from(&noise);
        self.append(&[columns]);
        Ok(())
    }

    fn append(&mut self, columns: &[DMatrix<f64>]) {
        let more: usize = columns.iter().map(DMatrix::ncols).sum();
        let mut at = self.root.ncols();
        let root = std::mem::replace(&mut self.root, DMatrix::zeros(0, 0));
        self.root = root.resize_horizontally(at + more, 0.0);
        for part in columns {
            self.root.columns_mut(at, part.ncols()).copy_from(part);
            at += part.ncols();
        }
    }

    /// Reduces the root to at most as many columns as rows; the covariance is unchanged.
    fn shorten(&mut self) {
        if self.root.ncols() > self.root.nrows() {
            self.root = self.root.transpose().qr().r().transpose();
        }
    }

    /// `H L` with the rows of `L` that belong to one block.
    fn rows<const M: usize>(&self, matrix: &SMatrix<f64, M, D>, block: usize) -> Rows<M> {
        matrix * self.root.fixed_rows::<D>(block * D)
    }

    /// A measurement that is a linear function of the joint state, with root `rows`, plus the sensor's noise.
    fn regression<const M: usize>(
        &self,
        sensor: &impl LinearSensing<D, M>,
        rows: &Rows<M>,
    ) -> Result<Regression<M>, Error> {
        let covariance = symmetrised(&(rows * rows.transpose() + sensor.noise_covariance()));
        let factor = Cholesky::new(covariance).ok_or(Error::Impossible)?;
        let gains = factor.solve(&(rows * self.root.transpose())).transpose();
        Ok((covariance, factor, gains))
    }

    /// Removes from the joint state the part that its regression on a variable explains: `L <- L - G rows`. `rows` are the root of the
    /// variable, `G` the regression coefficients.
    fn detach<const M: usize>(&mut self, gains: &Gains<M>, rows: &Rows<M>) {
        self.root -= gains * rows;
    }

    fn shift<const M: usize>(&mut self, gains: &Gains<M>, by: &SVector<f64, M>) {
        self.mean += gains * by;
    }

    /// Fuses a received value: a Kalman update, the condition of the rule on the sensor's own prediction, and the sensor's own update.
    fn receive<const M: usize>(
        &mut self,
        sensor: &impl LinearSensing<D, M>,
        (step, rule): &(OwnStep<D, M>, CensoringRule<M>),
        i: usize,
        value: &SVector<f64, M>,
    ) -> Result<f64, Error> {
        let (h, own) = (sensor.matrix(), i + 1);
        let rows = self.rows(h, 0);
        let (covariance, factor, gains) = self.regression(sensor, &rows)?;
        let innovation = value - h * self.block_mean(0);
        let noise = semidefinite_factor("noise_covariance", sensor.noise_covariance())?;
        // Joseph form on the root: `C = (L - G H L)(L - G H L)' + G R G'`.
        self.shift(&gains, &innovation);
        self.detach(&gains, &rows);
        self.append(&[columns(&gains * noise)]);
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let mut log_likelihood =
            -0.5 * innovation.dot(&factor.solve(&innovation)) - log_determinant - M as f64 * LN_SQRT_2PI;

        // The sensor's prediction t = H xhat_i was at least the threshold away from z: a Gaussian outside an ellipsoid.
        let mu = value - h * self.block_mean(own);
        let rows = self.rows(h, own);
        let spread = symmetrised(&(&rows * rows.transpose()));
        if spread.amax() <= NEGLIGIBLE * covariance.amax() {
            rule.check(&mu, &(value * 6e-8).abs())?;
        } else if rule.region().threshold() > 0.0 {
            let inside = rule.region().under(&spread)?.moments(&mu);
            let p = inside.map_or(0.0, |inside| inside.log_mass.exp());
            // Rounding may give p = 1. The report is then improbable, not impossible.
            log_likelihood += (1.0 - p).max(f64::EPSILON).ln();
            if let Some(inside) = inside.filter(|_| p < IMPLAUSIBLE) {
                // Moments outside: the whole is the mixture of inside (weight p) and outside.
                let outside = (mu - inside.mean * p) / (1.0 - p);
                let apart = inside.mean - outside;
                let left = (spread - inside.covariance * p) / (1.0 - p) - apart * apart.transpose() * p;
                let inverse = pseudo_inverse(&spread, NEGLIGIBLE * covariance.amax());
                let gains: Gains<M> = &self.root * rows.transpose() * inverse;
                // t = z - nu: the mean of t moves opposite to that of nu.
                self.shift(&gains, &(mu - outside));
                self.detach(&gains, &rows);
                self.append(&[columns(&gains * square_root(&left))]);
            }
        }

        let keep = SMatrix::<f64, D, D>::identity() - step.gain * h;
        let mean = keep * self.block_mean(own) + step.gain * value;
        self.mean.fixed_rows_mut::<D>(own * D).copy_from(&mean);
        let root = keep * self.root.fixed_rows::<D>(own * D);
        self.root.fixed_rows_mut::<D>(own * D).copy_from(&root);
        Ok(log_likelihood)
    }

    /// Fuses a missing report. `after` maps prior mean and covariance of the innovation `y = H (x - xhat_i) + n` to its moments given that
    /// the report is missing. The sensor's own filter used the measurement all the same: `xhat_i += W y`.
    fn withhold<const M: usize>(
        &mut self,
        sensor: &impl LinearSensing<D, M>,
        step: &OwnStep<D, M>,
        i: usize,
        after: impl FnOnce(&SVector<f64, M>, &SMatrix<f64, M, M>) -> Result<EllipsoidMoments<M>, Error>,
    ) -> Result<f64, Error> {
        let (h, own) = (sensor.matrix(), i + 1);
        // The innovation of the sensor is a linear function of the joint state, plus noise.
        let rows = self.rows(h, 0) - self.rows(h, own);
        let (covariance, _, mut gains) = self.regression(sensor, &rows)?;
        let mu = h * (self.block_mean(0) - self.block_mean(own));
        let after = after(&mu, &covariance)?;
        let noise = semidefinite_factor("noise_covariance", sensor.noise_covariance())?;
        self.shift(&gains, &(after.mean - mu));
        self.detach(&gains, &rows);
        let residual = columns(&gains * noise);
        // The sensor has used its measurement: its block moves by its own gain.
        let mut mean = self.mean.fixed_rows_mut::<D>(own * D);
        mean += step.gain * after.mean;
        let mut absorbed = gains.fixed_rows_mut::<D>(own * D);
        absorbed += step.gain;
        self.append(&[residual, columns(&gains * square_root(&after.covariance))]);
        Ok(after.log_mass)
    }
}

/// One step: predict, then one observation per sensor.
///
/// ```text
/// predict: every block by F, process noise on the state only
/// received z:  Kalman update with z = H x + n
///              t = H xhat_i was at least the threshold away from z: moments of a Gaussian outside an ellipsoid
///              xhat_i <- (I - W H) xhat_i + W z
/// nothing:     y = H (x - xhat_i) + n lies inside the ellipsoid (or was lost): moments, regress everything on y
///              xhat_i <- xhat_i + W y
/// lost:        y lies outside the ellipsoid: the same with the moments there
/// ```
///
/// # Errors
/// If there is not one observation per sensor, or a value is not finite; [`Error::Impossible`];
/// if the sensor's prediction is known exactly and the value violates the rule.
pub fn step<S: LinearSensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    network: &Network<S, D, M>,
    dynamics: &impl LinearDynamics<D>,
    belief: &JointBelief<D>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<(JointBelief<D>, Info), Error> {
    check(network, observations)?;
    let (mut next, mut info) = (belief.clone(), Info::default());
    let steps = advance(&mut next.own, network, dynamics)?;
    next.predict(dynamics)?;
    let link = network.link();
    let sensors = || network.sensors().iter().zip(&steps).zip(observations).enumerate();
    // Values first: their Kalman update is exact, and the moments of silence are then computed from the better belief.
    for (i, ((sensor, step), observation)) in sensors() {
        if let Observation::Received(value) = observation {
            info.log_likelihood += link.of_received()?.ln() + next.receive(sensor, step, i, value)?;
        }
    }
    for (i, ((sensor, (step, rule)), observation)) in sensors() {
        let missing = match observation {
            Observation::Nothing => Missing::nothing(link),
            Observation::Lost => Missing::lost(link),
            Observation::Received(_) => continue,
        };
        info.log_likelihood +=
            next.withhold(sensor, step, i, |mu, covariance| missing.innovation_moments(rule, mu, covariance))?;
    }
    next.shorten();
    let mut numbers = next.mean.iter().chain(next.root.iter());
    if !(info.log_likelihood.is_finite() && numbers.all(|x| x.is_finite())) {
        let what = "the joint belief (from the models or the reports)";
        return Err(Error::unlikely_or_no_number(info.log_likelihood, what));
    }
    Ok((next, info))
}

fn columns<const M: usize>(part: Gains<M>) -> DMatrix<f64> {
    let rows = part.nrows();
    part.reshape_generic(Dyn(rows), Dyn(M))
}

/// Pseudo-inverse of a symmetric matrix: eigenvalues up to `floor` count as zero.
fn pseudo_inverse<const M: usize>(matrix: &SMatrix<f64, M, M>, floor: f64) -> SMatrix<f64, M, M> {
    let (values, vectors) = symmetric_eigen(*matrix);
    let inverted = values.map(|v| if v > floor { 1.0 / v } else { 0.0 });
    vectors * SMatrix::from_diagonal(&inverted) * vectors.transpose()
}

/// A square root of a covariance; eigenvalues that rounding made negative count as zero.
fn square_root<const M: usize>(matrix: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    let (values, vectors) = symmetric_eigen(symmetrised(matrix));
    vectors * SMatrix::from_diagonal(&values.map(|v| v.max(0.0).sqrt()))
}
