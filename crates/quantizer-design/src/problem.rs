//! A criterion as a function of the breakpoints of some groups, the others being fixed: value, gradient and Hessian.
//!
//! For a group of `N` identical sensors with received-symbol probabilities `P_t` the reports enter through multinomial
//! probabilities `R_N(n)`. A breakpoint moves probability between two neighbouring cells, so `dP_t/db_i = c_{t,i} phi_i` with
//! `c_{t,i} = C_{t,i} - C_{t,i+1}` and `phi_i` the density of the sample at `b_i`, and
//!
//! ```text
//! dR_N(n)/db_i        = N sum_t c_{t,i} phi_i R_{N-1}(n - e_t)
//! d2R_N(n)/db_i db_j  = N (N-1) sum_{t,u} c_{t,i} c_{u,j} phi_i phi_j R_{N-2}(n - e_t - e_u)
//!                       + [i = j] N sum_t c_{t,i} phi_i' R_{N-1}(n - e_t)
//! ```
//!
//! The node sums therefore run over the few functions `R_N`, `phi_i R_{N-1}`, `phi_i' R_{N-1}` and `phi_i phi_j R_{N-2}`; the
//! channel's coefficients act on the results. No term divides by a cell probability, so empty cells are harmless.

use crate::axis::{Axis, reduce, scatter, slice};
use crate::criterion::{Criterion, LOG_FLOOR, Scored};
use crate::derivatives::Derivatives;
use crate::error::Error;
use crate::law::{Active, SensorLaw, Slots, negative_entropy, sums};
use crate::moments::{Table, moments};
use crate::newton::Objective;
use crate::system::System;
use nalgebra::{DMatrix, DVector};

/// A criterion (signed so that larger is better) over the breakpoints of the active groups.
#[derive(Debug, Clone)]
pub(crate) struct Problem<'a> {
    system: &'a System,
    scored: Scored,
    active: Vec<Active<'a>>,
    /// Report probabilities of each fixed group.
    fixed: Vec<Table>,
    /// Log multiplicity of every joint outcome, fixed groups slowest.
    log_multiplicity: Vec<f64>,
    constant: f64,
}

impl Objective for Problem<'_> {
    fn value(&self, b: &[f64]) -> f64 {
        self.value(b)
    }

    fn derivatives(&self, b: &[f64]) -> Derivatives {
        self.derivatives(b)
    }

    fn blocks(&self) -> Vec<usize> {
        self.blocks()
    }

    fn unit(&self, value: f64) -> f64 {
        self.scored.unit(value, self.system.scene())
    }
}


impl<'a> Problem<'a> {
    /// The criterion over the breakpoints of the groups `active` (increasing, may be empty).
    pub(crate) fn new(system: &'a System, criterion: Criterion, active: &[usize]) -> Result<Self, Error> {
        system.check_outcomes()?;
        let scene = system.scene();
        let scored = Scored::new(criterion, scene)?;
        let mut fixed = Vec::new();
        let mut log_multiplicity = vec![0.0];
        let mut constant = scored.constant(scene);
        let mut chosen = Vec::new();
        for index in 0..system.groups().len() {
            let entry = Active::new(system, index)?;
            if active.contains(&index) {
                chosen.push(entry);
                continue;
            }
            let (reports, symbols) = entry.reports(entry.group.quantizer().breakpoints());
            if scored.has_separable_entropy() {
                constant += entry.group.sensors().len() as f64 * negative_entropy(&symbols, &scene.mass.weights);
            }
            fixed.push(reports);
            log_multiplicity = sums(&log_multiplicity, entry.compositions.log_multiplicity());
        }
        for entry in &chosen {
            log_multiplicity = sums(&log_multiplicity, entry.compositions.log_multiplicity());
        }
        Ok(Self {
            system,
            scored,
            active: chosen,
            fixed,
            log_multiplicity,
            constant,
        })
    }

    /// The breakpoints of the active groups as they are in the system.
    pub(crate) fn start(&self) -> Vec<f64> {
        self.active
            .iter()
            .flat_map(|a| a.group.quantizer().breakpoints().to_vec())
            .collect()
    }

    /// Numbers of breakpoints of the active groups.
    pub(crate) fn blocks(&self) -> Vec<usize> {
        self.active.iter().map(Active::parameters).collect()
    }

    /// The system with the active groups' breakpoints replaced.
    pub(crate) fn system_at(&self, b: &[f64]) -> Result<System, Error> {
        self.active
            .iter()
            .zip(self.split(b))
            .try_fold(self.system.clone(), |system, (a, b)| {
                system.with_quantizer(a.index, a.group.quantizer().with_breakpoints(b.to_vec())?)
            })
    }

    /// Least probability of a cell of an active group: `(group, cell, probability)`.
    pub(crate) fn rarest_cell(&self, b: &[f64]) -> Option<(usize, usize, f64)> {
        let mass = &self.system.scene().mass.weights;
        let cells = self.active.iter().zip(self.split(b)).flat_map(|(a, b)| {
            let cells = a.cells(b).into_iter().enumerate();
            cells.map(move |(cell, p)| (a.index, cell, inner_product(&p, mass)))
        });
        cells.min_by(|x, y| x.2.total_cmp(&y.2))
    }

    fn split<'b>(&self, b: &'b [f64]) -> Vec<&'b [f64]> {
        let mut rest = b;
        self.active
            .iter()
            .map(|a| {
                let (head, tail) = rest.split_at(a.parameters());
                rest = tail;
                head
            })
            .collect()
    }

    /// The signed criterion.
    pub(crate) fn value(&self, b: &[f64]) -> f64 {
        let mut value = self.constant;
        let reports: Vec<Table> = self
            .active
            .iter()
            .zip(self.split(b))
            .map(|(a, b)| {
                let (reports, symbols) = a.reports(b);
                value += self.entropy_share(a, &symbols);
                reports
            })
            .collect();
        let tables: Vec<&Table> = self.fixed.iter().chain(&reports).collect();
        value + self.score(&moments(&tables, self.scored.features()))
    }

    /// Joint report probabilities of the fixed groups and, for the single active group, its symbol probabilities.
    pub(crate) fn surroundings(&self) -> (Table, Table) {
        let nodes = self.system.scene().nodes();
        let symbols = self
            .active
            .first()
            .map(|a| a.symbols(a.group.quantizer().breakpoints()));
        let joint = self
            .fixed
            .iter()
            .fold(Table::new(vec![1.0; nodes], nodes), |joint, t| joint.outer(t));
        (joint, Table::new(symbols.unwrap_or_default(), nodes))
    }

    fn fixed_outcomes(&self) -> usize {
        self.fixed.iter().map(Table::rows).product()
    }

    /// Everything about one sensor of the active group number `at` with breakpoints `b`.
    pub(crate) fn single_sensor_law(&self, at: usize, b: &[f64]) -> SensorLaw<'_> {
        let Some(a) = self.active.get(at) else {
            return SensorLaw::default();
        };
        let (densities, slopes) = a.densities(b);
        SensorLaw {
            symbols: a.symbols(b),
            densities,
            slopes,
            exchange: &a.exchange,
        }
    }

    /// What does not depend on the active groups.
    pub(crate) fn constant(&self) -> f64 {
        self.constant + self.offset()
    }

    /// What is added to a value for the outside.
    pub(crate) fn offset(&self) -> f64 {
        self.scored.offset()
    }

    /// Contribution of every cell between two of the edges `-inf, candidates, inf` of the single active sensor, ideal channel:
    /// entry `a * edges + b` for the cell from edge `a` to edge `b`.
    pub(crate) fn cell_values(&self, candidates: &[f64]) -> Vec<f64> {
        let edges = candidates.len() + 2;
        let mut values = vec![f64::NEG_INFINITY; edges * edges];
        let Some(active) = self.active.first() else {
            return values;
        };
        let nodes = active.means.len();
        let mass = &self.system.scene().mass.weights;
        let slivers = Table::new(active.cells(candidates).concat(), nodes);
        let width = self.scored.features().len();
        let tables: Vec<&Table> = self.fixed.iter().chain([&slivers]).collect();
        let sums = moments(&tables, self.scored.features());
        let outputs = active.compositions.len();
        let mut joint = vec![0.0; self.fixed_outcomes() * width];
        let mut own = vec![0.0; nodes];
        for a in 0..edges - 1 {
            joint.fill(0.0);
            own.fill(0.0);
            for b in a + 1..edges {
                // Slivers are added up, never differenced, so far cells keep their relative accuracy.
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
                    own.iter_mut().zip(slivers.row(b - 1)).for_each(|(o, s)| *o += s);
                    value += negative_entropy(&own, mass);
                }
                values[a * edges + b] = value;
            }
        }
        values
    }

    fn entropy_share(&self, a: &Active<'_>, symbols: &[f64]) -> f64 {
        if self.scored.has_separable_entropy() {
            a.group.sensors().len() as f64 * negative_entropy(symbols, &self.system.scene().mass.weights)
        } else {
            0.0
        }
    }

    fn score(&self, moments: &[f64]) -> f64 {
        let outcomes = moments.chunks_exact(self.scored.features().len());
        outcomes
            .zip(&self.log_multiplicity)
            .map(|(m, l)| self.scored.value(m, *l))
            .sum()
    }

    /// The signed criterion with gradient and Hessian.
    pub(crate) fn derivatives(&self, b: &[f64]) -> Derivatives {
        let parts = self.split(b);
        let total = b.len();
        let features = self.scored.features();
        let width = features.len();
        let mut value = self.constant;
        let mut gradient = DVector::zeros(total);
        let mut hessian = DMatrix::zeros(total, total);

        let mut offsets = Vec::with_capacity(parts.len());
        let mut slots = Vec::with_capacity(parts.len());
        let mut offset = 0;
        for (a, b) in self.active.iter().zip(&parts) {
            let symbols = a.symbols(b);
            let (densities, slopes) = a.densities(b);
            value += self.entropy_share(a, &symbols);
            if self.scored.has_separable_entropy() {
                let terms = self.entropy_derivatives(a, &symbols, &densities, &slopes);
                let n = b.len();
                for i in 0..n {
                    gradient[offset + i] += terms.gradient[i];
                    for j in 0..n {
                        hessian[(offset + i, offset + j)] += terms.hessian[(i, j)];
                    }
                }
            }
            slots.push(a.slots(&symbols, &densities, &slopes));
            offsets.push(offset);
            offset += b.len();
        }

        // Moments of every outcome, and what a change of each is worth.
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
            let n = a.parameters();
            let (first, bend) =
                (self.node_sums(&slots, &[(g, Slot::First)]), self.node_sums(&slots, &[(g, Slot::Slope)]));
            let second = if a.compositions.total() >= 2 {
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
                let reduced = reduce(&worth, axis, &a.compositions, 0, &a.exchange[i]);
                let moved = slice(&first, axis, n, below, i);
                gradient[row] += inner_product(&reduced, &moved);
                hessian[(row, row)] += inner_product(&reduced, &slice(&bend, axis, n, below, i));
                if a.compositions.total() >= 2 {
                    let pairs = n * (n + 1) / 2;
                    let twice = a.compositions.len_below(2);
                    for j in i..n {
                        let both = reduce(&reduced, axis, &a.compositions, 1, &a.exchange[j]);
                        let term = inner_product(&both, &slice(&second, axis, pairs, twice, pair));
                        add_symmetric(&mut hessian, row, offsets[g] + j, term);
                        pair += 1;
                    }
                }
                for (h, crossed) in (g + 1..self.active.len()).zip(&crossed) {
                    let other = &self.active[h];
                    // The axis of h in tables whose axis g has one report fewer.
                    let plain = self.axis(h, width);
                    let shrunk = Axis {
                        outer: plain.outer / a.compositions.len() * below,
                        inner: plain.inner,
                    };
                    let expanded = Axis {
                        outer: shrunk.outer * n,
                        ..shrunk
                    };
                    let below_h = other.compositions.len_below(1);
                    for j in 0..other.parameters() {
                        let both = reduce(&reduced, shrunk, &other.compositions, 0, &other.exchange[j]);
                        let of_j = slice(crossed, expanded, other.parameters(), below_h, j);
                        let inner = axis.inner / other.compositions.len() * below_h;
                        let of_ij = slice(
                            &of_j,
                            Axis {
                                outer: axis.outer,
                                inner,
                            },
                            n,
                            below,
                            i,
                        );
                        add_symmetric(&mut hessian, row, offsets[h] + j, inner_product(&both, &of_ij));
                    }
                }
                changes.push(scatter(&moved, axis, &a.compositions, &a.exchange[i]));
            }
        }

        // Second derivatives of the score along pairs of changes.
        let mut bent = vec![0.0; full.len()];
        for p in 0..total {
            let outcomes = full.chunks_exact(width).zip(changes[p].chunks_exact(width));
            for ((m, d), out) in outcomes.zip(bent.chunks_exact_mut(width)) {
                self.scored.curvature(m, d, out);
            }
            for q in p..total {
                add_symmetric(&mut hessian, p, q, inner_product(&bent, &changes[q]));
            }
        }
        Derivatives {
            value,
            gradient,
            hessian,
        }
    }

    /// Derivatives of `N sum_node mass sum_t P_t ln P_t`.
    fn entropy_derivatives(
        &self,
        a: &Active<'_>,
        symbols: &[f64],
        densities: &[Vec<f64>],
        slopes: &[Vec<f64>],
    ) -> Derivatives {
        let mass = &self.system.scene().mass.weights;
        let (n, nodes) = (a.parameters(), mass.len());
        let sensors = a.group.sensors().len() as f64;
        let mut gradient = DVector::zeros(n);
        let mut hessian = DMatrix::zeros(n, n);
        let mut worth = vec![0.0; nodes];
        for i in 0..n {
            worth.fill(0.0);
            for (t, c) in a.exchange[i].iter().enumerate().filter(|(_, c)| **c != 0.0) {
                let p = &symbols[t * nodes..(t + 1) * nodes];
                worth
                    .iter_mut()
                    .zip(p)
                    .for_each(|(w, p)| *w += c * p.max(LOG_FLOOR).ln());
            }
            for k in 0..nodes {
                gradient[i] += sensors * mass[k] * densities[i][k] * worth[k];
                hessian[(i, i)] += sensors * mass[k] * slopes[i][k] * worth[k];
            }
            for j in i..n {
                let mut term = 0.0;
                for (t, (c, d)) in a.exchange[i].iter().zip(&a.exchange[j]).enumerate() {
                    if c * d == 0.0 {
                        continue;
                    }
                    for k in 0..nodes {
                        let p = symbols[t * nodes + k];
                        if p > LOG_FLOOR {
                            term += c * d * mass[k] * densities[i][k] * (densities[j][k] / p);
                        }
                    }
                }
                add_symmetric(&mut hessian, i, j, sensors * term);
            }
        }
        Derivatives {
            value: 0.0,
            gradient,
            hessian,
        }
    }

    /// Moments over all joint outcomes, some groups' reports replaced; the rows of a replaced group are `(i, m)`.
    fn node_sums(&self, slots: &[Slots], replaced: &[(usize, Slot)]) -> Vec<f64> {
        let mut tables: Vec<&Table> = self.fixed.iter().collect();
        for (g, slots) in slots.iter().enumerate() {
            let slot = replaced.iter().find(|(h, _)| *h == g).map(|(_, slot)| *slot);
            let (factor, others) = match slot {
                None => (None, &slots.reports[0]),
                Some(Slot::First) => (Some(&slots.densities), &slots.reports[1]),
                Some(Slot::Slope) => (Some(&slots.slopes), &slots.reports[1]),
                Some(Slot::Second) => (Some(&slots.pairs), &slots.reports[2]),
            };
            tables.extend(factor);
            // With no sensor left the reports are a single row of ones.
            if factor.is_none() || others.rows() > 1 {
                tables.push(others);
            }
        }
        moments(&tables, self.scored.features())
    }

    fn axis(&self, g: usize, width: usize) -> Axis {
        let sizes = self.active.iter().map(|a| a.compositions.len());
        Axis {
            outer: self.fixed_outcomes() * sizes.clone().take(g).product::<usize>(),
            inner: sizes.skip(g + 1).product::<usize>() * width,
        }
    }
}

#[derive(Clone, Copy)]
enum Slot {
    First,
    Slope,
    Second,
}

fn inner_product(a: &[f64], b: &[f64]) -> f64 {
    crate::moments::dot(a, b)
}

fn add_symmetric(matrix: &mut DMatrix<f64>, i: usize, j: usize, term: f64) {
    matrix[(i, j)] += term;
    if i != j {
        matrix[(j, i)] += term;
    }
}
