//! Contribution of each cell of one sensor to the criterion, for the dynamic programme.

use super::Problem;
use crate::law::negative_entropy;
use crate::outcomes::{Table, moments};

impl Problem<'_> {
    /// Contribution of every cell between two of the edges `-inf, candidates, inf` of the single active sensor, ideal channel:
    /// entry `a * edges + b` for the cell from edge `a` to edge `b`.
    pub fn cell_values(&self, candidates: &[f64]) -> Vec<f64> {
        let edges = candidates.len() + 2;
        let mut values = vec![f64::NEG_INFINITY; edges * edges];
        let Some(active) = self.active.first() else {
            return values;
        };
        let nodes = active.means.len();
        let mass = &self.system.model().mass.weights;
        let slivers = active.cells(candidates);
        let width = self.scored.features().len();
        let tables: Vec<&Table> = self.fixed.iter().chain([&slivers]).collect();
        let sums = moments(&tables, self.scored.features());
        let outputs = active.compositions.len();
        let mut joint = vec![0.0; self.fixed_outcomes() * width];
        let mut own = Table::new(vec![0.0; nodes], nodes);
        for a in 0..edges - 1 {
            joint.fill(0.0);
            own.values.fill(0.0);
            for b in a + 1..edges {
                // Small intervals are added up, never subtracted, so that far cells keep their relative accuracy.
                for (other, m) in joint.chunks_exact_mut(width).enumerate() {
                    let at = (other * (edges - 1) + b - 1) * width;
                    m.iter_mut().zip(&sums[at..at + width]).for_each(|(m, s)| *m += s);
                }
                let mut value: f64 = joint
                    .chunks_exact(width)
                    .enumerate()
                    .map(|(other, m)| self.scored.value(m, self.log_multiplicity[other * outputs]))
                    .sum();
                if self.scored.has_separable_entropy() {
                    own.values.iter_mut().zip(slivers.row(b - 1)).for_each(|(o, s)| *o += s);
                    value += negative_entropy(&own, mass);
                }
                values[a * edges + b] = value;
            }
        }
        values
    }
}
