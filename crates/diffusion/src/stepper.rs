//! One time step of a transport, with an error estimate.

use crate::solver::{Direction, Factor};
use crate::{Error, Transport};
use faer::{Mat, Scale};

/// Method of a time step. Both damp the fast components that a sudden start excites.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Trapezoidal rule, then a backward difference (TR-BDF2): second order, with an embedded error estimate of third order. Its errors may
    /// make concentrations slightly negative; [`Snapshot::lowest`](crate::Snapshot::lowest) has the lowest.
    #[default]
    TrBdf2,
    /// Two implicit Euler steps of half the length. The error estimate is their difference from one whole step. First order, never
    /// negative.
    ImplicitEuler,
}

/// Largest number of factorisations that are kept.
const MAX_FACTORS: usize = 16;
/// `2 - sqrt 2`: the share of the step at which the trapezoidal rule ends. With this value both stages have the same matrix.
const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;
const HALF_GAMMA: f64 = 0.5 * GAMMA;
/// Weight of the first two slopes in the step.
const WEIGHT: f64 = 0.25 * std::f64::consts::SQRT_2;
/// Weights of the third-order formula minus those of the method (Hosea and Shampine, Applied Numerical Mathematics 20 (1996) 21).
const ERROR: [f64; 3] = [
    (1.0 - WEIGHT) / 3.0 - WEIGHT,
    (3.0 * WEIGHT + 1.0) / 3.0 - WEIGHT,
    HALF_GAMMA / 3.0 - HALF_GAMMA,
];
/// Makes time steps, and keeps the factors for the last step lengths.
pub(crate) struct Stepper<'a> {
    pub(crate) transport: &'a Transport,
    pub(crate) method: Method,
    /// Factors by their coefficient of `A`; the last used comes last.
    factors: Vec<(f64, Factor<'a>)>,
}

impl<'a> Stepper<'a> {
    pub(crate) fn new(transport: &'a Transport) -> Self {
        Self {
            transport,
            method: Method::default(),
            factors: Vec::new(),
        }
    }

    /// One step: the columns after it, what it adds to the dose, and its estimated error relative to each column's largest value.
    pub(crate) fn step(
        &mut self,
        direction: Direction,
        now: &Mat<f64>,
        source: &Mat<f64>,
        step: f64,
    ) -> Result<(Mat<f64>, Mat<f64>, f64), Error> {
        let transport = self.transport;
        let amounts = |c: &Mat<f64>| Mat::from_fn(c.nrows(), c.ncols(), |i, j| transport.volumes[i] * c[(i, j)]);
        let solved = |factor: &Factor<'_>, mut columns: Mat<f64>| {
            factor.solve(direction, &mut columns);
            columns
        };
        match self.method {
            Method::ImplicitEuler => {
                let euler = |from: &Mat<f64>, step: f64, factor: &Factor<'_>| {
                    solved(factor, amounts(from) + Scale(step) * source)
                };
                let whole = euler(now, step, self.factor(step)?);
                let half_factor = self.factor(0.5 * step)?;
                let middle = euler(now, 0.5 * step, half_factor);
                let next = euler(&middle, 0.5 * step, half_factor);
                let dose = Scale(0.5 * step) * (middle + &next);
                let error = relative_error(&(&next - whole), &next);
                Ok((next, dose, error))
            }
            Method::TrBdf2 => {
                let weight = HALF_GAMMA * step;
                let factor = self.factor(weight)?;
                let slope = |c: &Mat<f64>| {
                    let mut out = Mat::zeros(c.nrows(), c.ncols());
                    for j in 0..c.ncols() {
                        transport.apply(direction, c.col_as_slice(j), out.col_as_slice_mut(j));
                    }
                    source - out
                };
                let first = slope(now);
                let middle = solved(factor, amounts(now) + Scale(weight) * (&first + source));
                let second = slope(&middle);
                let slopes = Scale(step * WEIGHT) * (&first + &second) + Scale(weight) * source;
                let next = solved(factor, amounts(now) + slopes);
                let third = slope(&next);
                // One more solution with the matrix keeps the estimate bounded for stiff components.
                let error = Scale(ERROR[0]) * first + Scale(ERROR[1]) * second + Scale(ERROR[2]) * third;
                let error = solved(factor, Scale(step) * error);
                let dose = Scale(step * WEIGHT) * (now + middle) + Scale(weight) * &next;
                let error = relative_error(&error, &next);
                Ok((next, dose, error))
            }
        }
    }

    /// The factor of `V + weight A`.
    fn factor(&mut self, weight: f64) -> Result<&Factor<'a>, Error> {
        match self.factors.iter().position(|(known, _)| *known == weight) {
            Some(at) => self.factors[at..].rotate_left(1),
            None => {
                if self.factors.len() == MAX_FACTORS {
                    self.factors.remove(0);
                }
                self.factors.push((weight, self.transport.factor(1.0, weight)?));
            }
        }
        Ok(&self.factors[self.factors.len() - 1].1)
    }
}

/// Columns that are advanced together.
pub(crate) struct State {
    pub(crate) concentration: Mat<f64>,
    pub(crate) dose: Mat<f64>,
    pub(crate) lowest: f64,
    pub(crate) steps: usize,
    /// Length of the next step, s.
    pub(crate) wanted: f64,
}

impl State {
    /// Columns before their first step; the dose is zero.
    pub(crate) fn new(concentration: Mat<f64>) -> Self {
        let dose = Mat::zeros(concentration.nrows(), concentration.ncols());
        Self {
            concentration,
            dose,
            lowest: 0.0,
            steps: 0,
            wanted: f64::INFINITY,
        }
    }

    /// Replaces the columns by those after a step, and adds the step's dose.
    pub(crate) fn accept(&mut self, next: Mat<f64>, dose: Mat<f64>) {
        self.dose += dose;
        for j in 0..next.ncols() {
            self.lowest = next.col_as_slice(j).iter().copied().fold(self.lowest, f64::min);
        }
        self.concentration = next;
        self.steps += 1;
    }
}

/// The largest error of a column over the largest number of that column, over all columns.
fn relative_error(error: &Mat<f64>, values: &Mat<f64>) -> f64 {
    let larger = |most: f64, x: &f64| if x.is_nan() { f64::INFINITY } else { most.max(x.abs()) };
    let of_column = |j: usize| {
        let error = error.col_as_slice(j).iter().fold(0.0, larger);
        error / values.col_as_slice(j).iter().fold(f64::MIN_POSITIVE, larger)
    };
    (0..error.ncols()).map(of_column).fold(0.0, f64::max)
}
