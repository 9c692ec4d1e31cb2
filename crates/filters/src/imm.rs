//! The interacting-multiple-model (IMM) filter: one of several models holds at a time.

use crate::Error;
use crate::contract::{Info, StateFilter};
use crate::imm_belief::{ImmBelief, check_moments, moments};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood, ScaledNoise};
use fewbits_numerics::LogSum;
use fewbits_numerics::error::{ArgumentError, at_least_one, positive, probabilities, refuse, within};
use rand::Rng;

/// A filter for dynamics that follow one of several models at a time and switch between them as a Markov chain. Each model has a filter with
/// a Gaussian belief, and a probability.
///
/// The steps of a slot (Blom and Bar-Shalom 1988; the observation may be a value, a sign bit, a cell or silence, as the filters take it):
///
/// ```text
/// c_j = sum_i w_i T_ij                              predicted probability of model j
/// mean_j, P_j = moments of sum_i (w_i T_ij / c_j) N(mean_i, P_i)             mixing
/// predict each with its model; update each with the observations: evidence L_j = p(observations | j, past)
/// w_j = c_j L_j / sum;   p(observations | past) = sum_j c_j L_j
/// ```
///
/// The models are the [`modes`](GaussianDynamics::modes) of the dynamics, those of a [`Switching`](crate::Switching). Dynamics of one model
/// are the same for all filters but for the scale of the process noise: a bank that finds it. With one model it is the filter itself. Without
/// switching it is a bank of independent filters, whose probabilities are exact Bayes factors. The approximation is that the mixture over
/// `K^n` histories is kept as `K` Gaussians. A step costs as much as one step of each filter.
///
/// Scales multiply the covariance of the process noise: 4 doubles its deviation. Choose neighbours that differ by a factor of 4 or less. A
/// centre's own [noise scale](crate::centre::FusionCentre::noise_scale) multiplies all of them. Without switching the bank converges to one
/// scale. Words of 2 bits and more identify the scale by their evidence. A single bit whose threshold is the prediction of the only filter has
/// probability 1/2 for every scale, so it does not (use [`NoiseLearning`](crate::centre::NoiseLearning)). In a bank its threshold differs
/// from the predictions of the other filters, which gives a little information.
///
/// ```
/// use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
/// use fewbits_filters::{Imm, MomentFilter, StateFilter};
/// let mut bank = Imm::new(MomentFilter, vec![0.25, 1.0, 4.0], 1e-3)?;
/// let belief = bank.start(&mut rand_pcg::Pcg64Mcg::new(1), &Gaussian::scalar(0.0, 1.0)?)?;
/// assert!((bank.scale(&belief) - 1.0).abs() < 1e-12); // nothing is known yet
/// # Ok::<(), fewbits_filters::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Imm<const D: usize, F> {
    filters: Vec<F>,
    scales: Vec<f64>,
    /// `T_ij = p(next model j | model i)`, row by row.
    transition: Vec<f64>,
    /// Buffers of the next belief.
    next: ImmBelief<D>,
}

impl<const D: usize, F: StateFilter<D, Belief = Gaussian<D>>> Imm<D, F> {
    /// A filter like `filter` for each of these scales of the process-noise covariance; 1 for a model that holds as stated. In each step, with
    /// probability `switching`, the model is drawn anew uniformly from all.
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
            next: ImmBelief::buffers(),
        })
    }

    fn check(&self, belief: &ImmBelief<D>) -> Result<(), ArgumentError> {
        if belief.modes().len() == self.filters.len() {
            return Ok(());
        }
        let expected = format!("{}, as many as the filter has", self.filters.len());
        Err(ArgumentError::new("belief", format!("of {} models", belief.modes().len()), expected))
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

impl<const D: usize, F: StateFilter<D, Belief = Gaussian<D>>> StateFilter<D> for Imm<D, F> {
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
        self.check(belief)?;
        let (models, count) = (dynamics.modes(), self.scales.len());
        if !(models.is_empty() || models.len() == count) {
            let expected = format!("{count}, one for each scale");
            return refuse("dynamics", format!("{} modes", models.len()), expected);
        }
        self.next.clear();
        for (j, filter) in self.filters.iter_mut().enumerate() {
            // Joint probability of having been in mode i and being in mode j.
            let joint = |i: usize| belief.probabilities[i] * self.transition[i * count + j];
            let c: f64 = (0..count).map(joint).sum();
            // Mode j starts from the moments of the mixture of all modes that lead to it. If none does, it keeps its own.
            let mut moved = if c > 0.0 {
                moments((0..count).map(|i| (joint(i) / c, &belief.modes[i])))
            } else {
                belief.modes[j]
            };
            let model = models
                .get(j)
                .copied()
                .unwrap_or_else(|| ScaledNoise::new(dynamics, 1.0));
            filter.predict(rng, &model.times(self.scales[j]), &mut moved)?;
            self.next.probabilities.push(c);
            self.next.modes.push(moved);
        }
        check_moments(&self.next.modes)?;
        std::mem::swap(belief, &mut self.next);
        Ok(())
    }

    /// Updates each mode and multiplies its probability by its evidence.
    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut ImmBelief<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        self.check(belief)?;
        self.next.clear();
        for ((filter, mode), p) in self.filters.iter_mut().zip(&belief.modes).zip(&belief.probabilities) {
            let mut next = *mode;
            let log_evidence = match filter.update(rng, &mut next, observed) {
                Ok(info) => info.log_likelihood,
                // A mode under which the observation is impossible keeps its Gaussian and gets probability zero. It is an error only if
                // all modes do.
                Err(Error::Impossible) => f64::NEG_INFINITY,
                Err(error) => return Err(error),
            };
            self.next.modes.push(next);
            self.next.probabilities.push(log_evidence + p.ln());
        }
        let logs = &mut self.next.probabilities;
        let peak = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !peak.is_finite() {
            return Err(Error::unlikely_or_no_number(peak, "the evidence of a model"));
        }
        logs.iter_mut().for_each(|log| *log = (*log - peak).exp());
        let total: f64 = logs.iter().sum();
        logs.iter_mut().for_each(|p| *p /= total);
        check_moments(&self.next.modes)?;
        std::mem::swap(belief, &mut self.next);
        Ok(Info::new(peak + total.ln()))
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

/// Transition probabilities, row by row: with probability `switching` the next model is drawn uniformly from all models, else it stays.
fn evenly(models: usize, switching: f64) -> Result<Vec<f64>, ArgumentError> {
    within("switching", switching, 0.0, 1.0)?;
    let entry = |at: usize| {
        let stays = if at / models == at % models {
            1.0 - switching
        } else {
            0.0
        };
        stays + switching / models as f64
    };
    Ok((0..models * models).map(entry).collect())
}

/// A matrix of transition probabilities, row by row.
fn by_rows(models: usize, transition: &[Vec<f64>]) -> Result<Vec<f64>, ArgumentError> {
    if transition.len() != models || transition.iter().any(|row| row.len() != models) {
        let rows: Vec<usize> = transition.iter().map(Vec::len).collect();
        let expected = format!("{0} rows of {0}", models);
        return Err(ArgumentError::new("transition", format!("rows of {rows:?}"), expected));
    }
    for row in transition {
        probabilities("transition", row)?;
    }
    Ok(transition.concat())
}
