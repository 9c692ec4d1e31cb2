//! A diffusing source found by records that travel from node to node.

use crate::error::Error;
use crate::protocols::{Lead, Walker};
use crate::units::SensorId;
use fewbits_core::{BitString, Message, NumberFormat};
use fewbits_diffusive::message::{Contract, Packet};
use fewbits_diffusive::{Form, Outcome, Search, SourceSensor, Status};
use fewbits_topology::{Deployment, Graph};
use rand_pcg::Pcg64Dxsm;
use std::cell::Cell;

/// The chain of [`Search`] with raw records: whoever receives them repeats the search so far, adds its own, and asks the next
/// node.
#[derive(Debug, Clone)]
pub struct SourceChain {
    search: Search,
    sensor: SourceSensor,
    deployment: Deployment,
    graph: Graph,
    samples: Vec<Vec<f64>>,
}

impl SourceChain {
    /// A chain over a field; `samples` has what each node samples when it is asked.
    ///
    /// # Errors
    /// If there is not one list of samples for each node, or what travels is not raw records.
    pub fn new(
        search: Search,
        sensor: SourceSensor,
        deployment: Deployment,
        graph: Graph,
        samples: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        let refuse = |name, value: String, expected: &str| fewbits_numerics::ArgumentError::new(name, value, expected);
        if samples.len() != deployment.len() {
            return Err(refuse("samples", samples.len().to_string(), "a list for each node").into());
        }
        if search.form != Form::Raw {
            return Err(refuse("form", format!("{:?}", search.form), "raw records").into());
        }
        if search.wire.samples.is_some() && search.wire.numbers == NumberFormat::Double {
            return Err(refuse("wire", "samples of a code".into(), "plain samples").into());
        }
        Ok(Self {
            search,
            sensor,
            deployment,
            graph,
            samples,
        })
    }

    /// The search from its first node over `known` records, and which node it would ask after them.
    fn repeat(&self, known: &[(usize, Vec<f64>)]) -> Result<(Outcome, Option<usize>), Error> {
        let first = known.first().map_or(0, |(node, _)| *node);
        let run = |most: usize, asked: &Cell<Option<usize>>| {
            let mut search = self.search.clone();
            search.most_nodes = most.min(self.search.most_nodes);
            search
                .run(&self.sensor, &self.deployment, &self.graph, first, |node| {
                    match known.iter().find(|(at, _)| *at == node) {
                        Some((_, samples)) => samples.clone(),
                        None => {
                            asked.set(Some(node));
                            // Whoever it is will sample itself; here it only matters that it was asked.
                            self.samples.get(first).cloned().unwrap_or_default()
                        }
                    }
                })
                .map_err(|error| Error::estimator("diffusive", error))
        };
        let nobody = Cell::new(None);
        let outcome = run(known.len(), &nobody)?;
        if nobody.get().is_some() {
            return Err(Error::ForeignHandover {
                expected: "records of this search",
            });
        }
        let next = Cell::new(None);
        if outcome.status == Status::NodeLimit && known.len() < self.search.most_nodes {
            run(known.len() + 1, &next)?;
        }
        Ok((outcome, next.get()))
    }
}

impl Walker for SourceChain {
    fn lead(&self, _: &mut Pcg64Dxsm, slot: u32, node: SensorId, message: Option<&BitString>) -> Result<Lead, Error> {
        let contract = Contract {
            wire: self.search.wire,
            noise: self.sensor.noise(),
            samples: self.sensor.instants().len(),
        };
        let mut known = match message {
            None => Vec::new(),
            Some(bits) => match Packet::from_bits(&contract, bits)? {
                Packet::Raw { records, .. } => records,
                Packet::Belief { .. } => {
                    return Err(Error::ForeignHandover {
                        expected: "raw records",
                    });
                }
            },
        };
        let own = self.samples.get(node.index()).ok_or(Error::NoReading { node, slot })?;
        known.push((node.index(), own.clone()));
        let (outcome, next) = self.repeat(&known)?;
        let estimate = outcome.estimate().ok_or(Error::NoEstimate)?;
        let packet = Packet::Raw {
            records: known,
            noise: contract.noise,
        };
        Ok(Lead {
            message: packet.to_bits(&contract)?,
            next: next.map(|next| SensorId(next as u32)),
            estimate: estimate.mean().as_slice().to_vec(),
        })
    }
}
