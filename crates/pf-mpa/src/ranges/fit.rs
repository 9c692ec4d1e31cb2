//! The most probable state near a start, by Gauss-Newton steps.
//!
//! ```text
//! unknown    position, bias, scale; a bias of a single anchor is part of the error of its one range
//! minimised  sum of (range - expected)^2 / variance + (x - prior mean)^2 / prior variance
//! evidence   ln N(ranges; expected, J P J' + W), by the determinant lemma; Laplace's approximation
//! ```

use super::gaussian::Normal;
use super::own::Own;
use super::root::root;
use super::rows::{Collected, Rows};
use super::settings::Known;
use smallvec::SmallVec;

/// What is known of bias and scale: mean and variance of each.
pub(super) type Calibration = [(f64, f64); 2];

/// What is known before the ranges.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    pub(super) known: &'a Known,
    pub(super) calibration: Calibration,
    pub(super) anchors: usize,
}

impl Search<'_> {
    pub(super) fn axes(&self) -> usize {
        self.known.axes
    }

    /// What is measured of the distance.
    pub(super) fn measured(&self, point: &[f64], one: &Collected) -> f64 {
        self.known.measured.of(self.distance(point, one))
    }

    #[inline]
    pub(super) fn distance(&self, point: &[f64], one: &Collected) -> f64 {
        let height = if self.axes() == 2 { self.known.level } else { point[2] };
        let [x, y, z] = [point[0] - one.place[0], point[1] - one.place[1], height - one.place[2]];
        (x * x + y * y + z * z).sqrt()
    }
}

/// Gauss-Newton steps at most.
const STEPS: usize = 30;
/// A step that promises to lower the cost by less than this share is the last, and the slopes behind it are those before it.
const SETTLED: f64 = 1e-2;
/// No step follows one that lowers the cost by less than this share.
const STALLED: f64 = 1e-4;

/// `S` coordinates: positions, bias and scale.
type Vector<const S: usize> = [f64; S];
type Matrix<const S: usize> = [[f64; S]; S];

/// Cost, information and downhill gradient at a point.
struct Local<const S: usize> {
    cost: f64,
    information: Matrix<S>,
    gradient: Vector<S>,
}

impl<const S: usize> Local<S> {
    /// Adds what is off by `off` and has this slope and variance. Only the lower triangle of the information is filled.
    #[inline]
    fn add(&mut self, off: f64, slope: &Vector<S>, variance: f64) {
        let weight = 1.0 / variance;
        self.cost += off * off * weight;
        for i in 0..S {
            let scaled = slope[i] * weight;
            self.gradient[i] += scaled * off;
            for j in 0..=i {
                self.information[i][j] += scaled * slope[j];
            }
        }
    }
}

/// What is minimised.
struct Problem<'a, const S: usize> {
    search: &'a Search<'a>,
    rows: &'a Rows<'a>,
    middle: Vector<S>,
    prior: Vector<S>,
}

impl<'a, const S: usize> Problem<'a, S> {
    /// Number of positions.
    const AXES: usize = S - 2;

    fn new(search: &'a Search<'a>, rows: &'a Rows<'a>) -> Self {
        let axes = Self::AXES;
        let (mut middle, mut prior) = ([0.0; S], [0.0; S]);
        for i in 0..axes {
            (middle[i], prior[i]) = (search.known.middle[i], search.known.spreads[i].powi(2));
        }
        for (i, (mean, variance)) in search.calibration.into_iter().enumerate() {
            (middle[axes + i], prior[axes + i]) = (mean, variance);
        }
        Self {
            search,
            rows,
            middle,
            prior,
        }
    }

    /// The expected range and its gradient.
    #[inline]
    fn expected(&self, x: &Vector<S>, one: &Collected) -> (f64, Vector<S>) {
        let axes = Self::AXES;
        let measured = self.search.known.measured;
        let d = self.search.distance(x, one);
        let factor = 1.0 + x[axes + 1];
        let mut gradient = [0.0; S];
        if d > 0.0 {
            let slope = factor * measured.slope(d) / d;
            (0..axes).for_each(|i| gradient[i] = slope * (x[i] - one.place[i]));
        }
        let value = measured.of(d);
        (gradient[axes], gradient[axes + 1]) = (1.0, value);
        (factor * value + x[axes], gradient)
    }

    fn at(&self, x: &Vector<S>) -> Local<S> {
        let mut found = Local {
            cost: 0.0,
            information: [[0.0; S]; S],
            gradient: [0.0; S],
        };
        for (one, variance) in self.rows.ranges.iter().zip(&self.rows.variances) {
            let (expected, slope) = self.expected(x, one);
            found.add(one.range - expected, &slope, *variance);
        }
        if let Some(slice) = self.rows.slice {
            let along: f64 = (0..Self::AXES).map(|i| slice.direction[i] * x[i]).sum();
            let mut slope = [0.0; S];
            slope[..Self::AXES].copy_from_slice(&slice.direction[..Self::AXES]);
            found.add(slice.middle - along, &slope, slice.deviation * slice.deviation);
        }
        for i in 0..S {
            if self.prior[i] > 0.0 {
                let off = self.middle[i] - x[i];
                found.cost += off * off / self.prior[i];
                found.gradient[i] += off / self.prior[i];
                found.information[i][i] += 1.0 / self.prior[i];
            } else {
                // A coordinate that is known.
                found.gradient[i] = 0.0;
                for j in 0..S {
                    found.information[i.max(j)][i.min(j)] = 0.0;
                }
                found.information[i][i] = 1.0;
            }
        }
        found
    }
}

fn solve<const S: usize>(root: &Matrix<S>, right: &Vector<S>) -> Vector<S> {
    let mut x = *right;
    for i in 0..S {
        let known: f64 = (0..i).map(|k| root[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / root[i][i];
    }
    for i in (0..S).rev() {
        let known: f64 = (i + 1..S).map(|k| root[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / root[i][i];
    }
    x
}

/// `ln` of a product of positive numbers. One logarithm of many is cheaper than many.
fn log_of_product(numbers: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut product) = (0.0, 1.0);
    for number in numbers {
        product *= number;
        if !(1e-100..1e100).contains(&product) {
            sum += f64::ln(product);
            product = 1.0;
        }
    }
    sum + product.ln()
}

/// The inverse of the matrix of this lower triangular root.
fn inverse<const S: usize>(root: &Matrix<S>) -> Matrix<S> {
    let mut lower = [[0.0; S]; S];
    for j in 0..S {
        lower[j][j] = 1.0 / root[j][j];
        for i in j + 1..S {
            let known: f64 = (j..i).map(|k| root[i][k] * lower[k][j]).sum();
            lower[i][j] = -known / root[i][i];
        }
    }
    let mut found = [[0.0; S]; S];
    for i in 0..S {
        for j in 0..=i {
            found[i][j] = (i..S).map(|k| lower[k][i] * lower[k][j]).sum();
            found[j][i] = found[i][j];
        }
    }
    found
}

/// Coordinates of a peak at most.
const MOST: usize = 5;

/// The most probable state of some ranges, and its evidence. The law about it is built where it is needed.
#[derive(Clone, Copy)]
pub(super) struct Peak {
    x: [f64; MOST],
    /// The lower triangular root of the information there.
    root: Matrix<MOST>,
    pub(super) log_evidence: f64,
}

impl Peak {
    /// Positions, bias and scale: a start of another fit.
    pub(super) fn start(&self, axes: usize) -> &[f64] {
        &self.x[..axes + 2]
    }

    /// Whether it is a copy.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.log_evidence == other.log_evidence && self.x == other.x
    }

    /// The law of the whole state. `None` if it is not finite.
    pub(super) fn law(&self, search: &Search<'_>, rows: &Rows<'_>, speed: f64, own: Own) -> Option<Normal> {
        if search.axes() == 2 {
            self.law_of::<4>(search, rows, speed, own)
        } else {
            self.law_of::<MOST>(search, rows, speed, own)
        }
    }

    fn law_of<const S: usize>(&self, search: &Search<'_>, rows: &Rows<'_>, speed: f64, own: Own) -> Option<Normal> {
        let (x, factor) = (
            std::array::from_fn(|i| self.x[i]),
            std::array::from_fn(|i| std::array::from_fn(|j| self.root[i][j])),
        );
        let found = law::<S>(&Problem::new(search, rows), &x, &factor, speed, own);
        found.is_finite().then_some(found)
    }
}

/// The most probable state near a start, in a slice of the positions if there is one. A start is a place; positions, bias and scale; or a whole state.
/// `None` if the information is singular.
pub(super) fn peak(search: &Search<'_>, start: &[f64], rows: &Rows<'_>) -> Option<Peak> {
    if search.axes() == 2 {
        peak_of::<4>(search, start, rows)
    } else {
        peak_of::<MOST>(search, start, rows)
    }
}

fn peak_of<const S: usize>(search: &Search<'_>, start: &[f64], rows: &Rows<'_>) -> Option<Peak> {
    let axes = S - 2;
    let problem = Problem::<S>::new(search, rows);
    let prior = problem.prior;
    let mut x = problem.middle;
    x[..axes].copy_from_slice(start.get(..axes)?);
    let calibrated = if start.len() == S { axes } else { 2 * axes };
    if let Some(known) = start.get(calibrated..calibrated + 2) {
        for (i, value) in known.iter().enumerate().filter(|(i, _)| prior[axes + i] > 0.0) {
            x[axes + i] = *value;
        }
    }
    let mut local = problem.at(&x);
    let mut factor = root(S, 0.0, |i, j| local.information[i][j])?;
    let mut step = solve(&factor, &local.gradient);
    let promise = |step: &Vector<S>, local: &Local<S>| -> f64 { (0..S).map(|i| step[i] * local.gradient[i]).sum() };
    for _ in 0..STEPS {
        if promise(&step, &local) < SETTLED * (1.0 + local.cost) {
            break;
        }
        let (mut has_moved, mut share) = (false, 1.0);
        while share > 1e-4 {
            let mut next = x;
            (0..S).for_each(|i| next[i] += share * step[i]);
            let found = problem.at(&next);
            if found.cost < local.cost {
                has_moved = local.cost - found.cost > STALLED * (1.0 + found.cost);
                (x, local) = (next, found);
                break;
            }
            share *= 0.5;
        }
        factor = root(S, 0.0, |i, j| local.information[i][j])?;
        step = solve(&factor, &local.gradient);
        if !has_moved {
            break;
        }
    }
    // Cost at the minimum of the linearised problem.
    let promised = promise(&step, &local);
    let cost = local.cost - promised;
    if promised < SETTLED * (1.0 + local.cost) {
        (0..S).for_each(|i| x[i] += step[i]);
    }
    let gains = (0..S).map(|i| factor[i][i] * factor[i][i] * if prior[i] > 0.0 { prior[i] } else { 1.0 });
    let of_slice = rows.slice.map(|slice| slice.deviation * slice.deviation);
    let log_determinant = log_of_product(rows.variances.iter().copied().chain(of_slice).chain(gains));
    let count = (rows.ranges.len() + usize::from(rows.slice.is_some())) as f64;
    let log_evidence = -0.5 * (cost + log_determinant + count * std::f64::consts::TAU.ln());
    let mut found = Peak {
        x: [0.0; MOST],
        root: [[0.0; MOST]; MOST],
        log_evidence,
    };
    found.x[..S].copy_from_slice(&x);
    for (row, own) in found.root.iter_mut().zip(&factor) {
        row[..S].copy_from_slice(own);
    }
    let is_finite = log_evidence.is_finite() && x.iter().all(|x| x.is_finite());
    is_finite.then_some(found)
}

/// The law of the whole state.
fn law<const S: usize>(problem: &Problem<'_, S>, x: &Vector<S>, factor: &Matrix<S>, speed: f64, own: Own) -> Normal {
    let axes = S - 2;
    let first = 2 * axes + 2;
    let n = first + own.count(problem.search.anchors);
    let mut inverse = inverse(factor);
    for i in 0..S {
        if problem.prior[i] == 0.0 {
            inverse[i] = [0.0; S];
            inverse.iter_mut().for_each(|row| row[i] = 0.0);
        }
    }
    // Where a coordinate of the problem is in the state.
    let place = |i: usize| if i < axes { i } else { axes + i };
    let (mut mean, mut covariance) = (Vec::with_capacity(n), Vec::with_capacity(n * n));
    mean.resize(n, 0.0);
    covariance.resize(n * n, 0.0);
    for i in 0..S {
        mean[place(i)] = x[i];
        for j in 0..S {
            covariance[place(i) * n + place(j)] = inverse[i][j];
        }
    }
    (axes..2 * axes).for_each(|i| covariance[i * n + i] = speed * speed);
    if n > first {
        let deviation = own.deviation();
        (first..n).for_each(|i| covariance[i * n + i] = deviation * deviation);
        // Given the state, the bias of an anchor is a share of what its range is off.
        let shares: SmallVec<[(usize, f64, Vector<S>); 8]> = problem
            .rows
            .ranges
            .iter()
            .zip(&problem.rows.variances)
            .filter(|(one, _)| own.of(one.anchor) > 0.0)
            .map(|(one, variance)| {
                let (expected, slope) = problem.expected(x, one);
                let share = deviation * deviation / variance;
                let at = first + if own.only().is_some() { 0 } else { one.anchor };
                mean[at] = share * (one.range - expected);
                (at, share, slope)
            })
            .collect();
        for (at, share, slope) in &shares {
            let mut cross = [0.0; S];
            for i in 0..S {
                cross[i] = -share * (0..S).map(|j| inverse[i][j] * slope[j]).sum::<f64>();
                covariance[at * n + place(i)] = cross[i];
                covariance[place(i) * n + at] = cross[i];
            }
            for (other, other_share, other_slope) in &shares {
                let common: f64 = -other_share * (0..S).map(|i| cross[i] * other_slope[i]).sum::<f64>();
                let alone = if at == other {
                    deviation * deviation * (1.0 - share)
                } else {
                    0.0
                };
                covariance[at * n + other] = common + alone;
            }
        }
    }
    Normal {
        mean,
        covariance,
        axes,
        only: own.only(),
    }
}
