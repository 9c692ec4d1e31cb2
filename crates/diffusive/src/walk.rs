//! The search as a protocol between nodes.

use crate::message::{Contract, Packet};
use crate::{Form, Outcome, Search, SourceSensor, Status};
use fewbits_core::rand::Rng;
use fewbits_core::{BitString, Message, NumberFormat};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::entries;
use fewbits_protocol::{BoxError, Lead, Leader};
use fewbits_topology::{Deployment, Graph};
use std::cell::Cell;

/// [`Search`] with raw records as a protocol. The node that receives the records repeats the search so far, adds its own samples, and
/// sends all to the next node.
#[derive(Debug, Clone)]
pub struct SourceChain {
    search: Search,
    sensor: SourceSensor,
    deployment: Deployment,
    graph: Graph,
    samples: Vec<Vec<f64>>,
}

impl SourceChain {
    /// A chain over a deployment. `samples` has one list per node: what the node measures when it is asked, kg/m^3.
    ///
    /// # Errors
    /// If there is not one list of samples per node, or the form of the search is not [`Form::Raw`].
    pub fn new(
        search: Search,
        sensor: SourceSensor,
        deployment: Deployment,
        graph: Graph,
        samples: Vec<Vec<f64>>,
    ) -> Result<Self, ArgumentError> {
        entries("samples", samples.len(), deployment.len())?;
        if search.form != Form::Raw {
            return Err(ArgumentError::new("form", format!("{:?}", search.form), "raw records"));
        }
        if search.wire.samples.is_some() && search.wire.numbers == NumberFormat::Double {
            return Err(ArgumentError::new("wire", "samples of a code", "plain samples"));
        }
        Ok(Self {
            search,
            sensor,
            deployment,
            graph,
            samples,
        })
    }

    /// Repeats the search over the `known` records. Returns its outcome and the node that it asks next.
    fn repeat(&self, known: &[(usize, Vec<f64>)]) -> Result<(Outcome, Option<usize>), BoxError> {
        let first = known.first().map_or(0, |(node, _)| *node);
        let run = |most: usize, asked: &Cell<Option<usize>>| {
            let mut search = self.search.clone();
            search.most_nodes = most.min(self.search.most_nodes);
            search.run(&self.sensor, &self.deployment, &self.graph, first, |node| {
                Ok(match known.iter().find(|(at, _)| *at == node) {
                    Some((_, samples)) => samples.clone(),
                    None => {
                        asked.set(Some(node));
                        // The samples of the node that is asked do not matter here: it only counts which node it is.
                        self.samples.get(first).cloned().unwrap_or_default()
                    }
                })
            })
        };
        let nobody = Cell::new(None);
        let outcome = run(known.len(), &nobody)?;
        if nobody.get().is_some() {
            return Err("the handover has records of another search".into());
        }
        let next = Cell::new(None);
        if outcome.status == Status::NodeLimit && known.len() < self.search.most_nodes {
            run(known.len() + 1, &next)?;
        }
        Ok((outcome, next.get()))
    }
}

impl Leader for SourceChain {
    fn lead(&self, _: &mut dyn Rng, slot: u64, node: u32, message: Option<&BitString>) -> Result<Lead, BoxError> {
        let contract = Contract {
            wire: self.search.wire,
            noise: self.sensor.noise(),
            samples: self.sensor.instants().len(),
        };
        let mut known = match message {
            None => Vec::new(),
            Some(bits) => match Packet::from_bits(&contract, bits)? {
                Packet::Raw(records) => records,
                Packet::Belief(_) => return Err("the handover is a belief: expected raw records".into()),
            },
        };
        let own = self.samples.get(node as usize);
        let own = own.ok_or_else(|| format!("node {node} has no samples in slot {slot}"))?;
        known.push((node as usize, own.clone()));
        // Raw records lose nothing, so the search is repeated from its beginning.
        let (outcome, next) = self.repeat(&known)?;
        let estimate = outcome.estimate().ok_or("the step gave no estimate")?;
        Ok(Lead {
            message: Packet::Raw(known).to_bits(&contract)?,
            next: next.map(u32::try_from).transpose()?,
            estimate: estimate.mean().as_slice().to_vec(),
        })
    }
}
