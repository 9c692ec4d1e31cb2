//! Filters that differ in the scale of the process noise or in the model, weighted by evidence.

use crate::contract::{Info, Move, StateFilter, StateLikelihood};
use crate::imm::{ImmWorkspace, evenly, mix, weigh};
use crate::{Error, ImmBelief};
use fewbits_core::Gaussian;
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
/// use fewbits_core::Gaussian;
/// use fewbits_filters::{MomentFilter, NoiseBank, StateFilter};
/// let mut bank = NoiseBank::new(MomentFilter, vec![0.25, 1.0, 4.0], 1e-3)?;
/// let belief = bank.start(&mut rand_pcg::Pcg64Mcg::new(1), &Gaussian::scalar(0.0, 1.0)?)?;
/// assert!((bank.scale(&belief) - 1.0).abs() < 1e-12); // nothing is known yet
/// # Ok::<(), fewbits_filters::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct NoiseBank<const D: usize, F> {
    filter: F,
    scales: Vec<f64>,
    transition: Vec<f64>,
    workspace: ImmWorkspace<D>,
}

impl<const D: usize, F: StateFilter<D, Belief = Gaussian<D>>> NoiseBank<D, F> {
    /// A bank of `filter` with these scales of the process-noise covariance. The scale changes with probability `switching` in each step.
    ///
    /// # Errors
    /// If there is no scale, one is not above 0, or `switching` is outside `[0, 1]`.
    pub fn new(filter: F, scales: Vec<f64>, switching: f64) -> Result<Self, Error> {
        at_least_one("scales", scales.len())?;
        for scale in &scales {
            positive("scales", *scale)?;
        }
        Ok(Self {
            filter,
            transition: evenly(scales.len(), switching)?,
            scales,
            workspace: ImmWorkspace::default(),
        })
    }

    /// Scales of the process noise, in the order of the belief's modes.
    pub fn scales(&self) -> &[f64] {
        &self.scales
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
        Ok(ImmBelief::agreed(&self.filter.start(rng, prior)?, self.scales.len())?)
    }

    fn restart(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>, lost: &ImmBelief<D>) -> Result<ImmBelief<D>, Error> {
        let start = self.filter.start(rng, prior)?;
        Ok(ImmBelief::new(lost.probabilities().to_vec(), vec![start; lost.modes().len()])?)
    }

    fn predict(&mut self, rng: &mut dyn Rng, motion: Move<'_, D>, belief: &mut ImmBelief<D>) -> Result<(), Error> {
        let Self {
            filter,
            scales,
            transition,
            workspace,
        } = self;
        let modes = motion.motion.modes();
        if !(modes.is_empty() || modes.len() == scales.len()) {
            return refuse("motion", format!("{} modes", modes.len()), format!("{}, one for each scale", scales.len()));
        }
        mix(belief, transition, workspace, |j, mixed| {
            let mut moved = *mixed;
            let own = modes.get(j).map_or(motion.motion, |mode| &**mode);
            filter.predict(rng, Move::new(own, motion.noise_scale * scales[j]), &mut moved)?;
            Ok(moved)
        })
    }

    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut ImmBelief<D>,
        observed: &[&dyn StateLikelihood<D>],
    ) -> Result<Info, Error> {
        let Self { filter, workspace, .. } = self;
        let log_likelihood = weigh(belief, workspace, |mode| {
            let mut next = *mode;
            let info = filter.update(rng, &mut next, observed)?;
            Ok((next, info.log_likelihood))
        })?;
        Ok(Info::new(log_likelihood))
    }
}
