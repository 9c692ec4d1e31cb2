//! The fusion centre without feedback by particles: withheld measurements are drawn (imputed), and given them the belief is Gaussian.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{advance, check};
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_core::{FactoredGaussian, Gaussian, LinearDynamics, LinearSensing, Observation};
use fewbits_densities::GaussianCloud;
use fewbits_filters::{Info, RaoBlackwellised, Resampling, ResamplingRule, Schedule, StateFilter};
use fewbits_numerics::{LogSum, normal};
use nalgebra::SVector;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Log weight of a particle under which the sensor should have been silent, but sent. It is finite, so that the filter continues if a
/// report contradicts all particles.
const VIOLATION: f64 = -1e5;

/// Given every measurement, sent or not, the central Kalman filter and each sensor's own are deterministic. A particle therefore holds
/// the central mean and every sensor's estimate, both under the measurements imputed to it. All particles share one covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct ImputedBelief<const D: usize> {
    own: Vec<OwnRecursion<D>>,
    /// The central means, with `D` numbers per sensor beside each.
    cloud: GaussianCloud<D>,
    violations: usize,
}

impl<const D: usize> ImputedBelief<D> {
    /// `particles` particles. The centre and all `sensors` start from the belief `start`.
    ///
    /// # Errors
    /// If there is no particle or no sensor.
    pub fn new(start: &Gaussian<D>, sensors: usize, particles: usize) -> Result<Self, Error> {
        let mut cloud = GaussianCloud::agreed(start, particles)?;
        let side = (0..particles * sensors * D).map(|c| start.mean()[c % D]).collect();
        cloud.means = cloud.means.clone().with_auxiliary(side)?;
        Ok(Self {
            own: vec![OwnRecursion::new(start); sensors],
            cloud,
            violations: 0,
        })
    }

    /// Mean and covariance of the state.
    pub fn state(&self) -> Gaussian<D> {
        self.cloud.gaussian()
    }

    /// The particles.
    pub fn cloud(&self) -> &GaussianCloud<D> {
        &self.cloud
    }

    /// Number of received values so far that the rule would have withheld under every particle.
    pub fn violations(&self) -> usize {
        self.violations
    }
}

/// One step: predict, then one observation per sensor, those received first.
///
/// ```text
/// resample systematically below half the effective sample size
/// predict: xc = F xc, xhat_i = F xhat_i;  P = F P F' + Q
/// received z of i:  w *= N(z; H xc, S);  w *= 1{|z - H xhat_i| >= threshold};  Kalman update of xc, own update of xhat_i
/// nothing from i:   z ~ N(H xc, S) where |z - H xhat_i| < threshold, w *= P(there);  the same updates with that z
/// lost from i:      z ~ N(H xc, S) where |z - H xhat_i| >= threshold, w *= P(there);  the same updates
/// ```
/// Scalar measurements are drawn from their conditional distribution, vector ones from a proposal and weighted. If the link loses
/// reports, a measurement that did not arrive has the distribution `N(z) (loss + (1 - loss) 1{inside})`.
///
/// # Errors
/// If there is not one observation per sensor, or a value is not finite; [`Error::Impossible`].
pub fn step<S, R, const D: usize, const M: usize>(
    rng: &mut R,
    network: &Network<S, D, M>,
    dynamics: &impl LinearDynamics<D>,
    belief: &ImputedBelief<D>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<(ImputedBelief<D>, Info), Error>
where
    S: LinearSensing<D, M> + Clone + PartialEq,
    R: Rng + ?Sized,
{
    check(network, observations)?;
    let (mut next, mut info, mut arrived) = (belief.clone(), Info::default(), 0_usize);
    let rule = ResamplingRule {
        resampling: Resampling::Systematic,
        schedule: Schedule::Below(0.5),
    };
    RaoBlackwellised::new(rule, next.cloud.means.len())?.predict(&mut &mut *rng, dynamics, &mut next.cloud)?;
    for estimate in next.cloud.means.parts_mut().1.chunks_exact_mut(D) {
        let moved = dynamics.transition() * SVector::<f64, D>::from_column_slice(estimate);
        estimate.copy_from_slice(moved.as_slice());
    }
    let steps = advance(&mut next.own, network, dynamics)?;
    let (link, loss) = (network.link(), network.link().loss());
    let mut log_weights = vec![0.0; next.cloud.means.len()];
    let sensors = || network.sensors().iter().zip(&steps).zip(observations).enumerate();
    // Values first: the withheld measurements are then drawn given them.
    for received in [true, false] {
        for (i, ((sensor, (step, rule)), observation)) in sensors().filter(|s| s.1.1.received().is_some() == received) {
            let mut contradicted = 0;
            let (matrix, noise) = (sensor.matrix(), sensor.noise_covariance());
            fewbits_filters::impute(
                rng,
                &mut next.cloud,
                matrix,
                noise,
                &mut log_weights,
                |rng, innovation, central, side| {
                    let own = &mut side[i * D..(i + 1) * D];
                    let predicted = sensor.matrix() * SVector::<f64, D>::from_column_slice(own);
                    let (z, log_weight) = match observation {
                        Observation::Received(z) => {
                            let clash =
                                rule.region().statistic(&(z - predicted)) < rule.region().threshold() * (1.0 - 1e-9);
                            contradicted += usize::from(clash);
                            (*z, innovation.log_pdf(&(z - central)) + if clash { VIOLATION } else { 0.0 })
                        }
                        Observation::Nothing => impute(rng, innovation, rule, loss, central, &predicted),
                        Observation::Lost => impute_sent(rng, innovation, rule, central, &predicted),
                    };
                    let moved = step.gain * (z - predicted);
                    own.iter_mut().zip(moved.iter()).for_each(|(x, step)| *x += step);
                    (z, log_weight)
                },
            )?;
            arrived += usize::from(received);
            next.violations += usize::from(received && contradicted == log_weights.len());
        }
    }
    let increment = next.cloud.means.reweigh(|_, logs| {
        logs.iter_mut()
            .zip(&log_weights)
            .for_each(|(log, increment)| *log += increment);
    })?;
    let lost = observations.iter().filter(|o| **o == Observation::Lost).count();
    if arrived > 0 {
        info.log_likelihood += arrived as f64 * link.of_received()?.ln();
    }
    info.log_likelihood += increment + lost as f64 * link.lost_given_sent().ln();
    Ok((next, info))
}

fn noise<const M: usize, R: Rng + ?Sized>(rng: &mut R, innovation: &FactoredGaussian<M>) -> SVector<f64, M> {
    innovation.lower() * SVector::<f64, M>::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Draws a measurement that did not arrive: `z ~ q`, with log weight `ln (N(z; central, S) (loss + (1 - loss) 1{inside}) / q(z))`.
fn impute<const M: usize, R: Rng + ?Sized>(
    rng: &mut R,
    innovation: &FactoredGaussian<M>,
    rule: &CensoringRule<M>,
    loss: f64,
    central: &SVector<f64, M>,
    own: &SVector<f64, M>,
) -> (SVector<f64, M>, f64) {
    if M == 1 {
        let (z, log_weight) = impute_scalar(rng, innovation.lower()[(0, 0)], rule.interval(own[0]), loss, central[0]);
        return (SVector::repeat(z), log_weight);
    }
    let region = rule.region();
    // Threshold 0: every measurement is sent, so a missing report was lost on the link.
    // A lost measurement may be anywhere, a withheld one is inside.
    let share = if region.threshold() == 0.0 { 1.0 } else { loss };
    let anywhere = share > 0.0 && rng.random::<f64>() < share;
    let z = if anywhere {
        central + noise(rng, innovation)
    } else {
        own + region.from_ball(&in_unit_ball(rng))
    };
    let inside = region.statistic(&(z - own)) < region.threshold();
    let log_density = innovation.log_pdf(&(z - central));
    let log_target = log_density + if inside { 0.0 } else { loss.ln() };
    // Proposal: `share N(z) + (1 - share) U(z)`, `U` uniform in the ellipsoid and zero outside.
    let uniform_part = if inside {
        (1.0 - share).ln() - region.log_volume()
    } else {
        f64::NEG_INFINITY
    };
    let log_proposal = LogSum::from_iter([share.ln() + log_density, uniform_part]).value();
    (
        z,
        if log_target == f64::NEG_INFINITY {
            log_target
        } else {
            log_target - log_proposal
        },
    )
}

/// Draws a measurement that was sent and lost: `z ~ q`, with log weight `ln (N(z; central, S) 1{outside} / q(z))`.
fn impute_sent<const M: usize, R: Rng + ?Sized>(
    rng: &mut R,
    innovation: &FactoredGaussian<M>,
    rule: &CensoringRule<M>,
    central: &SVector<f64, M>,
    own: &SVector<f64, M>,
) -> (SVector<f64, M>, f64) {
    /// Half of the vectors are drawn with a deviation larger by this factor, so that a region far outside is reached.
    const WIDER: f64 = 3.0;
    if M == 1 {
        let (interval, deviation) = (rule.interval(own[0]), innovation.lower()[(0, 0)]);
        let (low, high) = ((interval.0 - central[0]) / deviation, (interval.1 - central[0]) / deviation);
        let tails = [normal::log_cdf(low), normal::log_cdf(-high)];
        let total = LogSum::from_iter(tails).value();
        // A tail in proportion to its probability, then the normal distribution truncated to it.
        let (from, to) = if rng.random::<f64>() < (tails[0] - total).exp() {
            (f64::NEG_INFINITY, low)
        } else {
            (high, f64::INFINITY)
        };
        return normal::sample_truncated(rng, from, to)
            .map_or((*central, VIOLATION), |x| (SVector::repeat(central[0] + deviation * x), total));
    }
    let scale = if rng.random::<bool>() { 1.0 } else { WIDER };
    let z = central + noise(rng, innovation) * scale;
    if rule.region().statistic(&(z - own)) < rule.region().threshold() {
        return (z, VIOLATION);
    }
    // q = (N(z; central, S) + N(z; central, WIDER^2 S)) / 2.
    let squared = innovation.squared_distance(&(z - central));
    let ratio = WIDER.powi(-(M as i32)) * (0.5 * squared * (1.0 - WIDER.powi(-2))).exp();
    (z, -(0.5 * (1.0 + ratio)).ln())
}

/// Draws from the conditional distribution itself: the normal truncated to the interval, or, lost, outside it.
fn impute_scalar<R: Rng + ?Sized>(
    rng: &mut R,
    deviation: f64,
    interval: (f64, f64),
    loss: f64,
    central: f64,
) -> (f64, f64) {
    let (low, high) = ((interval.0 - central) / deviation, (interval.1 - central) / deviation);
    let inside = normal::log_interval(low, high);
    let share = inside.exp();
    let total = loss + (1.0 - loss) * share;
    let log_weight = if loss == 0.0 { inside } else { total.ln() };
    let u = if loss == 0.0 { 0.0 } else { rng.random::<f64>() * total };
    let (from, to) = if loss == 0.0 || u < share {
        (low, high)
    } else if (u - share) / loss < normal::cdf(low) {
        // The remaining probability is loss times the mass outside.
        (f64::NEG_INFINITY, low)
    } else {
        (high, f64::INFINITY)
    };
    // An interval of zero width holds no mass and is refused.
    normal::sample_truncated(rng, from, to)
        .map_or((central, f64::NEG_INFINITY), |x| (central + deviation * x, log_weight))
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

#[cfg(test)]
mod tests {
    use super::{CensoringRule, impute, impute_scalar, in_unit_ball, noise};
    use fewbits_core::{FactoredGaussian, Gaussian};
    use fewbits_monte_carlo::{Moments, Stream};
    use nalgebra::{Matrix2, SVector, Vector1, Vector2};
    use rand::Rng;

    const DRAWS: usize = 20_000;

    /// Mean of each entry over draws, with its standard error.
    fn means<const K: usize>(mut draw: impl FnMut() -> [f64; K]) -> [(f64, f64); K] {
        let mut moments = [Moments::default(); K];
        for _ in 0..DRAWS {
            moments.iter_mut().zip(draw()).for_each(|(m, x)| m.add(x));
        }
        moments.map(|m| (m.mean(), m.standard_error()))
    }

    /// Mass and moments under the law of what did not arrive, by imputed values with their weights and by weighing draws from
    /// the innovation's law.
    fn check<const M: usize>(
        innovation: &FactoredGaussian<M>,
        rule: &CensoringRule<M>,
        loss: f64,
        central: SVector<f64, M>,
        own: SVector<f64, M>,
    ) {
        let mut rng = Stream::new(7).rng();
        let [first, last] = [0, M - 1];
        let features = |z: &SVector<f64, M>, w: f64| {
            [
                w,
                w * z[first],
                w * z[last],
                w * z[first] * z[last],
                w * z[last] * z[last],
            ]
        };
        let imputed = means(|| {
            let (z, log_weight) = impute(&mut rng, innovation, rule, loss, &central, &own);
            features(&z, log_weight.exp())
        });
        let weighed = means(|| {
            let z = central + noise(&mut rng, innovation);
            let withheld = rule.region().statistic(&(z - own)) < rule.region().threshold();
            features(&z, loss + if withheld { 1.0 - loss } else { 0.0 })
        });
        for (k, (a, b)) in imputed.iter().zip(&weighed).enumerate() {
            assert!((a.0 - b.0).abs() < 4.5 * a.1.hypot(b.1) + 1e-12, "{k}, loss {loss}: {a:?} {b:?}");
        }
    }

    #[test]
    fn imputed_values_have_the_law_of_what_did_not_arrive() {
        let plane = Gaussian::new(Vector2::zeros(), Matrix2::new(2.1, 0.7, 0.7, 0.9))
            .unwrap()
            .factored()
            .unwrap();
        let line = Gaussian::new(Vector1::zeros(), Vector1::new(2.1))
            .unwrap()
            .factored()
            .unwrap();
        for loss in [0.0, 0.3] {
            for threshold in [0.0, 1.7] {
                if loss == 0.0 && threshold == 0.0 {
                    continue;
                }
                let rule = CensoringRule::new(&Matrix2::new(1.3, -0.4, -0.4, 2.2), threshold).unwrap();
                check(&plane, &rule, loss, Vector2::new(0.6, -1.1), Vector2::new(1.2, 0.3));
                let rule = CensoringRule::new(&Vector1::new(1.3), threshold).unwrap();
                check(&line, &rule, loss, Vector1::new(0.6), Vector1::new(1.9));
            }
        }
        // Nothing is withheld and nothing lost: impossible.
        let rule = CensoringRule::new(&Matrix2::identity(), 0.0).unwrap();
        let (z, log_weight) =
            impute(&mut Stream::new(1).rng(), &plane, &rule, 0.0, &Vector2::zeros(), &Vector2::zeros());
        assert!(z.iter().all(|z| z.is_finite()) && log_weight == f64::NEG_INFINITY);
    }

    /// At 45 deviations the interval's probability is no longer a number above zero, but its logarithm is.
    #[test]
    fn an_interval_in_the_far_tail_is_still_met() {
        let (z, log_weight) = impute_scalar(&mut Stream::new(2).rng(), 2.0, (90.0, 91.0), 0.0, 0.0);
        assert!((90.0..91.0).contains(&z));
        // Mills' ratio: ln Phi(-45) to 1/45^2.
        let expected = -0.5 * 45.0 * 45.0 - (45.0 * std::f64::consts::TAU.sqrt()).ln();
        assert!((log_weight - expected).abs() < 6e-4, "{log_weight} {expected}");
        // With loss the value is out of reach of the interval, and the weight is the loss.
        let (z, log_weight) = impute_scalar(&mut Stream::new(2).rng(), 2.0, (90.0, 91.0), 0.25, 0.0);
        assert!(z < 90.0 && (log_weight - 0.25_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn points_are_uniform_in_the_ball() {
        fn check<const M: usize>(rng: &mut impl Rng) {
            let [(share, error), (sum, sum_error)] = means(|| {
                let x: SVector<f64, M> = in_unit_ball(rng);
                // The radius to the power of M is uniform, the direction symmetric.
                [x.norm().powi(M as i32), x.sum()]
            });
            assert!((share - 0.5).abs() < 4.5 * error && error < 0.003, "{M}: {share}");
            assert!(sum.abs() < 4.5 * sum_error);
        }
        let mut rng = Stream::new(3).rng();
        check::<2>(&mut rng);
        check::<3>(&mut rng);
    }
}
