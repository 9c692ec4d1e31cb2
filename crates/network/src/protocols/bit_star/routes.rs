//! Routes of a star with several hops: through which sensor each sensor sends.

use crate::medium::Field;
use crate::units::SensorId;

/// The fusion centre's node.
pub(crate) const CENTRE: SensorId = SensorId(0);

/// For each node the next one on its route to the centre, and whether others send through it.
#[derive(Debug)]
pub(super) struct Routes {
    parents: Vec<SensorId>,
    pub(super) passes: Vec<bool>,
}

impl Routes {
    pub(super) fn new(field: &Field) -> Self {
        let hops = field.graph().hops_from(CENTRE.index()).ok();
        let parent = |node| hops.as_ref().and_then(|hops| hops.parent(node));
        let parents: Vec<_> = (0..field.len())
            .map(|node| parent(node).map_or(CENTRE, |parent| SensorId(parent as u32)))
            .collect();
        let mut passes = vec![false; parents.len()];
        for parent in &parents {
            passes[parent.index()] = true;
        }
        Self { parents, passes }
    }

    pub(super) fn parent(&self, node: SensorId) -> SensorId {
        self.parents.get(node.index()).copied().unwrap_or(CENTRE)
    }

    /// The node before `below` on the way down from `above`.
    pub(super) fn down(&self, above: SensorId, below: SensorId) -> SensorId {
        let mut hop = below;
        for _ in 0..self.parents.len() {
            let parent = self.parent(hop);
            if parent == above || parent == CENTRE {
                break;
            }
            hop = parent;
        }
        hop
    }

    pub(super) fn hops(&self, node: u32) -> usize {
        let mut at = SensorId(node);
        (0..self.parents.len())
            .take_while(|_| {
                let here = at;
                at = self.parent(at);
                here != CENTRE
            })
            .count()
    }
}
