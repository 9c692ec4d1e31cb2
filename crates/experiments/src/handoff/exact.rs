//! The exact belief on a lattice: what every filter is measured against.

use super::world::{DISTURBANCE, Reading, START, STEP};
use fewbits_core::Likelihood;
use std::f64::consts::FRAC_PI_4;

/// Side of a cell.
const CELL: f64 = 0.04 * STEP;
/// Cells of less than this share of the largest mass are dropped.
const NEGLIGIBLE: f64 = 1e-10;

/// A belief on square cells: only those with mass are kept, row by row.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    /// Lowest cell along each axis.
    low: [i64; 2],
    /// Cells along each axis.
    size: [usize; 2],
    mass: Vec<f64>,
}

/// The law of one step as displacements in cells and their probabilities.
pub(super) struct StepLaw {
    moves: Vec<([i64; 2], f64)>,
}

impl StepLaw {
    /// By the midpoint rule over the angle and both disturbances.
    pub(super) fn new() -> Self {
        let mut table = std::collections::BTreeMap::new();
        let (angles, parts) = (2000, 20);
        for a in 0..angles {
            let angle = FRAC_PI_4 * ((2 * a + 1) as f64 / angles as f64 - 1.0);
            for i in 0..parts {
                for j in 0..parts {
                    let u = [i, j].map(|k| DISTURBANCE * (k as f64 + 0.5) / parts as f64);
                    let d = [angle.cos() + u[0], angle.sin() + u[1]].map(|x| STEP * x / CELL);
                    // Shared linearly between the four nearest cells, which keeps the mean.
                    let base = d.map(f64::floor);
                    for (p, q) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        let share = |k: usize, up: i64| {
                            if up == 1 {
                                d[k] - base[k]
                            } else {
                                1.0 - (d[k] - base[k])
                            }
                        };
                        let key = [base[0] as i64 + p, base[1] as i64 + q];
                        *table.entry(key).or_insert(0.0) +=
                            share(0, p) * share(1, q) / f64::from(angles * parts * parts);
                    }
                }
            }
        }
        Self {
            moves: table.into_iter().collect(),
        }
    }
}

impl Lattice {
    /// The belief at time 0.
    pub(super) fn prior() -> Self {
        let half = (6.0 * START / CELL).ceil() as i64;
        let size = 2 * half as usize + 1;
        let at = |k: usize| (k as i64 - half) as f64 * CELL / START;
        let mass = (0..size * size)
            .map(|i| (-0.5 * (at(i / size).powi(2) + at(i % size).powi(2))).exp())
            .collect();
        let mut lattice = Self {
            low: [-half; 2],
            size: [size; 2],
            mass,
        };
        lattice.normalise();
        lattice
    }

    fn normalise(&mut self) {
        let largest = self.mass.iter().fold(0.0_f64, |m, x| m.max(*x));
        self.mass
            .iter_mut()
            .filter(|m| **m < NEGLIGIBLE * largest)
            .for_each(|m| *m = 0.0);
        let total: f64 = self.mass.iter().sum();
        self.mass.iter_mut().for_each(|m| *m /= total);
    }

    /// The belief after a step and a reading.
    pub(super) fn advanced(&self, law: &StepLaw, reading: &Reading) -> Self {
        let range = |d: usize| {
            let of = law.moves.iter().map(|m| m.0[d]);
            (of.clone().min().unwrap_or(0), of.max().unwrap_or(0))
        };
        let ((x0, x1), (y0, y1)) = (range(0), range(1));
        let size = [self.size[0] + (x1 - x0) as usize, self.size[1] + (y1 - y0) as usize];
        let mut next = Self {
            low: [self.low[0] + x0, self.low[1] + y0],
            size,
            mass: vec![0.0; size[0] * size[1]],
        };
        for (from, row) in self.mass.chunks(self.size[1]).enumerate() {
            let Some(first) = row.iter().position(|m| *m > 0.0) else {
                continue;
            };
            let last = row.iter().rposition(|m| *m > 0.0).unwrap_or(first);
            for ([dx, dy], p) in &law.moves {
                let to = (from + (dx - x0) as usize) * size[1] + (dy - y0) as usize;
                let target = &mut next.mass[to + first..=to + last];
                target.iter_mut().zip(&row[first..=last]).for_each(|(t, m)| *t += p * m);
            }
        }
        let (points, index) = next.support();
        let mut logs = vec![0.0; index.len()];
        reading.add_log_likelihoods([&points[0], &points[1]], &mut logs);
        let best = logs.iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x));
        for (i, log) in index.iter().zip(&logs) {
            next.mass[*i] *= (log - best).exp();
        }
        next.normalise();
        next.cropped()
    }

    /// Without empty rows and columns.
    fn cropped(self) -> Self {
        let (_, index) = self.support();
        let of = |d: usize| {
            index
                .iter()
                .map(move |i| if d == 0 { i / self.size[1] } else { i % self.size[1] })
        };
        let (x, y) = ((of(0).min(), of(0).max()), (of(1).min(), of(1).max()));
        let ((Some(x0), Some(x1)), (Some(y0), Some(y1))) = (x, y) else {
            return self;
        };
        let mass = (x0..=x1)
            .flat_map(|r| self.mass[r * self.size[1] + y0..=r * self.size[1] + y1].iter().copied())
            .collect();
        Self {
            low: [self.low[0] + x0 as i64, self.low[1] + y0 as i64],
            size: [x1 - x0 + 1, y1 - y0 + 1],
            mass,
        }
    }

    /// Centres of the cells with mass, and their places.
    fn support(&self) -> ([Vec<f64>; 2], Vec<usize>) {
        let index: Vec<usize> = (0..self.mass.len()).filter(|i| self.mass[*i] > 0.0).collect();
        let x = index
            .iter()
            .map(|i| (self.low[0] + (i / self.size[1]) as i64) as f64 * CELL)
            .collect();
        let y = index
            .iter()
            .map(|i| (self.low[1] + (i % self.size[1]) as i64) as f64 * CELL)
            .collect();
        ([x, y], index)
    }

    /// Centres, masses and log densities of the cells above a millionth of the largest.
    pub(super) fn points(&self) -> ([Vec<f64>; 2], Vec<f64>, Vec<f64>) {
        let largest = self.mass.iter().fold(0.0_f64, |m, x| m.max(*x));
        let (points, index) = self.support();
        let kept: Vec<usize> = (0..index.len())
            .filter(|k| self.mass[index[*k]] > 1e-6 * largest)
            .collect();
        let columns = points.map(|c| kept.iter().map(|k| c[*k]).collect());
        let mass: Vec<f64> = kept.iter().map(|k| self.mass[index[*k]]).collect();
        let logs = mass.iter().map(|m| m.ln() - 2.0 * CELL.ln()).collect();
        (columns, mass, logs)
    }
}
