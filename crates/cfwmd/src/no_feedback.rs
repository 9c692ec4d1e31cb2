//! Fusion without feedback: each sensor compares its measurement with the prediction of its own Kalman filter.
//!
//! The fusion centre does not know those predictions, so silence and even a received value say something about them too. The
//! belief is joint, over the state and every sensor's own estimate; given all that was heard it is what makes silence
//! informative. The paper averages the silent factor over estimates drawn independently of the past instead; that factor is
//! one constant for every state, cancels in the normalisation and leaves the filter that ignores silence
//! ([`NoFeedback::Literal`]; erratum `cfwmd-2`).

use crate::Error;
use crate::assumed_density::silent_moments;
use crate::ellipsoid::symmetric_eigen;
use crate::message::{Format, Report};
use crate::network::{FusionInfo, Network};
use crate::no_feedback_particle::ImputingFilter;
use crate::rule::{CensoringRule, OwnRecursion, OwnStep};
use fewbits_core::{Gaussian, GaussianDynamics, LinearDynamics, Observation};
use fewbits_filters::kalman;
use fewbits_models::LinearSensor;
use fewbits_numerics::error::all_finite;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// How a fusion centre without feedback treats silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoFeedback {
    /// Deaf to it: a Kalman filter on what was received (the paper's CFoMD).
    Ignore,
    /// Joint Gaussian belief with exact moments after each message. The default: as accurate as the next in every case measured.
    #[default]
    AssumedDensity,
    /// Exact as the number of particles grows: withheld measurements imputed, the rest Gaussian.
    RaoBlackwell(usize),
    /// The paper's printed likelihood, for reproduction only: silence multiplies every state's likelihood by the same
    /// `1 - l/N`, so that the belief is that of [`Ignore`](Self::Ignore) to the last bit.
    Literal,
}

/// The sensor's half without feedback: its own Kalman filter, fed with all its measurements.
#[derive(Debug, Clone)]
pub struct LocalSensor<const D: usize, const M: usize> {
    sensor: LinearSensor<D, M>,
    threshold: f64,
    format: Format,
    own: OwnRecursion<D>,
    estimate: SVector<f64, D>,
}

impl<const D: usize, const M: usize> LocalSensor<D, M> {
    /// A sensor that starts from the common belief.
    ///
    /// # Errors
    /// A threshold that is negative.
    pub fn new(sensor: LinearSensor<D, M>, threshold: f64, format: Format, start: &Gaussian<D>) -> Result<Self, Error> {
        fewbits_numerics::error::non_negative("threshold", threshold)?;
        Ok(Self {
            sensor,
            threshold,
            format,
            own: OwnRecursion::new(start),
            estimate: *start.mean(),
        })
    }

    /// The sensor's own estimate of the state.
    pub fn estimate(&self) -> &SVector<f64, D> {
        &self.estimate
    }

    /// Takes one measurement, updates its own filter with it and says what the rule lets it say.
    ///
    /// # Errors
    /// A measurement that is not finite.
    pub fn step(
        &mut self,
        dynamics: &(impl LinearDynamics<D> + GaussianDynamics<D>),
        measurement: &SVector<f64, M>,
    ) -> Result<Report<M>, Error> {
        all_finite("measurement", measurement.as_slice())?;
        let measurement = measurement.map(|z| self.format.rounded(z));
        let step = self.own.advance(dynamics, &self.sensor, &self.estimate)?;
        let rule = CensoringRule::new(&step.innovation_covariance, self.threshold)?;
        let predicted = dynamics.transition() * self.estimate;
        let innovation = measurement - self.sensor.matrix() * predicted;
        self.estimate = predicted + step.gain * innovation;
        Ok(if rule.speaks(&innovation) {
            Report::Value(measurement)
        } else {
            Report::Silence
        })
    }
}

/// Rules and gains of all sensors' own filters in one step.
#[derive(Debug)]
pub(crate) struct OwnFilters<const D: usize, const M: usize> {
    recursions: Vec<OwnRecursion<D>>,
    pub(crate) steps: Vec<(OwnStep<D, M>, CensoringRule<M>)>,
}

/// Copies reuse memory: one is made in every step.
impl<const D: usize, const M: usize> Clone for OwnFilters<D, M> {
    fn clone(&self) -> Self {
        Self {
            recursions: self.recursions.clone(),
            steps: self.steps.clone(),
        }
    }

    fn clone_from(&mut self, other: &Self) {
        self.recursions.clone_from(&other.recursions);
        self.steps.clone_from(&other.steps);
    }
}

impl<const D: usize, const M: usize> OwnFilters<D, M> {
    pub(crate) fn new(start: &Gaussian<D>, sensors: usize) -> Self {
        Self {
            recursions: vec![OwnRecursion::new(start); sensors],
            steps: Vec::with_capacity(sensors),
        }
    }

    pub(crate) fn advance(
        &mut self,
        network: &Network<D, M>,
        dynamics: &impl GaussianDynamics<D>,
    ) -> Result<(), Error> {
        self.steps.clear();
        for (recursion, sensor) in self.recursions.iter_mut().zip(network.sensors()) {
            let step = recursion.advance(dynamics, sensor, &SVector::zeros())?;
            let rule = CensoringRule::new(&step.innovation_covariance, network.threshold())?;
            self.steps.push((step, rule));
        }
        Ok(())
    }
}

/// A fusion centre without feedback.
#[derive(Debug, Clone)]
pub struct NoFeedbackCentre<const D: usize, const M: usize> {
    network: Network<D, M>,
    estimator: Estimator<D, M>,
}

#[derive(Debug, Clone)]
enum Estimator<const D: usize, const M: usize> {
    /// With the logarithm of the constant that the printed likelihood gives to one silence.
    Deaf(Gaussian<D>, f64),
    Joint(Box<JointFilter<D, M>>),
    Imputing(Box<ImputingFilter<D, M>>),
}

impl<const D: usize, const M: usize> NoFeedbackCentre<D, M> {
    /// A centre that starts from the belief all sensors start from. `rate` is the probability `l/N` that a sensor speaks; only
    /// [`NoFeedback::Literal`] looks at it.
    ///
    /// # Errors
    /// No particle; a rate outside `(0, 1]`.
    pub fn new(network: Network<D, M>, start: &Gaussian<D>, method: NoFeedback, rate: f64) -> Result<Self, Error> {
        fewbits_numerics::error::within("rate", rate, f64::MIN_POSITIVE, 1.0)?;
        let estimator = match method {
            NoFeedback::Ignore => Estimator::Deaf(*start, 0.0),
            NoFeedback::Literal => Estimator::Deaf(*start, (-rate).ln_1p()),
            NoFeedback::AssumedDensity => Estimator::Joint(Box::new(JointFilter::new(start, network.len()))),
            NoFeedback::RaoBlackwell(particles) => {
                Estimator::Imputing(Box::new(ImputingFilter::new(start, network.len(), particles)?))
            }
        };
        Ok(Self { network, estimator })
    }

    /// Mean and covariance of the state.
    pub fn belief(&self) -> Gaussian<D> {
        match &self.estimator {
            Estimator::Deaf(belief, _) => *belief,
            Estimator::Joint(joint) => joint.belief.state(),
            Estimator::Imputing(particles) => particles.belief(),
        }
    }

    /// Number of received values so far that the rule should have kept silent under every particle; only the
    /// Rao-Blackwellised filter can tell.
    pub fn violations(&self) -> usize {
        match &self.estimator {
            Estimator::Imputing(particles) => particles.violations(),
            _ => 0,
        }
    }

    /// One step: predict, hear one observation a sensor.
    ///
    /// # Errors
    /// [`Error::ObservationCount`], values that are not finite, [`Error::ImpossibleSilence`], [`Error::ProtocolViolation`]
    /// where the sensor's prediction is known exactly; the belief is then as it was.
    pub fn step<R: Rng + ?Sized>(
        &mut self,
        rng: &mut R,
        dynamics: &(impl LinearDynamics<D> + GaussianDynamics<D>),
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<FusionInfo, Error> {
        let network = &self.network;
        if heard.len() != network.len() {
            return Err(Error::ObservationCount {
                heard: heard.len(),
                sensors: network.len(),
            });
        }
        for (sensor, observation) in heard.iter().enumerate() {
            match observation {
                Observation::Received(value) => all_finite("measurement", value.as_slice())?,
                Observation::Silent if network.threshold() == 0.0 && network.loss() == 0.0 => {
                    return Err(Error::ImpossibleSilence { sensor });
                }
                Observation::Silent | Observation::Lost => {}
            }
        }
        match &mut self.estimator {
            Estimator::Deaf(belief, log_silence) => {
                let (next, mut info) = network.fuse_values(&kalman::predict(dynamics, belief), heard)?;
                *belief = next;
                let silent = heard.iter().filter(|o| **o == Observation::Silent).count();
                if *log_silence < 0.0 {
                    info.log_likelihood += silent as f64 * *log_silence;
                }
                Ok(info)
            }
            Estimator::Joint(joint) => joint.step(network, dynamics, heard),
            Estimator::Imputing(particles) => particles.step(rng, network, dynamics, heard),
        }
    }
}

/// A Gaussian belief about the state and every sensor's own estimate: block 0 is the state, block `i + 1` the estimate of
/// sensor `i`.
#[derive(Debug, Clone)]
struct JointBelief<const D: usize> {
    means: Vec<SVector<f64, D>>,
    /// Row-major blocks of the covariance.
    blocks: Vec<SMatrix<f64, D, D>>,
}

impl<const D: usize> JointBelief<D> {
    fn new(start: &Gaussian<D>, sensors: usize) -> Self {
        let size = sensors + 1;
        let mut blocks = vec![SMatrix::zeros(); size * size];
        blocks[0] = *start.covariance();
        Self {
            means: vec![*start.mean(); size],
            blocks,
        }
    }

    fn size(&self) -> usize {
        self.means.len()
    }

    fn block(&self, a: usize, b: usize) -> &SMatrix<f64, D, D> {
        &self.blocks[a * self.size() + b]
    }

    fn state(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.means[0], self.blocks[0])
    }

    fn copy_from(&mut self, other: &Self) {
        self.means.copy_from_slice(&other.means);
        self.blocks.copy_from_slice(&other.blocks);
    }

    fn predict(&mut self, dynamics: &impl LinearDynamics<D>) {
        let f = dynamics.transition();
        self.means.iter_mut().for_each(|m| *m = f * *m);
        self.blocks.iter_mut().for_each(|c| *c = f * *c * f.transpose());
        self.blocks[0] += dynamics.noise_covariance();
    }

    /// Something linear in the joint state, with gains `K_a` onto each block, moved by `shift` and lost `shrink` of its
    /// covariance: `m_a += K_a shift`, `C_ab -= K_a shrink K_b'`.
    fn regress<const M: usize>(
        &mut self,
        gains: &[SMatrix<f64, D, M>],
        shift: &SVector<f64, M>,
        shrink: &SMatrix<f64, M, M>,
    ) {
        let size = self.size();
        for a in 0..size {
            self.means[a] += gains[a] * shift;
            let left = gains[a] * shrink;
            for b in 0..size {
                self.blocks[a * size + b] -= left * gains[b].transpose();
            }
        }
    }

    /// Rounding must not make the covariance lopsided over thousands of steps.
    fn symmetrise(&mut self) {
        let size = self.size();
        for a in 0..size {
            for b in 0..=a {
                let mean = (self.blocks[a * size + b] + self.blocks[b * size + a].transpose()) * 0.5;
                self.blocks[a * size + b] = mean;
                self.blocks[b * size + a] = mean.transpose();
            }
        }
    }
}

/// Above this probability of the contrary a received value is taken as is: conditioning on a rarer event would amplify the
/// error of the Gaussian belief in its tails.
const IMPLAUSIBLE: f64 = 0.999;
/// Variances below this share of the innovation's count as zero.
const NEGLIGIBLE: f64 = 1e-12;

/// The assumed-density filter on the joint belief.
///
/// ```text
/// predict: every block by F, process noise on the state only
/// received z:  Kalman update with z = H x + n
///              t = H xhat_i was at least the threshold away from z: moments of a Gaussian outside an ellipsoid
///              xhat_i <- (I - W H) xhat_i + W z
/// silent:      y = H (x - xhat_i) + n lies inside the ellipsoid: truncated moments, regress everything on y
///              xhat_i <- xhat_i + W y
/// ```
#[derive(Debug, Clone)]
struct JointFilter<const D: usize, const M: usize> {
    own: OwnFilters<D, M>,
    spare_own: OwnFilters<D, M>,
    belief: JointBelief<D>,
    spare: JointBelief<D>,
    gains: Vec<SMatrix<f64, D, M>>,
}

impl<const D: usize, const M: usize> JointFilter<D, M> {
    fn new(start: &Gaussian<D>, sensors: usize) -> Self {
        let belief = JointBelief::new(start, sensors);
        let own = OwnFilters::new(start, sensors);
        Self {
            spare_own: own.clone(),
            own,
            spare: belief.clone(),
            belief,
            gains: vec![SMatrix::zeros(); sensors + 1],
        }
    }

    fn step(
        &mut self,
        network: &Network<D, M>,
        dynamics: &(impl LinearDynamics<D> + GaussianDynamics<D>),
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<FusionInfo, Error> {
        self.spare_own.recursions.copy_from_slice(&self.own.recursions);
        self.spare_own.advance(network, dynamics)?;
        self.spare.copy_from(&self.belief);
        self.spare.predict(dynamics);
        let mut info = FusionInfo {
            log_likelihood: 0.0,
            received: 0,
        };
        for (i, observation) in heard.iter().enumerate() {
            if let Observation::Received(value) = observation {
                info.log_likelihood += self.hear_value(network, i, value)?;
                info.received += 1;
            }
        }
        for (i, observation) in heard.iter().enumerate() {
            match observation {
                Observation::Silent => info.log_likelihood += self.hear_silence(network, i, network.loss())?,
                // Nothing is known of the measurement, but the sensor's own filter used it all the same.
                Observation::Lost => drop(self.absorb_unseen(network, i)?),
                Observation::Received(_) => {}
            }
        }
        self.spare.symmetrise();
        std::mem::swap(&mut self.belief, &mut self.spare);
        std::mem::swap(&mut self.own, &mut self.spare_own);
        Ok(info)
    }

    fn hear_value(&mut self, network: &Network<D, M>, i: usize, value: &SVector<f64, M>) -> Result<f64, Error> {
        let sensor = &network.sensors()[i];
        let h = sensor.matrix();
        let (step, rule) = &self.spare_own.steps[i];
        let (belief, gains) = (&mut self.spare, &mut self.gains);

        let innovation = value - h * belief.means[0];
        let covariance = symmetrised(&(h * belief.blocks[0] * h.transpose() + sensor.noise_covariance()));
        let factor = Cholesky::new(covariance).ok_or(fewbits_filters::Error::SingularInnovation)?;
        for (a, gain) in gains.iter_mut().enumerate() {
            *gain = factor.solve(&(h * belief.block(0, a))).transpose();
        }
        belief.regress(gains, &innovation, &covariance);
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let mut log_likelihood =
            -0.5 * innovation.dot(&factor.solve(&innovation)) - log_determinant - M as f64 * LN_SQRT_2PI;

        let own = i + 1;
        let mu = value - h * belief.means[own];
        let spread = symmetrised(&(h * belief.block(own, own) * h.transpose()));
        let known = spread.amax() <= NEGLIGIBLE * covariance.amax();
        if known {
            rule.audit(i, &mu)?;
        } else if rule.threshold() > 0.0 {
            let inside = rule.region().under(&spread)?.moments(&mu);
            let p = inside.map_or(0.0, |inside| inside.log_mass.exp());
            if let Some(inside) = inside.filter(|_| p < IMPLAUSIBLE) {
                let outside = (mu - inside.mean * p) / (1.0 - p);
                let second =
                    spread + mu * mu.transpose() - (inside.covariance + inside.mean * inside.mean.transpose()) * p;
                let left = second / (1.0 - p) - outside * outside.transpose();
                let inverse = pseudo_inverse(&spread, NEGLIGIBLE * covariance.amax());
                for (a, gain) in gains.iter_mut().enumerate() {
                    *gain = belief.block(a, own) * h.transpose() * inverse;
                }
                // t = z - nu, so that its mean moves the other way.
                belief.regress(gains, &(mu - outside), &symmetrised(&(spread - left)));
                log_likelihood += (-p).ln_1p();
            }
        }

        let keep = SMatrix::<f64, D, D>::identity() - step.gain * h;
        belief.means[own] = keep * belief.means[own] + step.gain * value;
        let size = belief.size();
        for a in 0..size {
            belief.blocks[own * size + a] = keep * belief.blocks[own * size + a];
        }
        for a in 0..size {
            belief.blocks[a * size + own] *= keep.transpose();
        }
        Ok(log_likelihood)
    }

    fn hear_silence(&mut self, network: &Network<D, M>, i: usize, loss: f64) -> Result<f64, Error> {
        let (mu, covariance) = self.relative_innovation(network, i)?;
        let rule = &self.spare_own.steps[i].1;
        let after = silent_moments(rule, &mu, &covariance, loss)?;
        self.spare
            .regress(&self.gains, &(after.mean - mu), &(covariance - after.covariance));
        self.absorb(i, &after.mean, &after.covariance);
        Ok(after.log_mass)
    }

    fn absorb_unseen(&mut self, network: &Network<D, M>, i: usize) -> Result<(), Error> {
        let (mu, covariance) = self.relative_innovation(network, i)?;
        self.absorb(i, &mu, &covariance);
        Ok(())
    }

    /// Mean and covariance of `y = H (x - xhat_i) + n`; leaves the gains of everything on `y`.
    fn relative_innovation(
        &mut self,
        network: &Network<D, M>,
        i: usize,
    ) -> Result<(SVector<f64, M>, SMatrix<f64, M, M>), Error> {
        let sensor = &network.sensors()[i];
        let (belief, own, h) = (&self.spare, i + 1, sensor.matrix());
        let difference = belief.block(0, 0) - belief.block(0, own) - belief.block(own, 0) + belief.block(own, own);
        let covariance = symmetrised(&(h * difference * h.transpose() + sensor.noise_covariance()));
        let factor = Cholesky::new(covariance).ok_or(fewbits_filters::Error::SingularInnovation)?;
        for (a, gain) in self.gains.iter_mut().enumerate() {
            let cross = h * (belief.block(0, a) - belief.block(own, a));
            *gain = factor.solve(&cross).transpose();
        }
        Ok((h * (belief.means[0] - belief.means[own]), covariance))
    }

    /// `xhat_i += W y`, where everything regresses on `y` with the gains at hand and `y` now has this mean and covariance.
    fn absorb(&mut self, i: usize, mean: &SVector<f64, M>, covariance: &SMatrix<f64, M, M>) {
        let weight = &self.spare_own.steps[i].0.gain;
        let (belief, own) = (&mut self.spare, i + 1);
        belief.means[own] += weight * mean;
        let size = belief.size();
        for a in 0..size {
            // Cov(W y, X_a) = W Cov(y) K_a'.
            let cross = weight * covariance * self.gains[a].transpose();
            belief.blocks[own * size + a] += cross;
            belief.blocks[a * size + own] += cross.transpose();
        }
        belief.blocks[own * size + own] += weight * covariance * weight.transpose();
    }
}

/// Inverse on the eigenvectors whose eigenvalues exceed `floor`, zero on the others.
fn pseudo_inverse<const M: usize>(matrix: &SMatrix<f64, M, M>, floor: f64) -> SMatrix<f64, M, M> {
    let (values, vectors) = symmetric_eigen(*matrix);
    let inverted = values.map(|v| if v > floor { 1.0 / v } else { 0.0 });
    vectors * SMatrix::from_diagonal(&inverted) * vectors.transpose()
}
