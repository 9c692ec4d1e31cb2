//! Exact errors of all assignments of a few sensors.

use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::outcomes::Table;
use fewbits_sensor_assignment::engine::{Moments, explained_by_pair};
use fewbits_sensor_assignment::{CodedSensors, Error, Estimator};
use nalgebra::DMatrix;

/// Largest number of sensors for enumeration; 10! is 3.6 million.
const MAX_ENUMERATED: usize = 10;
/// Errors that differ by less than this fraction are equal.
const TIE: f64 = 1e-12;

/// Errors of all assignments.
#[derive(Debug, Clone, PartialEq)]
pub struct AllErrors {
    /// The assignment of smallest error; the first in lexicographic order if several are equal.
    pub best: Vec<usize>,
    /// Error of the best assignment.
    pub least: f64,
    /// Mean error over all assignments, which is the expected error of a random assignment.
    pub mean: f64,
    /// Largest error.
    pub largest: f64,
}

/// Exact errors of all `N!` assignments.
///
/// For the centre decoder the recursion begins with the last bit, and assignments that agree on the last bits share it. For
/// the posterior mean the bits are divided into two halves. For every choice of the sensors of the first half, one matrix product
/// combines all orders of the one half with all orders of the other.
///
/// # Errors
/// If there are more than ten sensors.
pub fn all_errors(sensors: &CodedSensors, estimator: Estimator) -> Result<AllErrors, Error> {
    let n = sensors.sensors();
    if n > MAX_ENUMERATED {
        return refuse("sensors", n, "at most 10 sensors");
    }
    let mut tally = Tally {
        errors: AllErrors {
            best: Vec::new(),
            least: f64::INFINITY,
            mean: 0.0,
            largest: 0.0,
        },
        count: 0,
    };
    match estimator {
        Estimator::CellCentre => {
            let rows = sensors.nodes.points.len();
            let mut moments = vec![(vec![0.0; rows], vec![0.0; rows]); n + 1];
            centre_tree(sensors, n, &mut vec![0; n], 0, &mut moments, &mut tally);
        }
        Estimator::PosteriorMean => mmse_halves(sensors, &mut tally),
    }
    tally.errors.mean /= tally.count as f64;
    Ok(tally.errors)
}

/// The statistics of the errors so far; `mean` contains their sum until all are computed.
struct Tally {
    errors: AllErrors,
    count: usize,
}

impl Tally {
    fn add(&mut self, assignment: &[usize], error: f64) {
        let all = &mut self.errors;
        let better = error < all.least * (1.0 - TIE);
        let tied = error <= all.least * (1.0 + TIE) && assignment < all.best.as_slice();
        if better || tied {
            all.best = assignment.to_vec();
            all.least = if tied { all.least.min(error) } else { error };
        }
        all.largest = all.largest.max(error);
        all.mean += error;
        self.count += 1;
    }
}

/// Assigns bits `left - 1, ..., 0`; `moments[left]` contains the recursion after the later bits.
fn centre_tree(
    sensors: &CodedSensors,
    left: usize,
    assignment: &mut Vec<usize>,
    used: u32,
    moments: &mut [Moments],
    tally: &mut Tally,
) {
    let bit = left - 1;
    for sensor in (0..assignment.len()).filter(|s| used >> s & 1 == 0) {
        assignment[bit] = sensor;
        let (below, above) = moments.split_at_mut(left);
        sensors.push_bit(bit, sensor, &above[0], &mut below[bit]);
        if bit == 0 {
            tally.add(assignment, sensors.centre_error(&moments[0]));
        } else {
            centre_tree(sensors, bit, assignment, used | 1 << sensor, moments, tally);
        }
    }
}

/// All orders of some sensors over consecutive bits.
struct Half {
    orders: Vec<Vec<usize>>,
    /// `P(outcome|x)`: one column per order and outcome, one row per node.
    columns: DMatrix<f64>,
}

impl Half {
    fn new(sensors: &CodedSensors, members: &[usize], bits: std::ops::Range<usize>) -> Self {
        let (mut orders, mut values) = (Vec::new(), Vec::new());
        let nodes = sensors.nodes.points.len();
        for_permutations(members.len(), |p| {
            let order: Vec<usize> = p.iter().map(|&i| members[i]).collect();
            let own = bits
                .clone()
                .zip(&order)
                .map(|(bit, &sensor)| &sensors.probability[bit][sensor]);
            let ones = Table::new(vec![1.0; nodes], nodes);
            values.extend(own.fold(ones, |all, own| all.outer(own)).values);
            orders.push(order);
        });
        let columns = DMatrix::from_vec(nodes, values.len() / nodes, values);
        Self { orders, columns }
    }
}

fn mmse_halves(sensors: &CodedSensors, tally: &mut Tally) {
    let n = sensors.sensors();
    let coarse_bits = n.div_ceil(2);
    // Outcomes of the first half that differ in the first bit are as far apart as the rest has outcomes.
    let (apart, fine) = (1usize << (coarse_bits - 1), 1usize << (n - coarse_bits));
    let variance = sensors.half_width() * sensors.half_width() / 3.0;
    let features = sensors.features();
    for members in (0u32..1 << n).filter(|m| m.count_ones() as usize == coarse_bits) {
        let (chosen, others): (Vec<usize>, Vec<usize>) = (0..n).partition(|s| members >> s & 1 == 1);
        let first = Half::new(sensors, &chosen, 0..coarse_bits);
        let second = Half::new(sensors, &others, coarse_bits..n);
        // Probabilities and first moments of all joint outcomes: a row for each of the first half, a column for the second.
        let [mass, moment] = features.each_ref().map(|feature| {
            let mut weighted = first.columns.clone();
            for (mut row, w) in weighted.row_iter_mut().zip(&feature.weights) {
                row *= *w;
            }
            weighted.transpose() * &second.columns
        });
        for (i, head) in first.orders.iter().enumerate() {
            for (j, tail) in second.orders.iter().enumerate() {
                let mut explained = 0.0;
                for a in 2 * i * apart..(2 * i + 1) * apart {
                    for b in j * fine..(j + 1) * fine {
                        let at = [(a, b), (a + apart, b)];
                        explained += explained_by_pair(&[mass[at[0]], moment[at[0]], mass[at[1]], moment[at[1]]]);
                    }
                }
                let assignment: Vec<usize> = head.iter().chain(tail).copied().collect();
                tally.add(&assignment, variance - explained);
            }
        }
    }
}

/// Visits all permutations of `0..n` in lexicographic order.
fn for_permutations(n: usize, mut visit: impl FnMut(&[usize])) {
    let mut p: Vec<usize> = (0..n).collect();
    loop {
        visit(&p);
        // The next permutation: the last ascent is raised by the least larger number after it, and the rest becomes increasing.
        let Some(i) = (1..n).rev().find(|&i| p[i - 1] < p[i]) else {
            return;
        };
        let Some(j) = (i..n).rev().find(|&j| p[j] > p[i - 1]) else {
            return;
        };
        p.swap(i - 1, j);
        p[i..].reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn enumeration_agrees_with_single_evaluations() {
        for variances in [
            vec![0.02],
            vec![0.05, 0.01],
            vec![0.012, 0.021, 0.037, 0.05],
            vec![0.01, 0.3, 0.02, 0.04, 0.1],
        ] {
            let sensors = CodedSensors::with_variances(1.0, &variances).unwrap();
            for estimator in [Estimator::CellCentre, Estimator::PosteriorMean] {
                let all = all_errors(&sensors, estimator).unwrap();
                let (mut sum, mut count, mut least, mut largest) = (0.0, 0.0, f64::INFINITY, 0.0f64);
                for_permutations(variances.len(), |p| {
                    let error = sensors.mse(p, estimator).unwrap();
                    sum += error;
                    count += 1.0;
                    least = least.min(error);
                    largest = largest.max(error);
                });
                assert_relative_eq!(all.mean, sum / count, max_relative = 1e-10);
                assert_relative_eq!(all.least, least, max_relative = 1e-9);
                assert_relative_eq!(all.largest, largest, max_relative = 1e-9);
                assert_relative_eq!(sensors.mse(&all.best, estimator).unwrap(), least, max_relative = 1e-9);
            }
        }
    }

    #[test]
    fn eleven_sensors_are_too_many() {
        let sensors = CodedSensors::with_variances(1.0, &[0.01; 11]).unwrap();
        assert!(all_errors(&sensors, Estimator::CellCentre).is_err());
    }
}
