//! Probabilities of one group's reports, and their derivatives with respect to its breakpoints.

use crate::error::Error;
use crate::outcomes::counts::Compositions;
use crate::outcomes::{Feature, Table, cell_probabilities, for_each, for_each_log, moments};
use crate::system::{SensorGroup, System};
use fewbits_numerics::{kernels, normal};

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
        let outputs = group.channel().outputs();
        let (means, deviation) = system.model().sample_law(group.sensors()[0]);
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
            deviation,
            exchange,
        })
    }

    /// Number of breakpoints.
    pub fn parameters(&self) -> usize {
        self.exchange.len()
    }

    /// The breakpoints of the group in the system.
    pub fn breakpoints(&self) -> &'a [f64] {
        self.group.quantizer().breakpoints()
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

    /// Logarithms of the symbols' probabilities at each node.
    fn log_symbols(&self) -> Table {
        let edges: Vec<f64> = self.breakpoints().iter().copied().chain([f64::INFINITY]).collect();
        let mut values = Vec::with_capacity(self.compositions.parts * self.means.len());
        for t in 0..self.compositions.parts {
            values.extend(self.means.iter().map(|m| {
                let mut low = f64::NEG_INFINITY;
                let cells = edges.iter().enumerate().map(|(cell, edge)| {
                    let high = (edge - m) / self.deviation;
                    let inside = normal::log_interval(std::mem::replace(&mut low, high), high);
                    inside + self.group.cell_transition(t, cell).ln()
                });
                kernels::log_sum_exp(&cells.collect::<Vec<_>>())
            }));
        }
        Table::new(values, self.means.len())
    }

    /// Report probabilities of the whole group, and the symbol probabilities of one sensor.
    pub fn reports(&self, b: &[f64]) -> (Table, Table) {
        let symbols = self.symbols(b);
        (self.compositions.probabilities(&symbols).swap_remove(0), symbols)
    }

    /// Density of the sample at each breakpoint, and its derivative, at every node.
    pub fn densities(&self, b: &[f64]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        b.iter()
            .map(|b| {
                let standardised = self.means.iter().map(|m| (b - m) / self.deviation);
                standardised
                    .map(|u| {
                        let density = normal::pdf(u) / self.deviation;
                        (density, -u * density / self.deviation)
                    })
                    .unzip()
            })
            .unzip()
    }

    /// The tables that enter the node sums as factors.
    pub(crate) fn slots(&self, symbols: &Table, densities: &[Vec<f64>], slopes: &[Vec<f64>]) -> Slots {
        let nodes = self.means.len();
        let mut levels = self.compositions.probabilities(symbols).into_iter();
        let reports = [(); 3].map(|()| levels.next().unwrap_or(Table::new(Vec::new(), nodes)));
        // Products of two densities move the reports of two sensors, so a single sensor has none.
        let mut pairs = Vec::new();
        if self.compositions.total >= 2 {
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

/// Report probabilities of every group at every node, and the log multiplicity of every joint outcome, with the first group varying
/// slowest.
pub(crate) struct Reports {
    tables: Vec<Table>,
    pub(crate) log_multiplicity: Vec<f64>,
}

impl Reports {
    pub(crate) fn of(system: &System) -> Result<Self, Error> {
        system.check_outcomes()?;
        let mut tables = Vec::with_capacity(system.groups().len());
        let mut log_multiplicity = vec![0.0];
        for index in 0..system.groups().len() {
            let entry = Active::new(system, index)?;
            tables.push(entry.reports(entry.breakpoints()).0);
            log_multiplicity = sums(&log_multiplicity, &entry.compositions.log_multiplicity);
        }
        Ok(Self {
            tables,
            log_multiplicity,
        })
    }

    /// Visits the report probabilities at the nodes of every joint outcome.
    pub(crate) fn for_each(&self, mut visit: impl FnMut(&[f64])) {
        let nodes = self.tables.first().map_or(0, |table| table.nodes);
        for_each(&self.tables.iter().collect::<Vec<_>>(), &vec![1.0; nodes], |_, product| visit(product));
    }

    /// For every joint outcome, its moments: the features of the product of its report probabilities.
    pub(crate) fn moments(&self, features: &[Feature]) -> Vec<f64> {
        moments(&self.tables.iter().collect::<Vec<_>>(), features)
    }
}

/// Symbol probabilities at the nodes of a sensor of each group.
pub(crate) fn symbol_tables(system: &System) -> Result<Vec<Table>, Error> {
    let of = |g| {
        let entry = Active::new(system, g)?;
        Ok(entry.symbols(entry.breakpoints()))
    };
    (0..system.groups().len()).map(of).collect()
}

/// `ln P(outcome | x_k)` for every joint outcome, outcomes by values. It stays accurate if the probabilities underflow.
///
/// # Errors
/// [`Error::TooLarge`] if there are more outcomes than the system allows.
pub fn log_likelihoods(system: &System) -> Result<Vec<f64>, Error> {
    system.check_outcomes()?;
    let tables = (0..system.groups().len())
        .map(|index| {
            Ok(Active::new(system, index)?
                .log_symbols()
                .of_log_counts(system.groups()[index].sensors().len()))
        })
        .collect::<Result<Vec<Table>, Error>>()?;
    let model = system.model();
    let mut out = Vec::new();
    for_each_log(&tables.iter().collect::<Vec<_>>(), &vec![0.0; model.nodes()], |_, row| {
        // With correlated noise each value is a mixture over nodes: log-sum-exp over the nodes of the value.
        for feature in &model.given {
            let logs = row[feature.start..].iter().zip(&feature.weights);
            let terms: Vec<f64> = logs.filter(|(_, w)| **w > 0.0).map(|(l, w)| l + w.ln()).collect();
            out.push(kernels::log_sum_exp(&terms));
        }
    });
    Ok(out)
}

/// All sums of an entry of `a` and an entry of `b`; the index of `b` varies faster.
pub(crate) fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().flat_map(|x| b.iter().map(move |y| x + y)).collect()
}
