//! Optimal thresholds without a grid, by descent along the exact gradient.

use super::lbfgs::minimise;
use super::outcomes::SEARCH_PANEL;
use crate::Error;
use crate::decoding::decoder::moments;
use crate::observation::bank::IMPOSSIBLE;
use crate::observation::source::Nodes;
use crate::patterns::linear::sensors_of;
use crate::{Bank, BinaryQuantizer, CellGrid, Mask, PatternSensor, Source};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::{at_least_one, non_negative, refuse};
use fewbits_numerics::normal::pdf;
use fewbits_numerics::quadrature::gauss_legendre;
use rand::RngExt;

/// Largest number of sensors: the outcome tree of distinct sensors has `2^N` leaves.
const MAX_SENSORS: usize = 16;
/// Largest number of iterations of a run.
const MAX_ITERATIONS: usize = 400;
/// A run ends below this relative decrease of the error; the nodes of a search give errors to about `1e-10`.
const DECREASE: f64 = 1e-11;

/// The result of [`free_breakpoints`].
#[derive(Debug, Clone, PartialEq)]
pub struct FreeDesign {
    /// The sensors with their new thresholds.
    pub sensors: Vec<PatternSensor>,
    /// Exact mean squared error of the posterior mean.
    pub mse: f64,
}

/// Moves all thresholds of all sensors to a local minimum of the posterior mean's error.
///
/// The gradient is exact. With `E = sum_z M1^2/M0` and `xhat = M1/M0`, `dE = sum_z int (2 xhat x - xhat^2) dW_z`. One pass
/// through the outcome tree that propagates these leaf weights back gives the derivative with respect to every sensor's probabilities;
/// for thresholds `dP1/dt = -+phi((t - x)/s)/s`. The variables are each sensor's first threshold and the logarithms
/// of the gaps, which keeps the thresholds in order. They are optimised by L-BFGS.
///
/// Sensors with equal thresholds stay equal under the gradient. To break this symmetry there are `starts` runs, all but the first with
/// every threshold moved at random by up to `jitter` (in units of `V`, or of the source's standard deviation). The best run is returned.
///
/// # Errors
/// If there is no sensor or more than 16, a noise is below `1e-4` of the source's reach, `starts` is 0, or `jitter` is
/// negative or not finite.
pub fn free_breakpoints(
    source: &Source,
    sensors: &[PatternSensor],
    jitter: f64,
    starts: usize,
) -> Result<FreeDesign, Error> {
    at_least_one("sensors", sensors.len())?;
    at_least_one("starts", starts)?;
    non_negative("jitter", jitter)?;
    if sensors.len() > MAX_SENSORS {
        return refuse("sensors", sensors.len(), "at most 16 sensors");
    }
    for sensor in sensors {
        // The thresholds move, so the nodes must be dense everywhere.
        source.resolvable(sensor.noise_deviation())?;
    }
    // In the source's own unit, so that steps and tolerances do not depend on units.
    let unit = source.scale();
    let scaled = sensors
        .iter()
        .map(|s| rescaled(s, 1.0 / unit))
        .collect::<Result<Vec<_>, _>>()?;
    let found = from_starts(&source.rescaled(1.0 / unit)?, &scaled, jitter, starts)?;
    Ok(FreeDesign {
        sensors: found
            .sensors
            .iter()
            .map(|s| rescaled(s, unit))
            .collect::<Result<_, _>>()?,
        mse: unit * unit * found.mse,
    })
}

/// As [`free_breakpoints`], started from the patterns of `masks` on `grid`, one per sensor.
///
/// # Errors
/// As [`free_breakpoints`], and if a mask is out of the grid's range.
pub fn free_breakpoints_of_masks(
    source: &Source,
    grid: &CellGrid,
    masks: &[Mask],
    noise_deviation: f64,
    jitter: f64,
    starts: usize,
) -> Result<FreeDesign, Error> {
    free_breakpoints(source, &sensors_of(masks, grid, noise_deviation)?, jitter, starts)
}

/// The sensor in units in which all numbers are `factor` times as large.
fn rescaled(sensor: &PatternSensor, factor: f64) -> Result<PatternSensor, Error> {
    let breakpoints = sensor.quantizer().breakpoints().iter().map(|b| factor * b).collect();
    PatternSensor::with_deviation(BinaryQuantizer::new(breakpoints)?, factor * sensor.noise_deviation())
}

fn from_starts(source: &Source, sensors: &[PatternSensor], jitter: f64, starts: usize) -> Result<FreeDesign, Error> {
    let mut tree = OutcomeTree::new(source, sensors);
    let mut best = FreeDesign {
        sensors: sensors.to_vec(),
        mse: Bank::new(*source, sensors.to_vec())?.mmse()?,
    };
    let mut rng = Stream::new(0).named("free-breakpoints").rng();
    for start in 0..starts {
        let from: Vec<Vec<f64>> = sensors
            .iter()
            .map(|sensor| {
                let mut moved = sensor.quantizer().breakpoints().to_vec();
                if start > 0 {
                    let mut offset = || jitter * (2.0 * rng.random::<f64>() - 1.0);
                    moved.iter_mut().for_each(|t| *t += offset());
                }
                moved.sort_by(f64::total_cmp);
                // Gaps must be positive, since their logarithms are the variables.
                for j in 1..moved.len() {
                    moved[j] = moved[j].max(moved[j - 1] + 1e-9);
                }
                moved
            })
            .collect();
        let variables = minimise(|v, g| tree.value(v, g), encode(&from), MAX_ITERATIONS, DECREASE);
        let found = decode(&variables, &tree.lengths)
            .into_iter()
            .zip(sensors)
            .map(|(thresholds, sensor)| {
                PatternSensor::with_deviation(BinaryQuantizer::new(thresholds)?, sensor.noise_deviation())
            })
            .collect::<Result<Vec<_>, _>>();
        // A run in which two thresholds meet is left out; the other runs are used.
        let Ok(found) = found else { continue };
        let mse = Bank::new(*source, found.clone())?.mmse()?;
        if mse < best.mse {
            best = FreeDesign { sensors: found, mse };
        }
    }
    Ok(best)
}

/// Variables: first threshold and logarithms of the gaps, for one sensor after the other.
fn encode(thresholds: &[Vec<f64>]) -> Vec<f64> {
    thresholds
        .iter()
        .flat_map(|t| std::iter::once(t[0]).chain(t.windows(2).map(|w| (w[1] - w[0]).ln())))
        .collect()
}

fn decode(variables: &[f64], lengths: &[usize]) -> Vec<Vec<f64>> {
    let mut rest = variables;
    lengths
        .iter()
        .map(|&length| {
            let (own, after) = rest.split_at(length);
            rest = after;
            let mut sum = 0.0;
            own.iter()
                .enumerate()
                .map(|(j, v)| {
                    sum += if j == 0 { *v } else { v.exp() };
                    sum
                })
                .collect()
        })
        .collect()
}

/// Value and gradient of the error as a function of the thresholds, for distinct sensors.
struct OutcomeTree {
    nodes: Nodes,
    noise: Vec<f64>,
    lengths: Vec<usize>,
    variance: f64,
    /// `P(bit|x)` of each sensor.
    p: Vec<[Vec<f64>; 2]>,
    /// Derivative of the explained variance with respect to `p`.
    slope: Vec<[Vec<f64>; 2]>,
    /// `w p(x) P(bits so far|x)` at each depth.
    weight: Vec<Vec<f64>>,
    /// Expected leaf value `2 xhat x - xhat^2` below each depth.
    value: Vec<Vec<f64>>,
}

impl OutcomeTree {
    fn new(source: &Source, sensors: &[PatternSensor]) -> Self {
        let noise: Vec<f64> = sensors.iter().map(PatternSensor::noise_deviation).collect();
        let finest = noise.iter().copied().fold(f64::INFINITY, f64::min);
        let nodes = source.nodes(SEARCH_PANEL * finest, gauss_legendre::<8>());
        let row = || vec![0.0; nodes.len()];
        let pairs = || sensors.iter().map(|_| [row(), row()]).collect();
        let rows = || (0..=sensors.len()).map(|_| row()).collect();
        let mut weight: Vec<Vec<f64>> = rows();
        weight[0].copy_from_slice(&nodes.w);
        Self {
            noise,
            lengths: sensors.iter().map(|s| s.quantizer().breakpoints().len()).collect(),
            variance: source.variance(),
            p: pairs(),
            slope: pairs(),
            weight,
            value: rows(),
            nodes,
        }
    }

    fn value(&mut self, variables: &[f64], gradient: &mut [f64]) -> f64 {
        let all = decode(variables, &self.lengths);
        for (n, thresholds) in all.iter().enumerate() {
            let Ok(quantizer) = BinaryQuantizer::new(thresholds.clone()) else {
                // Overflowing or merged thresholds have an infinite error, so that the line search goes back.
                gradient.fill(0.0);
                return f64::INFINITY;
            };
            for (i, [p0, p1]) in quantizer
                .probabilities_at(&self.nodes.x, self.noise[n])
                .into_iter()
                .enumerate()
            {
                self.p[n][0][i] = p0;
                self.p[n][1][i] = p1;
            }
            self.slope[n].iter_mut().for_each(|row| row.fill(0.0));
        }
        let explained = self.walk(0);
        let mut at = 0;
        for (n, thresholds) in all.iter().enumerate() {
            let slopes = self.threshold_slopes(n, thresholds);
            // Moving the first threshold moves all thresholds; widening a gap moves those above it.
            let mut above = 0.0;
            for j in (0..slopes.len()).rev() {
                above += slopes[j];
                gradient[at + j] = if j == 0 { above } else { above * variables[at + j].exp() };
            }
            at += slopes.len();
        }
        self.variance - explained
    }

    fn threshold_slopes(&self, n: usize, thresholds: &[f64]) -> Vec<f64> {
        let s = self.noise[n];
        let [zero, one] = &self.slope[n];
        // The bit alternates between cells, so neighbouring thresholds move probability in opposite directions.
        let mut sign = 1.0;
        thresholds
            .iter()
            .map(|t| {
                let sum: f64 = self
                    .nodes
                    .x
                    .iter()
                    .zip(zero.iter().zip(one))
                    .map(|(x, (zero, one))| pdf((t - x) / s) / s * (one - zero))
                    .sum();
                let slope = sign * sum;
                sign = -sign;
                slope
            })
            .collect()
    }

    /// Computes `value[depth]` and adds to `slope`; returns the variance explained by the leaves below.
    fn walk(&mut self, depth: usize) -> f64 {
        if depth == self.p.len() {
            let (mass, first) = moments(&self.weight[depth], &self.nodes.x);
            if mass <= IMPOSSIBLE {
                self.value[depth].fill(0.0);
                return 0.0;
            }
            // Leaf: the posterior mean explains `first^2 / mass`. Its derivative with respect to the joint density at x is `estimate (2 x -
            // estimate)`.
            let estimate = first / mass;
            for (v, x) in self.value[depth].iter_mut().zip(&self.nodes.x) {
                *v = estimate * (2.0 * x - estimate);
            }
            return first * estimate;
        }
        let mut explained = 0.0;
        self.value[depth].fill(0.0);
        for bit in 0..2 {
            let (above, below) = self.weight.split_at_mut(depth + 1);
            for ((child, w), p) in below[0].iter_mut().zip(&above[depth]).zip(&self.p[depth][bit]) {
                *child = w * p;
            }
            explained += self.walk(depth + 1);
            let (own, child) = self.value.split_at_mut(depth + 1);
            let p = &self.p[depth][bit];
            let slope = &mut self.slope[depth][bit];
            // Reverse mode: derivatives are carried from the leaves upwards, and those with respect to the bit probabilities are added up.
            for i in 0..p.len() {
                own[depth][i] += p[i] * child[0][i];
                slope[i] += self.weight[depth][i] * child[0][i];
            }
        }
        explained
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn sensors() -> Vec<PatternSensor> {
        [(vec![0.1], 0.3), (vec![-0.4, 0.5], 0.2), (vec![-0.7, -0.1, 0.6], 0.25)]
            .into_iter()
            .map(|(t, s)| PatternSensor::with_deviation(BinaryQuantizer::new(t).unwrap(), s).unwrap())
            .collect()
    }

    #[test]
    fn the_gradient_is_the_derivative() {
        let source = Source::uniform(1.0).unwrap();
        let sensors = sensors();
        let mut tree = OutcomeTree::new(&source, &sensors);
        let thresholds: Vec<Vec<f64>> = sensors.iter().map(|s| s.quantizer().breakpoints().to_vec()).collect();
        let variables = encode(&thresholds);
        let mut gradient = vec![0.0; variables.len()];
        let mut ignored = gradient.clone();
        let value = tree.value(&variables, &mut gradient);
        assert_relative_eq!(value, Bank::new(source, sensors).unwrap().mmse().unwrap(), max_relative = 1e-9);
        let h = 1e-5;
        for j in 0..variables.len() {
            let mut shifted = variables.clone();
            shifted[j] += h;
            let up = tree.value(&shifted, &mut ignored);
            shifted[j] -= 2.0 * h;
            let down = tree.value(&shifted, &mut ignored);
            assert_relative_eq!(gradient[j], (up - down) / (2.0 * h), epsilon = 1e-8);
        }
    }

    /// The printed unit dependence: .032555 at half widths up to 1e2, .036715 at 1e4, no step at all at 1e-5.
    #[test]
    fn free_breakpoints_know_no_unit() {
        let run = |v: f64| {
            let source = Source::uniform(v).unwrap();
            let grid = CellGrid::uniform(v, 3).unwrap();
            let noise = source.noise_deviation(5.0).unwrap();
            let found = free_breakpoints_of_masks(&source, &grid, &[4, 4, 6], noise, 0.05, 2).unwrap();
            let start = sensors_of(&[4], &grid, noise).unwrap();
            assert!(found.sensors.iter().any(|s| *s != start[0]));
            (found.mse / (v * v), found.sensors[2].quantizer().breakpoints()[0] / v)
        };
        let one = run(1.0);
        for v in [1e-5, 1e-4, 1e2, 1e4, 1e5] {
            let other = run(v);
            assert_relative_eq!(other.0, one.0, max_relative = 1e-9);
            assert_relative_eq!(other.1, one.1, max_relative = 1e-3);
        }
    }

    #[test]
    fn descent_never_ends_above_its_start() {
        let source = Source::gaussian_with_deviation(0.5).unwrap();
        let before = Bank::new(source, sensors()).unwrap().mmse().unwrap();
        let found = free_breakpoints(&source, &sensors(), 0.05, 2).unwrap();
        assert!(found.mse < before);
        assert!(free_breakpoints(&source, &sensors(), -1.0, 2).is_err());
        assert!(free_breakpoints(&source, &sensors(), 0.1, 0).is_err());
        assert!(free_breakpoints(&source, &[], 0.1, 1).is_err());
    }
}
