//! Probabilities of one group's reports, and their derivatives with respect to its breakpoints.

use crate::error::Error;
use crate::outcomes::counts::Compositions;
use crate::outcomes::{SETTLED, Table, cell_probabilities};
use crate::system::{SensorGroup, System};
use fewbits_numerics::normal;

/// A group whose breakpoints may change.
#[derive(Debug, Clone)]
pub struct Active<'a> {
    pub(crate) index: usize,
    pub(crate) group: &'a SensorGroup,
    pub(crate) compositions: Compositions,
    /// Mean of a sensor's sample at each node.
    pub means: Vec<f64>,
    /// The standard deviation.
    pub deviation: f64,
    /// `c[i][t]`: derivative of the probability of symbol `t` with respect to breakpoint `i`, divided by the density of the sample there.
    pub exchange: Vec<Vec<f64>>,
}

/// Tables from which the node sums of one group are formed, at given breakpoints.
pub(crate) struct Slots {
    /// Report probabilities of all sensors of the group, of all but one, and of all but two.
    pub(crate) reports: [Table; 3],
    pub(crate) densities: Table,
    pub(crate) slopes: Table,
    /// Products `phi_i phi_j`, `j >= i`.
    pub(crate) pairs: Table,
}

impl<'a> Active<'a> {
    /// The group `index` of the system.
    ///
    /// # Errors
    /// If there is no such group.
    pub fn new(system: &'a System, index: usize) -> Result<Self, Error> {
        let group = system.group(index)?;
        let outputs = group.channel.outputs();
        let (means, deviation) = system.model().sample_law(group.sensors[0]);
        let exchange = (0..group.quantizer.breakpoints().len())
            .map(|i| {
                (0..outputs)
                    .map(|t| group.cell_transition(t, i) - group.cell_transition(t, i + 1))
                    .collect()
            })
            .collect();
        let compositions = Compositions::new(group.sensors.len(), outputs);
        Ok(Self {
            index,
            group,
            compositions,
            means,
            deviation,
            exchange,
        })
    }

    /// The breakpoints of the group in the system.
    pub fn breakpoints(&self) -> &'a [f64] {
        self.group.quantizer.breakpoints()
    }

    /// Probability of each cell at each node.
    pub(crate) fn cells(&self, b: &[f64]) -> Table {
        cell_probabilities(&self.means, self.deviation, b)
    }

    /// Probability of each received symbol at each node.
    pub fn symbols(&self, b: &[f64]) -> Table {
        let of = |t: usize, cell: usize| self.group.cell_transition(t, cell);
        self.cells(b).mixed(self.compositions.parts, of)
    }

    /// Report probabilities of the whole group, and the symbol probabilities of one sensor.
    pub fn reports(&self, b: &[f64]) -> (Table, Table) {
        let symbols = self.symbols(b);
        (self.compositions.probabilities(&symbols).swap_remove(0), symbols)
    }

    /// Density of the sample at each breakpoint, and its derivative, at every node: a row per breakpoint.
    pub fn densities(&self, b: &[f64]) -> (Table, Table) {
        let standardised = b
            .iter()
            .flat_map(|b| self.means.iter().map(move |m| (b - m) / self.deviation));
        let (densities, slopes) = standardised
            .map(|u| {
                let density = if u.abs() > SETTLED {
                    0.0
                } else {
                    normal::pdf(u) / self.deviation
                };
                (density, -u * density / self.deviation)
            })
            .unzip();
        (Table::new(densities, self.means.len()), Table::new(slopes, self.means.len()))
    }

    /// The tables that enter the node sums as factors.
    pub(crate) fn slots(&self, symbols: &Table, (densities, slopes): (Table, Table)) -> Slots {
        let nodes = self.means.len();
        let mut levels = self.compositions.probabilities(symbols).into_iter();
        let reports = [(); 3].map(|()| levels.next().unwrap_or(Table::new(Vec::new(), nodes)));
        // Products of two densities move the reports of two sensors, so a single sensor has none.
        let mut pairs = Vec::new();
        if self.compositions.total >= 2 {
            for (i, p) in densities.iter().enumerate() {
                for q in densities.iter().skip(i) {
                    pairs.extend(p.iter().zip(q).map(|(x, y)| x * y));
                }
            }
        }
        Slots {
            reports,
            densities,
            slopes,
            pairs: Table::new(pairs, nodes),
        }
    }
}

/// `sum_node mass sum_t P_t ln P_t` of one sensor.
pub(crate) fn negative_entropy(symbols: &Table, mass: &[f64]) -> f64 {
    symbols
        .iter()
        .map(|row| {
            row.iter()
                .zip(mass)
                .filter(|(p, _)| **p > 0.0)
                .map(|(p, w)| w * p * p.ln())
                .sum::<f64>()
        })
        .sum()
}

/// Report probabilities at the nodes of every group.
pub(crate) fn report_tables(system: &System) -> Result<Vec<Table>, Error> {
    system.check_outcomes()?;
    of_groups(system, |entry| entry.reports(entry.breakpoints()).0)
}

/// Symbol probabilities at the nodes of a sensor of each group.
pub(crate) fn symbol_tables(system: &System) -> Result<Vec<Table>, Error> {
    of_groups(system, |entry| entry.symbols(entry.breakpoints()))
}

/// A table for every group.
fn of_groups(system: &System, table: impl Fn(&Active<'_>) -> Table) -> Result<Vec<Table>, Error> {
    let groups = 0..system.groups().len();
    groups.map(|index| Ok(table(&Active::new(system, index)?))).collect()
}

/// All sums of an entry of `a` and an entry of `b`; the index of `b` varies faster.
pub(crate) fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().flat_map(|x| b.iter().map(move |y| x + y)).collect()
}
