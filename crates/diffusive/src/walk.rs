//! The search as a protocol between nodes.

use crate::{Action, Error, Search, SearchField};
use fewbits_core::BitString;
use fewbits_core::rand::Rng;
use fewbits_numerics::error::{all_finite, entries};
use fewbits_protocol::{BoxError, Lead, Leader};

/// [`Search`] as a protocol: the node that receives a message decodes it, makes its step and encodes the state for the next node.
#[derive(Debug, Clone)]
pub struct SourceChain {
    search: Search,
    field: SearchField,
    samples: Vec<Vec<f64>>,
}

impl SourceChain {
    /// A chain over a field. `samples` has one list per node: what the node measures when it is asked, kg/m^3.
    ///
    /// # Errors
    /// As [`Search::start`]; if there is not one list of samples per node, or a list has not one finite sample per instant.
    pub fn new(search: Search, field: SearchField, samples: Vec<Vec<f64>>) -> Result<Self, Error> {
        search.start(&field)?;
        entries("samples", samples.len(), field.deployment().len())?;
        for list in &samples {
            entries("samples", list.len(), field.models().instants().len())?;
            all_finite("samples", list)?;
        }
        Ok(Self { search, field, samples })
    }
}

impl Leader for SourceChain {
    fn lead(&self, _: &mut dyn Rng, _: u64, node: u32, message: Option<&BitString>) -> Result<Lead, BoxError> {
        let state = match message {
            None => self.search.start(&self.field)?,
            Some(bits) => self.search.decode(&self.field, bits)?,
        };
        let own = self.samples.get(node as usize);
        let own = own.ok_or_else(|| format!("node {node} has no samples"))?;
        let next = self.search.step(&self.field, state, node as usize, own)?;
        let (asked, ended) = match next.action {
            Action::Ask { node, .. } => (Some(u32::try_from(node)?), None),
            Action::End { status, cause, .. } => (None, Some((status, cause))),
        };
        let step = next.step.ok_or_else(|| match ended {
            Some((_, Some(cause))) => BoxError::from(cause),
            Some((status, None)) => format!("the search ended without an estimate: {status:?}").into(),
            None => "the step gave no estimate".into(),
        })?;
        Ok(Lead {
            message: self.search.encode(&self.field, &next.state)?,
            next: asked,
            estimate: step.estimate.mean().as_slice().to_vec(),
        })
    }
}
