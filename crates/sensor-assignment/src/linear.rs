//! The linear assignment problem, with a proof of optimality for every solution.

use super::coded::check_permutation;
use crate::Error;
use fewbits_multi_target::assign;
use fewbits_numerics::error::{all_finite, refuse};

/// Tolerance of the certificate's inequalities, relative to the largest cost.
const SLACK: f64 = 1e-12;

/// A square matrix of finite costs; each row is matched with one column.
#[derive(Debug, Clone, PartialEq)]
pub struct CostMatrix {
    pub(crate) size: usize,
    /// Row by row.
    pub(crate) costs: Vec<f64>,
}

impl CostMatrix {
    /// A matrix from `size * size` costs, row by row.
    ///
    /// # Errors
    /// If there are not `size^2` costs, `size` is 0, or one is not finite.
    pub fn new(size: usize, costs: Vec<f64>) -> Result<Self, Error> {
        let entries = costs.len();
        if size == 0 || size.checked_mul(size) != Some(entries) {
            return refuse("costs", format!("{entries} entries"), format!("{size} x {size}, and at least one"));
        }
        all_finite("costs", &costs)?;
        Ok(Self { size, costs })
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The cost of matching `row` with `column`; `None` if one of them does not exist.
    pub fn get(&self, row: usize, column: usize) -> Option<f64> {
        (row < self.size && column < self.size).then(|| self.costs[row * self.size + column])
    }

    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.costs.chunks_exact(self.size)
    }

    /// Total cost of an assignment, given as the column of each row.
    ///
    /// # Errors
    /// If the assignment is not a permutation.
    pub fn cost(&self, assignment: &[usize]) -> Result<f64, Error> {
        check_permutation(assignment, self.size())?;
        Ok(assignment.iter().zip(self.rows()).map(|(&j, row)| row[j]).sum())
    }

    /// The column of each row for the smallest total cost, by shortest augmenting paths (Jonker and Volgenant 1987). `O(n^3)` in
    /// the worst case. Deterministic: the same costs give the same result.
    ///
    /// The thesis describes the older Hungarian method with its Hopcroft-Karp step. The result is equally good, as
    /// [`CostMatrix::certificate`] proves.
    pub fn solve(&self) -> Vec<usize> {
        let largest = self.costs.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        // Costs are scaled, since differences of the largest numbers would overflow.
        let unit = if largest > 0.0 { largest } else { 1.0 };
        let rows: Vec<Vec<f64>> = self.rows().map(|row| row.iter().map(|c| c / unit).collect()).collect();
        // Refused are only matrices that are not square or not finite.
        assign(&rows).unwrap_or_default()
    }

    /// Dual variables that show whether an assignment is optimal.
    ///
    /// Feasible dual variables have `u_i + v_j <= c_ij`. Their sum is a lower bound for every assignment and equals the cost of an optimal
    /// one. Given the assignment, `v` solves the shortest-path inequalities `v_j - v_a(i) <= c_ij - c_i,a(i)` (Bellman-Ford,
    /// `O(n^2)` per pass, few passes). A negative cycle means that the assignment can be improved.
    ///
    /// # Errors
    /// If the assignment is not a permutation.
    pub fn certificate(&self, assignment: &[usize]) -> Result<DualCertificate, Error> {
        let cost = self.cost(assignment)?;
        let n = self.size();
        let scale = self.costs.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        let tolerance = SLACK * scale;
        let mut columns = vec![0.0f64; n];
        // Bellman-Ford: shortest paths in the graph of exchanges give column potentials, unless an exchange would lower the cost.
        for _ in 0..=n {
            let mut changed = false;
            for (i, row) in self.rows().enumerate() {
                let own = assignment[i];
                let base = columns[own] - row[own];
                for (j, c) in row.iter().enumerate() {
                    let reached = base + c;
                    if reached < columns[j] - tolerance * 1e-3 {
                        columns[j] = reached;
                        changed = true;
                    }
                }
            }
            if !changed {
                break;
            }
        }
        let rows: Vec<f64> = (0..n)
            .map(|i| self.costs[i * n + assignment[i]] - columns[assignment[i]])
            .collect();
        let mut violation = 0.0f64;
        for (i, row) in self.rows().enumerate() {
            for (c, v) in row.iter().zip(&columns) {
                violation = violation.max(rows[i] + v - c);
            }
        }
        // Weak duality: no assignment costs less than the sum of the dual variables if no entry violates them.
        let dual: f64 = rows.iter().sum::<f64>() + columns.iter().sum::<f64>();
        Ok(DualCertificate {
            rows,
            columns,
            cost,
            gap: cost - dual,
            violation,
            tolerance,
        })
    }
}

/// Dual variables of an assignment, and their distance from a proof of its optimality.
#[derive(Debug, Clone, PartialEq)]
pub struct DualCertificate {
    /// Dual variable `u_i` of each row.
    pub rows: Vec<f64>,
    /// Dual variable `v_j` of each column.
    pub columns: Vec<f64>,
    /// Cost of the assignment.
    pub cost: f64,
    /// Cost minus the sum of the duals.
    pub gap: f64,
    /// Largest `u_i + v_j - c_ij`; feasible if not above 0.
    pub violation: f64,
    tolerance: f64,
}

impl DualCertificate {
    /// Whether the duals are feasible and their sum is the cost, up to `1e-12` of the largest cost per row.
    pub fn is_optimal(&self) -> bool {
        self.violation <= self.tolerance && self.gap.abs() <= self.tolerance * self.rows.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Visits all permutations of `0..n`.
    fn for_permutations(n: usize, mut visit: impl FnMut(&[usize])) {
        let mut all = vec![Vec::new()];
        for _ in 0..n {
            let longer = |p: Vec<usize>| {
                (0..n)
                    .filter(|i| !p.contains(i))
                    .map(|i| [p.as_slice(), &[i]].concat())
                    .collect::<Vec<_>>()
            };
            all = all.into_iter().flat_map(longer).collect();
        }
        all.iter().for_each(|p| visit(p));
    }

    fn least(costs: &CostMatrix) -> f64 {
        let mut best = f64::INFINITY;
        for_permutations(costs.size(), |p| best = best.min(costs.cost(p).unwrap()));
        best
    }

    proptest! {
        #[test]
        fn the_solver_is_optimal_and_proves_it(size in 1usize..7, seed in prop::collection::vec(-50i32..50, 36)) {
            // Small whole numbers make many ties.
            let costs = CostMatrix::new(size, seed.iter().take(size * size).map(|&c| f64::from(c / 7)).collect()).unwrap();
            let found = costs.solve();
            prop_assert_eq!(costs.cost(&found).unwrap(), least(&costs));
            prop_assert!(costs.certificate(&found).unwrap().is_optimal());
        }

        #[test]
        fn wide_ranges_of_costs_do_no_harm(size in 2usize..6, exponents in prop::collection::vec(-250f64..250.0, 25)) {
            let costs = CostMatrix::new(size, exponents.iter().take(size * size).map(|e| e.exp2()).collect()).unwrap();
            let found = costs.solve();
            let (cost, best) = (costs.cost(&found).unwrap(), least(&costs));
            let largest = exponents.iter().take(size * size).fold(f64::NEG_INFINITY, |m, e| m.max(*e)).exp2();
            prop_assert!(cost - best <= 1e-12 * largest);
        }

        #[test]
        fn the_certificate_refuses_what_is_not_optimal(seed in prop::collection::vec(0.0f64..1.0, 25)) {
            let costs = CostMatrix::new(5, seed).unwrap();
            let best = least(&costs);
            let mut all_right = true;
            for_permutations(5, |p| {
                let optimal = costs.cost(p).unwrap() <= best + 1e-13;
                all_right &= costs.certificate(p).unwrap().is_optimal() == optimal;
            });
            prop_assert!(all_right);
        }
    }

    #[test]
    fn costs_near_the_largest_number_are_assigned() {
        let costs = CostMatrix::new(2, vec![1e308, -1e308, -1e308, 1e308]).unwrap();
        assert_eq!(costs.solve(), [1, 0]);
        assert_eq!(CostMatrix::new(3, vec![0.0; 9]).unwrap().solve().len(), 3);
    }

    #[test]
    fn bad_matrices_are_refused() {
        assert!(matches!(CostMatrix::new(2, vec![1.0; 3]), Err(Error::Argument(e)) if e.name == "costs"));
        assert!(matches!(CostMatrix::new(0, vec![]), Err(Error::Argument(e)) if e.name == "costs"));
        assert!(CostMatrix::new(1, vec![f64::NAN]).is_err());
        assert!(CostMatrix::new(1, vec![f64::INFINITY]).is_err());
        let costs = CostMatrix::new(2, vec![1.0; 4]).unwrap();
        assert!(costs.cost(&[0, 0]).is_err());
        assert_eq!((costs.get(1, 1), costs.get(2, 0)), (Some(1.0), None));
    }
}
