//! Particle message passing, Algorithm 6 of the thesis. Its errata are settings.

use crate::pf_mpa::Velocity;
use crate::pf_mpa::chain::draw;
use crate::pf_mpa::message::{DynamicsWeight, KernelMessage, KernelRule, Ring, RingWeight, kernel_of};
use crate::pf_mpa::product_sampler::{Drawn, ProductSampler, ProductWorkspace};
use crate::pf_mpa::{GaussianTracker, Ranged, Step, StepInfo};
use fewbits_core::Gaussian;
use fewbits_core::columns::set_state;
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels;
use fewbits_numerics::linalg::triangular_factor;
use fewbits_pf_mpa::Error;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Particle message passing on the factor graph of one step.
///
/// ```text
/// N states ~ N(m, P), accelerations ~ Pr_k, X_i = F X + G a + G u          the prediction's message
/// per sensor: z_i ~ U(cell), d_i = z_i - v_i, bearing uniform, P_i = n + d_i (cos, sin)
/// a kernel for each message;  N positions ~ product of all messages
/// velocities transferred, or drawn given position and the prediction behind it
/// m, P = mean and covariance (N - 1) of the N states
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessagePassing {
    /// Number of particles `N`, at least 2.
    pub particles: usize,
    /// Bearings from which ring messages are drawn.
    pub ring: Ring,
    /// Weights of the points on the rings.
    pub ring_weight: RingWeight,
    /// Weights of the predicted points.
    pub dynamics_weight: DynamicsWeight,
    /// Kernels of all messages.
    pub kernel: KernelRule,
    /// How the velocity is updated.
    pub velocity: Velocity,
    /// How the product of the messages is drawn.
    pub sampler: ProductSampler,
}

/// Buffers that are reused from step to step.
#[derive(Debug, Clone, Default)]
pub struct MessageWorkspace {
    states: [Vec<f64>; 4],
    /// First the means of the predicted positions (for the printed ratio), then ranges and radii of a ring.
    means: [Vec<f64>; 2],
    logs: Vec<f64>,
    messages: Vec<KernelMessage<2>>,
    product: ProductWorkspace<2>,
    places: [Vec<f64>; 2],
    labels: Vec<usize>,
}

impl MessagePassing {
    /// As published: full rings, printed ratios, the printed kernel, velocities not corrected. It loses the target.
    ///
    /// # Errors
    /// If there are fewer than two particles.
    pub fn published(particles: usize) -> Result<Self, Error> {
        Self {
            particles,
            ring: Ring::Full,
            ring_weight: RingWeight::PrintedRatio,
            dynamics_weight: DynamicsWeight::PrintedRatio,
            kernel: KernelRule::Printed,
            velocity: Velocity::Transfer,
            sampler: ProductSampler::Gibbs { sweeps: 5 },
        }
        .checked()
    }

    /// With the errata corrected: local rings weighted by the radius, equal weights, Silverman's kernel, joint velocities.
    ///
    /// # Errors
    /// If there are fewer than two particles.
    pub fn improved(particles: usize) -> Result<Self, Error> {
        Self {
            particles,
            ring: Ring::Local,
            ring_weight: RingWeight::Jacobian,
            dynamics_weight: DynamicsWeight::Uniform,
            kernel: KernelRule::Silverman,
            velocity: Velocity::Joint,
            sampler: ProductSampler::Gibbs { sweeps: 5 },
        }
        .checked()
    }

    fn checked(self) -> Result<Self, Error> {
        if self.particles < 2 {
            return refuse("particles", self.particles, "at least 2, for a covariance");
        }
        Ok(self)
    }

    /// Forms the prediction's message. Returns its mean, its covariance over all four coordinates, and the kernel's `lambda`.
    fn predict<R: Rng>(
        &self,
        rng: &mut R,
        &Step { target, k, belief, .. }: &Step<'_>,
        workspace: &mut MessageWorkspace,
    ) -> Result<(Vector2<f64>, Matrix4<f64>, f64, u32), Error> {
        let n = self.particles;
        let MessageWorkspace {
            states,
            means,
            logs,
            messages,
            ..
        } = workspace;
        let root = triangular_factor(belief.covariance());
        for i in 0..n {
            let z = Vector4::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let state = belief.mean() + root * z;
            set_state(&mut states.each_mut().map(Vec::as_mut_slice), i, &state);
        }
        let (ts, half) = (target.interval(), 0.5 * target.interval() * target.interval());
        let deviation = target.noise_variance().sqrt();
        let Some(message) = messages.first_mut() else {
            return refuse("messages", 0, "at least one");
        };
        let law = target.chain().law(k);
        let values = target.chain().values();
        for i in 0..n {
            // Position and velocity share one acceleration and one noise per axis.
            for axis in 0..2 {
                let a = draw(rng, &law, &values);
                let noise = deviation * rng.sample::<f64, _>(StandardNormal);
                let mean = states[axis][i] + ts * states[2 + axis][i] + half * a;
                means[axis][i] = mean;
                states[axis][i] = mean + half * noise;
                states[2 + axis][i] += ts * (a + noise);
            }
        }
        message
            .points
            .iter_mut()
            .zip(&*states)
            .for_each(|(to, from)| to.copy_from_slice(from));
        message.log_weights.fill(0.0);
        let spread = half * half * target.noise_variance();
        // Without the printed ratio all weights are equal: one draw from each component is an exact stratified sample (erratum `mpa-4`).
        if self.dynamics_weight == DynamicsWeight::PrintedRatio && spread > 0.0 {
            let log_density = |i: usize, j: usize| {
                let (dx, dy) = (states[0][i] - means[0][j], states[1][i] - means[1][j]);
                -0.5 * (dx * dx + dy * dy) / spread
            };
            printed_ratios(&mut message.log_weights, logs, log_density);
        }
        let (mean, covariance, fallbacks) = message.finish();
        let lambda = self.lambda(message.effective);
        let (kernel, widened) = kernel_of(&covariance, lambda)?;
        message.kernel = kernel;
        let whole = sample_covariance(states, |i| message.log_weights[i].exp());
        Ok((mean, whole, lambda, fallbacks + widened))
    }

    fn lambda(&self, effective: f64) -> f64 {
        match self.kernel {
            // The printed rule uses the number of particles and ignores their weights.
            KernelRule::Printed => (self.particles as f64).powf(-1.0 / 6.0),
            KernelRule::Silverman | KernelRule::Narrow => effective.powf(-1.0 / 3.0),
        }
    }

    /// Forms the message of one range. Returns the number of fallbacks; `None` if the range carries no information.
    fn ring<R: Rng>(
        &self,
        rng: &mut R,
        range: &Ranged,
        predicted: &Vector2<f64>,
        spread: f64,
        message: &mut KernelMessage<2>,
        (radii, logs): (&mut [Vec<f64>; 2], &mut Vec<f64>),
    ) -> Result<Option<u32>, Error> {
        let cell = range.factor.nominal_cell().or_else(|| {
            let (z, variance) = range.factor.reconstruction()?;
            let half = (3.0 * variance).sqrt();
            Some([z - half, z + half])
        });
        let Some([lower, upper]) = cell.filter(|c| c[1] > 0.0) else {
            return Ok(None);
        };
        let lower = lower.max(0.0);
        let (at, noise) = (range.sensing.position(), range.factor.noise());
        let offset = predicted - at;
        let distance = offset.norm();
        // Bearings all around the sensor, or only the arc that the prediction can reach.
        let (bearing, half) = match self.ring {
            Ring::Full => (0.0, PI),
            Ring::Local => {
                let reach = 4.0 * spread.sqrt() + 0.5 * (upper - lower);
                let half = if distance > 0.0 { (reach / distance).min(PI) } else { PI };
                (offset[1].atan2(offset[0]), half)
            }
        };
        let [ranges, distances] = radii;
        for i in 0..self.particles {
            let z = lower + (upper - lower) * rng.random::<f64>();
            let d = z - noise.deviation(z) * rng.sample::<f64, _>(StandardNormal);
            let angle = match self.ring {
                Ring::Full => TAU * rng.random::<f64>(),
                Ring::Local => bearing + half * (2.0 * rng.random::<f64>() - 1.0),
            };
            (ranges[i], distances[i]) = (z, d);
            message.points[0][i] = at[0] + d * angle.cos();
            message.points[1][i] = at[1] + d * angle.sin();
            message.log_weights[i] = match self.ring_weight {
                // Uniform bearings give a density over the plane that falls as 1/d; the weight d cancels that.
                RingWeight::Jacobian => d.abs().max(1e-9 * upper).ln(),
                RingWeight::Uniform | RingWeight::PrintedRatio => 0.0,
            };
        }
        if self.ring_weight == RingWeight::PrintedRatio {
            let log_density = |i: usize, j: usize| {
                let deviation = noise.deviation(ranges[j]);
                let t = (distances[i] - ranges[j]) / deviation;
                -0.5 * t * t - deviation.ln()
            };
            printed_ratios(&mut message.log_weights, logs, log_density);
        }
        let (_, covariance, fallbacks) = message.finish();
        let (kernel, widened) = match self.kernel {
            KernelRule::Narrow => {
                let (radial, along) = (0.25 * (upper - lower), 2.0 * half * distance / self.particles as f64);
                kernel_of(&(Matrix2::identity() * (radial * radial + along * along)), 1.0)?
            }
            KernelRule::Printed | KernelRule::Silverman => kernel_of(&covariance, self.lambda(message.effective))?,
        };
        message.kernel = kernel;
        Ok(Some(fallbacks + widened))
    }
}

/// `ln (sum_j f(x_i | X_j) / (N f(x_i | X_i)))` for every `i`, from `log_density(i, j)`: cost `N^2`.
fn printed_ratios(log_weights: &mut [f64], logs: &mut Vec<f64>, log_density: impl Fn(usize, usize) -> f64) {
    let n = log_weights.len();
    logs.resize(n, 0.0);
    for (i, log_weight) in log_weights.iter_mut().enumerate() {
        for (j, log) in logs.iter_mut().enumerate() {
            *log = log_density(i, j);
        }
        *log_weight = kernels::log_sum_exp(logs) - log_density(i, i) - (n as f64).ln();
    }
}

/// Weighted covariance of states in columns.
fn sample_covariance(states: &[Vec<f64>; 4], weight: impl Fn(usize) -> f64) -> Matrix4<f64> {
    let (mut mean, mut covariance) = (Vector4::zeros(), Matrix4::zeros());
    let at = |i: usize| Vector4::from_fn(|d, _| states[d][i]);
    for i in 0..states[0].len() {
        mean += at(i) * weight(i);
    }
    for i in 0..states[0].len() {
        let d = at(i) - mean;
        covariance += d * d.transpose() * weight(i);
    }
    covariance
}

impl GaussianTracker for MessagePassing {
    type Workspace = MessageWorkspace;

    fn check(&self) -> Result<(), Error> {
        self.checked().map(|_| ())
    }

    fn advance<R: Rng>(
        &self,
        rng: &mut R,
        step: Step<'_>,
        workspace: &mut MessageWorkspace,
    ) -> Result<(Gaussian<4>, StepInfo), Error> {
        self.checked()?;
        let n = self.particles;
        for buffer in workspace
            .states
            .iter_mut()
            .chain(&mut workspace.means)
            .chain(&mut workspace.places)
        {
            buffer.resize(n, 0.0);
        }
        workspace.labels.resize(n, 0);
        let wanted = workspace.messages.len().max(step.observed.len() + 1);
        workspace.messages.resize_with(wanted, || KernelMessage::new(n));
        workspace.messages.iter_mut().for_each(|m| m.resize(n));
        let (mean, whole, lambda, mut fallbacks) = self.predict(rng, &step, workspace)?;
        let MessageWorkspace {
            states,
            means,
            logs,
            messages,
            product,
            places,
            labels,
        } = workspace;
        let spread = whole[(0, 0)].max(whole[(1, 1)]);
        let mut used = 1;
        for range in step.observed {
            let message = &mut messages[used];
            if let Some(widened) = self.ring(rng, range, &mean, spread, message, (&mut *means, &mut *logs))? {
                fallbacks += widened;
                used += 1;
            }
        }
        let mut drawn = Drawn {
            points: places.each_mut().map(Vec::as_mut_slice),
            labels,
        };
        self.sampler.draw(rng, &mut messages[..used], product, &mut drawn)?;
        if self.velocity == Velocity::Transfer {
            messages[0].resample(rng, drawn.labels);
        }
        // The velocity given the position, from the joint covariance of the predicted particles.
        let position: Matrix2<f64> = whole.fixed_view::<2, 2>(0, 0).into();
        let cross: Matrix2<f64> = whole.fixed_view::<2, 2>(2, 0).into();
        let own: Matrix2<f64> = whole.fixed_view::<2, 2>(2, 2).into();
        let factor = kernel_of(&position, 1.0)?.0.cholesky().ok_or(Error::Impossible)?;
        let slope = factor.solve(&cross.transpose()).transpose();
        let left = (own - slope * cross.transpose()) * lambda;
        let kernel = triangular_factor(&((left + left.transpose()) * 0.5));
        let mut sum = Vector4::zeros();
        for i in 0..n {
            let place = Vector2::new(drawn.points[0][i], drawn.points[1][i]);
            let from = drawn.labels[i];
            let mut velocity = Vector2::new(states[2][from], states[3][from]);
            if self.velocity == Velocity::Joint {
                let behind = Vector2::new(states[0][from], states[1][from]);
                let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                velocity += slope * (place - behind) + kernel * z;
            }
            // The buffers of the rings are free now and take the velocities of the draws.
            (means[0][i], means[1][i]) = (velocity[0], velocity[1]);
            sum += Vector4::new(place[0], place[1], velocity[0], velocity[1]);
        }
        let mean = sum / n as f64;
        let mut covariance = Matrix4::zeros();
        for i in 0..n {
            let d = Vector4::new(drawn.points[0][i], drawn.points[1][i], means[0][i], means[1][i]) - mean;
            covariance += d * d.transpose();
        }
        covariance /= (n - 1) as f64;
        let info = StepInfo {
            fallbacks,
            ..StepInfo::default()
        };
        Ok((Gaussian::from_trusted_parts(mean, covariance), info))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_one_on_average() {
        let (mut weights, mut logs) = (vec![0.0; 3], Vec::new());
        // Components that do not overlap: every point is its own component's alone.
        printed_ratios(&mut weights, &mut logs, |i, j| if i == j { 0.0 } else { -1e4 });
        assert!(weights.iter().all(|w| (w + 3.0_f64.ln()).abs() < 1e-12));
    }
}
