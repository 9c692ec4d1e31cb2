//! What every node of a search knows: the models of the medium, where the nodes are, and who reaches whom.

use crate::Error;
use crate::model_grid::ModelGrid;
use fewbits_numerics::error::refuse;
use fewbits_topology::{Deployment, Graph};

/// Models of the medium, positions of the nodes and the graph of their radios. All nodes know them before a search.
///
/// A single [`SourceSensor`](crate::SourceSensor) is a grid of one model. With several, each has its own posterior of all records, weighted by its evidence.
#[derive(Debug, Clone)]
pub struct SearchField {
    models: ModelGrid,
    deployment: Deployment,
    graph: Graph,
}

impl SearchField {
    /// Models of the medium over a deployment and its graph.
    ///
    /// # Errors
    /// If graph and deployment differ in size, or a model has no concentrations at a node.
    pub fn new(models: impl Into<ModelGrid>, deployment: Deployment, graph: Graph) -> Result<Self, Error> {
        let models = models.into();
        if graph.len() != deployment.len() {
            let expected = format!("a graph of the {} nodes deployed", deployment.len());
            return refuse("graph", format!("of {} nodes", graph.len()), expected);
        }
        for (sensor, _) in models.iter() {
            for position in deployment.positions() {
                sensor.receptor(position)?;
            }
        }
        Ok(Self {
            models,
            deployment,
            graph,
        })
    }

    /// The models of the medium.
    pub(crate) fn models(&self) -> &ModelGrid {
        &self.models
    }

    /// The positions of the nodes.
    pub fn deployment(&self) -> &Deployment {
        &self.deployment
    }

    /// Who reaches whom.
    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }
}
