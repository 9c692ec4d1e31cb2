//! The filter step of one leader.

use crate::{Error, Handover, Reducer};
use fewbits_core::{Dynamics, Likelihood};
use fewbits_densities::{Bandwidth, KernelEstimate, Mixture, Particles, SampleSize};
use fewbits_numerics::error::{at_least_one, non_negative};
use rand::Rng;

/// A particle filter whose belief is handed from one leader node to the next.
///
/// ```text
/// receive a mixture q
/// x_i        ~ q                                   systematic choice of the component, then one Gaussian draw
/// x_i        ~ p(x' | x_i)                         dynamics
/// w_i        = p(y | x_i), normalised              likelihood, in the log domain
/// drop       particles with w_i < trim / N         renormalise
/// H          = bandwidth rule
/// x_i        <- m + sqrt(1 - H/C) (x_i - m)        if shrinking
/// estimate   = sum w_i N(x; x_i, H)
/// send       reducer(estimate)
/// ```
///
/// The kernel widens the belief at every step; over ten steps this costs more accuracy than the reduction. Shrinkage
/// removes the widening without additional bits. The paper does not use it; here it is on by default.
#[derive(Debug, Clone, PartialEq)]
pub struct HandoffFilter<R> {
    /// Number of particles `N`, at least one.
    pub particles: usize,
    /// Particles of weight below `trim / N` are dropped; 0 keeps all.
    pub trim: f64,
    /// The bandwidth rule of the kernel. [`SampleSize::Count`] means `N`, dropped particles included.
    pub bandwidth: Bandwidth,
    /// Whether the centres are moved towards the mean so that the estimate has the sample's variances.
    pub shrink: bool,
    /// The reduction of the belief to what is sent.
    pub reducer: R,
}

/// Results of a step other than the belief that is sent.
#[derive(Debug, Clone, PartialEq)]
pub struct HandoffInfo<const D: usize> {
    /// Estimate of `ln p(y now | all earlier y)`.
    pub log_likelihood: f64,
    /// Effective sample size after the update, before trimming.
    pub effective_sample_size: f64,
    /// Number of particles after trimming.
    pub kept: usize,
    /// The kernel estimate before its reduction.
    pub estimate: KernelEstimate<D>,
}

impl<R> HandoffFilter<R> {
    /// A filter with Silverman's bandwidth, a trim of 0.01, and shrinkage.
    ///
    /// # Errors
    /// If `particles` is zero.
    pub fn new(particles: usize, reducer: R) -> Result<Self, Error> {
        Ok(Self {
            particles: at_least_one("particles", particles)?,
            trim: 0.01,
            bandwidth: Bandwidth::default(),
            shrink: true,
            reducer,
        })
    }

    /// The weighted particles after receiving, predicting and updating, and the increment of the log likelihood.
    ///
    /// # Errors
    /// If there is no particle, or the measurement has probability zero for all ([`Error::Impossible`]).
    pub fn posterior<const D: usize>(
        &self,
        rng: &mut dyn Rng,
        received: &Mixture<D>,
        dynamics: &(impl Dynamics<D> + ?Sized),
        likelihood: &(impl Likelihood<D> + ?Sized),
    ) -> Result<(Particles<D>, f64), Error> {
        let mut particles = received.sample_systematic(rng, self.particles)?;
        dynamics.propagate_columns(rng, particles.columns_mut());
        let log_likelihood = particles.reweigh(|states, logs| likelihood.add_log_likelihoods(states, logs))?;
        Ok((particles, log_likelihood))
    }

    /// The kernel estimate from weighted particles: trimmed, shrunk if so set, and smoothed by the kernel.
    ///
    /// # Errors
    /// If `trim` is negative, or the kept particles coincide and the bandwidth has no floor.
    pub fn estimate<const D: usize>(&self, particles: &Particles<D>) -> Result<KernelEstimate<D>, Error> {
        let kept = trimmed(particles, self.trim)?;
        let n = match self.bandwidth.size {
            SampleSize::Count => particles.len() as f64,
            SampleSize::Effective => kept.effective_sample_size(),
        };
        let kernel = self.bandwidth.kernel_for(&kept, n)?;
        let centres = if self.shrink {
            self.bandwidth.shrunk(&kept, &kernel)
        } else {
            kept
        };
        KernelEstimate::new(centres, kernel)
    }

    /// One leader's step: returns the belief that is sent on, and further results.
    ///
    /// # Errors
    /// As [`posterior`](Self::posterior) and [`estimate`](Self::estimate), or if the reducer returns an error. The received
    /// belief is unchanged.
    pub fn step<const D: usize>(
        &self,
        rng: &mut dyn Rng,
        received: &Mixture<D>,
        dynamics: &(impl Dynamics<D> + ?Sized),
        likelihood: &(impl Likelihood<D> + ?Sized),
    ) -> Result<(Handover<D>, HandoffInfo<D>), Error>
    where
        R: Reducer<D>,
    {
        let (particles, log_likelihood) = self.posterior(rng, received, dynamics, likelihood)?;
        let estimate = self.estimate(&particles)?;
        let handover = self.reducer.reduce(&estimate)?;
        let info = HandoffInfo {
            log_likelihood,
            effective_sample_size: particles.effective_sample_size(),
            kept: estimate.len(),
            estimate,
        };
        Ok((handover, info))
    }
}

/// The particles of weight at least `trim / N`. If there are none, those of largest weight. Weights are normalised again.
///
/// # Errors
/// If `trim` is negative or not finite.
pub fn trimmed<const D: usize>(particles: &Particles<D>, trim: f64) -> Result<Particles<D>, Error> {
    non_negative("trim", trim)?;
    let weights = particles.weights();
    // If all weights are below `trim / N`, only those equal to the largest are kept.
    let largest = weights.iter().fold(0.0_f64, |m, w| m.max(*w));
    let least = (trim / particles.len() as f64).min(largest);
    let kept: Vec<usize> = (0..weights.len())
        .filter(|i| weights[*i] >= least && weights[*i] > 0.0)
        .collect();
    let columns = particles
        .columns()
        .map(|column| kept.iter().map(|i| column[*i]).collect());
    let logs: Vec<f64> = kept.iter().map(|i| particles.log_weights()[*i]).collect();
    Particles::new(columns, &logs)
}
