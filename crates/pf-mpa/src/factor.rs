//! Likelihood of a quantized or plain range as a function of the distance. The noise grows with the distance.

use crate::sensor::RangeNoise;
use fewbits_core::columns::lengths_agree;
use fewbits_core::factor::{Factor, Feature, InCell, Tilted, Value, tilted_by_quadrature};
use fewbits_core::{Cell, Columns, Error, Gaussian};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, within};
use fewbits_numerics::kernels::{scalar, vectorised};
use fewbits_numerics::normal;
use nalgebra::SVector;

/// `p(observation | d)` for a measurement `z = d + v`, `v ~ N(0, sigma(d)^2)`. The noise is evaluated at the *hypothesised* distance `d`.
///
/// | observation | probability |
/// |---|---|
/// | the cell `[lower, upper)` of `z` | `share (Phi((upper - d)/sigma(d)) - Phi((lower - d)/sigma(d)))` |
/// | a symbol over a link that inverts bits | `sum_q p_q P(z in cell q)` |
/// | `z` itself | `N(z; d, sigma(d)^2)` |
/// | nothing | a constant |
///
/// All are in closed form and in logarithms, so tails do not underflow. The first and the last cell are half-infinite, because the
/// quantizer clamps.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeFactor {
    noise: RangeNoise,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Value(f64),
    Cell {
        lower: f64,
        upper: f64,
        log_share: f64,
        /// The cell with both ends finite.
        nominal: [f64; 2],
    },
    Levels {
        /// All edges of the cells, the outermost finite too.
        edges: Vec<f64>,
        given: Vec<f64>,
    },
    Constant(f64),
}

impl RangeFactor {
    /// The likelihood of an unquantized range.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn value(range: f64, noise: RangeNoise) -> Result<Self, ArgumentError> {
        let kind = Kind::Value(finite("range", range)?);
        Ok(Self { noise, kind })
    }

    /// The range lies in `cell`; the report arrives with probability `share`. `nominal` is the cell with both ends finite: message
    /// passing draws from it, and the reconstruction is its middle.
    ///
    /// # Errors
    /// If a nominal end is not finite or the ends are not increasing, or `share` is outside `(0, 1]`.
    pub fn in_cell(cell: Cell, nominal: [f64; 2], share: f64, noise: RangeNoise) -> Result<Self, ArgumentError> {
        within("share", share, f64::MIN_POSITIVE, 1.0)?;
        finite("nominal", nominal[0])?;
        finite("nominal", nominal[1])?;
        Cell::new(nominal[0], nominal[1])?;
        Ok(Self {
            noise,
            kind: Kind::Cell {
                lower: cell.lower(),
                upper: cell.upper(),
                log_share: share.ln(),
                nominal,
            },
        })
    }

    /// `sum_q given[q] P(z in cell q)`, the cells between consecutive `edges`, the first and the last cell half-infinite.
    pub(crate) fn levels(edges: Vec<f64>, given: Vec<f64>, noise: RangeNoise) -> Self {
        Self {
            noise,
            kind: Kind::Levels { edges, given },
        }
    }

    /// An observation of the same probability at every distance.
    ///
    /// # Errors
    /// If `probability` is outside `[0, 1]`.
    pub fn constant(probability: f64, noise: RangeNoise) -> Result<Self, ArgumentError> {
        within("probability", probability, 0.0, 1.0)?;
        Ok(Self {
            noise,
            kind: Kind::Constant(probability),
        })
    }

    /// The noise of the range.
    pub fn noise(&self) -> &RangeNoise {
        &self.noise
    }

    /// The cell with both ends finite; `None` unless the observation is a cell.
    pub fn nominal_cell(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Cell { nominal, .. } => Some(*nominal),
            _ => None,
        }
    }

    /// The observation as a value with an additional variance: the middle of the cell and `width^2 / 12`. `None` if nothing was
    /// observed, or a number is not finite.
    pub fn reconstruction(&self) -> Option<(f64, f64)> {
        let uniform = |[a, b]: [f64; 2]| (0.5 * (a + b), (b - a) * (b - a) / 12.0);
        let (mean, variance) = match &self.kind {
            Kind::Value(range) => (*range, 0.0),
            Kind::Cell { nominal, .. } => uniform(*nominal),
            Kind::Levels { edges, given } => {
                let cells = || edges.windows(2).zip(given).map(|(e, p)| (uniform([e[0], e[1]]), *p));
                let total: f64 = given.iter().sum();
                let mean = cells().map(|((m, _), p)| p * m).sum::<f64>() / total;
                let spread = |((m, v), p): ((f64, f64), f64)| p * (v + (m - mean) * (m - mean));
                (mean, cells().map(spread).sum::<f64>() / total)
            }
            Kind::Constant(_) => return None,
        };
        (mean.is_finite() && variance.is_finite()).then_some((mean, variance))
    }

    /// `ln p(observation | d)` at the distance `d`.
    #[inline]
    pub fn log_probability(&self, d: f64) -> f64 {
        let deviation = self.noise.deviation(d);
        match &self.kind {
            Kind::Value(range) => normal::log_pdf((range - d) / deviation) - deviation.ln(),
            Kind::Cell {
                lower,
                upper,
                log_share,
                ..
            } => log_share + log_inside(*lower, *upper, d, deviation),
            Kind::Levels { edges, given } => log_mixed(edges, given, d, deviation),
            Kind::Constant(p) => p.ln(),
        }
    }

    /// Whether the cell is wider than 17 noise deviations at all these distances. Then only the nearer edge matters: the other tail is
    /// below the rounding of the sum.
    fn is_wide(&self, width: f64, distances: &[f64]) -> bool {
        let furthest = distances
            .iter()
            .fold(0.0, |most: f64, d| if d.abs() > most { d.abs() } else { most });
        width > 17.0 * self.noise.deviation(furthest)
    }

    fn features(&self) -> Vec<Feature> {
        let feature = |location: f64| Feature {
            location,
            width: self.noise.deviation(location),
        };
        let mut features: Vec<Feature> = match &self.kind {
            Kind::Value(range) => vec![feature(*range)],
            Kind::Cell { lower, upper, .. } => [*lower, *upper]
                .into_iter()
                .filter(|e| e.is_finite())
                .map(feature)
                .collect(),
            Kind::Levels { edges, .. } => edges.iter().copied().map(feature).collect(),
            Kind::Constant(_) => return Vec::new(),
        };
        // Noise that grows with the distance has a kink at distance zero.
        if self.noise.relative() > 0.0 {
            let width = features.iter().map(|f| f.width).fold(f64::INFINITY, f64::min);
            features.push(Feature { location: 0.0, width });
        }
        features
    }
}

/// `ln P(d + v in [lower, upper))`.
#[inline]
pub(crate) fn log_inside(lower: f64, upper: f64, d: f64, deviation: f64) -> f64 {
    if upper == f64::INFINITY {
        normal::log_cdf((d - lower) / deviation)
    } else if lower == f64::NEG_INFINITY {
        normal::log_cdf((upper - d) / deviation)
    } else {
        normal::log_interval((lower - d) / deviation, (upper - d) / deviation)
    }
}

/// `ln sum_q given[q] P(d + v in cell q)`.
fn log_mixed(edges: &[f64], given: &[f64], d: f64, deviation: f64) -> f64 {
    let last = given.len() - 1;
    let term = |q: usize| {
        let lower = if q == 0 { f64::NEG_INFINITY } else { edges[q] };
        let upper = if q == last { f64::INFINITY } else { edges[q + 1] };
        given[q].ln() + log_inside(lower, upper, d, deviation)
    };
    let terms = (0..given.len()).filter(|q| given[*q] > 0.0).map(term);
    let largest = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + terms.map(|t| (t - largest).exp()).sum::<f64>().ln()
}

/// Adds `log(d)` to the log weight of every distance, vectorised. `log` must be inlined for that.
#[inline(always)]
fn add_to_each(log_weights: &mut [f64], distances: &[f64], log: impl Fn(f64) -> f64) {
    vectorised(
        #[inline(always)]
        || {
            for (log_weight, d) in log_weights.iter_mut().zip(distances) {
                *log_weight += log(*d);
            }
        },
    );
}

impl Factor<1> for RangeFactor {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.log_probability(m[0])
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        if !lengths_agree(means, log_weights) {
            return;
        }
        let (noise, distances) = (self.noise, means[0]);
        match &self.kind {
            Kind::Value(range) => add_to_each(
                log_weights,
                distances,
                #[inline(always)]
                |d| {
                    let deviation = noise.deviation(d);
                    let t = (range - d) / deviation;
                    -(0.5 * t * t + normal::LN_SQRT_2PI + scalar::ln(deviation))
                },
            ),
            Kind::Cell {
                lower,
                upper,
                log_share,
                ..
            } => {
                // A half-infinite cell has one edge; the sign is that of the slope.
                let cut = if *upper == f64::INFINITY {
                    Some((*lower, 1.0))
                } else if *lower == f64::NEG_INFINITY {
                    Some((*upper, -1.0))
                } else {
                    None
                };
                match cut {
                    Some((edge, sign)) => add_to_each(
                        log_weights,
                        distances,
                        #[inline(always)]
                        |d| log_share + scalar::log_cdf(sign * ((d - edge) / noise.deviation(d))),
                    ),
                    None if self.is_wide(upper - lower, distances) => add_to_each(
                        log_weights,
                        distances,
                        #[inline(always)]
                        |d| {
                            let (above, below) = (d - lower, upper - d);
                            let inside = if above < below { above } else { below };
                            log_share + scalar::log_cdf(inside / noise.deviation(d))
                        },
                    ),
                    None => add_to_each(
                        log_weights,
                        distances,
                        #[inline(always)]
                        |d| {
                            let deviation = noise.deviation(d);
                            log_share + scalar::log_interval((lower - d) / deviation, (upper - d) / deviation)
                        },
                    ),
                }
            }
            Kind::Levels { .. } | Kind::Constant(_) => {
                for (log_weight, d) in log_weights.iter_mut().zip(distances) {
                    *log_weight += self.log_probability(*d);
                }
            }
        }
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        if let Kind::Constant(p) = self.kind {
            return Tilted::unchanged(prior, p.ln());
        }
        // Noise that does not depend on the distance has closed forms.
        if self.noise.relative() == 0.0 {
            let variance = self.noise.at_sensor() * self.noise.at_sensor();
            match &self.kind {
                Kind::Value(range) => return Value::scalar(*range, variance)?.tilted(prior),
                Kind::Cell {
                    lower,
                    upper,
                    log_share,
                    ..
                } => {
                    let cell = Cell::new(*lower, *upper)?;
                    return InCell::new(cell, variance, 0.0, log_share.exp())?.tilted(prior);
                }
                Kind::Levels { .. } | Kind::Constant(_) => {}
            }
        }
        tilted_by_quadrature(prior, self.features(), |d, logs| self.add_log_likelihoods(&[d], logs))
    }
}
