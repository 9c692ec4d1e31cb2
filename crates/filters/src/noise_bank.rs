//! Filters that differ in the scale of the process noise or in the model, weighted by evidence.

use crate::contract::{Info, StateFilter};
use crate::imm::{ImmWorkspace, by_rows, evenly, mix, weigh};
use crate::{Error, ImmBelief};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood, ScaledNoise};
use fewbits_numerics::LogSum;
use fewbits_numerics::error::{at_least_one, positive, refuse};
use rand::Rng;

/// A bank of filters whose models differ in the scale of their process noise. They are weighted by evidence and mixed as in
/// [`Imm`](crate::Imm).
///
/// ```text
/// predict:  w <- (1 - e) w + e / M, beliefs mixed; filter j moves with its own scale of the noise
/// update:   each filter updates with the observations; w_j is multiplied by its evidence, then normalised
/// ```
/// Scales multiply the covariance of the process noise: 4 doubles its deviation. Choose neighbours that differ by a factor of 4 or less. A
/// step costs as much as one step of each of the `M` filters. A centre's own [noise scale](crate::centre::FusionCentre::noise_scale)
/// multiplies all of them. With a [`Switching`](crate::Switching) motion of as many models as scales, each filter has a model of its own.
///
/// `e` is the probability per step that the scale changes; with 0 the bank converges to one scale. Words of 2 bits and more identify the
/// scale by their evidence. A single bit whose threshold is the prediction of the only filter has probability 1/2 for every scale, so it
/// does not (use [`NoiseLearning`](crate::centre::NoiseLearning)). In a bank its threshold differs from the predictions of the other
/// filters, which gives a little information.
///
/// ```
/// use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
/// use fewbits_filters::{MomentFilter, NoiseBank, StateFilter};
/// let mut bank = NoiseBank::new(MomentFilter, vec![0.25, 1.0, 4.0], 1e-3)?;
/// let belief = bank.start(&mut rand_pcg::Pcg64Mcg::new(1), &Gaussian::scalar(0.0, 1.0)?)?;
/// assert!((bank.scale(&belief) - 1.0).abs() < 1e-12); // nothing is known yet
/// # Ok::<(), fewbits_filters::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct NoiseBank<const D: usize, F> {
    filters: Vec<F>,
    scales: Vec<f64>,
    transition: Vec<f64>,
    workspace: ImmWorkspace<D>,
}

impl<const D: usize, F: StateFilter<D, Belief = Gaussian<D>>> NoiseBank<D, F> {
    /// A bank of `filter` with these scales of the process-noise covariance. The scale changes with probability `switching` in each step.
    ///
    /// # Errors
    /// If there is no scale, one is not above 0, or `switching` is outside `[0, 1]`.
    pub fn new(filter: F, scales: Vec<f64>, switching: f64) -> Result<Self, Error>
    where
        F: Clone,
    {
        let transition = evenly(scales.len(), switching)?;
        Self::checked(vec![filter; scales.len()], scales, transition)
    }

    /// A bank of these filters, each with its scale of the process-noise covariance: they may differ in more than the scale. In each
    /// step they change by the probabilities `transition[i][j] = p(next j | i)`.
    ///
    /// # Errors
    /// As [`new`](Self::new), or if the matrix is not square of their number, or a row does not sum to one.
    pub fn of(filters: Vec<(F, f64)>, transition: &[Vec<f64>]) -> Result<Self, Error> {
        let transition = by_rows(filters.len(), transition)?;
        let (filters, scales) = filters.into_iter().unzip();
        Self::checked(filters, scales, transition)
    }

    fn checked(filters: Vec<F>, scales: Vec<f64>, transition: Vec<f64>) -> Result<Self, Error> {
        at_least_one("scales", scales.len())?;
        for scale in &scales {
            positive("scales", *scale)?;
        }
        Ok(Self {
            filters,
            transition,
            scales,
            workspace: ImmWorkspace::default(),
        })
    }

    /// The filters, in the order of the belief's modes.
    pub fn filters(&self) -> &[F] {
        &self.filters
    }

    /// Scales of the process noise, in the order of the belief's modes.
    pub fn scales(&self) -> &[f64] {
        &self.scales
    }

    fn starts(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Vec<Gaussian<D>>, Error> {
        self.filters.iter_mut().map(|filter| filter.start(rng, prior)).collect()
    }

    /// The estimated scale: the geometric mean of the scales, weighted by the modes' probabilities.
    pub fn scale(&self, belief: &ImmBelief<D>) -> f64 {
        let pairs = self.scales.iter().zip(belief.probabilities());
        pairs.map(|(scale, p)| p * scale.ln()).sum::<f64>().exp()
    }
}

impl<const D: usize, F: StateFilter<D, Belief = Gaussian<D>>> StateFilter<D> for NoiseBank<D, F> {
    type Belief = ImmBelief<D>;

    fn start(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<ImmBelief<D>, Error> {
        let even = vec![1.0 / self.filters.len() as f64; self.filters.len()];
        Ok(ImmBelief::new(even, self.starts(rng, prior)?)?)
    }

    fn restart(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>, lost: &ImmBelief<D>) -> Result<ImmBelief<D>, Error> {
        Ok(ImmBelief::new(lost.probabilities().to_vec(), self.starts(rng, prior)?)?)
    }

    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut ImmBelief<D>,
    ) -> Result<(), Error> {
        let Self {
            filters,
            scales,
            transition,
            workspace,
        } = self;
        let modes = dynamics.modes();
        if !(modes.is_empty() || modes.len() == scales.len()) {
            return refuse(
                "dynamics",
                format!("{} modes", modes.len()),
                format!("{}, one for each scale", scales.len()),
            );
        }
        mix(belief, transition, workspace, |j, mixed| {
            let mut moved = *mixed;
            let own = modes.get(j).copied().unwrap_or_else(|| ScaledNoise::new(dynamics, 1.0));
            filters[j].predict(rng, &own.times(scales[j]), &mut moved)?;
            Ok(moved)
        })
    }

    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut ImmBelief<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let Self { filters, workspace, .. } = self;
        let log_likelihood = weigh(belief, workspace, |j, mode| {
            let mut next = *mode;
            let info = filters[j].update(rng, &mut next, observed)?;
            Ok((next, info.log_likelihood))
        })?;
        Ok(Info::new(log_likelihood))
    }

    fn mixture(&self, belief: &ImmBelief<D>) -> Option<Vec<(f64, Gaussian<D>)>> {
        let mut all = Vec::new();
        for ((filter, mode), probability) in self.filters.iter().zip(belief.modes()).zip(belief.probabilities()) {
            let log = probability.ln();
            // Filters of moments have the law of their Gaussian.
            if filter.of_moments(mode).is_some() {
                all.push((log, *mode));
                continue;
            }
            let parts = filter.mixture(mode)?;
            let total = parts.iter().map(|(log, _)| *log).collect::<LogSum>().value();
            all.extend(parts.into_iter().map(|(part, gaussian)| (log + part - total, gaussian)));
        }
        Some(all)
    }
}
