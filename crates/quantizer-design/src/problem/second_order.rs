//! Gradients and Hessians of a criterion.

use super::{Problem, Slot};
use crate::criterion::LOG_FLOOR;
use crate::law::Active;
use crate::newton::Derivatives;
use crate::outcomes::axis::{Axis, reduce, scatter, slice};
use crate::outcomes::{Table, dot};
use nalgebra::{DMatrix, DVector};

impl Problem<'_> {
    /// The signed criterion with gradient and Hessian.
    pub(super) fn second_order(&self, b: &[f64]) -> Derivatives {
        let total = b.len();
        let features = self.scored.features();
        let width = features.len();
        let mut value = self.constant;
        let mut gradient = DVector::zeros(total);
        let mut hessian = DMatrix::zeros(total, total);

        let (mut offsets, mut slots) = (Vec::new(), Vec::new());
        let mut offset = 0;
        for (a, b) in self.groups_at(b) {
            let symbols = a.symbols(b);
            let densities = a.densities(b);
            value += self.entropy_share(a, &symbols);
            if self.scored.has_separable_entropy() {
                let terms = self.entropy_derivatives(a, &symbols, &densities);
                let mut own = gradient.rows_mut(offset, b.len());
                own += terms.gradient;
                let mut own = hessian.view_mut((offset, offset), (b.len(), b.len()));
                own += terms.hessian;
            }
            slots.push(a.slots(&symbols, densities));
            offsets.push(offset);
            offset += b.len();
        }

        // Moments of every outcome, and the derivatives of the score with respect to them.
        let full = self.node_sums(&slots, &[]);
        value += self.score(&full);
        let mut worth = vec![0.0; full.len()];
        for ((m, l), out) in full
            .chunks_exact(width)
            .zip(&self.log_multiplicity)
            .zip(worth.chunks_exact_mut(width))
        {
            self.scored.slope(m, *l, out);
        }

        let mut changes = Vec::with_capacity(total);
        for (g, a) in self.active.iter().enumerate() {
            let n = a.exchange.len();
            let (first, bend) =
                (self.node_sums(&slots, &[(g, Slot::First)]), self.node_sums(&slots, &[(g, Slot::Slope)]));
            let second = if a.compositions.total >= 2 {
                self.node_sums(&slots, &[(g, Slot::Second)])
            } else {
                Vec::new()
            };
            let axis = self.axis(g, width);
            let below = a.compositions.len_below(1);
            let crossed: Vec<Vec<f64>> = (g + 1..self.active.len())
                .map(|h| self.node_sums(&slots, &[(g, Slot::First), (h, Slot::First)]))
                .collect();
            let mut pair = 0;
            for i in 0..n {
                let row = offsets[g] + i;
                // The gradient and the term with `phi_i'` are sums over one report fewer, the terms with `phi_i phi_j` over two fewer
                // (formulas at the head of `problem`).
                let reduced = reduce(&worth, axis, &a.compositions, 0, &a.exchange[i]);
                let moved = slice(&first, axis, n, below, i);
                gradient[row] += dot(&reduced, &moved);
                hessian[(row, row)] += dot(&reduced, &slice(&bend, axis, n, below, i));
                if a.compositions.total >= 2 {
                    let pairs = n * (n + 1) / 2;
                    let twice = a.compositions.len_below(2);
                    for j in i..n {
                        let both = reduce(&reduced, axis, &a.compositions, 1, &a.exchange[j]);
                        let term = dot(&both, &slice(&second, axis, pairs, twice, pair));
                        hessian[(row, offsets[g] + j)] += term;
                        pair += 1;
                    }
                }
                for (h, crossed) in (g + 1..self.active.len()).zip(&crossed) {
                    let other = &self.active[h];
                    // The axis of h in tables in which axis g has one report fewer.
                    let plain = self.axis(h, width);
                    let shrunk = Axis {
                        outer: plain.outer / a.compositions.len() * below,
                        ..plain
                    };
                    let expanded = Axis {
                        outer: shrunk.outer * n,
                        ..shrunk
                    };
                    let below_h = other.compositions.len_below(1);
                    for j in 0..other.exchange.len() {
                        let both = reduce(&reduced, shrunk, &other.compositions, 0, &other.exchange[j]);
                        let of_j = slice(crossed, expanded, other.exchange.len(), below_h, j);
                        let beside = Axis {
                            inner: axis.inner / other.compositions.len() * below_h,
                            ..axis
                        };
                        let of_ij = slice(&of_j, beside, n, below, i);
                        hessian[(row, offsets[h] + j)] += dot(&both, &of_ij);
                    }
                }
                changes.push(scatter(&moved, axis, &a.compositions, &a.exchange[i]));
            }
        }

        // Second derivatives of the score for pairs of breakpoint changes.
        let mut bent = vec![0.0; full.len()];
        for p in 0..total {
            let outcomes = full.chunks_exact(width).zip(changes[p].chunks_exact(width));
            for ((m, d), out) in outcomes.zip(bent.chunks_exact_mut(width)) {
                self.scored.curvature(m, d, out);
            }
            for q in p..total {
                hessian[(p, q)] += dot(&bent, &changes[q]);
            }
        }
        // All terms above went to the upper triangle.
        hessian.fill_lower_triangle_with_upper_triangle();
        Derivatives {
            value,
            gradient,
            hessian,
        }
    }

    /// Derivatives of `N sum_node mass sum_t P_t ln P_t`; of the Hessian only the upper triangle.
    fn entropy_derivatives(
        &self,
        a: &Active<'_>,
        symbols: &Table,
        (densities, slopes): &(Table, Table),
    ) -> Derivatives {
        let mass = &self.system.model().mass.weights;
        let (n, nodes) = (a.exchange.len(), mass.len());
        let sensors = a.group.sensors.len() as f64;
        let mut gradient = DVector::zeros(n);
        let mut hessian = DMatrix::zeros(n, n);
        let mut worth = vec![0.0; nodes];
        // A moving breakpoint transfers probability from one cell to its neighbour; `exchange` has the sign for each symbol.
        for i in 0..n {
            worth.fill(0.0);
            for (t, c) in a.exchange[i].iter().enumerate().filter(|(_, c)| **c != 0.0) {
                let p = symbols.row(t);
                worth
                    .iter_mut()
                    .zip(p)
                    .for_each(|(w, p)| *w += c * p.max(LOG_FLOOR).ln());
            }
            for k in 0..nodes {
                gradient[i] += sensors * mass[k] * densities.row(i)[k] * worth[k];
                hessian[(i, i)] += sensors * mass[k] * slopes.row(i)[k] * worth[k];
            }
            for j in i..n {
                let (own, other) = (densities.row(i), densities.row(j));
                let mut term = 0.0;
                for (t, (c, d)) in a.exchange[i].iter().zip(&a.exchange[j]).enumerate() {
                    if c * d == 0.0 {
                        continue;
                    }
                    for (k, p) in symbols.row(t).iter().copied().enumerate() {
                        if p > LOG_FLOOR {
                            term += c * d * mass[k] * own[k] * (other[k] / p);
                        }
                    }
                }
                hessian[(i, j)] += sensors * term;
            }
        }
        Derivatives {
            value: 0.0,
            gradient,
            hessian,
        }
    }
}
