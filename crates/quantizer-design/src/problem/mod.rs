//! A criterion as a function of the breakpoints of some groups, with the others fixed: value, gradient and Hessian.
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
//! The node sums are therefore needed only for the functions `R_N`, `phi_i R_{N-1}`, `phi_i' R_{N-1}` and `phi_i phi_j R_{N-2}`; the
//! channel's coefficients are applied to the results. There is no division by a cell probability, so empty cells do no harm.

mod cells;
mod second_order;

use crate::criterion::{Criterion, Scored};
use crate::error::Error;
use crate::law::{Active, Slots, negative_entropy, sums};
use crate::newton::{Derivatives, Objective, split};
use crate::outcomes::axis::Axis;
use crate::outcomes::{Table, dot, moments};
use crate::system::System;

/// A criterion (signed so that larger is better) as a function of the breakpoints of the active groups.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    system: &'a System,
    scored: Scored,
    active: Vec<Active<'a>>,
    /// Report probabilities of each fixed group.
    fixed: Vec<Table>,
    /// Log multiplicity of every joint outcome; fixed groups vary slowest.
    log_multiplicity: Vec<f64>,
    constant: f64,
}

impl Objective for Problem<'_> {
    /// The signed criterion.
    fn value(&self, b: &[f64]) -> f64 {
        let mut value = self.constant;
        let reports: Vec<Table> = self
            .groups_at(b)
            .into_iter()
            .map(|(a, b)| {
                let (reports, symbols) = a.reports(b);
                value += self.entropy_share(a, &symbols);
                reports
            })
            .collect();
        let tables: Vec<&Table> = self.fixed.iter().chain(&reports).collect();
        value + self.score(&moments(&tables, self.scored.features()))
    }

    fn derivatives(&self, b: &[f64]) -> Derivatives {
        self.second_order(b)
    }

    /// Numbers of breakpoints of the active groups.
    fn blocks(&self) -> Vec<usize> {
        self.active.iter().map(|a| a.exchange.len()).collect()
    }

    fn unit(&self, value: f64) -> f64 {
        self.scored.unit(value, self.system.model())
    }
}

impl<'a> Problem<'a> {
    /// The criterion over the breakpoints of the groups `active` (increasing indices, possibly none).
    ///
    /// # Errors
    /// [`Error::TooLarge`] for too many outcomes; [`Error::Argument`] if the criterion does not fit the prior.
    pub fn new(system: &'a System, criterion: Criterion, active: &[usize]) -> Result<Self, Error> {
        system.check_outcomes()?;
        let model = system.model();
        let scored = Scored::new(criterion, model)?;
        let mut problem = Self {
            constant: scored.constant(model),
            system,
            scored,
            active: Vec::new(),
            fixed: Vec::new(),
            log_multiplicity: vec![0.0],
        };
        for index in 0..system.groups().len() {
            let entry = Active::new(system, index)?;
            if active.contains(&index) {
                problem.active.push(entry);
                continue;
            }
            // Groups that stay fixed enter through the probabilities of their reports.
            let (reports, symbols) = entry.reports(entry.breakpoints());
            problem.constant += problem.entropy_share(&entry, &symbols);
            problem.fixed.push(reports);
            problem.log_multiplicity = sums(&problem.log_multiplicity, &entry.compositions.log_multiplicity);
        }
        for entry in &problem.active {
            problem.log_multiplicity = sums(&problem.log_multiplicity, &entry.compositions.log_multiplicity);
        }
        Ok(problem)
    }

    /// The breakpoints of the active groups in the system.
    pub(crate) fn start(&self) -> Vec<f64> {
        self.active.iter().flat_map(|a| a.breakpoints().to_vec()).collect()
    }

    /// The system with the active groups' breakpoints replaced.
    pub(crate) fn system_at(&self, b: &[f64]) -> Result<System, Error> {
        let mut groups = self.groups_at(b).into_iter();
        groups.try_fold(self.system.clone(), |system, (a, b)| {
            system.with_quantizer(a.index, a.group.quantizer.with_breakpoints(b.to_vec())?)
        })
    }

    /// The least probable cell of the active groups: `(group, cell, probability)`.
    pub(crate) fn rarest_cell(&self, b: &[f64]) -> Option<(usize, usize, f64)> {
        let mass = &self.system.model().mass.weights;
        let cells = self.groups_at(b).into_iter().flat_map(|(a, b)| {
            let cells = a.cells(b);
            (0..cells.rows()).map(move |cell| (a.index, cell, dot(cells.row(cell), mass)))
        });
        cells.min_by(|x, y| x.2.total_cmp(&y.2))
    }

    /// Each active group with its breakpoints.
    fn groups_at<'b>(&self, b: &'b [f64]) -> Vec<(&Active<'a>, &'b [f64])> {
        self.active.iter().zip(split(b, &self.blocks())).collect()
    }

    fn fixed_outcomes(&self) -> usize {
        self.fixed.iter().map(Table::rows).product()
    }

    /// Part of the criterion that does not depend on the active groups.
    pub fn constant(&self) -> f64 {
        self.constant + self.offset()
    }

    /// [`Scored::offset`].
    pub(crate) fn offset(&self) -> f64 {
        self.scored.offset()
    }

    fn entropy_share(&self, a: &Active<'_>, symbols: &Table) -> f64 {
        if self.scored.has_separable_entropy() {
            a.group.sensors.len() as f64 * negative_entropy(symbols, &self.system.model().mass.weights)
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

    /// Moments over all joint outcomes, with the reports of some groups replaced; the rows of a replaced group are `(i, m)`.
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
            // Without sensors the reports are a single row of ones.
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

impl System {
    /// Value of a criterion: nats, squared units of the unknown, or a probability. The quadrature error is about 1e-12.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there are more outcomes than the limit; [`Error::Argument`] for a Bayes error under a continuous prior.
    pub fn value(&self, criterion: Criterion) -> Result<f64, Error> {
        let problem = Problem::new(self, criterion, &[])?;
        Ok((problem.value(&[]) + problem.offset()) * criterion.sense())
    }

    /// Value, gradient and Hessian of a criterion with respect to all breakpoints, group by group.
    ///
    /// The Bayes error is smooth except at breakpoints where a decision changes; its derivatives are those of the smooth piece.
    ///
    /// # Errors
    /// As [`System::value`].
    pub fn derivatives(&self, criterion: Criterion) -> Result<Derivatives, Error> {
        let all: Vec<usize> = (0..self.groups().len()).collect();
        let problem = Problem::new(self, criterion, &all)?;
        let sense = criterion.sense();
        let found = problem.derivatives(&problem.start());
        Ok(Derivatives {
            value: (found.value + problem.offset()) * sense,
            gradient: found.gradient * sense,
            hessian: found.hessian * sense,
        })
    }
}

#[derive(Clone, Copy)]
enum Slot {
    First,
    Slope,
    Second,
}
