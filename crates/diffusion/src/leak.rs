//! Where a source is and when it began, from readings of a few bits at irregular times.

use crate::leak_prior::{LeakPrior, Reading};
use crate::leak_resolution::{Law, Offsets};
use crate::{Domain, Error, Plan, SensorField};
use fewbits_numerics::error::{finite, positive, refuse, within};
use fewbits_numerics::normal::{cdf, interval, quantile};
use std::sync::Arc;

/// The probability of every cell, start and rate of one leak, given readings of sensors of a [`SensorField`].
///
/// Besides the sensor's noise, a reading's variance counts what the response changes across a cell and between two starts and rates: the
/// resolution of the belief itself. What all values of a sensor share of it, where in the cell, between starts and between rates the truth is, is
/// estimated from them to first order; words have errors of their own. The lasting relative error of each sensor ([`LeakPrior::model_error`]) is integrated out.
///
/// ```
/// use fewbits_diffusion::{Flow, LeakBelief, LeakPrior, Plan, Reading, FluxRule, SensorField, StepControl, Transport};
///
/// let rows = ["##########", "#kkkk#bbb#", "#kkkk.bbbO", "#kkkk#bbb#", "##########", "k = kitchen", "b = bath"];
/// let plan = Plan::parse(&rows.join("\n"))?;
/// let domain = plan.domain(0.5, 2, 0.0)?;
/// let still = Flow::still(&domain);
/// let transport = Transport::new(domain, 0.02, &still, 0.0, FluxRule::default())?;
/// let sensors = [[0.7, 0.7, 0.0], [2.2, 1.7, 0.0], [4.2, 0.8, 0.0]];
/// let ages = [30.0, 60.0, 120.0, 240.0, 480.0, 960.0];
/// let field = SensorField::transient(&transport, &sensors, &ages, StepControl::Tolerance(1e-3))?;
///
/// let prior = LeakPrior { start: [0.0, 300.0], rate: [1e-7, 1e-5], model_error: 0.1, faults: 0.001 };
/// let mut belief = LeakBelief::new(field, &prior)?;
/// let bit = |word| Reading::Word { edges: vec![2e-5], word }; // below or above 20 mg/m^3
/// for (sensor, time, word) in [(0, 200.0, 0), (2, 230.0, 0), (0, 400.0, 1), (1, 410.0, 1), (2, 700.0, 0), (0, 720.0, 1)] {
///     belief.observe(sensor, time, &bit(word), 5e-6)?;
/// }
/// let rooms = belief.rooms(&plan)?;
/// assert_eq!(rooms[0].0, "kitchen");
/// assert!(rooms[0].1 > 0.9 && belief.misfit() > 0.01);
/// # Ok::<(), fewbits_diffusion::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct LeakBelief {
    field: SensorField,
    domain: Arc<Domain>,
    starts: Vec<f64>,
    /// Logarithms of the rates, and on each side as many as errors of the model reach.
    log_rates: Vec<f64>,
    /// Probabilities of an error of the model by so many steps of the rates: about none.
    gains: Vec<f64>,
    faults: f64,
    log_volumes: Vec<f64>,
    /// Per free cell and axis, the free cells before and after it; the cell itself where there is none.
    neighbours: Vec<[[usize; 2]; 3]>,
    /// Per sensor that reported: the log-likelihood of all its readings by cell, start and rate.
    logs: Vec<Option<Vec<f64>>>,
    /// The same with the sensor's error integrated out; only rates of the prior.
    shared: Vec<Option<Vec<f64>>>,
    /// Per sensor whose values came: the part of the error of resolution that its values share.
    offsets: Vec<Option<Offsets>>,
    surprise: f64,
    variance: f64,
}

/// Number of rates of the belief.
const RATES: usize = 24;
/// Deviation of a uniform distribution of width 1.
const UNIFORM: f64 = 0.288_675_134_594_812_9;
/// Root of the mean square of half the square of a number that is uniform in a width of 1.
const BEND: f64 = 0.055_901_699_437_494_74;

impl LeakBelief {
    /// The belief before the first reading.
    ///
    /// # Errors
    /// If starts are not finite or decrease, rates are not positive and increasing, or the error of the model or the share of faults is not in `[0, 1)`.
    pub fn new(field: SensorField, prior: &LeakPrior) -> Result<Self, Error> {
        prior.check()?;
        let domain = field.domain().clone();
        let volumes = domain.volumes();
        let starts = prior.starts(volumes.len(), field.is_steady());
        let step = (prior.rate[1] / prior.rate[0]).ln() / RATES as f64;
        let reach = (2.5 * prior.model_error / step).ceil() as usize;
        let rate = |i: usize| prior.rate[0].ln() + (i as f64 - reach as f64 + 0.5) * step;
        let gain = |i: usize| {
            let from = (i as f64 - reach as f64 - 0.5) * step / prior.model_error;
            if reach == 0 {
                1.0
            } else {
                interval(from, from + step / prior.model_error)
            }
        };
        let mut gains: Vec<f64> = (0..=2 * reach).map(gain).collect();
        let total: f64 = gains.iter().sum();
        gains.iter_mut().for_each(|gain| *gain /= total);
        let all: f64 = volumes.iter().sum();
        Ok(Self {
            neighbours: field.neighbours(),
            log_volumes: volumes.iter().map(|volume| (volume / all).ln()).collect(),
            log_rates: (0..RATES + 2 * reach).map(rate).collect(),
            logs: vec![None; field.sensor_count()],
            shared: vec![None; field.sensor_count()],
            offsets: vec![None; field.sensor_count()],
            faults: prior.faults,
            domain,
            field,
            starts,
            gains,
            surprise: 0.0,
            variance: 0.0,
        })
    }

    /// Takes in what a sensor of the field said at a time (s), with noise of this deviation (kg/m^3). Readings may come in any order and at any
    /// times.
    ///
    /// # Errors
    /// If there is no such sensor, a number is not finite, the deviation is not positive, the edges do not increase, or there is no such word.
    pub fn observe(&mut self, sensor: usize, time: f64, reading: &Reading, deviation: f64) -> Result<(), Error> {
        if sensor >= self.logs.len() {
            let expected = format!("a number below {}", self.logs.len());
            return refuse("sensor", sensor, expected);
        }
        finite("time", time)?;
        positive("deviation", deviation)?;
        reading.check()?;
        let resolved = self.resolved(sensor, time);
        let weights = self.weights(sensor);
        let predicted = |p: &[f64]| weights.iter().zip(p).map(|(weight, p)| weight * p).sum::<f64>();
        let (own, tested) = match reading {
            Reading::Value(value) => {
                let mut offsets = self.offsets[sensor]
                    .take()
                    .unwrap_or_else(|| Offsets::new(resolved.len(), self.domain.grid().dimension()));
                let laws: Vec<(f64, f64)> = resolved
                    .iter()
                    .enumerate()
                    .map(|(i, law)| {
                        let (mean, variance) = offsets.predicted(i, law);
                        (mean, (variance + deviation * deviation).sqrt())
                    })
                    .collect();
                let standard = |(mean, deviation): &(f64, f64)| (value - mean) / deviation;
                let wide = self.widest(&laws);
                let log = |law: &(f64, f64)| {
                    let density = (-0.5 * standard(law).powi(2)).exp() / law.1;
                    ((1.0 - self.faults) * density + self.faults / wide).ln()
                };
                let below: Vec<f64> = laws.iter().map(|law| cdf(standard(law))).collect();
                let share = predicted(&below).clamp(1e-12, 1.0 - 1e-12);
                for (i, (law, known)) in resolved.iter().zip(&laws).enumerate() {
                    // A faulty value tells nothing of the error.
                    let density = (1.0 - self.faults) * (-0.5 * standard(known).powi(2)).exp() / known.1;
                    let right = density / (density + self.faults / wide).max(f64::MIN_POSITIVE);
                    offsets.update(i, law, value - known.0, known.1 * known.1, right);
                }
                self.offsets[sensor] = Some(offsets);
                // Its quantile is normal under the right model; the square has mean 1 and variance 2.
                (laws.iter().map(log).collect::<Vec<f64>>(), (quantile(share).powi(2) - 1.0, 2.0))
            }
            Reading::Word { edges, word } => {
                let laws: Vec<(f64, f64)> = resolved
                    .iter()
                    .map(|law| (law.mean, deviation.hypot(law.error())))
                    .collect();
                // Probabilities to be below each edge, and to be above it.
                let tails = edges.iter().map(|edge| {
                    let standard = laws.iter().map(|(mean, deviation)| (edge - mean) / deviation);
                    standard.map(|x| (cdf(x), cdf(-x))).unzip()
                });
                let tails: Vec<(Vec<f64>, Vec<f64>)> = tails.collect();
                let other = self.faults / (edges.len() + 1) as f64;
                let probabilities = |word: usize| -> Vec<f64> {
                    let inside = |i: usize| match (word.checked_sub(1).map(|edge| &tails[edge]), tails.get(word)) {
                        (Some(lower), Some(upper)) => (upper.0[i] - lower.0[i]).max(0.0),
                        (None, Some(upper)) => upper.0[i],
                        (Some(lower), None) => lower.1[i],
                        (None, None) => 1.0,
                    };
                    (0..laws.len())
                        .map(|i| (1.0 - self.faults) * inside(i) + other)
                        .collect()
                };
                let (mut entropy, mut square, mut own) = (0.0, 0.0, (Vec::new(), 0.0));
                for next in 0..=edges.len() {
                    let each = probabilities(next);
                    let p = predicted(&each).max(1e-300);
                    entropy -= p * p.ln();
                    square += p * p.ln().powi(2);
                    if next == *word {
                        own = (each, -p.ln());
                    }
                }
                let logs = own.0.iter().map(|p| p.max(1e-300).ln()).collect();
                (logs, (own.1 - entropy, (square - entropy * entropy).max(0.0)))
            }
        };
        self.surprise += tested.0;
        self.variance += tested.1;
        let logs = match self.logs[sensor].take() {
            Some(logs) => logs.iter().zip(own).map(|(log, own)| log + own).collect(),
            None => own,
        };
        self.shared[sensor] = Some(self.without_error(&logs));
        self.logs[sensor] = Some(logs);
        Ok(())
    }

    /// Largest deviation of a reading by the belief: faulty values are that wide.
    fn widest(&self, laws: &[(f64, f64)]) -> f64 {
        laws.iter()
            .map(|(mean, deviation)| mean + deviation)
            .fold(f64::MIN_POSITIVE, f64::max)
    }

    /// What a sensor measures at a time, by cell, start and rate.
    fn resolved(&self, sensor: usize, time: f64) -> Vec<Law> {
        let width = self.starts.get(1).map_or(0.0, |next| next - self.starts[0]);
        let step = self.log_rates[1] - self.log_rates[0];
        let rates: Vec<f64> = self.log_rates.iter().map(|log| log.exp()).collect();
        let about: Vec<_> = self
            .starts
            .iter()
            .map(|start| [0.0, -0.5, 0.5].map(|by| self.field.about(time - start + by * width)))
            .collect();
        let mut laws = Vec::with_capacity(self.log_volumes.len() * self.starts.len() * rates.len());
        for (cell, neighbours) in self.neighbours.iter().enumerate() {
            for ages in &about {
                let [response, before, after] = ages.map(|about| self.field.response_at(about, sensor, cell));
                let mut slopes = [UNIFORM * step * response, UNIFORM * (after - before), 0.0, 0.0, 0.0];
                let mut bends = [
                    step * step * response,
                    4.0 * (after + before - 2.0 * response),
                    0.0,
                    0.0,
                    0.0,
                ];
                for (axis, pair) in neighbours.iter().enumerate() {
                    let [down, up] = pair.map(|next| self.field.response_at(ages[0], sensor, next) - response);
                    // Next to a wall the slope is that to the other side.
                    let cells = if pair.contains(&cell) { 1.0 } else { 2.0 };
                    slopes[2 + axis] = UNIFORM * (up - down) / cells;
                    bends[2 + axis] = up + down;
                }
                let curvature = BEND * bends.iter().map(|bend: &f64| bend * bend).sum::<f64>().sqrt();
                laws.extend(rates.iter().map(|rate| Law {
                    mean: rate * response,
                    slopes: slopes.map(|slope| rate * slope),
                    curvature: rate * curvature,
                }));
            }
        }
        laws
    }

    /// Integrates the sensor's lasting error out of log-likelihoods by cell, start and rate.
    fn without_error(&self, logs: &[f64]) -> Vec<f64> {
        let mut found = Vec::with_capacity(logs.len());
        for block in logs.chunks(self.log_rates.len()) {
            let most = block.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let all: Vec<f64> = block.iter().map(|log| (log - most).exp()).collect();
            let shared = |own: &[f64]| self.gains.iter().zip(own).map(|(gain, p)| gain * p).sum::<f64>();
            found.extend(
                all.windows(self.gains.len())
                    .map(|own| most + shared(own).max(1e-300).ln()),
            );
        }
        found
    }

    /// Log posterior of cells, starts and rates by all sensors but one, not normalised.
    fn log_posterior(&self, without: Option<usize>) -> Vec<f64> {
        let each = self.starts.len() * RATES;
        let mut found: Vec<f64> = self
            .log_volumes
            .iter()
            .flat_map(|log| std::iter::repeat_n(*log, each))
            .collect();
        for (_, shared) in self
            .shared
            .iter()
            .enumerate()
            .filter(|(sensor, _)| Some(*sensor) != without)
        {
            for (log, own) in found.iter_mut().zip(shared.iter().flatten()) {
                *log += own;
            }
        }
        found
    }

    /// Probabilities by cell, start and what a sensor takes for the rate: the rate times its error.
    fn weights(&self, sensor: usize) -> Vec<f64> {
        let (rates, others) = (self.log_rates.len(), self.log_posterior(Some(sensor)));
        let mut found = vec![f64::NEG_INFINITY; others.len() / RATES * rates];
        for (block, others) in others.chunks(RATES).enumerate() {
            let most = others.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let all: Vec<f64> = others.iter().map(|log| (log - most).exp()).collect();
            for (i, found) in found[block * rates..][..rates].iter_mut().enumerate() {
                let known = self
                    .gains
                    .iter()
                    .enumerate()
                    .filter_map(|(j, gain)| Some(gain * all.get(i.checked_sub(j)?)?));
                let own = self.logs[sensor].as_ref().map_or(0.0, |logs| logs[block * rates + i]);
                *found = most + known.sum::<f64>().ln() + own;
            }
        }
        normalised(found)
    }

    /// Probabilities by cell, start and rate.
    fn probabilities(&self) -> Vec<f64> {
        normalised(self.log_posterior(None))
    }

    /// The probability that the leak is in each free cell of the domain.
    pub fn cells(&self) -> Vec<f64> {
        self.probabilities()
            .chunks(self.starts.len() * RATES)
            .map(|cell| cell.iter().sum())
            .collect()
    }

    /// The smallest set of free cells that holds the leak with this probability, likeliest first.
    ///
    /// # Errors
    /// If the probability is not in `[0, 1]`.
    pub fn area(&self, probability: f64) -> Result<Vec<usize>, Error> {
        within("probability", probability, 0.0, 1.0)?;
        let cells = self.cells();
        let density = |cell: usize| cells[cell].ln() - self.log_volumes[cell];
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by(|one, other| density(*other).total_cmp(&density(*one)));
        let mut sum = 0.0;
        let last = order.iter().position(|cell| {
            sum += cells[*cell];
            sum >= probability
        });
        order.truncate(last.map_or(order.len(), |last| last + 1));
        Ok(order)
    }

    /// Each room of a plan with the probability that the leak is in it, the likeliest first; air that belongs to no room is `elsewhere`.
    ///
    /// # Errors
    /// If the domain is not one of this plan.
    pub fn rooms(&self, plan: &Plan) -> Result<Vec<(String, f64)>, Error> {
        let names = plan.rooms();
        let mut found: Vec<(String, f64)> = names.iter().map(|name| ((*name).to_owned(), 0.0)).collect();
        found.push(("elsewhere".to_owned(), 0.0));
        for (room, p) in plan.rooms_of(&self.domain)?.into_iter().zip(self.cells()) {
            found[room.unwrap_or(names.len())].1 += p;
        }
        // Rounding may leave a sum a little above 1.
        found.iter_mut().for_each(|(_, p)| *p = p.min(1.0));
        found.sort_by(|one, other| other.1.total_cmp(&one.1));
        Ok(found)
    }

    /// Mean and standard deviation of the rate's natural logarithm.
    pub fn log_rate(&self) -> (f64, f64) {
        let reach = self.gains.len() / 2;
        self.moments(&self.log_rates[reach..reach + RATES], |index| index % RATES)
    }

    /// Mean and standard deviation of the time at which the leak began, s.
    pub fn start(&self) -> (f64, f64) {
        self.moments(&self.starts, |index| index / RATES % self.starts.len())
    }

    /// Moments of a quantity with evenly spaced values, each of which stands for all within half a step.
    fn moments(&self, values: &[f64], of: impl Fn(usize) -> usize) -> (f64, f64) {
        let all = self.probabilities();
        let within = UNIFORM * values.get(1).map_or(0.0, |next| next - values[0]);
        let mean: f64 = all.iter().enumerate().map(|(i, p)| p * values[of(i)]).sum();
        let square = |(i, p): (usize, &f64)| p * (values[of(i)] - mean).powi(2);
        let variance: f64 = all.iter().enumerate().map(square).sum();
        (mean, variance.sqrt().hypot(within))
    }

    /// Probability that readings are as surprising as these if the model is right: each is compared with its predictive distribution, given those
    /// before it. Do not trust a belief whose misfit is below .001, however sharp it is: the walls, the wind or the number of leaks are others.
    pub fn misfit(&self) -> f64 {
        if self.variance > 0.0 {
            cdf(-self.surprise / self.variance.sqrt())
        } else {
            1.0
        }
    }
}

fn normalised(mut logs: Vec<f64>) -> Vec<f64> {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logs.iter_mut().for_each(|log| *log = (*log - most).exp());
    let total: f64 = logs.iter().sum();
    logs.iter_mut().for_each(|p| *p /= total);
    logs
}
