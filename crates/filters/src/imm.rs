//! The interacting-multiple-model (IMM) filter: one of several models holds at a time; any factor.

use crate::{Error, assumed_density};
use fewbits_core::columns::change_each;
use fewbits_core::{Belief, ColumnsMut, Factor, Gaussian, GaussianDynamics, Observed, Sensing};
use fewbits_densities::Categorical;
use fewbits_numerics::error::{ArgumentError, at_least_one, probabilities, within};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A filter for dynamics that follow one of several models at a time and switch between them as a Markov chain.
///
/// Each model has a Gaussian belief and a probability. The steps of a slot (Blom and Bar-Shalom 1988; the measurement update is that of
/// [`assumed_density`], so the observation may be a value, a sign bit, a cell or silence: any [`Factor`]):
///
/// ```text
/// c_j = sum_i w_i T_ij                              predicted probability of model j
/// mean_j, P_j = moments of sum_i (w_i T_ij / c_j) N(mean_i, P_i)             mixing
/// predict each with its model; update each with the factor: evidence L_j = p(observation | j, past)
/// w_j = c_j L_j / sum;   p(observation | past) = sum_j c_j L_j
/// ```
///
/// With one model it is the assumed-density filter. Without mixing (`T` the identity) it is a bank of independent filters, whose
/// probabilities are exact Bayes factors. The approximation is that the mixture over `K^n` histories is kept as `K` Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub struct Imm<G> {
    models: Vec<G>,
    /// `T_ij = p(next model j | model i)`, row by row.
    transition: Vec<f64>,
}

/// The belief of an [`Imm`]: a Gaussian and a probability for each model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>")]
pub struct ImmBelief<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    probabilities: Vec<f64>,
    modes: Vec<Gaussian<D>>,
}

/// The stored form of [`ImmBelief`].
#[derive(Deserialize)]
#[serde(rename = "ImmBelief")]
#[serde(deny_unknown_fields)]
struct Stored<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    probabilities: Vec<f64>,
    modes: Vec<Gaussian<D>>,
}

impl<const D: usize> TryFrom<Stored<D>> for ImmBelief<D> {
    type Error = ArgumentError;

    fn try_from(parts: Stored<D>) -> Result<Self, ArgumentError> {
        ImmBelief::new(parts.probabilities, parts.modes)
    }
}

impl<const D: usize> ImmBelief<D> {
    /// A belief with a probability and a Gaussian for each model.
    ///
    /// # Errors
    /// If the two lists differ in length, or the probabilities do not sum to one.
    pub fn new(probabilities_: Vec<f64>, modes: Vec<Gaussian<D>>) -> Result<Self, ArgumentError> {
        probabilities("probabilities", &probabilities_)?;
        if modes.len() != probabilities_.len() {
            let expected = format!("{}, one for each probability", probabilities_.len());
            return Err(ArgumentError::new("modes", format!("{} Gaussians", modes.len()), expected));
        }
        Ok(Self {
            probabilities: probabilities_,
            modes,
        })
    }

    /// A belief of `count` models with equal probability and the same Gaussian.
    ///
    /// # Errors
    /// If `count` is 0.
    pub fn agreed(belief: &Gaussian<D>, count: usize) -> Result<Self, ArgumentError> {
        at_least_one("count", count)?;
        Ok(Self {
            probabilities: vec![1.0 / count as f64; count],
            modes: vec![*belief; count],
        })
    }

    /// Probability of each model.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// The Gaussian of each model.
    pub fn modes(&self) -> &[Gaussian<D>] {
        &self.modes
    }

    /// The Gaussian of the same mean and covariance as the mixture.
    pub fn moment_matched(&self) -> Gaussian<D> {
        moments(self.probabilities.iter().copied().zip(&self.modes))
    }
}

/// Mean and covariance of a mixture whose weights sum to one. The covariance of the means is computed as a sum of squares.
pub(crate) fn moments<'a, const D: usize>(parts: impl Iterator<Item = (f64, &'a Gaussian<D>)> + Clone) -> Gaussian<D> {
    let mean = parts.clone().fold(SVector::zeros(), |sum, (w, g)| sum + g.mean() * w);
    let covariance = parts.fold(SMatrix::zeros(), |sum, (w, g)| {
        let d = g.mean() - mean;
        sum + (g.covariance() + d * d.transpose()) * w
    });
    Gaussian::from_trusted_parts(mean, covariance)
}

/// The models' beliefs may be so far apart that the covariance of all together overflows.
fn check_moments<const D: usize>(modes: &[Gaussian<D>]) -> Result<(), Error> {
    let size = |mode: &Gaussian<D>| mode.mean().norm_squared() + mode.covariance().trace();
    // No distance of two means is larger than twice the larger of their norms.
    match (4.0 * modes.iter().map(size).sum::<f64>()).is_finite() {
        true => Ok(()),
        false => Err(Error::NotANumber {
            what: "the moments of all models together",
        }),
    }
}

impl<const D: usize> Belief<D> for ImmBelief<D> {
    fn mean(&self) -> SVector<f64, D> {
        *self.moment_matched().mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.moment_matched().covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let modes = Categorical::new(&self.probabilities);
        change_each(states, |_| self.modes[modes.draw(rng)].sample(rng));
    }
}

/// Buffers reused from step to step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImmWorkspace<const D: usize> {
    modes: Vec<Gaussian<D>>,
    probabilities: Vec<f64>,
}

/// Transition probabilities, row by row: with probability `switching` the next model is drawn uniformly from all models, else it stays.
pub(crate) fn evenly(models: usize, switching: f64) -> Result<Vec<f64>, ArgumentError> {
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
pub(crate) fn by_rows(models: usize, transition: &[Vec<f64>]) -> Result<Vec<f64>, ArgumentError> {
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

impl<G> Imm<G> {
    /// The filter with transition probabilities `transition[i][j] = p(next model j | model i)`.
    ///
    /// # Errors
    /// If there is no model, the matrix is not square of their number, or a row does not sum to one.
    pub fn new(models: Vec<G>, transition: &[Vec<f64>]) -> Result<Self, ArgumentError> {
        at_least_one("models", models.len())?;
        Ok(Self {
            transition: by_rows(models.len(), transition)?,
            models,
        })
    }

    /// The filter whose model, with probability `switching` in each slot, is drawn anew uniformly from all models.
    ///
    /// # Errors
    /// If there is no model, or `switching` is outside `[0, 1]`.
    pub fn switching(models: Vec<G>, switching: f64) -> Result<Self, ArgumentError> {
        at_least_one("models", models.len())?;
        Ok(Self {
            transition: evenly(models.len(), switching)?,
            models,
        })
    }

    /// The models.
    pub fn models(&self) -> &[G] {
        &self.models
    }

    fn check<const D: usize>(&self, belief: &ImmBelief<D>) -> Result<(), ArgumentError> {
        if belief.modes.len() == self.models.len() {
            return Ok(());
        }
        let expected = format!("{}, as many as the filter has", self.models.len());
        Err(ArgumentError::new("belief", format!("of {} models", belief.modes.len()), expected))
    }

    /// Mixing and time update.
    ///
    /// # Errors
    /// If the belief has another number of models.
    pub fn predict_in_place<const D: usize>(
        &self,
        belief: &mut ImmBelief<D>,
        workspace: &mut ImmWorkspace<D>,
    ) -> Result<(), Error>
    where
        G: GaussianDynamics<D>,
    {
        self.check(belief)?;
        mix(belief, &self.transition, workspace, |j, mixed| Ok(assumed_density::predict(&self.models[j], mixed)))
    }

    /// Measurement update; returns `ln p(observation | past)`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under every model; the belief is then unchanged.
    /// If it is impossible under some models only, these keep their Gaussian and get probability zero.
    pub fn update_in_place<const D: usize, const M: usize>(
        &self,
        belief: &mut ImmBelief<D>,
        observed: &Observed<impl Sensing<D, M>, impl Factor<M>, M>,
        workspace: &mut ImmWorkspace<D>,
    ) -> Result<f64, Error> {
        self.check(belief)?;
        weigh(belief, workspace, |_, mode| {
            let (next, info) = assumed_density::update_through(mode, observed)?;
            Ok((next, info.log_likelihood))
        })
    }
}

/// Mixes the modes by `transition` (row by row) and predicts each: `predict(j, mixed)` is the time update of model `j`.
pub(crate) fn mix<const D: usize>(
    belief: &mut ImmBelief<D>,
    transition: &[f64],
    workspace: &mut ImmWorkspace<D>,
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
pub(crate) fn weigh<const D: usize>(
    belief: &mut ImmBelief<D>,
    workspace: &mut ImmWorkspace<D>,
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
