//! The exact fusion centre without feedback: withheld measurements are imputed, the rest is Gaussian.

use crate::Error;
use crate::network::{FusionInfo, Network};
use crate::no_feedback::OwnFilters;
use fewbits_core::{ColumnsMut, Gaussian, GaussianDynamics, LinearDynamics, Observation};
use fewbits_densities::Particles;
use fewbits_filters::{Resampling, Schedule};
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::{self, LN_SQRT_2PI};
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Log weight of a particle for which a sensor sent what it should have withheld: finite, so that the filter survives a
/// message that contradicts all of them.
const VIOLATION: f64 = -1e5;

/// Given every measurement, sent or not, the central Kalman filter and each sensor's own are deterministic. A particle is the
/// central mean and every sensor's estimate under the measurements it imputed; all share one covariance.
///
/// ```text
/// predict: xc = F xc, xhat_i = F xhat_i;  P = F P F' + Q
/// received z of i:  w *= N(z; H xc, S);  w *= 1{|z - H xhat_i| >= threshold};  Kalman update of xc, own update of xhat_i
/// silent i:         z ~ N(H xc, S) where |z - H xhat_i| < threshold, w *= P(there);  the same updates with that z
/// P = P - K S K' once a sensor;  resample systematically below half the effective sample size
/// ```
/// Scalar measurements are drawn from their conditional law; vector ones uniformly in the ellipsoid and weighted. With loss the
/// silent law is `N(z) (loss + (1 - loss) 1{inside})`.
#[derive(Debug, Clone)]
pub(crate) struct ImputingFilter<const D: usize, const M: usize> {
    now: Cloud<D, M>,
    /// The step under construction: it becomes `now` when it has succeeded.
    next: Cloud<D, M>,
    increments: Vec<f64>,
    ancestors: Vec<u32>,
    column: Vec<f64>,
    violations: usize,
}

#[derive(Debug, Clone)]
struct Cloud<const D: usize, const M: usize> {
    own: OwnFilters<D, M>,
    central: Particles<D>,
    /// Columns of the sensors' estimates, `D` a sensor.
    local: Vec<Vec<f64>>,
    covariance: SMatrix<f64, D, D>,
}

/// One sensor in one step.
struct Turn<'a, const D: usize, const M: usize> {
    /// `S = H P H' + R` and its factor.
    factor: Cholesky<f64, Const<M>>,
    gain: SMatrix<f64, D, M>,
    own_gain: SMatrix<f64, D, M>,
    rule: &'a crate::rule::CensoringRule<M>,
    log_normaliser: f64,
    loss: f64,
}

impl<const D: usize, const M: usize> ImputingFilter<D, M> {
    pub(crate) fn new(start: &Gaussian<D>, sensors: usize, particles: usize) -> Result<Self, Error> {
        let now = Cloud {
            own: OwnFilters::new(start, sensors),
            central: Particles::from_draws(particles, || *start.mean())?,
            local: (0..sensors * D).map(|c| vec![start.mean()[c % D]; particles]).collect(),
            covariance: *start.covariance(),
        };
        Ok(Self {
            next: now.clone(),
            now,
            increments: vec![0.0; particles],
            ancestors: vec![0; particles],
            column: vec![0.0; particles],
            violations: 0,
        })
    }

    pub(crate) fn belief(&self) -> Gaussian<D> {
        let mean = self.now.central.mean();
        Gaussian::from_trusted_parts(mean, self.now.covariance + self.now.central.covariance_about(&mean))
    }

    pub(crate) fn violations(&self) -> usize {
        self.violations
    }

    pub(crate) fn step<R: Rng + ?Sized>(
        &mut self,
        rng: &mut R,
        network: &Network<D, M>,
        dynamics: &(impl LinearDynamics<D> + GaussianDynamics<D>),
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<FusionInfo, Error> {
        self.resample(rng)?;
        self.next.copy_from(&self.now);
        self.next.predict(dynamics);
        self.next.own.advance(network, dynamics)?;
        self.increments.fill(0.0);
        let (mut received, mut violations) = (0, 0);
        for spoken in [true, false] {
            for (i, observation) in heard.iter().enumerate() {
                if matches!(observation, Observation::Received(_)) == spoken {
                    received += usize::from(spoken);
                    let clash = self.next.hear(rng, network, i, observation, &mut self.increments)?;
                    violations += usize::from(clash);
                }
            }
        }
        let increments = &self.increments;
        let log_likelihood = self.next.central.reweigh(|_, log_weights| {
            for (log_weight, increment) in log_weights.iter_mut().zip(increments) {
                *log_weight += increment;
            }
        })?;
        std::mem::swap(&mut self.now, &mut self.next);
        self.violations += violations;
        Ok(FusionInfo {
            log_likelihood,
            received,
        })
    }

    fn resample<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Result<(), Error> {
        let cloud = &mut self.now;
        if !Schedule::Below(0.5).is_due(cloud.central.effective_sample_size(), cloud.central.len()) {
            return Ok(());
        }
        Resampling::Systematic.ancestors(rng, cloud.central.weights(), &mut self.ancestors)?;
        cloud.central.select(&self.ancestors)?;
        for column in &mut cloud.local {
            for (new, a) in self.column.iter_mut().zip(&self.ancestors) {
                *new = column[*a as usize];
            }
            std::mem::swap(column, &mut self.column);
        }
        Ok(())
    }
}

impl<const D: usize, const M: usize> Cloud<D, M> {
    fn copy_from(&mut self, other: &Self) {
        self.own.clone_from(&other.own);
        self.central.clone_from(&other.central);
        self.local.clone_from(&other.local);
        self.covariance = other.covariance;
    }

    fn predict(&mut self, dynamics: &impl LinearDynamics<D>) {
        let transition = dynamics.transition();
        self.covariance = transition * self.covariance * transition.transpose() + dynamics.noise_covariance();
        let central = self.central.columns_mut();
        move_columns(transition, central);
        for sensor in self.local.chunks_exact_mut(D) {
            let mut columns = sensor.iter_mut();
            // `chunks_exact_mut` hands out D columns.
            move_columns(transition, std::array::from_fn(|_| columns.next().map_or(&mut [][..], Vec::as_mut_slice)));
        }
    }

    /// Hears one sensor; tells whether it contradicted every particle.
    fn hear<R: Rng + ?Sized>(
        &mut self,
        rng: &mut R,
        network: &Network<D, M>,
        i: usize,
        observation: &Observation<SVector<f64, M>>,
        increments: &mut [f64],
    ) -> Result<bool, Error> {
        let sensor = &network.sensors()[i];
        let h = *sensor.matrix();
        let cross = self.covariance * h.transpose();
        let innovation = symmetrised(&(h * cross + sensor.noise_covariance()));
        let factor = Cholesky::new(innovation).ok_or(fewbits_filters::Error::SingularInnovation)?;
        let gain = factor.solve(&cross.transpose()).transpose();
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let (step, rule) = &self.own.steps[i];
        let turn = Turn {
            gain,
            own_gain: step.gain,
            rule,
            log_normaliser: -log_determinant - M as f64 * LN_SQRT_2PI,
            loss: network.loss(),
            factor,
        };
        let local = &mut self.local[i * D..(i + 1) * D];
        let columns = self.central.columns_mut();
        let mut contradicted = 0;
        for (p, total) in increments.iter_mut().enumerate() {
            let central = h * SVector::<f64, D>::from_fn(|d, _| columns[d][p]);
            let own = h * SVector::<f64, D>::from_fn(|d, _| local[d][p]);
            let (z, increment) = match observation {
                Observation::Received(z) => {
                    let clash = turn.rule.statistic(&(z - own)) < turn.rule.threshold() * (1.0 - 1e-9);
                    contradicted += usize::from(clash);
                    (*z, turn.log_density(&(z - central)) + if clash { VIOLATION } else { 0.0 })
                }
                Observation::Silent => turn.impute(rng, &central, &own),
                Observation::Lost => (central + turn.noise(rng), 0.0),
            };
            *total += increment;
            let (shift, own_shift) = (turn.gain * (z - central), turn.own_gain * (z - own));
            for d in 0..D {
                columns[d][p] += shift[d];
                local[d][p] += own_shift[d];
            }
        }
        self.covariance = symmetrised(&(self.covariance - gain * innovation * gain.transpose()));
        Ok(contradicted == increments.len())
    }
}

/// `x <- F x` for every column-wise state.
fn move_columns<const D: usize>(transition: &SMatrix<f64, D, D>, columns: ColumnsMut<'_, D>) {
    for p in 0..columns.first().map_or(0, |column| column.len()) {
        let moved = transition * SVector::<f64, D>::from_fn(|d, _| columns[d][p]);
        for d in 0..D {
            columns[d][p] = moved[d];
        }
    }
}

impl<const D: usize, const M: usize> Turn<'_, D, M> {
    fn log_density(&self, innovation: &SVector<f64, M>) -> f64 {
        self.log_normaliser - 0.5 * innovation.dot(&self.factor.solve(innovation))
    }

    fn noise<R: Rng + ?Sized>(&self, rng: &mut R) -> SVector<f64, M> {
        self.factor.l() * SVector::<f64, M>::from_fn(|_, _| rng.sample(StandardNormal))
    }

    /// A measurement that was not received, with the logarithm of its importance weight.
    fn impute<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        central: &SVector<f64, M>,
        own: &SVector<f64, M>,
    ) -> (SVector<f64, M>, f64) {
        if M == 1 {
            return self.impute_scalar(rng, central[0], own[0]);
        }
        let region = self.rule.region();
        let anywhere = self.loss > 0.0 && (rng.random::<f64>() < self.loss || region.threshold() == 0.0);
        let z = if anywhere {
            central + self.noise(rng)
        } else {
            own + region.from_ball(&in_unit_ball(rng))
        };
        let log_density = self.log_density(&(z - central));
        let inside = region.statistic(&(z - own)) < region.threshold();
        let log_uniform = if inside {
            -region.log_scale() - log_ball_volume(M)
        } else {
            f64::NEG_INFINITY
        };
        if self.loss == 0.0 {
            return (z, log_density - log_uniform);
        }
        // Target N(z) (loss + (1 - loss) 1{inside}) over proposal loss N(z) + (1 - loss) U(z).
        let target = log_density + if inside { 0.0 } else { self.loss.ln() };
        let share = if region.threshold() == 0.0 { 1.0 } else { self.loss };
        let normal_part = share.ln() + log_density;
        let uniform_part = (1.0 - share).ln() + log_uniform;
        let largest = normal_part.max(uniform_part);
        let proposal = largest + ((normal_part - largest).exp() + (uniform_part - largest).exp()).ln();
        (z, target - proposal)
    }

    fn impute_scalar<R: Rng + ?Sized>(&self, rng: &mut R, central: f64, own: f64) -> (SVector<f64, M>, f64) {
        let deviation = self.factor.l_dirty()[(0, 0)];
        let c = self.rule.first_half_width();
        let (low, high) = ((own - c - central) / deviation, (own + c - central) / deviation);
        let inside = normal::log_interval(low, high);
        let (log_weight, x) = if self.loss == 0.0 {
            (inside, normal::sample_truncated(rng, low, high))
        } else {
            let share = inside.exp();
            let total = self.loss + (1.0 - self.loss) * share;
            let u = rng.random::<f64>() * total;
            let x = if u < share {
                normal::sample_truncated(rng, low, high)
            } else {
                // The rest is loss times the mass outside.
                if (u - share) / self.loss < normal::cdf(low) {
                    normal::sample_truncated(rng, f64::NEG_INFINITY, low)
                } else {
                    normal::sample_truncated(rng, high, f64::INFINITY)
                }
            };
            (total.ln(), x)
        };
        // A part that was chosen by its mass holds numbers: it is never refused.
        (SVector::repeat(x.map_or(central, |x| central + deviation * x)), log_weight)
    }
}

/// A point uniform in the unit ball: a random direction at radius `U^(1/M)`.
fn in_unit_ball<const M: usize, R: Rng + ?Sized>(rng: &mut R) -> SVector<f64, M> {
    loop {
        let direction = SVector::<f64, M>::from_fn(|_, _| rng.sample(StandardNormal));
        let length = direction.norm();
        if length > 0.0 {
            return direction * (rng.random::<f64>().powf(1.0 / M as f64) / length);
        }
    }
}

/// `ln(pi^(M/2) / Gamma(M/2 + 1))`.
fn log_ball_volume(dimension: usize) -> f64 {
    let half = 0.5 * dimension as f64;
    half * std::f64::consts::PI.ln() - statrs::function::gamma::ln_gamma(half + 1.0)
}
