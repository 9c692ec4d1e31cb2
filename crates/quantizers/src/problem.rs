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

use crate::compositions::Compositions;
use crate::criterion::{Criterion, LOG_FLOOR, Scored};
use crate::error::Error;
use crate::moments::{Table, moments};
use crate::scene::Feature;
use crate::system::{Derivatives, Group, System};
use fewbits_core::normal;
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

#[derive(Debug, Clone)]
struct Active<'a> {
    index: usize,
    group: &'a Group,
    compositions: Compositions,
    means: Vec<f64>,
    sd: f64,
    /// `c[i][t]`: change of the probability of symbol `t` when breakpoint `i` moves up, per density.
    exchange: Vec<Vec<f64>>,
}

/// Report probabilities of every group at every node, and the log multiplicity of every joint outcome.
pub(crate) struct Reports {
    tables: Vec<Table>,
    pub(crate) log_multiplicity: Vec<f64>,
}

impl Reports {
    pub(crate) fn of(system: &System) -> Result<Self, Error> {
        // The reports do not depend on the criterion.
        let problem = Problem::new(system, Criterion::MeanSquaredError, &[])?;
        Ok(Self {
            tables: problem.fixed,
            log_multiplicity: problem.log_multiplicity,
        })
    }

    /// The features' moments of every joint outcome.
    pub(crate) fn moments(&self, features: &[Feature]) -> Vec<f64> {
        moments(&self.tables.iter().collect::<Vec<_>>(), features)
    }
}

/// One sensor's symbol probabilities (a row a symbol), and how breakpoints move them.
#[derive(Debug, Default)]
pub(crate) struct SensorLaw<'a> {
    pub(crate) symbols: Vec<f64>,
    pub(crate) densities: Vec<Vec<f64>>,
    pub(crate) slopes: Vec<Vec<f64>>,
    pub(crate) exchange: &'a [Vec<f64>],
}

/// What the node sums of one group need at given breakpoints.
struct Slots {
    /// Report probabilities of all sensors of the group, of all but one, and of all but two.
    reports: [Table; 3],
    densities: Table,
    slopes: Table,
    /// Products `phi_i phi_j`, `j >= i`.
    pairs: Table,
}

impl<'a> Active<'a> {
    fn new(system: &'a System, index: usize) -> Result<Self, Error> {
        let group = system.group(index)?;
        let outputs = group.channel().outputs();
        let (means, sd) = system.scene().sample_law(group.sensors()[0]);
        let exchange = (0..group.quantizer().breakpoints().len())
            .map(|i| {
                (0..outputs)
                    .map(|t| group.cell_transition(t, i) - group.cell_transition(t, i + 1))
                    .collect()
            })
            .collect();
        let compositions = Compositions::new(group.sensors().len(), outputs);
        Ok(Self {
            index,
            group,
            compositions,
            means,
            sd,
            exchange,
        })
    }

    fn parameters(&self) -> usize {
        self.exchange.len()
    }

    /// Probability of each cell at each node.
    fn cells(&self, b: &[f64]) -> Vec<Vec<f64>> {
        (0..=b.len())
            .map(|cell| {
                let lower = if cell == 0 { f64::NEG_INFINITY } else { b[cell - 1] };
                let upper = b.get(cell).copied().unwrap_or(f64::INFINITY);
                let inside = |m: &f64| normal::interval((lower - m) / self.sd, (upper - m) / self.sd);
                self.means.iter().map(inside).collect()
            })
            .collect()
    }

    /// Probability of each received symbol at each node.
    fn symbols(&self, b: &[f64]) -> Vec<f64> {
        let nodes = self.means.len();
        let mut symbols = vec![0.0; self.compositions.parts() * nodes];
        for (cell, column) in self.cells(b).iter().enumerate() {
            for (t, row) in symbols.chunks_exact_mut(nodes).enumerate() {
                let p = self.group.cell_transition(t, cell);
                if p != 0.0 {
                    row.iter_mut().zip(column).for_each(|(r, c)| *r += p * c);
                }
            }
        }
        symbols
    }

    /// Joint report probabilities, and `-H(T | node)` of one sensor where wanted.
    fn reports(&self, b: &[f64]) -> (Table, Vec<f64>) {
        let nodes = self.means.len();
        let symbols = self.symbols(b);
        let reports = self.compositions.probabilities(&symbols, nodes).swap_remove(0);
        (Table::new(reports, nodes), symbols)
    }

    fn densities(&self, b: &[f64]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        b.iter()
            .map(|b| {
                let standardised = self.means.iter().map(|m| (b - m) / self.sd);
                standardised
                    .map(|u| {
                        let density = normal::pdf(u) / self.sd;
                        (density, -u * density / self.sd)
                    })
                    .unzip()
            })
            .unzip()
    }

    fn slots(&self, symbols: &[f64], densities: &[Vec<f64>], slopes: &[Vec<f64>]) -> Slots {
        let nodes = self.means.len();
        let mut levels = self.compositions.probabilities(symbols, nodes).into_iter();
        let reports = [(); 3].map(|()| Table::new(levels.next().unwrap_or_default(), nodes));
        let mut pairs = Vec::new();
        if self.compositions.total() >= 2 {
            for (i, p) in densities.iter().enumerate() {
                for q in &densities[i..] {
                    pairs.extend(p.iter().zip(q).map(|(x, y)| x * y));
                }
            }
        }
        Slots {
            reports,
            densities: Table::new(densities.concat(), nodes),
            slopes: Table::new(slopes.concat(), nodes),
            pairs: Table::new(pairs, nodes),
        }
    }
}

/// `sum_node mass sum_t P_t ln P_t` of one sensor.
fn negative_entropy(symbols: &[f64], mass: &[f64]) -> f64 {
    symbols
        .chunks_exact(mass.len())
        .map(|row| {
            row.iter()
                .zip(mass)
                .filter(|(p, _)| **p > 0.0)
                .map(|(p, w)| w * p * p.ln())
                .sum::<f64>()
        })
        .sum()
}

/// Where the axis of one group lies in a table of joint outcomes.
#[derive(Clone, Copy)]
struct Axis {
    outer: usize,
    inner: usize,
}

impl<'a> Problem<'a> {
    /// The criterion over the breakpoints of the groups `active` (increasing, may be empty).
    pub(crate) fn new(system: &'a System, criterion: Criterion, active: &[usize]) -> Result<Self, Error> {
        system.check_outcomes()?;
        let scene = system.scene();
        let scored = Scored::new(criterion, scene)?;
        let mut fixed = Vec::new();
        let mut log_multiplicity = vec![0.0];
        let mut constant = match criterion {
            Criterion::MeanSquaredError => -scene.second_moment,
            _ => 0.0,
        };
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
        self.constant
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
                let reduced = reduce(&worth, axis, a, 0, &a.exchange[i]);
                let moved = slice(&first, axis, n, below, i);
                gradient[row] += inner_product(&reduced, &moved);
                hessian[(row, row)] += inner_product(&reduced, &slice(&bend, axis, n, below, i));
                if a.compositions.total() >= 2 {
                    let pairs = n * (n + 1) / 2;
                    let twice = a.compositions.len_below(2);
                    for j in i..n {
                        let both = reduce(&reduced, axis, a, 1, &a.exchange[j]);
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
                        let both = reduce(&reduced, shrunk, other, 0, &other.exchange[j]);
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
                changes.push(scatter(&moved, axis, a, &a.exchange[i]));
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

fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().flat_map(|x| b.iter().map(move |y| x + y)).collect()
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

/// The part of a table whose axis has rows `(block, m)` that belongs to one block.
fn slice(values: &[f64], axis: Axis, blocks: usize, rows: usize, block: usize) -> Vec<f64> {
    let chunk = rows * axis.inner;
    let mut out = Vec::with_capacity(axis.outer * chunk);
    for o in 0..axis.outer {
        let at = (o * blocks + block) * chunk;
        out.extend_from_slice(&values[at..at + chunk]);
    }
    out
}

/// `out(m) = (N - missing) sum_t c_t worth(m + e_t)` along the group's axis.
fn reduce(worth: &[f64], axis: Axis, a: &Active<'_>, missing: usize, c: &[f64]) -> Vec<f64> {
    let sensors = (a.compositions.total() - missing) as f64;
    let (above, below) = (a.compositions.len_below(missing), a.compositions.len_below(missing + 1));
    let mut out = vec![0.0; axis.outer * below * axis.inner];
    for (o, block) in out.chunks_exact_mut(below * axis.inner).enumerate() {
        for (m, row) in block.chunks_exact_mut(axis.inner).enumerate() {
            for (t, at) in a.compositions.up(missing + 1)[m * c.len()..(m + 1) * c.len()]
                .iter()
                .enumerate()
            {
                if c[t] != 0.0 {
                    let from = (o * above + at) * axis.inner;
                    let factor = sensors * c[t];
                    for (r, w) in row.iter_mut().zip(&worth[from..from + axis.inner]) {
                        *r += factor * w;
                    }
                }
            }
        }
    }
    out
}

/// The transpose of [`reduce`]: `out(m + e_t) += N c_t moved(m)`.
fn scatter(moved: &[f64], axis: Axis, a: &Active<'_>, c: &[f64]) -> Vec<f64> {
    let sensors = a.compositions.total() as f64;
    let (above, below) = (a.compositions.len(), a.compositions.len_below(1));
    let mut out = vec![0.0; axis.outer * above * axis.inner];
    for o in 0..axis.outer {
        for m in 0..below {
            let from = (o * below + m) * axis.inner;
            for (t, at) in a.compositions.up(1)[m * c.len()..(m + 1) * c.len()].iter().enumerate() {
                if c[t] != 0.0 {
                    let to = (o * above + at) * axis.inner;
                    let factor = sensors * c[t];
                    for i in 0..axis.inner {
                        out[to + i] += factor * moved[from + i];
                    }
                }
            }
        }
    }
    out
}
