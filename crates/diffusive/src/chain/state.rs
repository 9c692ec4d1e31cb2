//! What a search knows between two nodes, and its encoding.

use super::Search;
use super::alternatives::{Alternative, most_probable};
use super::field::SearchField;
use crate::belief::Travelling;
use crate::fit::Fit;
use crate::form::Form;
use crate::message::{Contract, Packet, RECORD_COUNT_BITS};
use crate::{Error, Record};
use fewbits_core::{BitReader, BitString, BitWriter, CodecError, Message, NumberFormat};
use fewbits_numerics::error::refuse;

/// State of a search before a node samples: what the node received.
///
/// Made by [`Search::start`] or [`Search::decode`], and by every [`Search::step`].
#[derive(Debug, Clone)]
pub struct SearchState {
    pub(super) alternatives: Vec<Alternative>,
    /// The nodes that have sampled, in order.
    pub(super) route: Vec<usize>,
    /// The belief of the last message and the fit so far; `None` before the first message, and if raw records are sent.
    pub(super) received: Option<(Travelling, Fit)>,
    /// The last message; `None` before the first step.
    pub(super) packet: Option<Packet>,
    /// `log10` of the determinant after each of the last nodes, as many as [`Search::stall`] compares.
    pub(super) log10_determinants: Vec<f64>,
}

impl SearchState {
    /// The nodes that have sampled, in order.
    pub fn route(&self) -> &[usize] {
        &self.route
    }

    /// The records of the nodes that have sampled, under the most probable model. After [`Search::decode`] of a belief it has only the
    /// records taken since.
    pub(crate) fn records(&self) -> &[Record] {
        &self.alternatives[most_probable(&self.alternatives)].records
    }

    pub(super) fn into_records(mut self) -> Vec<Record> {
        let best = most_probable(&self.alternatives);
        std::mem::take(&mut self.alternatives[best].records)
    }

    /// Probabilities of the models, in their order.
    pub(crate) fn models(&self) -> Vec<f64> {
        self.alternatives.iter().map(|a| a.probability).collect()
    }
}

impl Search {
    /// The state before the first node.
    ///
    /// # Errors
    /// If a parameter of the search is outside its range, or its messages cannot hold the rate, the components, the number of nodes of
    /// the field, or the records of `max_nodes` nodes.
    pub fn start(&self, field: &SearchField) -> Result<SearchState, Error> {
        self.check(field)?;
        Ok(SearchState {
            alternatives: field.models().iter().map(Alternative::new).collect(),
            route: Vec::new(),
            received: None,
            packet: None,
            log10_determinants: Vec::new(),
        })
    }

    /// The message to the next node: the packet of the last step (raw records or a belief). A belief is followed by the route, since the
    /// next node must not ask those again: the number of nodes in 10 bits and the index of each. With [`Search::stall`] the determinants
    /// that it compares follow in single precision.
    ///
    /// # Errors
    /// If no node has sampled yet.
    pub fn encode(&self, field: &SearchField, state: &SearchState) -> Result<BitString, Error> {
        let Some(packet) = &state.packet else {
            return refuse("state", "no node has sampled", "the state after a step");
        };
        let mut writer = BitWriter::new();
        packet.encode(&self.contract(field), &mut writer)?;
        if let Packet::Belief(_) = packet {
            writer.write(state.route.len() as u64, RECORD_COUNT_BITS)?;
            for node in &state.route {
                writer.write(*node as u64, self.wire.index_bits)?;
            }
        }
        for log in &state.log10_determinants {
            NumberFormat::Single.write(f64::from(*log as f32), &mut writer)?;
        }
        Ok(writer.finish())
    }

    /// The state that a node receives from a message of [`encode`](Self::encode).
    ///
    /// A belief continues as in [`run`](Self::run), to the bit (determinants of [`Search::stall`] in single precision). Raw records are
    /// exact too, but the first cells of the next posterior cover the whole search box instead of the neighbourhood of the last posterior:
    /// its moments agree to the accuracy of the cells.
    ///
    /// # Errors
    /// If the bits are no such message: of another form or length, with a node that does not exist or occurs twice, or with numbers that
    /// are no belief.
    pub fn decode(&self, field: &SearchField, message: &BitString) -> Result<SearchState, Error> {
        let mut state = self.start(field)?;
        let mut reader = BitReader::new(message);
        let contract = self.contract(field);
        let packet = Packet::decode(&contract, &mut reader)?;
        if matches!(packet, Packet::Raw(_)) != (self.form == Form::Raw) {
            return refuse("message", "records or a belief", format!("a message of the form {:?}", self.form));
        }
        match &packet {
            Packet::Raw(records) => {
                state.route = records.iter().map(|(node, _)| *node).collect();
                self.check_route(field, &state.route)?;
                for alternative in &mut state.alternatives {
                    for (node, samples) in records {
                        let position = &field.deployment().positions()[*node];
                        let record = self.wire.received(&alternative.sensor, position, samples)?;
                        alternative.records.push(record);
                    }
                }
            }
            Packet::Belief(_) => {
                let count = reader.read(RECORD_COUNT_BITS)?;
                let route = (0..count).map(|_| Ok(reader.read(self.wire.index_bits)? as usize));
                state.route = route.collect::<Result<_, CodecError>>()?;
                self.check_route(field, &state.route)?;
                state.received = packet.belief(self.form)?;
            }
        }
        let compared = state.route.len().min(self.compared_determinants());
        let determinants = (0..compared).map(|_| NumberFormat::Single.read(&mut reader));
        state.log10_determinants = determinants.collect::<Result<_, _>>()?;
        reader.finish()?;
        state.packet = Some(packet);
        Ok(state)
    }

    fn check_route(&self, field: &SearchField, route: &[usize]) -> Result<(), Error> {
        let nodes = field.deployment().len();
        for (i, node) in route.iter().enumerate() {
            if *node >= nodes || route[..i].contains(node) {
                return refuse("route", format!("node {node}"), format!("each of the {nodes} nodes at most once"));
            }
        }
        if route.is_empty() || route.len() >= self.max_nodes {
            let expected = format!("one node at least and less than {}", self.max_nodes);
            return refuse("route", format!("{} nodes", route.len()), expected);
        }
        Ok(())
    }

    pub(super) fn contract(&self, field: &SearchField) -> Contract {
        Contract {
            form: self.form,
            wire: self.wire,
            noise: field.models().noise(),
            samples: field.models().instants().len(),
        }
    }

    /// How many determinants [`Search::stall`] compares; none without it.
    pub(super) fn compared_determinants(&self) -> usize {
        self.stall.map_or(0, |patience| patience.saturating_add(1))
    }
}
