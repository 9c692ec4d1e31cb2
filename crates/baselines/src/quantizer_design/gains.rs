//! The gain of each level for a sample, for fixed other sensors and a fixed decoder.
//!
//! For fixed scores of the decoder every criterion is linear in the sensor's decisions. The best level for a sample `y`
//! is then the one with the largest of a few functions `D_z(y)`. The alternating algorithm uses this.

use fewbits_numerics::error::refuse;
use fewbits_numerics::{kernels, normal};
use fewbits_quantizer_design::engine::{Active, LOG_FLOOR, Problem};
use fewbits_quantizer_design::outcomes::{Table, for_each_log, moments};
use fewbits_quantizer_design::system::SensorGroup;
use fewbits_quantizer_design::{Channel, Criterion, Error, ObservationModel, System};

/// Stands for the logarithm of probability zero. It is finite, so that a weight of zero removes it.
const LOG_IMPOSSIBLE: f64 = -1e12;

/// The group if it is a single sensor.
///
/// # Errors
/// If there is no such group, or it has several sensors.
pub(crate) fn single_sensor(system: &System, group: usize) -> Result<&SensorGroup, Error> {
    match system.groups().get(group) {
        Some(entry) if entry.sensors.len() == 1 => Ok(entry),
        Some(entry) => refuse("group", format!("{} sensors", entry.sensors.len()), "a group of a single sensor"),
        None => refuse("group", group, format!("a number below {}", system.groups().len())),
    }
}

/// The gains of all levels of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LevelGains {
    /// The gain of each level at each node, relative to the density of the sample there.
    pub gains: Vec<Vec<f64>>,
    /// Mean of the sample at each node.
    pub means: Vec<f64>,
    /// Standard deviation of the sample at each node.
    pub deviation: f64,
}

impl LevelGains {
    /// The gains of the single sensor in `group` under the decoder for the present cells.
    ///
    /// # Errors
    /// If the group is not a single sensor, there are too many outcomes, or the criterion does not fit the prior.
    pub(crate) fn new(system: &System, group: usize, criterion: Criterion) -> Result<Self, Error> {
        let entry = single_sensor(system, group)?;
        // Refuses a criterion that does not fit the prior, and too many outcomes.
        Problem::new(system, criterion, &[])?;
        let (model, own) = (system.model(), Active::new(system, group)?);
        // Joint report probabilities of the other groups.
        let nodes = own.means.len();
        let (mut others, mut inner) = (Table::new(vec![1.0; nodes], nodes), 1);
        for index in (0..system.groups().len()).filter(|index| *index != group) {
            let other = Active::new(system, index)?;
            let reports = other.reports(other.breakpoints()).0;
            inner *= if index > group { reports.rows() } else { 1 };
            others = others.outer(&reports);
        }
        let (channel, values) = (&entry.channel, model.values().len());
        let outputs = channel.outputs();
        // Log likelihoods, and the index of an outcome in their table.
        let (logs, is_by_group) = if model.prior().points().is_some() {
            // If hypotheses are far apart, the probability of a wrong symbol underflows, but its logarithm is needed.
            (log_likelihoods(system)?, true)
        } else {
            let symbols = own.symbols(own.breakpoints());
            let likelihood = moments(&[&others, &symbols], model.given());
            (likelihood.iter().map(|q| q.max(LOG_FLOOR).ln()).collect(), false)
        };
        let gains = level_gains(model, criterion, &others, channel, |at| {
            let (other, symbol) = (at / outputs, at % outputs);
            let by_group = (other / inner * outputs + symbol) * inner + other % inner;
            let outcome = if is_by_group { by_group } else { at };
            &logs[outcome * values..(outcome + 1) * values]
        });
        Ok(Self {
            gains: gains.iter().map(<[f64]>::to_vec).collect(),
            means: own.means,
            deviation: own.deviation,
        })
    }
}

/// `lambda_z(node) = sum_k w_k P(node | x_k) sum_t' P(t' | node) sum_t C[t, z] score(t', t, x_k)`, levels by nodes.
///
/// `others` holds the joint report probabilities of the other sensors, one row per report. The score is `ln p(t', t | x) / p(t', t)`, or
/// minus the squared error of the posterior mean, or minus one for a wrong decision. It is computed from `log_likelihood(i)` of the outcome
/// `i = other * outputs + symbol`, one number per value of the unknown. Probabilities may underflow; their logarithms must not.
fn level_gains<'a>(
    model: &ObservationModel,
    criterion: Criterion,
    others: &Table,
    channel: &Channel,
    log_likelihood: impl Fn(usize) -> &'a [f64],
) -> Table {
    let (nodes, values) = (others.nodes, model.values().len());
    let mut per_symbol = vec![0.0; channel.outputs() * nodes];
    let mut score = vec![0.0; values];
    for at in 0..others.rows() * channel.outputs() {
        let (other, symbol) = (at / channel.outputs(), at % channel.outputs());
        scores(model, criterion, log_likelihood(at), &mut score);
        let reports = others.row(other);
        let out = &mut per_symbol[symbol * nodes..(symbol + 1) * nodes];
        for ((feature, w), s) in model.given().iter().zip(model.weights()).zip(&score) {
            let factor = w * s;
            let range = feature.start..feature.start + feature.weights.len();
            for ((out, p), report) in out[range.clone()].iter_mut().zip(&feature.weights).zip(&reports[range]) {
                *out += factor * p * report;
            }
        }
    }
    // The gain of a level is the mean gain of the symbols into which the channel turns it.
    Table::new(per_symbol, nodes).mixed(channel.inputs(), |z, t| channel.probability(t, z))
}

/// `ln P(outcome | x_k)` for every joint outcome, outcomes by values. It stays accurate if the probabilities underflow. The caller checks
/// the number of outcomes.
///
/// # Errors
/// As [`Active::new`].
pub(crate) fn log_likelihoods(system: &System) -> Result<Vec<f64>, Error> {
    let counts = |(index, group): (usize, &SensorGroup)| {
        let logs = log_symbols(&Active::new(system, index)?, group);
        Ok(logs.of_log_counts(group.sensors.len()))
    };
    let tables: Vec<Table> = system
        .groups()
        .iter()
        .enumerate()
        .map(counts)
        .collect::<Result<_, Error>>()?;
    let given = system.model().given();
    let nodes = tables.first().map_or(0, |table| table.nodes);
    let mut out = Vec::new();
    for_each_log(&tables, &vec![0.0; nodes], |_, row| {
        // With correlated noise each value is a mixture over nodes: log-sum-exp over the nodes of the value.
        for feature in given {
            let logs = row[feature.start..].iter().zip(&feature.weights);
            let terms: Vec<f64> = logs.filter(|(_, w)| **w > 0.0).map(|(l, w)| l + w.ln()).collect();
            out.push(kernels::log_sum_exp(&terms));
        }
    });
    Ok(out)
}

/// Logarithms of the probabilities of a sensor's symbols at each node.
fn log_symbols(own: &Active<'_>, group: &SensorGroup) -> Table {
    let edges: Vec<f64> = own.breakpoints().iter().copied().chain([f64::INFINITY]).collect();
    let labels = group.quantizer.labels();
    let mut values = Vec::new();
    for t in 0..group.channel.outputs() {
        values.extend(own.means.iter().map(|m| {
            let mut low = f64::NEG_INFINITY;
            let cells = edges.iter().zip(labels).map(|(edge, label)| {
                let high = (edge - m) / own.deviation;
                let inside = normal::log_interval(std::mem::replace(&mut low, high), high);
                inside + group.channel.probability(t, *label).ln()
            });
            kernels::log_sum_exp(&cells.collect::<Vec<_>>())
        }));
    }
    Table::new(values, own.means.len())
}

/// Score of the decoder for one outcome, for each value of the unknown.
fn scores(model: &ObservationModel, criterion: Criterion, log_likelihood: &[f64], out: &mut [f64]) {
    // Relative to the most likely value, so that the largest number is 1.
    let largest = log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        // An outcome that has probability zero for all values.
        out.fill(0.0);
        return;
    }
    let relative = |l: &f64| (l - largest).exp();
    let total: f64 = model
        .weights()
        .iter()
        .zip(log_likelihood)
        .map(|(w, l)| w * relative(l))
        .sum();
    match criterion {
        Criterion::MutualInformation => {
            let log_total = largest + total.max(LOG_FLOOR).ln();
            for (o, l) in out.iter_mut().zip(log_likelihood) {
                *o = (l - log_total).max(LOG_IMPOSSIBLE);
            }
        }
        Criterion::MeanSquaredError => {
            let terms = model.weights().iter().zip(model.values()).zip(log_likelihood);
            let moment: f64 = terms
                .map(|((w, x), l)| w * (x - model.prior().mean()) * relative(l))
                .sum();
            let mean = model.prior().mean() + if total > 0.0 { moment / total } else { 0.0 };
            for (o, x) in out.iter_mut().zip(model.values()) {
                *o = -(x - mean) * (x - mean);
            }
        }
        Criterion::BayesError => {
            let joint = |k: usize| model.weights()[k].ln() + log_likelihood[k];
            let best = (1..out.len()).fold(0, |best, k| if joint(k) > joint(best) { k } else { best });
            for (k, o) in out.iter_mut().enumerate() {
                *o = if k == best { 0.0 } else { -1.0 };
            }
        }
    }
}
