//! The search: nodes update a belief of the source and send it on until its covariance is small.

mod alternatives;
mod field;
mod outcome;
mod state;
mod update;

pub use field::SearchField;
pub use outcome::{Action, Next, Outcome, Status, Step};
pub use state::SearchState;

use crate::belief::Travelling;
use crate::density::CellOptions;
use crate::fit::Fit;
use crate::form::{Form, Update};
use crate::message::{Packet, Wire};
use crate::posterior::Posterior;
use crate::project::project;
use crate::search_box::SearchBox;
use crate::select::{SelectionRule, Selector};
use crate::{Error, RateModel};
use alternatives::{log_evidence, mixed, mixed_fit, most_probable};
use fewbits_core::{Gaussian, Message};
use fewbits_numerics::error::{at_least_one, entries, positive, refuse, within};
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
    pub max_nodes: usize,
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
const MAX_BORDER_MASS: f64 = 0.5;

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
            max_nodes: 40,
            stall: None,
            wire: Wire::default(),
            cells: CellOptions::default(),
            refusal: Some(1e-3),
        })
    }

    /// Runs the search from node `start`. `samples` returns what a node measures, kg/m^3, when it is asked.
    ///
    /// With several models estimate and determinant are those of the mixture; the most probable model chooses the next node. A search that
    /// cannot continue ends with a [`Status`]; errors are for invalid arguments.
    ///
    /// # Errors
    /// As [`start`](Self::start) and [`step`](Self::step), or if `samples` fails.
    pub fn run(
        &self,
        field: &SearchField,
        start: usize,
        mut samples: impl FnMut(usize) -> Result<Vec<f64>, Error>,
    ) -> Result<Outcome, Error> {
        let (mut state, mut steps) = (self.start(field)?, Vec::new());
        let (mut node, mut hops, mut bits) = (start, 0, 0);
        loop {
            self.check_node(field, &state, node)?;
            let next = self.step(field, state, node, &samples(node)?)?;
            let bits_received = bits * hops;
            steps.extend(next.step.map(|step| Step {
                hops,
                bits: bits_received,
                ..step
            }));
            state = next.state;
            match next.action {
                Action::Ask {
                    node: asked,
                    hops: distance,
                } => (node, hops, bits) = (asked, distance, next.bits),
                Action::End {
                    status,
                    posterior,
                    cause,
                } => {
                    return Ok(Outcome {
                        status,
                        cause,
                        steps,
                        posterior,
                        models: state.models(),
                        records: state.into_records(),
                    });
                }
            }
        }
    }

    /// One node's part: it updates the received state with its samples, kg/m^3, and chooses the node to ask next.
    ///
    /// The state after the step goes to that node as the bits of [`encode`](Self::encode).
    ///
    /// # Errors
    /// If the node does not exist or has sampled before, the number of samples is wrong, a sample is not finite, the state is not of
    /// this field, or messages of this form cannot contain the rate.
    pub fn step(
        &self,
        field: &SearchField,
        mut state: SearchState,
        node: usize,
        samples: &[f64],
    ) -> Result<Next, Error> {
        self.check_node(field, &state, node)?;
        state.route.push(node);
        for alternative in &mut state.alternatives {
            let record = alternative
                .sensor
                .record(&field.deployment().positions()[node], samples)?;
            alternative.records.push(match self.form {
                Form::Raw => self.wire.quantised(record)?,
                _ => record,
            });
        }
        let before = state.received.take();
        if let Some(status) = self.update(&mut state.alternatives, before.as_ref().map(|(belief, _)| belief))? {
            return Ok(Next::end(state, None, status));
        }
        let best = most_probable(&state.alternatives);
        let Some(updated) = state.alternatives[best].posterior.clone() else {
            return Ok(Next::end(state, None, Status::Unresolved));
        };
        let fit = mixed_fit(&state.alternatives, updated.fit.samples);
        let fit = before.as_ref().map_or(fit, |(_, before)| before.plus(&fit));

        // Project and encode, and continue with what the next node will decode.
        let belief = match self.projected(&updated, &state, before.as_ref().map(|(belief, _)| belief)) {
            Ok(belief) => belief,
            Err(error) => {
                let status = failure(&error).ok_or_else(|| error.clone())?;
                return Ok(Next::end(state, None, status).because(error));
            }
        };
        let packet = match &belief {
            Some(belief) => Packet::belief_of(belief, &fit, &self.wire)?,
            None => Packet::raw(&state.alternatives[0].records, &state.route),
        };
        let contract = self.contract(field);
        let message = packet.to_bits(&contract)?;
        let (packet, bits) = (Packet::from_bits(&contract, &message)?, message.bits());
        state.received = match packet.belief(self.form) {
            Ok(decoded) => decoded,
            Err(error) => {
                return Ok(Next::end(state, Some(updated), Status::Undecodable).because(error));
            }
        };
        state.packet = Some(packet);
        let estimate = state
            .received
            .as_ref()
            .map_or_else(|| mixed(&state.alternatives), |(belief, _)| belief.gaussian());
        let determinant = estimate.covariance().determinant();
        let step = Step {
            node,
            hops: 0,
            estimate,
            log10_determinant: determinant.log10(),
            bits: 0,
            evaluations: state
                .alternatives
                .iter()
                .filter_map(|a| a.posterior.as_ref())
                .map(|p| p.cells.evaluations())
                .sum(),
            log_evidence: log_evidence(&state.alternatives),
            fit,
        };
        let stalled = self.stalled(&mut state, step.log10_determinant);

        // Stop, or choose the next node.
        let (candidates, hops) = field.graph().nearest(node, |other| !state.route.contains(&other))?;
        let reason = if determinant < self.threshold {
            Some(Status::Converged)
        } else if state.route.len() >= self.max_nodes {
            Some(Status::NodeLimit)
        } else if candidates.is_empty() {
            Some(Status::Exhausted)
        } else {
            None
        };
        if let Some(reason) = reason {
            let status = self.ending(reason, &updated, &fit);
            return Ok(Next {
                step: Some(step),
                bits,
                ..Next::end(state, Some(updated), status)
            });
        }
        let rule = if stalled {
            SelectionRule::MutualInformation
        } else {
            self.rule
        };
        let selector = Selector::new(rule, &updated, &estimate, &self.rate)?;
        let positions = field.deployment().positions();
        let places: Vec<_> = candidates.iter().map(|c| (*c, positions[*c])).collect();
        // There is a candidate, so the selector returns one.
        let asked = selector
            .best(&state.alternatives[best].sensor, &places)
            .unwrap_or(candidates[0]);
        Ok(Next {
            action: Action::Ask { node: asked, hops },
            step: Some(step),
            bits,
            state,
        })
    }

    fn check(&self, field: &SearchField) -> Result<(), Error> {
        self.form.check(&self.rate)?;
        at_least_one("max_nodes", self.max_nodes)?;
        if let Some(level) = self.refusal {
            within("refusal", level, 0.0, 1.0)?;
        }
        if field.models().len() > 1 && self.form != Form::Raw {
            return refuse("form", format!("{:?}", self.form), "Raw with several models");
        }
        self.wire
            .check(self.max_nodes.min(field.deployment().len()), field.deployment().len())
    }

    fn check_node(&self, field: &SearchField, state: &SearchState, node: usize) -> Result<(), Error> {
        let nodes = field.deployment().len();
        if node >= nodes || state.route.contains(&node) {
            let expected = format!("one of the {nodes} nodes that has not sampled yet");
            return refuse("node", format!("node {node}"), expected);
        }
        entries("state.models", state.alternatives.len(), field.models().len())?;
        Ok(())
    }

    /// The belief of the next message; `None` if raw records are sent.
    fn projected(
        &self,
        posterior: &Posterior,
        state: &SearchState,
        before: Option<&Travelling>,
    ) -> Result<Option<Travelling>, Error> {
        let Form::Other(form) = self.form else {
            return project(posterior, self.form, &self.rate);
        };
        let records = state.records();
        let update = Update {
            record: &records[records.len() - 1],
            prior: before.map_or(self.prior, Travelling::gaussian),
        };
        form.0.project(posterior, &self.rate, Some(&update)).map(Some)
    }

    /// The status of a search that ends here for the given reason.
    fn ending(&self, reason: Status, posterior: &Posterior, fit: &Fit) -> Status {
        if posterior.mass_at_border(&self.search) > MAX_BORDER_MASS {
            Status::OutsideField
        } else if self.refusal.is_some_and(|level| fit.is_refused(level)) {
            Status::Misfit
        } else {
            reason
        }
    }

    /// Adds the determinant of this step, and returns whether it has not halved over `stall` nodes.
    fn stalled(&self, state: &mut SearchState, log10_determinant: f64) -> bool {
        let kept = self.compared_determinants();
        let logs = &mut state.log10_determinants;
        logs.push(log10_determinant);
        logs.drain(..logs.len().saturating_sub(kept));
        // A factor of two is 0.3 in decimal logarithms.
        kept > 0 && logs.len() == kept && log10_determinant > logs[0] - 0.3
    }
}
