//! The normal density.

use super::{CellMoments, Density, edges};
use crate::error::Error;
use fewbits_numerics::error::{finite, positive};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_numerics::{kernels, normal};

/// In cells over which a normal density changes by less than a factor of `exp(2)`, eight quadrature nodes are exact to rounding.
const NARROW: f64 = 1.0;
/// Number of nodes in a narrow cell.
const NODES: usize = 8;
/// Number of cells whose exponentials are computed together.
const BATCH: usize = 16;

/// The normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normal {
    mean: f64,
    deviation: f64,
}

impl Normal {
    /// The density of mean 0 and standard deviation 1.
    pub const STANDARD: Self = Self {
        mean: 0.0,
        deviation: 1.0,
    };

    /// Normal density with the given mean and standard deviation.
    ///
    /// # Errors
    /// If `mean` is not finite or `deviation` is not a positive number.
    pub fn with_deviation(mean: f64, deviation: f64) -> Result<Self, Error> {
        Ok(Self {
            mean: finite("mean", mean)?,
            deviation: positive("deviation", deviation)?,
        })
    }
}

impl Density for Normal {
    fn centre(&self) -> f64 {
        self.mean
    }

    #[inline]
    fn pdf(&self, x: f64) -> f64 {
        normal::pdf(x / self.deviation) / self.deviation
    }

    #[inline]
    fn cell(&self, a: f64, b: f64) -> CellMoments {
        let s = self.deviation;
        standard_cell(a / s, b / s).scaled(s)
    }

    /// The exponentials of narrow cells are computed many at a time.
    fn cells(&self, breakpoints: &[f64], cells: &mut [CellMoments]) {
        let s = self.deviation;
        for (batch, cells) in cells.chunks_mut(BATCH).enumerate() {
            let standard = |i: usize| {
                let (lower, upper) = edges(breakpoints, batch * BATCH + i);
                (lower / s, upper / s)
            };
            let mut densities = [[0.0; NODES]; BATCH];
            for (i, densities) in densities.iter_mut().enumerate().take(cells.len()) {
                let (a, b) = standard(i);
                if let Some((middle, half)) = narrow(a, b) {
                    *densities = log_densities(middle, half);
                }
            }
            kernels::exp(densities[..cells.len()].as_flattened_mut());
            for ((i, cell), densities) in cells.iter_mut().enumerate().zip(&densities) {
                let (a, b) = standard(i);
                let moments = match narrow(a, b) {
                    Some((middle, half)) => narrow_cell(middle, half, densities),
                    None => wide_cell(a, b),
                };
                *cell = moments.scaled(s);
            }
        }
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        let s = self.deviation;
        let (a, b, point) = (a / s, b / s, point / s);
        if point * point == f64::INFINITY {
            // The square is beyond all numbers, and its share may not be. Any place with mass is as far from the point.
            return (s * (normal::interval(a, b).sqrt() * point)).powi(2);
        }
        if let Some((middle, half)) = narrow(a, b) {
            // phi(middle + t) = phi(middle) exp(-t (middle + t / 2)).
            let density = |t: f64| (-t * (middle + 0.5 * t)).exp() * (middle + t - point) * (middle + t - point);
            return s * s * normal::pdf(middle) * gauss_legendre::<NODES>().sum(-half, half, density);
        }
        match normal::truncated_moments(a, b) {
            Ok(inside) => {
                let off = inside.mean - point;
                s * s * normal::interval(a, b) * (inside.variance + off * off)
            }
            Err(_) => 0.0,
        }
    }

    fn normal_deviation(&self) -> Option<f64> {
        Some(self.deviation)
    }

    fn extent(&self) -> (f64, f64) {
        // The cube root of the density has standard deviation sqrt(3).
        (-14.0 * self.deviation, 14.0 * self.deviation)
    }

    /// The cube root of a normal density is a normal density of three times the variance.
    fn companding(&self, levels: usize) -> Vec<f64> {
        let scale = 3f64.sqrt() * self.deviation;
        let mut edges = vec![0.0; levels - 1];
        for l in 1..levels.div_ceil(2) {
            let edge = scale * normal::quantile(l as f64 / levels as f64);
            edges[l - 1] = edge;
            edges[levels - 1 - l] = -edge;
        }
        edges
    }
}

/// Middle and half width of a cell that is narrow in the sense of [`NARROW`]; `None` for others.
#[inline]
fn narrow(a: f64, b: f64) -> Option<(f64, f64)> {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    (half * (middle.abs() + half) < NARROW).then_some((middle, half))
}

/// Moments of a cell of the standard normal density.
fn standard_cell(a: f64, b: f64) -> CellMoments {
    match narrow(a, b) {
        Some((middle, half)) => {
            let densities = log_densities(middle, half).map(kernels::scalar::exp);
            narrow_cell(middle, half, &densities)
        }
        None => wide_cell(a, b),
    }
}

/// Logarithms of the density at the nodes of a narrow cell, relative to that in its middle.
#[inline]
fn log_densities(middle: f64, half: f64) -> [f64; NODES] {
    let mut logs = [0.0; NODES];
    for (log, node) in logs.iter_mut().zip(gauss_legendre::<NODES>().nodes()) {
        let t = half * node;
        *log = -t * (middle + 0.5 * t);
    }
    logs
}

/// Moments of a narrow cell, given the density at its nodes relative to that in its middle.
#[inline]
fn narrow_cell(middle: f64, half: f64, densities: &[f64; NODES]) -> CellMoments {
    let rule = gauss_legendre::<NODES>();
    let (mut mass, mut first) = (0.0, 0.0);
    for ((node, weight), density) in rule.nodes().iter().zip(rule.weights()).zip(densities) {
        let p = weight * density;
        mass += p;
        first += p * node;
    }
    let offset = half * (first / mass);
    CellMoments {
        mass: normal::pdf(middle) * half * mass,
        from_lower: half + offset,
        to_upper: half - offset,
    }
}

/// Moments of a cell that is not narrow.
fn wide_cell(a: f64, b: f64) -> CellMoments {
    let (from_lower, to_upper) = if b == f64::INFINITY {
        (normal::inverse_mills(-a) - a, f64::INFINITY)
    } else if a == f64::NEG_INFINITY {
        (f64::INFINITY, normal::inverse_mills(b) + b)
    } else {
        match normal::truncated_moments(a, b) {
            Ok(inside) => (inside.mean - a, b - inside.mean),
            // An empty cell: its middle.
            Err(_) => (0.5 * (b - a), 0.5 * (b - a)),
        }
    };
    CellMoments {
        mass: normal::interval(a, b),
        from_lower,
        to_upper,
    }
}
