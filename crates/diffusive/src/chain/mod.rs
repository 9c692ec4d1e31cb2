//! The search: nodes update a belief of the source and send it on until its covariance is small.

mod alternatives;
mod outcome;
mod update;

pub use outcome::{Outcome, Status, Step};

use crate::belief::{PositionBelief, SearchBox};
use crate::density::CellOptions;
use crate::density::laplace::Peak;
use crate::fit::Fit;
use crate::message::{Contract, Packet, Wire};
use crate::model_grid::ModelGrid;
use crate::posterior::Posterior;
use crate::project::{Form, Travelling, project};
use crate::select::{SelectionRule, Selector};
use crate::{Error, RateModel, Record, SourceLikelihood, SourceSensor};
use alternatives::{Alternative, log_evidence, mixed, mixed_fit, most_probable};
use fewbits_core::{Gaussian, Message};
use fewbits_densities::Mixture;
use fewbits_numerics::error::{at_least_one, positive, refuse, within};
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;
use outcome::failure;

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
    /// Prior of the position.
    pub prior: Gaussian<2>,
    /// Box that contains the source.
    pub search: SearchBox,
    /// Model of the release rate.
    pub rate: RateModel,
    /// Form of the messages.
    pub form: Form,
    /// How the next node is chosen.
    pub rule: SelectionRule,
    /// The search has converged when the determinant of the position's covariance falls below this, m^4.
    pub threshold: f64,
    /// Largest number of nodes that sample.
    pub most_nodes: usize,
    /// If the determinant has not halved over this many nodes, the next node is chosen by mutual information, whatever `rule` is.
    pub stall: Option<usize>,
    /// Encoding of the messages.
    pub wire: Wire,
    /// Options of the cells that hold exact posteriors.
    pub cells: CellOptions,
    /// Probability with which a correct model may be refused ([`Status::Misfit`]), 1e-3 by default. `None`: it is never refused.
    pub refusal: Option<f64>,
}

/// If the mass at the border of the box exceeds this, the source is taken to be outside.
const LEANING: f64 = 0.5;

impl Search {
    /// A search that starts around the node `alarm`: the prior has standard deviation `deviation`, m, about that place. Nodes send raw
    /// records, and the next node is chosen by mutual information.
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
            rule: SelectionRule::default(),
            threshold,
            most_nodes: 40,
            stall: None,
            wire: Wire::default(),
            cells: CellOptions::default(),
            refusal: Some(1e-3),
        })
    }

    /// Runs the search from node `start`. `samples` returns what a node measures, kg/m^3, when it is asked.
    ///
    /// A search that cannot continue ends with a [`Status`]; errors are for invalid arguments.
    ///
    /// # Errors
    /// If `start` does not exist, graph and deployment differ in size, the model has no concentrations at a node, `samples` fails, a
    /// sample is not finite, or messages of this form cannot contain the rate.
    pub fn run(
        &self,
        sensor: &SourceSensor,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
        samples: impl FnMut(usize) -> Result<Vec<f64>, Error>,
    ) -> Result<Outcome, Error> {
        self.run_models(&ModelGrid::single(sensor.clone()), deployment, graph, start, samples)
    }

    /// Runs the search when a property of the medium, such as the wind or the diffusivity, is one of a few candidates. Every model has its
    /// own posterior of all records, weighted by its evidence. Estimate and determinant are those of the mixture. The most probable model
    /// chooses the next node.
    ///
    /// # Errors
    /// As [`run`](Self::run); if there are several models and the form is not [`Form::Raw`].
    pub fn run_models(
        &self,
        models: &ModelGrid,
        deployment: &Deployment,
        graph: &Graph,
        start: usize,
        mut samples: impl FnMut(usize) -> Result<Vec<f64>, Error>,
    ) -> Result<Outcome, Error> {
        self.check(models, deployment, graph, start)?;
        let mut alternatives: Vec<Alternative> = models.iter().map(Alternative::new).collect();
        let mut outcome = Outcome {
            status: Status::NodeLimit,
            steps: Vec::new(),
            posterior: None,
            records: Vec::new(),
            models: models.iter().map(|(_, prior)| prior).collect(),
        };
        let mut visited = vec![false; deployment.len()];
        // What the node received: a belief with the fit so far (only records, if the form is raw), and its number of bits.
        let mut received: Option<(Travelling, Fit)> = None;
        let (mut node, mut hops, mut bits) = (start, 0, 0);
        loop {
            // Sample and update.
            visited[node] = true;
            let taken = samples(node)?;
            for alternative in &mut alternatives {
                let record = alternative.sensor.record(&deployment.positions()[node], &taken)?;
                alternative.records.push(match self.form {
                    Form::Raw => self.wire.quantised(record)?,
                    _ => record,
                });
            }
            if let Some(status) = self.update(&mut alternatives, received.as_ref().map(|(belief, _)| belief))? {
                outcome.records = alternatives.swap_remove(most_probable(&alternatives)).records;
                return Ok(outcome.ended(status));
            }
            let best = most_probable(&alternatives);
            outcome.models = alternatives.iter().map(|a| a.probability).collect();
            outcome.records.clone_from(&alternatives[best].records);
            let Some(updated) = alternatives[best].posterior.clone() else {
                return Ok(outcome.ended(Status::Unresolved));
            };
            let fit = mixed_fit(&alternatives, updated.fit.samples);
            let fit = received.as_ref().map_or(fit, |(_, before)| before.plus(&fit));

            // Project, encode, and continue with what the next node will decode.
            let ids: Vec<usize> = outcome.steps.iter().map(|step| step.node).chain([node]).collect();
            let last = &outcome.records[outcome.records.len() - 1];
            let projected = match project(&updated, self.form, &self.rate) {
                Ok(Some(belief)) => {
                    let before = received.as_ref().map(|(belief, _)| belief);
                    Some(self.peak(belief, &updated, last, before)?)
                }
                Ok(None) => None,
                Err(error) => return Ok(outcome.ended(failure(&error).ok_or(error)?)),
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
                    outcome.posterior = Some(updated);
                    return Ok(outcome.ended(Status::Undecodable));
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
            let (candidates, distance) = graph.nearest(node, |other| !visited[other])?;
            let reason = if determinant < self.threshold {
                Some(Status::Converged)
            } else if outcome.steps.len() >= self.most_nodes {
                Some(Status::NodeLimit)
            } else if candidates.is_empty() {
                Some(Status::Exhausted)
            } else {
                None
            };
            if let Some(reason) = reason {
                let status = self.ending(reason, &updated, &fit);
                outcome.posterior = Some(updated);
                return Ok(outcome.ended(status));
            }
            let rule = if self.stalled(&outcome.steps) {
                SelectionRule::MutualInformation
            } else {
                self.rule
            };
            let selector = Selector::new(rule, &updated, &estimate, &self.rate)?;
            let places: Vec<_> = candidates.iter().map(|c| (*c, deployment.positions()[*c])).collect();
            let next = selector.best(&alternatives[best].sensor, &places);
            // There is a candidate, so the selector returns one.
            (node, hops) = (next.unwrap_or(candidates[0]), distance);
        }
    }

    fn check(&self, models: &ModelGrid, deployment: &Deployment, graph: &Graph, start: usize) -> Result<(), Error> {
        self.form.check(&self.rate)?;
        at_least_one("most_nodes", self.most_nodes)?;
        if let Some(level) = self.refusal {
            within("refusal", level, 0.0, 1.0)?;
        }
        if graph.len() != deployment.len() || start >= deployment.len() {
            let expected = format!("a node of a graph of the {} deployed", deployment.len());
            return refuse("start", format!("{start} in a graph of {}", graph.len()), expected);
        }
        if models.len() > 1 && self.form != Form::Raw {
            return refuse("form", format!("{:?}", self.form), "Raw with several models");
        }
        for (sensor, _) in models.iter() {
            for position in deployment.positions() {
                sensor.receptor(position)?;
            }
        }
        Ok(())
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

    /// For the Laplace form: mode and curvature instead of the moments, if the posterior has a peak.
    fn peak(
        &self,
        moments: Travelling,
        posterior: &Posterior,
        last: &Record,
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
        // A factor of two is 0.3 in decimal logarithms.
        now > steps[past].log10_determinant - 0.3
    }
}
