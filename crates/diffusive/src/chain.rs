//! The search: a belief travels from node to node until it is sharp.

use crate::belief::{PositionBelief, Prior, SearchBox};
use crate::message::{Packet, Wire};
use crate::posterior::Posterior;
use crate::project::{Form, Travelling, project};
use crate::select::{Rule, Selector};
use crate::{Error, RateModel, Record, SourceLikelihood, SourceSensor};
use fewbits_core::Gaussian;
use fewbits_densities::laplace::Peak;
use fewbits_densities::{CellOptions, Mixture};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;

/// Parameters of a search.
///
/// ```text
/// belief = prior at the node that raised the alarm
/// repeat at node k: record     = samples of node k
///                   posterior  = belief x likelihood(record)            exact, over cells
///                   belief     = project(posterior)                     what travels; measured in bits
///                   stop if det cov(belief) < threshold
///                   k          = best unvisited neighbour by the rule; none: nearest unvisited node through any
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
    /// A node's samples and the belief exclude each other: a mode was lost on the way, or the model is wrong.
    BeliefMiss,
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
}

/// How a search went.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why it ended.
    pub status: Status,
    /// Every node that sampled, in order.
    pub steps: Vec<Step>,
    /// The last posterior, before projection.
    pub posterior: Option<Posterior>,
    /// The records that were used.
    pub records: Vec<Record>,
}

impl Outcome {
    /// The last estimate.
    pub fn estimate(&self) -> Option<&Gaussian<2>> {
        self.steps.last().map(|step| &step.estimate)
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
        })
    }

    /// Runs the search from node `start`; `samples` says what a node measures when it is asked.
    ///
    /// What can go wrong on the way ends the search with a [`Status`]; errors are for arguments that make no sense.
    ///
    /// # Errors
    /// If `start` does not exist, graph and deployment differ in size, a sample is not finite, or the form cannot carry the rate.
    pub fn run(
        &self,
        sensor: &SourceSensor,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
        mut samples: impl FnMut(usize) -> Vec<f64>,
    ) -> Result<Outcome, Error> {
        self.form.check(&self.rate)?;
        at_least_one("most_nodes", self.most_nodes)?;
        if graph.len() != deployment.len() || start >= deployment.len() {
            let expected = format!("a node of a graph of the {} deployed", deployment.len());
            return Err(ArgumentError::new("start", format!("{start} in a graph of {}", graph.len()), expected).into());
        }
        let mut outcome = Outcome {
            status: Status::NodeLimit,
            steps: Vec::new(),
            posterior: None,
            records: Vec::new(),
        };
        let mut visited = vec![false; deployment.len()];
        let mut belief: Option<Travelling> = None;
        let mut packet: Option<Packet> = None;
        let (mut node, mut hops) = (start, 0);
        loop {
            visited[node] = true;
            let position = &deployment.positions()[node];
            let taken = sensor.record(position, &samples(node))?;
            let record = match self.form {
                Form::Raw => self.wire.quantised(taken)?,
                _ => taken,
            };
            outcome.records.push(record);
            let updated = match self.update(belief.as_ref(), &outcome) {
                Ok(updated) => updated,
                Err(error) => {
                    outcome.status = failure(&error).ok_or(error)?;
                    return Ok(outcome);
                }
            };
            let bits = match &packet {
                Some(packet) => packet.bits(&self.wire)? * hops,
                None => 0,
            };
            belief = match project(&updated, self.form, &self.rate) {
                Ok(Some(travelling)) => Some(self.peak(travelling, &updated, &outcome, belief.as_ref())?),
                Ok(None) => None,
                Err(error) => {
                    outcome.status = failure(&error).ok_or(error)?;
                    return Ok(outcome);
                }
            };
            let estimate = belief.as_ref().map_or_else(|| updated.gaussian(), Travelling::gaussian);
            let determinant = estimate.covariance().determinant();
            outcome.steps.push(Step {
                node,
                hops,
                estimate,
                log10_determinant: determinant.log10(),
                bits,
                evaluations: updated.cells.evaluations(),
                log_evidence: updated.cells.log_evidence(),
            });
            let leaning = updated.mass_at_border(&self.search) > LEANING;
            let converged = determinant < self.threshold;
            if converged || outcome.steps.len() >= self.most_nodes {
                outcome.status = match (leaning, converged) {
                    (true, _) => Status::OutsideField,
                    (false, true) => Status::Converged,
                    (false, false) => Status::NodeLimit,
                };
                outcome.posterior = Some(updated);
                return Ok(outcome);
            }
            let (candidates, distance) = graph.nearest(node, |other| !visited[other])?;
            if candidates.is_empty() {
                outcome.status = if leaning {
                    Status::OutsideField
                } else {
                    Status::Exhausted
                };
                outcome.posterior = Some(updated);
                return Ok(outcome);
            }
            let rule = if self.stalled(&outcome.steps) {
                Rule::MutualInformation
            } else {
                self.rule
            };
            let selector = Selector::new(rule, &updated, &estimate, &self.rate)?;
            let places: Vec<_> = candidates.iter().map(|c| (*c, deployment.positions()[*c])).collect();
            let next = selector.best(sensor, &places).unwrap_or(candidates[0]);
            packet = Some(Packet::new(belief.as_ref(), &outcome.records, &visited_ids(&outcome.steps), &self.wire)?);
            outcome.posterior = Some(updated);
            (node, hops) = (next, distance);
        }
    }

    fn update(&self, belief: Option<&Travelling>, outcome: &Outcome) -> Result<Posterior, Error> {
        let carried = match &self.rate {
            RateModel::Joint(range) => Some(*range),
            _ => None,
        };
        let last = &outcome.records[outcome.records.len() - 1..];
        let (prior, records, near) = match (belief, carried) {
            (None, _) => {
                let near = outcome
                    .posterior
                    .as_ref()
                    .map(|posterior| posterior.around(&self.search));
                (Prior::Exact(self.prior), outcome.records.as_slice(), near)
            }
            (Some(Travelling::WithRate(belief)), Some(range)) => (Prior::WithRate(belief.clone(), range), last, None),
            (Some(Travelling::WithRate(belief)), None) => {
                let position = Mixture::single(&belief.position())?;
                (Prior::Position(PositionBelief::Mixture(position)), last, None)
            }
            (Some(Travelling::Position(position)), _) => (Prior::Position(position.clone()), last, None),
        };
        let likelihood = SourceLikelihood::new(records.to_vec(), self.rate)?;
        Posterior::new(&prior, &likelihood, &self.search, near, &self.cells)
    }

    /// For the Laplace form: replaces the moments by mode and curvature where there is a peak.
    fn peak(
        &self,
        moments: Travelling,
        posterior: &Posterior,
        outcome: &Outcome,
        before: Option<&Travelling>,
    ) -> Result<Travelling, Error> {
        let (Form::Laplace, Travelling::Position(_)) = (self.form, &moments) else {
            return Ok(moments);
        };
        let last = &outcome.records[outcome.records.len() - 1..];
        let likelihood = SourceLikelihood::new(last.to_vec(), self.rate)?;
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

fn visited_ids(steps: &[Step]) -> Vec<usize> {
    steps.iter().map(|step| step.node).collect()
}

/// Failures of a belief that end a search; others are errors.
fn failure(error: &Error) -> Option<Status> {
    match error {
        Error::Density(fewbits_densities::Error::Core(fewbits_core::Error::Impossible)) => Some(Status::BeliefMiss),
        Error::Density(fewbits_densities::Error::Unresolved { .. }) => Some(Status::Unresolved),
        Error::Density(fewbits_densities::Error::Argument(_)) => Some(Status::BeliefMiss),
        _ => None,
    }
}
