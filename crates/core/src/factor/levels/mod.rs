//! A likelihood that is constant in each cell of the noisy measurement.

mod stored;
mod sweep;
mod tilted;

use super::moments::Feature;
use crate::cell::Cell;
use crate::noise::Noise;
use crate::observation::Link;
use crate::sign::Sign;
use fewbits_numerics::error::{ArgumentError, all_finite, finite, within};
use fewbits_numerics::{kernels, normal};
use serde::{Deserialize, Serialize};

/// `p(observation | m) = s (floor + sum_i w_i P(m + n in cell i))` with noise `n` and a constant `s`.
///
/// | observation | cells | floor |
/// |---|---|---|
/// | sign bit over a link with arrival `a` and crossover `c` | a half-line with weight `a (1 - 2 c)` | `a c` |
/// | cell of a quantizer, perfect link | the cell | 0 |
/// | nothing from a censoring sensor, loss `l` | region of silence with weight `1 - l` | `l` |
/// | a symbol through any discrete channel, a bit of a pattern | each cell with the symbol's probability | 0 |
/// | a loss, a random silence | none | its probability |
///
/// The noise has one variance, or a deviation that grows with `m` ([`Noise`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "stored::Parts", into = "stored::Parts")]
pub struct Levels {
    cells: Cells,
    floor: f64,
    /// Logarithm of the constant `s`. The weight of a cell that is alone and without a floor is part of it.
    log_scale: f64,
    noise: Noise,
    /// Standard deviation of noise with one variance.
    deviation: f64,
}

/// Cells with their weights, which are positive.
#[derive(Debug, Clone, PartialEq)]
enum Cells {
    None,
    One(Cell, f64),
    /// Increasing and disjoint. Of neighbours that touch, the weights differ.
    Many(Vec<(Cell, f64)>),
}

impl Cells {
    fn as_slice(&self) -> impl DoubleEndedIterator<Item = (Cell, f64)> + '_ {
        let (one, many) = match self {
            Self::None => (None, [].as_slice()),
            Self::One(cell, weight) => (Some((*cell, *weight)), [].as_slice()),
            Self::Many(cells) => (None, cells.as_slice()),
        };
        one.into_iter().chain(many.iter().copied())
    }
}

impl Levels {
    /// `floor + weight P(m + n in cell)`.
    ///
    /// # Errors
    /// If the variance of the noise is not positive, `floor` or `weight` is negative, their sum exceeds one, or both are zero.
    #[inline]
    pub fn new(cell: Cell, noise: impl Into<Noise>, floor: f64, weight: f64) -> Result<Self, ArgumentError> {
        let noise = noise.into().checked()?;
        within("floor", floor, 0.0, 1.0)?;
        // Rounding of `loss + (1 - loss)` and its like is forgiven.
        within("floor + weight", floor + weight, f64::MIN_POSITIVE, 1.0 + 1e-12)?;
        within("weight", weight, 0.0, 1.0)?;
        let (log_scale, weight) = match floor > 0.0 || weight == 1.0 {
            true => (0.0, weight),
            false => (weight.ln(), 1.0),
        };
        let cells = match weight > 0.0 {
            true => Cells::One(cell, weight),
            false => Cells::None,
        };
        Ok(Self::of_parts(cells, floor, log_scale, noise))
    }

    #[inline]
    fn of_parts(cells: Cells, floor: f64, log_scale: f64, noise: Noise) -> Self {
        let deviation = match noise {
            Noise::Variance(variance) => variance.sqrt(),
            Noise::Range(noise) => noise.deviation(0.0),
        };
        Self {
            cells,
            floor,
            log_scale,
            noise,
            deviation,
        }
    }

    /// The measurement lies in `cell`, for sure.
    ///
    /// # Errors
    /// If the variance of the noise is not positive.
    pub fn certain(cell: Cell, noise: impl Into<Noise>) -> Result<Self, ArgumentError> {
        Self::new(cell, noise, 0.0, 1.0)
    }

    /// A sign bit at `threshold`, received over `link`.
    ///
    /// # Errors
    /// If `threshold` is not finite or the variance of the noise not positive.
    #[inline]
    pub fn sign(sign: Sign, threshold: f64, noise: impl Into<Noise>, link: &Link) -> Result<Self, ArgumentError> {
        let (arrives, crossover) = (link.arrival(), link.crossover());
        let cell = Cell::of_sign(sign, threshold)?;
        Self::new(cell, noise, arrives * crossover, arrives * (1.0 - 2.0 * crossover))
    }

    /// Nothing from a sensor that is silent if and only if its measurement lies in `cell`, over `link`.
    ///
    /// # Errors
    /// If the variance of the noise is not positive.
    pub fn silence(cell: Cell, noise: impl Into<Noise>, link: &Link) -> Result<Self, ArgumentError> {
        Self::new(cell, noise, link.loss(), 1.0 - link.loss())
    }

    /// `p P(m + n outside cell)`: a known loss from a sensor that is silent if and only if its measurement lies in `cell`, with `p` the
    /// link's [`lost_given_sent`](crate::Link::lost_given_sent). Impossible if `cell` is the whole line.
    ///
    /// # Errors
    /// If the variance of the noise is not positive or `p` is outside `(0, 1]`.
    pub fn outside(cell: &Cell, noise: impl Into<Noise>, p: f64) -> Result<Self, ArgumentError> {
        let edges: Vec<f64> = [cell.lower(), cell.upper()]
            .into_iter()
            .filter(|e| e.is_finite())
            .collect();
        let given = match (cell.lower().is_finite(), cell.upper().is_finite()) {
            (false, false) => return Self::constant(0.0),
            (true, false) => vec![p, 0.0],
            (false, true) => vec![0.0, p],
            (true, true) => vec![p, 0.0, p],
        };
        Self::partition(&edges, &given, noise)
    }

    /// `sum_i given_cell[i] P(m + n in cell i)`: cells between increasing `edges` (measurement units), the first and the last unbounded,
    /// and one probability for each of the `edges.len() + 1` cells.
    ///
    /// # Errors
    /// If an edge is not finite or not above the one before, the number of probabilities is wrong, one is outside `[0, 1]`, all are zero,
    /// or the variance of the noise is not positive.
    pub fn partition(edges: &[f64], given_cell: &[f64], noise: impl Into<Noise>) -> Result<Self, ArgumentError> {
        all_finite("edges", edges)?;
        if let Some(pair) = edges.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(ArgumentError::new("edges", format!("{} before {}", pair[0], pair[1]), "increasing edges"));
        }
        if given_cell.len() != edges.len() + 1 {
            let text = format!("{} probabilities", given_cell.len());
            return Err(ArgumentError::new("given_cell", text, format!("{}, one per cell", edges.len() + 1)));
        }
        if let Some(bad) = given_cell.iter().find(|p| !(0.0..=1.0).contains(*p)) {
            return Err(ArgumentError::new("given_cell", bad, "probabilities in [0, 1]"));
        }
        // Neighbours of equal probability are one cell; cells that cannot cause the observation are left out.
        let (mut cells, mut first) = (Vec::new(), 0);
        for last in 0..given_cell.len() {
            if given_cell.get(last + 1) == Some(&given_cell[last]) {
                continue;
            }
            if given_cell[last] > 0.0 {
                let lower = if first == 0 {
                    f64::NEG_INFINITY
                } else {
                    edges[first - 1]
                };
                let upper = edges.get(last).copied().unwrap_or(f64::INFINITY);
                cells.push((Cell::new(lower, upper)?, given_cell[last]));
            }
            first = last + 1;
        }
        match cells.as_slice() {
            [] => Err(ArgumentError::new("given_cell", "all zero", "an observation that some cell can cause")),
            [(cell, weight)] => Self::new(*cell, noise, 0.0, *weight),
            _ => Ok(Self::of_parts(Cells::Many(cells), 0.0, 0.0, noise.into().checked()?)),
        }
    }

    /// As [`partition`](Self::partition) on a circle: `edges` within one period, and a probability for the cell after each edge; the last cell
    /// goes on to the first edge. Exact for a measurement within a period of the middle of the edges, which [`crate::circle`] sees to.
    ///
    /// A bit that says on which side of a prediction of 350 degrees a compass points, by the shorter way:
    ///
    /// ```
    /// use fewbits_core::factor::Levels;
    /// let left = Levels::around(360.0, &[170.0, 350.0], &[1.0, 0.0], 25.0)?;
    /// assert!(left.log_probability(340.0) > -0.1 && left.log_probability(10.0) < -5.0);
    /// assert!((left.log_probability(350.0).exp() - 0.5).abs() < 1e-9);
    /// assert!((left.log_probability(170.0).exp() - 0.5).abs() < 1e-9); // the far side
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As there; if the period is not positive and finite, or the edges span a period or more.
    pub fn around(
        period: f64,
        edges: &[f64],
        given_cell: &[f64],
        noise: impl Into<Noise>,
    ) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::positive("period", period)?;
        let (Some(first), Some(last)) = (edges.first(), edges.last()) else {
            return Err(ArgumentError::new("edges", "none", "at least one edge"));
        };
        if last - first >= period {
            let text = format!("{first} to {last}");
            return Err(ArgumentError::new("edges", text, format!("edges within a period of {period}")));
        }
        if given_cell.len() != edges.len() {
            let text = format!("{} probabilities", given_cell.len());
            return Err(ArgumentError::new("given_cell", text, format!("{}, one per edge", edges.len())));
        }
        let turns = [-1.0, 0.0, 1.0];
        let all: Vec<f64> = turns
            .iter()
            .flat_map(|turn| edges.iter().map(move |e| e + turn * period))
            .collect();
        let before = &given_cell[given_cell.len() - 1..];
        Self::partition(&all, &[before, &given_cell.repeat(turns.len())].concat(), noise)
    }

    /// An observation of the same probability under every measurement. Zero makes it impossible.
    ///
    /// # Errors
    /// If `probability` is outside `[0, 1]`.
    pub fn constant(probability: f64) -> Result<Self, ArgumentError> {
        within("probability", probability, 0.0, 1.0)?;
        Ok(Self::of_probability(probability))
    }

    pub(super) fn of_probability(probability: f64) -> Self {
        Self::of_parts(Cells::None, probability, 0.0, Noise::Variance(1.0))
    }

    /// The same, with `log` added to every log likelihood.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn times_exp(self, log: f64) -> Result<Self, ArgumentError> {
        let log_scale = finite("log", self.log_scale + log)?;
        Ok(Self { log_scale, ..self })
    }

    /// `ln p(observation)` if it is the same under every measurement.
    pub fn as_constant(&self) -> Option<f64> {
        matches!(self.cells, Cells::None).then(|| self.floor.ln() + self.log_scale)
    }

    /// The noise of the measurement.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// `p(observation | measurement)` as a function of the noisy measurement: the cells of positive probability, each with it.
    pub fn pieces(&self) -> Vec<(Cell, f64)> {
        let (scale, mut pieces, mut end) = (self.log_scale.exp(), Vec::new(), f64::NEG_INFINITY);
        let mut push = |lower: f64, upper: f64, p: f64| {
            if let (Ok(cell), true) = (Cell::new(lower, upper), p > 0.0) {
                pieces.push((cell, p));
            }
        };
        for (cell, weight) in self.cells.as_slice() {
            push(end, cell.lower(), scale * self.floor);
            push(cell.lower(), cell.upper(), scale * (self.floor + weight));
            end = cell.upper();
        }
        push(end, f64::INFINITY, scale * self.floor);
        pieces
    }

    /// Standard deviation of the noise at the noise-free measurement `m`.
    #[inline(always)]
    fn deviation(&self, m: f64) -> f64 {
        match &self.noise {
            Noise::Variance(_) => self.deviation,
            Noise::Range(noise) => noise.deviation(m),
        }
    }

    /// `ln p(observation | m)`.
    #[inline]
    pub fn log_probability(&self, m: f64) -> f64 {
        let deviation = self.deviation(m);
        let own = match &self.cells {
            Cells::None => self.floor.ln(),
            Cells::One(cell, _) if self.floor == 0.0 => {
                of_cell(cell, m, deviation, normal::log_cdf, normal::log_interval)
            }
            Cells::One(cell, weight) => {
                (self.floor + weight * of_cell(cell, m, deviation, normal::cdf, normal::interval)).ln()
            }
            Cells::Many(cells) => self.log_sum(cells, m, deviation),
        };
        self.log_scale + own
    }

    /// `ln(floor + sum_i w_i P(m + n in cell i))`, over logarithms, so that tails do not underflow.
    fn log_sum(&self, cells: &[(Cell, f64)], m: f64, deviation: f64) -> f64 {
        if m.is_nan() {
            return m;
        }
        let logs = cells.iter().map(|(cell, weight)| {
            let inside = match m.is_infinite() {
                // Only an unbounded cell on that side holds an infinite measurement.
                true if m == cell.lower() || m == cell.upper() => 0.0,
                true => f64::NEG_INFINITY,
                false => of_cell(cell, m, deviation, normal::log_cdf, normal::log_interval),
            };
            weight.ln() + inside
        });
        let logs: Vec<f64> = logs.chain((self.floor > 0.0).then(|| self.floor.ln())).collect();
        kernels::log_sum_exp(&logs).min(0.0)
    }

    /// Where the likelihood changes: the edges of the cells, each as wide as the noise.
    pub(crate) fn features(&self) -> Vec<Feature> {
        let mut edges: Vec<f64> = self
            .cells
            .as_slice()
            .flat_map(|(c, _)| [c.lower(), c.upper()])
            .collect();
        edges.dedup();
        let finite = edges.into_iter().filter(|edge| edge.is_finite());
        let mut features: Vec<Feature> = finite
            .map(|location| Feature {
                location,
                width: self.deviation(location),
            })
            .collect();
        // A deviation that grows with the measurement has a kink at zero.
        if matches!(self.noise, Noise::Range(_)) && !features.is_empty() {
            let width = features.iter().map(|f| f.width).fold(f64::INFINITY, f64::min);
            features.push(Feature { location: 0.0, width });
        }
        features
    }
}

/// Applies `half_line` to the signed distance of `m` from the only finite edge, positive inside the cell, or `interval` to both edges
/// minus `m`. All in standard deviations of the noise.
#[inline]
fn of_cell(
    cell: &Cell,
    m: f64,
    deviation: f64,
    half_line: impl Fn(f64) -> f64,
    interval: impl Fn(f64, f64) -> f64,
) -> f64 {
    let (lower, upper) = (cell.lower(), cell.upper());
    if upper == f64::INFINITY {
        half_line((m - lower) / deviation)
    } else if lower == f64::NEG_INFINITY {
        half_line((upper - m) / deviation)
    } else {
        interval((lower - m) / deviation, (upper - m) / deviation)
    }
}
