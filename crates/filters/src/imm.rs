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
    workspace: Workspace<D>,
}

/// Buffers reused from step to step.
#[derive(Debug, Clone, PartialEq, Default)]
struct Workspace<const D: usize> {
    modes: Vec<Gaussian<D>>,
    probabilities: Vec<f64>,
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
            workspace: Workspace::default(),
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
        self.check(belief)?;
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

/// Mixes the modes by `transition` (row by row) and predicts each: `predict(j, mixed)` is the time update of model `j`.
fn mix<const D: usize>(
    belief: &mut ImmBelief<D>,
    transition: &[f64],
    workspace: &mut Workspace<D>,
    mut predict: impl FnMut(usize, &Gaussian<D>) -> Result<Gaussian<D>, Error>,
) -> Result<(), Error> {
    let n = belief.modes.len();
    workspace.modes.clear();
    workspace.probabilities.clear();
    for j in 0..n {
        // Joint probability of having been in mode i and being in mode j.
        let joint = |i: usize| belief.probabilities[i] * transition[i * n + j];
        let c: f64 = (0..n).map(joint).sum();
        // Mode j starts from the moments of the mixture of all modes that lead to it. If none does, it keeps its own.
        let mixed = if c > 0.0 {
            moments((0..n).map(|i| (joint(i) / c, &belief.modes[i])))
        } else {
            belief.modes[j]
        };
        workspace.probabilities.push(c);
        workspace.modes.push(predict(j, &mixed)?);
    }
    check_moments(&workspace.modes)?;
    std::mem::swap(&mut belief.modes, &mut workspace.modes);
    std::mem::swap(&mut belief.probabilities, &mut workspace.probabilities);
    Ok(())
}

/// Updates each mode and multiplies its probability by its evidence; returns `ln p(observation | past)`. A mode under which the observation
/// is impossible keeps its Gaussian and gets probability zero.
fn weigh<const D: usize>(
    belief: &mut ImmBelief<D>,
    workspace: &mut Workspace<D>,
    mut update: impl FnMut(usize, &Gaussian<D>) -> Result<(Gaussian<D>, f64), Error>,
) -> Result<f64, Error> {
    workspace.modes.clear();
    workspace.probabilities.clear();
    for (j, (mode, p)) in belief.modes.iter().zip(&belief.probabilities).enumerate() {
        let (next, log_evidence) = match update(j, mode) {
            Ok(updated) => updated,
            // A mode under which the observation is impossible gets probability zero. It is an error only if all modes do.
            Err(Error::Impossible) => (*mode, f64::NEG_INFINITY),
            Err(error) => return Err(error),
        };
        workspace.modes.push(next);
        workspace.probabilities.push(log_evidence + p.ln());
    }
    let logs = &mut workspace.probabilities;
    let peak = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !peak.is_finite() {
        return Err(Error::unlikely_or_no_number(peak, "the evidence of a model"));
    }
    logs.iter_mut().for_each(|log| *log = (*log - peak).exp());
    let total: f64 = logs.iter().sum();
    logs.iter_mut().for_each(|p| *p /= total);
    check_moments(&workspace.modes)?;
    std::mem::swap(&mut belief.modes, &mut workspace.modes);
    std::mem::swap(&mut belief.probabilities, &mut workspace.probabilities);
    Ok(peak + total.ln())
}
