//! The search: a belief travels from node to node until it is sharp.

use crate::belief::{PositionBelief, Prior, SearchBox};
use crate::best_fit::best_fit;
use crate::density::CellOptions;
use crate::density::laplace::Peak;
use crate::fit::Fit;
use crate::message::{Contract, Packet, Wire};
use crate::model_grid::ModelGrid;
use crate::posterior::Posterior;
use crate::project::{Form, Travelling, project};
use crate::select::{Rule, Selector};
use crate::target::Target;
use crate::{Error, RateModel, Record, SourceLikelihood, SourceSensor};
use fewbits_core::{Belief, Gaussian, Message};
use fewbits_densities::Mixture;
use fewbits_models::SourceModel;
use fewbits_models::diffusion::Air;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, positive, within};
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;

/// Parameters of a search.
///
/// ```text
/// belief = prior at the node that raised the alarm
/// repeat at node k: record     = samples of node k
///                   posterior  = belief x likelihood(record)            exact, over cells
///                   belief     = decode(encode(project(posterior)))     what travels: the next node knows these bits alone
///                   stop if det cov(belief) < threshold
///                   k          = best unvisited neighbour by the rule; none: nearest unvisited node through any
/// at the end: refuse the model if the samples do not fit it
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Search {
    /// What is known of the position beforehand.
    pub prior: Gaussian<2>,
    /// Where the source can be at all.
    pub search: SearchBox,
    /// What is assumed of the release rate.
    pub rate: RateModel,
    /// What travels.
    pub form: Form,
    /// How the next node is chosen.
    pub rule: Rule,
    /// The search has converged when the determinant of the position's covariance falls below this, m^4.
    pub threshold: f64,
    /// The most nodes that sample.
    pub most_nodes: usize,
    /// After so many nodes without the determinant falling to a half, the next node is chosen by mutual information whatever the
    /// rule.
    pub stall: Option<usize>,
    /// How what travels is encoded.
    pub wire: Wire,
    /// How exact posteriors are covered.
    pub cells: CellOptions,
    /// The probability with which a right model may be refused ([`Status::Misfit`]), 1e-3 unless told. `None`: it is never refused.
    pub refusal: Option<f64>,
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// The determinant fell below the threshold.
    Converged,
    /// No unvisited node can be reached.
    Exhausted,
    /// The most nodes were used.
    NodeLimit,
    /// A node's samples and the belief that it received exclude each other: a mode was lost on the way, or the model is wrong.
    BeliefMiss,
    /// The samples are not what the model says ([`Fit`]): no source at the place and with a rate that are possible causes them in this
    /// medium. Whatever the belief says, do not trust it.
    Misfit,
    /// What was to travel is no belief any more once it is encoded: the wire's numbers are too coarse.
    Undecodable,
    /// The posterior leans on the border of the search box: the source is probably outside.
    OutsideField,
    /// The posterior is too thin for the cells allowed.
    Unresolved,
}

/// One node's part in a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Which node sampled.
    pub node: usize,
    /// Hops from the node before.
    pub hops: usize,
    /// Mean and covariance of what travels on (of the posterior, for raw records).
    pub estimate: Gaussian<2>,
    /// `log10` of the determinant of that covariance, m^4.
    pub log10_determinant: f64,
    /// Bits that arrived with the belief from the node before, over all hops.
    pub bits: usize,
    /// Cells that were evaluated.
    pub evaluations: usize,
    /// Logarithm of the integral of belief times likelihood.
    pub log_evidence: f64,
    /// How the samples fit so far. Raw records: all samples under this posterior. Other forms: of every node its own samples under
    /// its own posterior, summed; the sum travels with the belief.
    pub fit: Fit,
}

/// How a search went.
#[derive(Debug, Clone)]
pub struct Outcome<M = Air> {
    /// Why it ended.
    pub status: Status,
    /// Every node that sampled, in order.
    pub steps: Vec<Step>,
    /// The last posterior, before projection. With several models that of the most probable one.
    pub posterior: Option<Posterior>,
    /// The records that were used. With several models those of the most probable one.
    pub records: Vec<Record<M>>,
    /// Probabilities of the models, in their order.
    pub models: Vec<f64>,
}

impl<M> Outcome<M> {
    /// The last estimate.
    pub fn estimate(&self) -> Option<&Gaussian<2>> {
        self.steps.last().map(|step| &step.estimate)
    }

    /// How the samples fit at the last node.
    pub fn fit(&self) -> Option<Fit> {
        self.steps.last().map(|step| step.fit)
    }

    /// All bits that travelled.
    pub fn bits(&self) -> usize {
        self.steps.iter().map(|step| step.bits).sum()
    }
}

/// Mass at the border above which the source is taken to be outside.
const LEANING: f64 = 0.5;

impl Search {
    /// A search around the node that raised the alarm, with a wide prior: standard deviation `deviation` about its place.
    /// Raw records travel, the next node is chosen by mutual information.
    ///
    /// # Errors
    /// If `deviation` or `threshold` is not a positive number, or the box is empty.
    pub fn new(
        alarm: &Vector2<f64>,
        deviation: f64,
        search: SearchBox,
        rate: RateModel,
        threshold: f64,
    ) -> Result<Self, Error> {
        positive("deviation", deviation)?;
        positive("threshold", threshold)?;
        rate.check()?;
        for d in 0..2 {
            positive("upper - lower", search.upper[d] - search.lower[d])?;
        }
        Ok(Self {
            prior: Gaussian::new(*alarm, nalgebra::Matrix2::identity() * deviation * deviation)?,
            search,
            rate,
            form: Form::Raw,
            rule: Rule::default(),
            threshold,
            most_nodes: 40,
            stall: None,
            wire: Wire::default(),
            cells: CellOptions::default(),
            refusal: Some(1e-3),
        })
    }

    /// Runs the search from node `start`; `samples` says what a node measures when it is asked.
    ///
    /// What can go wrong on the way ends the search with a [`Status`]; errors are for arguments that make no sense.
    ///
    /// # Errors
    /// If `start` does not exist, graph and deployment differ in size, the model has no concentrations at a node, a sample is not
    /// finite, or the form cannot carry the rate.
    pub fn run<M: SourceModel + Clone>(
        &self,
        sensor: &SourceSensor<M>,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
        samples: impl FnMut(usize) -> Vec<f64>,
    ) -> Result<Outcome<M>, Error> {
        self.run_models(&ModelGrid::single(sensor.clone()), deployment, graph, start, samples)
    }

    /// Runs the search while wind, diffusivity or anything else of the medium is known up to a few models. Every model has its own
    /// posterior of all records, weighed by its evidence; estimate and determinant are those of the mixture, and the most probable
    /// model chooses the next node.
    ///
    /// # Errors
    /// As [`run`](Self::run), or if there are several models and anything but raw records travels.
    pub fn run_models<M: SourceModel + Clone>(
        &self,
        models: &ModelGrid<M>,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
        mut samples: impl FnMut(usize) -> Vec<f64>,
    ) -> Result<Outcome<M>, Error> {
        self.check(models, deployment, graph, start)?;
        let mut alternatives: Vec<Alternative<M>> = models.iter().map(Alternative::new).collect();
        let mut outcome = Outcome {
            status: Status::NodeLimit,
            steps: Vec::new(),
            posterior: None,
            records: Vec::new(),
            models: models.iter().map(|(_, prior)| prior).collect(),
        };
        let mut visited = vec![false; deployment.len()];
        // What the node received: a belief with the fit so far (nothing but records, if these travel), and its price.
        let mut received: Option<(Travelling, Fit)> = None;
        let (mut node, mut hops, mut bits) = (start, 0, 0);
        loop {
            // Sample and update.
            visited[node] = true;
            let taken = samples(node);
            for alternative in &mut alternatives {
                let record = alternative.sensor.record(&deployment.positions()[node], &taken)?;
                alternative.records.push(match self.form {
                    Form::Raw => self.wire.quantised(record)?,
                    _ => record,
                });
            }
            if let Some(status) = self.update(&mut alternatives, received.as_ref().map(|(belief, _)| belief))? {
                outcome.status = status;
                outcome.records = alternatives.swap_remove(most_probable(&alternatives)).records;
                return Ok(outcome);
            }
            let best = most_probable(&alternatives);
            outcome.models = alternatives.iter().map(|a| a.probability).collect();
            outcome.records.clone_from(&alternatives[best].records);
            let Some(updated) = alternatives[best].posterior.clone() else {
                outcome.status = Status::Unresolved;
                return Ok(outcome);
            };
            let fit = mixed_fit(&alternatives, updated.fit.samples);
            let fit = received.as_ref().map_or(fit, |(_, before)| before.plus(&fit));

            // Project, encode, and go on with what will be decoded.
            let ids: Vec<usize> = outcome.steps.iter().map(|step| step.node).chain([node]).collect();
            let last = &outcome.records[outcome.records.len() - 1];
            let projected = match project(&updated, self.form, &self.rate) {
                Ok(Some(belief)) => {
                    let before = received.as_ref().map(|(belief, _)| belief);
                    Some(self.peak(belief, &updated, last, before)?)
                }
                Ok(None) => None,
                Err(error) => {
                    outcome.status = failure(&error).ok_or(error)?;
                    return Ok(outcome);
                }
            };
            let packet = match &projected {
                Some(belief) => Packet::belief_of(belief, &fit, &self.wire)?,
                None => Packet::raw(&outcome.records, &ids),
            };
            let contract = Contract {
                wire: self.wire,
                noise: last.sensor().noise(),
                samples: last.samples().len(),
            };
            let message = packet.to_bits(&contract)?;
            received = match Packet::from_bits(&contract, &message)?.belief() {
                Ok(decoded) => decoded,
                Err(_) => {
                    outcome.status = Status::Undecodable;
                    outcome.posterior = Some(updated);
                    return Ok(outcome);
                }
            };
            let estimate = received
                .as_ref()
                .map_or_else(|| mixed(&alternatives), |(belief, _)| belief.gaussian());
            let determinant = estimate.covariance().determinant();
            outcome.steps.push(Step {
                node,
                hops,
                estimate,
                log10_determinant: determinant.log10(),
                bits: bits * hops,
                evaluations: alternatives
                    .iter()
                    .filter_map(|a| a.posterior.as_ref())
                    .map(|p| p.cells.evaluations())
                    .sum(),
                log_evidence: log_evidence(&alternatives),
                fit,
            });
            bits = message.bits();

            // Stop, or choose the next node.
            let ending = |status| self.ending(status, &updated, &fit);
            if determinant < self.threshold {
                outcome.status = ending(Status::Converged);
            } else if outcome.steps.len() >= self.most_nodes {
                outcome.status = ending(Status::NodeLimit);
            } else {
                let (candidates, distance) = graph.nearest(node, |other| !visited[other])?;
                if candidates.is_empty() {
                    outcome.status = ending(Status::Exhausted);
                } else {
                    let rule = if self.stalled(&outcome.steps) {
                        Rule::MutualInformation
                    } else {
                        self.rule
                    };
                    let selector = Selector::new(rule, &updated, &estimate, &self.rate)?;
                    let places: Vec<_> = candidates.iter().map(|c| (*c, deployment.positions()[*c])).collect();
                    let next = selector
                        .best(&alternatives[best].sensor, &places)
                        .unwrap_or(candidates[0]);
                    (node, hops) = (next, distance);
                    continue;
                }
            }
            outcome.posterior = Some(updated);
            return Ok(outcome);
        }
    }

    fn check<M: SourceModel>(
        &self,
        models: &ModelGrid<M>,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
    ) -> Result<(), Error> {
        self.form.check(&self.rate)?;
        at_least_one("most_nodes", self.most_nodes)?;
        if let Some(level) = self.refusal {
            within("refusal", level, 0.0, 1.0)?;
        }
        if graph.len() != deployment.len() || start >= deployment.len() {
            let expected = format!("a node of a graph of the {} deployed", deployment.len());
            return Err(ArgumentError::new("start", format!("{start} in a graph of {}", graph.len()), expected).into());
        }
        if models.len() > 1 && self.form != Form::Raw {
            return Err(ArgumentError::new("form", format!("{:?}", self.form), "Raw with several models").into());
        }
        for (sensor, _) in models.iter() {
            for position in deployment.positions() {
                sensor.receptor(position)?;
            }
        }
        Ok(())
    }

    /// Updates the posterior of every model that is left, and the models' probabilities. A status if the search ends here.
    fn update<M: SourceModel + Clone>(
        &self,
        alternatives: &mut [Alternative<M>],
        received: Option<&Travelling>,
    ) -> Result<Option<Status>, Error> {
        let mut end = None;
        for alternative in alternatives.iter_mut().filter(|a| a.log_weight > f64::NEG_INFINITY) {
            let (prior, likelihood, near) = self.terms(alternative, received)?;
            match Posterior::new(&prior, &likelihood, &self.search, near, &self.cells) {
                Ok(posterior) => {
                    alternative.log_evidence = posterior.cells.log_evidence();
                    alternative.posterior = Some(posterior);
                }
                Err(error) => {
                    let status = failure(&error).ok_or(error)?;
                    let status = self.explained(status, &prior, &likelihood, received.is_some())?;
                    if status == Status::Unresolved {
                        // The evidence of this model is not known: no other can be said to be right.
                        return Ok(Some(status));
                    }
                    alternative.log_weight = f64::NEG_INFINITY;
                    end = Some(status);
                }
            }
        }
        let largest = alternatives
            .iter()
            .map(Alternative::log_posterior)
            .fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return Ok(Some(end.unwrap_or(Status::Misfit)));
        }
        let mut total = 0.0;
        for alternative in alternatives.iter_mut() {
            let log = alternative.log_posterior() - largest;
            if log < -EXCLUDED {
                alternative.log_weight = f64::NEG_INFINITY;
            }
            alternative.probability = log.exp();
            total += alternative.probability;
        }
        alternatives.iter_mut().for_each(|a| a.probability /= total);
        Ok(None)
    }

    /// What an update of one model multiplies: the prior, the likelihood, and the box that holds the product.
    fn terms<M: SourceModel + Clone>(
        &self,
        alternative: &Alternative<M>,
        received: Option<&Travelling>,
    ) -> Result<(Prior, SourceLikelihood<M>, Option<SearchBox>), Error> {
        let all = alternative.records.as_slice();
        let last = &all[all.len() - 1..];
        let (prior, records) = match (received, &self.rate) {
            (None, _) => (Prior::Exact(self.prior), all),
            (Some(Travelling::WithRate(belief)), RateModel::Joint(range)) => {
                (Prior::WithRate(belief.clone(), *range), last)
            }
            (Some(Travelling::WithRate(belief)), _) => {
                let position = Mixture::single(&belief.position())?;
                (Prior::Position(PositionBelief::Mixture(position)), last)
            }
            (Some(Travelling::Position(position)), _) => (Prior::Position(position.clone()), last),
        };
        let near = match (received, &alternative.posterior) {
            (None, Some(posterior)) => Some(posterior.around(&self.search)),
            _ => None,
        };
        Ok((prior, SourceLikelihood::new(records.to_vec(), self.rate)?, near))
    }

    /// The status of an update that failed. If not even the best position explains the samples, that is the reason.
    fn explained<M: SourceModel>(
        &self,
        status: Status,
        prior: &Prior,
        likelihood: &SourceLikelihood<M>,
        carried: bool,
    ) -> Result<Status, Error> {
        let Some(level) = self.refusal else {
            return Ok(status);
        };
        let fit = best_fit(&Target::new(prior, likelihood)?, likelihood, &self.search);
        Ok(match (status, fit) {
            // What excludes a belief that was received may lie in the belief.
            (Status::BeliefMiss, None) if carried => status,
            (_, None) => Status::Misfit,
            (_, Some(fit)) if fit.is_refused(level) => Status::Misfit,
            _ => status,
        })
    }

    /// The status of a search that ends here for the given reason.
    fn ending(&self, reason: Status, posterior: &Posterior, fit: &Fit) -> Status {
        if posterior.mass_at_border(&self.search) > LEANING {
            Status::OutsideField
        } else if self.refusal.is_some_and(|level| fit.is_refused(level)) {
            Status::Misfit
        } else {
            reason
        }
    }

    /// For the Laplace form: replaces the moments by mode and curvature where there is a peak.
    fn peak<M: SourceModel + Clone>(
        &self,
        moments: Travelling,
        posterior: &Posterior,
        last: &Record<M>,
        before: Option<&Travelling>,
    ) -> Result<Travelling, Error> {
        let (Form::Laplace, Travelling::Position(_)) = (self.form, &moments) else {
            return Ok(moments);
        };
        let likelihood = SourceLikelihood::new(vec![last.clone()], self.rate)?;
        let prior = before.map_or(self.prior, Travelling::gaussian).factored()?;
        let log = |x: &Vector2<f64>| prior.log_pdf(x) + fewbits_core::Likelihood::log_likelihood(&likelihood, x);
        // The mode among the cells.
        let best = posterior
            .cells
            .weights()
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map_or(0, |(i, _)| i);
        let [x, y] = posterior.cells.columns();
        let scale = Vector2::repeat(posterior.cells.width());
        match Peak::climb(&log, &Vector2::new(x[best], y[best]), &scale) {
            Ok(peak) => Ok(Travelling::Position(PositionBelief::Mixture(Mixture::single(&peak.gaussian())?))),
            Err(_) => Ok(moments),
        }
    }

    fn stalled(&self, steps: &[Step]) -> bool {
        let Some(patience) = self.stall else { return false };
        let Some(past) = steps.len().checked_sub(patience + 1) else {
            return false;
        };
        let now = steps.last().map_or(0.0, |step| step.log10_determinant);
        now > steps[past].log10_determinant - 0.3
    }
}

/// Models this many nats below the best are not looked at again.
const EXCLUDED: f64 = 30.0;

/// One model of the medium along a search.
struct Alternative<M> {
    sensor: SourceSensor<M>,
    /// Logarithm of the prior probability; `-inf` once the model is excluded.
    log_weight: f64,
    log_evidence: f64,
    probability: f64,
    records: Vec<Record<M>>,
    posterior: Option<Posterior>,
}

impl<M: Clone> Alternative<M> {
    fn new((sensor, prior): (&SourceSensor<M>, f64)) -> Self {
        Self {
            sensor: sensor.clone(),
            log_weight: prior.ln(),
            log_evidence: 0.0,
            probability: prior,
            records: Vec::new(),
            posterior: None,
        }
    }
}

impl<M> Alternative<M> {
    fn log_posterior(&self) -> f64 {
        self.log_weight + self.log_evidence
    }
}

/// The first of the most probable.
fn most_probable<M>(alternatives: &[Alternative<M>]) -> usize {
    (1..alternatives.len()).fold(0, |best, i| {
        if alternatives[i].probability > alternatives[best].probability {
            i
        } else {
            best
        }
    })
}

/// Mean and covariance of the position under all models.
fn mixed<M>(alternatives: &[Alternative<M>]) -> Gaussian<2> {
    let parts = || {
        let held = alternatives.iter().filter(|a| a.probability > 0.0);
        held.filter_map(|a| Some((a.probability, &a.posterior.as_ref()?.cells)))
    };
    let mean: Vector2<f64> = parts().map(|(p, cells)| cells.mean() * p).sum();
    let covariance = parts().map(|(p, cells)| {
        let d = cells.mean() - mean;
        (cells.covariance() + d * d.transpose()) * p
    });
    Gaussian::from_trusted_parts(mean, covariance.sum())
}

/// How the samples fit under all models.
fn mixed_fit<M>(alternatives: &[Alternative<M>], samples: usize) -> Fit {
    let held = alternatives.iter().filter(|a| a.probability > 0.0);
    let parts = held.filter_map(|a| Some(a.probability * a.posterior.as_ref()?.fit.chi_squared));
    Fit {
        chi_squared: parts.sum(),
        samples,
    }
}

/// Logarithm of the evidence under all models.
fn log_evidence<M>(alternatives: &[Alternative<M>]) -> f64 {
    let logs = || alternatives.iter().map(Alternative::log_posterior);
    let largest = logs().fold(f64::NEG_INFINITY, f64::max);
    largest + logs().map(|log| (log - largest).exp()).sum::<f64>().ln()
}

/// Failures of a belief that end a search; others are errors.
fn failure(error: &Error) -> Option<Status> {
    match error {
        Error::Density(crate::density::Error::Core(fewbits_core::Error::Impossible)) => Some(Status::BeliefMiss),
        Error::Density(crate::density::Error::Unresolved { .. }) => Some(Status::Unresolved),
        Error::Density(crate::density::Error::Argument(_)) => Some(Status::BeliefMiss),
        _ => None,
    }
}
