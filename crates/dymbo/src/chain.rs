//! The exact mean squared error of every scalar filter of this crate, without Monte Carlo.
//!
//! With the threshold at the prediction, what the sensor says depends on the state only through the prediction error
//! `e = theta - prediction`. So the error is a Markov chain of its own, whatever the state does:
//!
//! ```text
//! message j with probability p_j(e)          sign bit: Phi(e/sigma); word: a cell; K sensors: a count or a string
//! filtered error  e - d_j                    d_j: the filter's correction
//! next error      a (e - d_j) + u,  u ~ N(0, sigma_u^2)
//! ```
//!
//! Its density is smooth, so the trapezoid rule on a uniform grid of a few hundred points is exact to about `1e-12`; the
//! shift by `d_j` is evaluated inside the normal kernel and never interpolated.
//!
//! ```
//! use fewbits_dymbo::{chain, ScalarPlant};
//! let plant = ScalarPlant::new(0.9, 0.5, 1.0)?;
//! let exact = chain::dymbo_mse(&plant)?;
//! assert!((exact - 0.729_565_800_136).abs() < 1e-10);
//! # Ok::<(), fewbits_dymbo::Error>(())
//! ```

use crate::parallel::count_probability;
use crate::{Error, MultibitFilter, ParallelFilter, ScalarPlant, steady};
use fewbits_filters::Grid;
use fewbits_numerics::error::{ArgumentError, positive, within};
use fewbits_numerics::normal::{self, INV_SQRT_2PI, SQRT_2_OVER_PI};
use std::f64::consts::FRAC_2_PI;

/// What is sent for each prediction error, and how the filter corrects: the messages of one slot at one predicted variance.
#[derive(Debug, Clone, PartialEq)]
pub struct MessageLaw {
    corrections: Vec<f64>,
    measurement_variance: f64,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// A sign bit, delivered inverted with a probability.
    Bit { crossover: f64 },
    /// Cells of the innovation, by their finite edges.
    Word { edges: Vec<f64> },
    /// The number of `+1` among this many sensors.
    Count { sensors: usize },
    /// One bit after the other, each against the estimate so far; the gains of the steps.
    Sequence { gains: Vec<f64> },
}

/// Most sensors whose bit strings are enumerated.
const LONGEST_SEQUENCE: usize = 12;

impl MessageLaw {
    /// A sign bit through a link of crossover `actual`, heard by a filter that believes it to be `assumed`.
    ///
    /// # Errors
    /// Probabilities outside `[0, 1/2]`.
    pub fn bit(plant: &ScalarPlant, predicted_variance: f64, assumed: f64, actual: f64) -> Result<Self, Error> {
        within("assumed", assumed, 0.0, 0.5)?;
        let gain = (1.0 - 2.0 * assumed) * SQRT_2_OVER_PI * plant.innovation_gain(predicted_variance);
        Ok(Self {
            corrections: vec![-gain, gain],
            measurement_variance: plant.measurement_variance(),
            kind: Kind::Bit {
                crossover: within("actual", actual, 0.0, 0.5)?,
            },
        })
    }

    /// A word of several bits.
    pub fn word(filter: &MultibitFilter, predicted_variance: f64) -> Self {
        let plant = filter.plant();
        let quantizer = filter.sensor().quantizer();
        let deviation = (predicted_variance + plant.measurement_variance()).sqrt();
        let gain = plant.innovation_gain(predicted_variance);
        Self {
            corrections: quantizer.centroids().iter().map(|y| gain * y).collect(),
            measurement_variance: plant.measurement_variance(),
            kind: Kind::Word {
                edges: quantizer.breakpoints().iter().map(|z| deviation * z).collect(),
            },
        }
    }

    /// The count of several sensors that answer at once.
    pub fn count(filter: &ParallelFilter, predicted_variance: f64) -> Self {
        Self {
            corrections: filter.table(predicted_variance).0,
            measurement_variance: filter.plant().measurement_variance(),
            kind: Kind::Count {
                sensors: filter.sensors(),
            },
        }
    }

    /// The bits of several sensors that answer one after the other, the threshold refreshed in between.
    ///
    /// # Errors
    /// More than 12 sensors, whose strings are too many.
    pub fn sequence(plant: &ScalarPlant, predicted_variance: f64, sensors: usize) -> Result<Self, Error> {
        within("sensors", sensors as f64, 0.0, LONGEST_SEQUENCE as f64)?;
        let mut p = predicted_variance;
        let mut gains = Vec::with_capacity(sensors);
        for _ in 0..sensors {
            gains.push(SQRT_2_OVER_PI * plant.innovation_gain(p));
            p = plant.filtered_variance(p, FRAC_2_PI);
        }
        let corrections = (0..1_usize << sensors)
            .map(|string| gains.iter().enumerate().map(|(i, gain)| signed(string, i) * gain).sum())
            .collect();
        Ok(Self {
            corrections,
            measurement_variance: plant.measurement_variance(),
            kind: Kind::Sequence { gains },
        })
    }

    /// The filter's correction for each message, in state units.
    pub fn corrections(&self) -> &[f64] {
        &self.corrections
    }

    /// Probability of a message when the prediction error is `error`.
    pub fn probability(&self, message: usize, error: f64) -> f64 {
        let sigma = self.measurement_variance.sqrt();
        match &self.kind {
            Kind::Bit { crossover } => {
                crossover + (1.0 - 2.0 * crossover) * normal::cdf(signed(message, 0) * error / sigma)
            }
            Kind::Word { edges } => {
                let low = if message == 0 {
                    f64::NEG_INFINITY
                } else {
                    edges[message - 1]
                };
                let high = edges.get(message).copied().unwrap_or(f64::INFINITY);
                normal::interval((low - error) / sigma, (high - error) / sigma)
            }
            Kind::Count { sensors } => count_probability(*sensors, message, error, self.measurement_variance),
            Kind::Sequence { gains } => {
                let (mut probability, mut left) = (1.0, error);
                for (i, gain) in gains.iter().enumerate() {
                    let sign = signed(message, i);
                    probability *= normal::cdf(sign * left / sigma);
                    left -= sign * gain;
                }
                probability
            }
        }
    }
}

/// Bit `i` of a string as `+1` or `-1`.
fn signed(string: usize, i: usize) -> f64 {
    if string >> i & 1 == 1 { 1.0 } else { -1.0 }
}

/// Grid spacing as a share of the smaller of the two noise deviations.
const SPACING: f64 = 0.4;
/// Half width of the grid in deviations of the predicted error.
const WIDTH: f64 = 14.0;
/// Deviations beyond which the kernel is below rounding.
const REACH: f64 = 8.6;
/// More points than this are refused: the plant has next to no process noise, and the chain next to no end.
const MOST_POINTS: f64 = 40_000.0;
/// A density at the edge of the grid above this share of its peak asks for a wider grid.
const EDGE: f64 = 1e-13;
/// Change of the density, in total mass, at which the power iteration has settled.
const SETTLED: f64 = 1e-14;
/// Power iterations after which a chain is given up.
const MOST_STEPS: usize = 200_000;

/// The density of the prediction error.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorChain {
    plant: ScalarPlant,
    grid: Grid,
    density: Vec<f64>,
}

impl ErrorChain {
    fn grid(plant: &ScalarPlant, half_width: f64) -> Result<Grid, Error> {
        let finest = positive("process_variance", plant.process_variance())?
            .min(plant.measurement_variance())
            .sqrt();
        let spacing = SPACING * finest;
        if 2.0 * half_width / spacing > MOST_POINTS {
            let expected = "enough process noise for a grid of at most 40000 points";
            return Err(ArgumentError::new("process_variance", plant.process_variance(), expected).into());
        }
        Ok(Grid::symmetric(half_width, spacing)?)
    }

    /// The chain after one prediction from a normal filtered error of variance `filtered_variance`.
    ///
    /// # Errors
    /// No process noise: the chain then has no density on a grid.
    pub fn from_normal(plant: &ScalarPlant, filtered_variance: f64) -> Result<Self, Error> {
        let variance = plant.dynamics().predict_variance(filtered_variance);
        let grid = Self::grid(plant, WIDTH * variance.max(plant.process_variance()).sqrt())?;
        let density = grid
            .nodes()
            .map(|e| normal::log_pdf_with(e, 0.0, variance).exp())
            .collect();
        Ok(Self {
            plant: *plant,
            grid,
            density,
        })
    }

    /// The chain at `n = 1` after a first message of the given resolution about a state of unknown place: the error of the
    /// rounded sample has density `[Phi((e + tau/2)/sigma) - Phi((e - tau/2)/sigma)]/tau`.
    ///
    /// # Errors
    /// No process noise, a resolution that is not positive.
    pub fn from_first_message(plant: &ScalarPlant, resolution: f64) -> Result<Self, Error> {
        let tau = positive("resolution", resolution)?;
        let sigma = plant.measurement_variance().sqrt();
        let start_width = 0.5 * tau + 9.0 * sigma;
        let a = plant.coefficient().abs();
        let steady = plant.steady_state(FRAC_2_PI)?.predicted_variance;
        let width = (WIDTH * steady.sqrt()).max(a * start_width + 9.0 * plant.process_variance().sqrt());
        let grid = Self::grid(plant, width)?;
        let mut chain = Self {
            plant: *plant,
            grid,
            density: vec![0.0; grid.points()],
        };
        let from = Self::grid(plant, start_width)?;
        for e in from.nodes() {
            let mass = from.spacing() * normal::interval((e - 0.5 * tau) / sigma, (e + 0.5 * tau) / sigma) / tau;
            chain.add_kernel(plant.coefficient() * e, mass);
        }
        Ok(chain)
    }

    /// Adds `mass` spread by the process noise around `centre`.
    fn add_kernel(&mut self, centre: f64, mass: f64) {
        let deviation = self.plant.process_variance().sqrt();
        let scale = mass * INV_SQRT_2PI / deviation;
        let reached = self
            .grid
            .indices_within(centre - REACH * deviation, centre + REACH * deviation);
        for i in reached {
            let z = (self.grid.node(i) - centre) / deviation;
            self.density[i] += scale * (-0.5 * z * z).exp();
        }
    }

    /// `E e^2` before the message.
    pub fn predicted_mse(&self) -> f64 {
        let sum: f64 = self.grid.nodes().zip(&self.density).map(|(e, p)| e * e * p).sum();
        sum * self.grid.spacing()
    }

    /// `E (e - d)^power` after the message.
    pub fn filtered_moment(&self, law: &MessageLaw, power: i32) -> f64 {
        let sum: f64 = self
            .grid
            .nodes()
            .zip(&self.density)
            .map(|(e, p)| p * moment(law, e, power))
            .sum();
        sum * self.grid.spacing()
    }

    /// Mean squared error after the message.
    pub fn filtered_mse(&self, law: &MessageLaw) -> f64 {
        self.filtered_moment(law, 2)
    }

    /// Sends a message and predicts: the density of the next prediction error.
    pub fn advance(&mut self, law: &MessageLaw) {
        let mut next = Self {
            density: vec![0.0; self.density.len()],
            ..*self
        };
        for (e, p) in self.grid.nodes().zip(&self.density) {
            for (j, correction) in law.corrections.iter().enumerate() {
                let mass = p * self.grid.spacing() * law.probability(j, e);
                next.add_kernel(self.plant.coefficient() * (e - correction), mass);
            }
        }
        self.density = next.density;
    }

    /// The transition of [`ErrorChain::advance`] as a matrix: for each node its first successor and their weights.
    fn transition(&self, law: &MessageLaw) -> Vec<(usize, Vec<f64>)> {
        let mut column = Self {
            density: vec![0.0; self.density.len()],
            ..*self
        };
        let unit = self.grid.spacing();
        let deviation = self.plant.process_variance().sqrt();
        let a = self.plant.coefficient();
        self.grid
            .nodes()
            .map(|e| {
                let (mut first, mut end) = (self.grid.points(), 0);
                for (j, correction) in law.corrections.iter().enumerate() {
                    let centre = a * (e - correction);
                    column.add_kernel(centre, unit * law.probability(j, e));
                    let reached = self
                        .grid
                        .indices_within(centre - REACH * deviation, centre + REACH * deviation);
                    if !reached.is_empty() {
                        (first, end) = (first.min(reached.start), end.max(reached.end));
                    }
                }
                let first = first.min(end);
                let weights = column.density[first..end].to_vec();
                column.density[first..end].fill(0.0);
                (first, weights)
            })
            .collect()
    }

    /// Iterates one law until the density settles.
    fn settle(&mut self, law: &MessageLaw) -> Result<(), Error> {
        let transition = self.transition(law);
        let mut next = vec![0.0; self.density.len()];
        for _ in 0..MOST_STEPS {
            next.fill(0.0);
            for ((first, weights), p) in transition.iter().zip(&self.density) {
                for (n, w) in next[*first..].iter_mut().zip(weights) {
                    *n += w * p;
                }
            }
            let total = next.iter().sum::<f64>() * self.grid.spacing();
            let mut change = 0.0;
            for (n, p) in next.iter_mut().zip(&self.density) {
                *n /= total;
                change += (*n - p).abs();
            }
            std::mem::swap(&mut self.density, &mut next);
            if change * self.grid.spacing() <= SETTLED * (self.density.len() as f64).sqrt() {
                return Ok(());
            }
        }
        Err(Error::NotConverged {
            what: "the error chain",
            iterations: MOST_STEPS,
        })
    }

    fn spills(&self) -> bool {
        let peak = self.density.iter().copied().fold(0.0, f64::max);
        let ends = [self.density.first(), self.density.last()];
        ends.into_iter().flatten().any(|p| *p > EDGE * peak)
    }
}

fn moment(law: &MessageLaw, error: f64, power: i32) -> f64 {
    let terms = law.corrections.iter().enumerate();
    terms
        .map(|(j, d)| law.probability(j, error) * (error - d).powi(power))
        .sum()
}

/// What the error settles to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StationaryError {
    /// Mean squared error before a message.
    pub predicted_mse: f64,
    /// Mean squared error after a message.
    pub filtered_mse: f64,
    /// `E e^4/(E e^2)^2` after a message: 3 for a normal error.
    pub kurtosis: f64,
}

/// The stationary error under one law of messages, e.g. that at the filter's steady predicted variance.
///
/// # Errors
/// A plant with `|a| > 1` (the chain has no stationary law) or without process noise; [`Error::NotConverged`].
pub fn stationary(plant: &ScalarPlant, law: &MessageLaw) -> Result<StationaryError, Error> {
    let coefficient = plant.coefficient();
    if coefficient.abs() > 1.0 {
        return Err(Error::UnstablePlant { coefficient });
    }
    let largest = law.corrections.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
    // A rough normal start; the width follows the density if this guess is too small.
    let mut guess = plant.steady_state(FRAC_2_PI)?.filtered_variance.max(largest * largest);
    loop {
        let mut chain = ErrorChain::from_normal(plant, guess)?;
        chain.settle(law)?;
        if !chain.spills() {
            let filtered_mse = chain.filtered_mse(law);
            return Ok(StationaryError {
                predicted_mse: chain.predicted_mse(),
                filtered_mse,
                kurtosis: chain.filtered_moment(law, 4) / (filtered_mse * filtered_mse),
            });
        }
        guess = 4.0 * guess + plant.process_variance();
    }
}

/// Exact stationary mean squared error of the Dymbo filter.
///
/// # Errors
/// As [`stationary`].
pub fn dymbo_mse(plant: &ScalarPlant) -> Result<f64, Error> {
    crossover_mse(plant, 0.0, 0.0)
}

/// Exact stationary mean squared error of the Dymbo filter on a link of crossover `actual` when it assumes `assumed`.
///
/// # Errors
/// As [`stationary`]; probabilities outside `[0, 1/2]`.
pub fn crossover_mse(plant: &ScalarPlant, assumed: f64, actual: f64) -> Result<f64, Error> {
    let p = plant
        .steady_state(steady::bit_information(assumed)?)?
        .predicted_variance;
    Ok(stationary(plant, &MessageLaw::bit(plant, p, assumed, actual)?)?.filtered_mse)
}

/// Exact stationary mean squared error of the filter for words of several bits.
///
/// # Errors
/// As [`stationary`].
pub fn multibit_mse(filter: &MultibitFilter) -> Result<f64, Error> {
    let p = filter.plant().steady_state(filter.information())?.predicted_variance;
    Ok(stationary(filter.plant(), &MessageLaw::word(filter, p))?.filtered_mse)
}

/// Exact stationary mean squared error of several sensors that answer at once, and the variance the filter computes.
///
/// # Errors
/// As [`stationary`].
pub fn parallel_mse(filter: &ParallelFilter) -> Result<(f64, f64), Error> {
    let settled = steady::settle(filter.plant(), |p| filter.table(p).1)?;
    let law = MessageLaw::count(filter, settled.predicted_variance);
    Ok((stationary(filter.plant(), &law)?.filtered_mse, settled.filtered_variance))
}

/// Exact stationary mean squared error of several sensors that answer one after the other.
///
/// # Errors
/// As [`stationary`]; more than 12 sensors.
pub fn sequential_mse(plant: &ScalarPlant, sensors: usize) -> Result<f64, Error> {
    let p = steady::sequential_steady_state(plant, sensors)?.predicted_variance;
    Ok(stationary(plant, &MessageLaw::sequence(plant, p, sensors)?)?.filtered_mse)
}

/// Exact stationary error over the Kalman filter's: what [`steady::loss`] predicts.
///
/// # Errors
/// As [`stationary`].
pub fn true_loss(plant: &ScalarPlant) -> Result<f64, Error> {
    Ok(dymbo_mse(plant)? / plant.steady_state(1.0)?.filtered_variance)
}

/// One step of a transient: what the filter computes and what is true.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransientStep {
    /// Predicted variance `P` of the filter; at the first message its filtered one.
    pub predicted_variance: f64,
    /// Filtered variance `M` of the filter.
    pub filtered_variance: f64,
    /// Exact mean squared error.
    pub mse: f64,
}

/// Variances and exact errors of the Dymbo filter for `n = 0..=steps` after a first message of the given resolution about a
/// state of unknown place, when the filter starts from `initial_variance` (`sigma^2 + tau^2/12` is right).
///
/// # Errors
/// As [`ErrorChain::from_first_message`]; a negative variance.
pub fn first_message_transient(
    plant: &ScalarPlant,
    resolution: f64,
    initial_variance: f64,
    steps: usize,
) -> Result<Vec<TransientStep>, Error> {
    fewbits_numerics::error::non_negative("initial_variance", initial_variance)?;
    let mut chain = ErrorChain::from_first_message(plant, resolution)?;
    let mut filtered_variance = initial_variance;
    let mut transient = vec![TransientStep {
        predicted_variance: initial_variance,
        filtered_variance,
        mse: plant.measurement_variance() + resolution * resolution / 12.0,
    }];
    for _ in 0..steps {
        let predicted_variance = plant.dynamics().predict_variance(filtered_variance);
        filtered_variance = plant.filtered_variance(predicted_variance, FRAC_2_PI);
        let law = MessageLaw::bit(plant, predicted_variance, 0.0, 0.0)?;
        transient.push(TransientStep {
            predicted_variance,
            filtered_variance,
            mse: chain.filtered_mse(&law),
        });
        chain.advance(&law);
    }
    Ok(transient)
}

#[cfg(test)]
mod tests {
    use super::{
        ErrorChain, MessageLaw, crossover_mse, dymbo_mse, multibit_mse, parallel_mse, sequential_mse, stationary,
    };
    use crate::{CountFusion, Error, MultibitFilter, ParallelFilter, ScalarPlant};

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    #[test]
    fn messages_are_a_distribution() {
        let laws = [
            MessageLaw::bit(&plant(), 1.1, 0.1, 0.2).unwrap(),
            MessageLaw::word(&MultibitFilter::new(plant(), 3).unwrap(), 1.1),
            MessageLaw::count(&ParallelFilter::new(plant(), 4, CountFusion::Table).unwrap(), 1.1),
            MessageLaw::sequence(&plant(), 1.1, 4).unwrap(),
        ];
        for law in laws {
            for error in [-3.0, 0.2, 7.0] {
                let total: f64 = (0..law.corrections().len()).map(|j| law.probability(j, error)).sum();
                assert!((total - 1.0).abs() < 1e-12);
            }
        }
        assert!(MessageLaw::sequence(&plant(), 1.0, 13).is_err());
    }

    #[test]
    fn all_roads_lead_to_one_bit() {
        let dymbo = dymbo_mse(&plant()).unwrap();
        let one_word = multibit_mse(&MultibitFilter::new(plant(), 1).unwrap()).unwrap();
        let one_count = parallel_mse(&ParallelFilter::new(plant(), 1, CountFusion::Linear).unwrap())
            .unwrap()
            .0;
        let one_string = sequential_mse(&plant(), 1).unwrap();
        for other in [one_word, one_count, one_string] {
            assert!((dymbo - other).abs() < 1e-12);
        }
    }

    #[test]
    fn a_deaf_filter_has_the_plants_variance_and_scaling_holds() {
        let deaf = crossover_mse(&plant(), 0.5, 0.0).unwrap();
        let alone = plant().dynamics().stationary_variance().unwrap();
        assert!((deaf - alone).abs() < 1e-10);
        let scaled = ScalarPlant::new(-0.9, 0.5 * 9.0, 9.0).unwrap();
        assert!((dymbo_mse(&scaled).unwrap() / 9.0 - dymbo_mse(&plant()).unwrap()).abs() < 1e-12);
    }

    #[test]
    fn the_transient_forgets_its_start() {
        let law = MessageLaw::bit(
            &plant(),
            plant()
                .steady_state(std::f64::consts::FRAC_2_PI)
                .unwrap()
                .predicted_variance,
            0.0,
            0.0,
        )
        .unwrap();
        let mut chain = ErrorChain::from_first_message(&plant(), 1.0).unwrap();
        for _ in 0..60 {
            chain.advance(&law);
        }
        assert!((chain.filtered_mse(&law) - stationary(&plant(), &law).unwrap().filtered_mse).abs() < 1e-11);
    }

    #[test]
    fn refuses_chains_without_end() {
        let still = ScalarPlant::new(0.9, 0.0, 1.0).unwrap();
        assert!(matches!(dymbo_mse(&still), Err(Error::Argument(_))));
        let wild = ScalarPlant::new_unstable(1.2, 0.5, 1.0).unwrap();
        assert!(matches!(dymbo_mse(&wild), Err(Error::UnstablePlant { .. })));
        assert!(crossover_mse(&plant(), 0.6, 0.0).is_err());
        let nearly_still = ScalarPlant::new(0.9, 1e-16, 1.0).unwrap();
        assert!(dymbo_mse(&nearly_still).is_err() || dymbo_mse(&nearly_still).unwrap() > 0.0);
    }
}
