//! Several linear models in continuous time, of which one holds at a time.

use crate::{AffineGaussian, ContinuousLinear, Error};
use fewbits_numerics::error::{at_least_one, finite, non_negative, refuse};
use nalgebra::{DMatrix, SVector, Vector4};

/// Dynamics that follow one of several models and switch between them at random instants, as a Markov chain in continuous time.
///
/// Over `t` seconds it gives what an interacting-multiple-model filter needs: each model over `t`, and `exp(R t)`, the probabilities of the
/// model at the end given the one at the beginning. Law: the matrix over `a + b` is that over `a` times that over `b`; each model composes
/// as [`ContinuousLinear`] does. The filter assumes that the model does not switch within a step, so long steps are approximate.
///
/// ```
/// use fewbits_models::Switching;
/// // Rests, or accelerates by 0.1 either way along each axis; each acceleration lasts about five seconds.
/// let target = Switching::manoeuvring(0.02, 0.1, [0.1, 0.2])?;
/// let (models, transition) = target.over(0.7)?;
/// assert_eq!((models.len(), transition.len()), (9, 9));
/// # Ok::<(), fewbits_models::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Switching<const D: usize> {
    models: Vec<ContinuousLinear<D>>,
    /// `R_ij`, rate of changes from model `i` to `j`; rows sum to zero.
    rates: DMatrix<f64>,
}

impl<const D: usize> Switching<D> {
    /// Models, and the rates per second `rates[i][j]` of changes from model `i` to model `j`; the diagonal is not read.
    ///
    /// # Errors
    /// If there is no model, there is not one row and one column of rates per model, or a rate is negative or not finite.
    pub fn new(models: Vec<ContinuousLinear<D>>, rates: &[Vec<f64>]) -> Result<Self, Error> {
        let n = at_least_one("models", models.len())?;
        if rates.len() != n || rates.iter().any(|row| row.len() != n) {
            let sizes: Vec<usize> = rates.iter().map(Vec::len).collect();
            let expected = format!("{n} rows of {n}");
            return refuse("rates", format!("rows of {sizes:?}"), expected);
        }
        let mut generator = DMatrix::zeros(n, n);
        for (i, row) in rates.iter().enumerate() {
            for (j, rate) in row.iter().enumerate().filter(|(j, _)| *j != i) {
                generator[(i, j)] = non_negative("rates", *rate)?;
                generator[(i, i)] -= rate;
            }
            finite("rates", generator[(i, i)])?;
        }
        Ok(Self {
            models,
            rates: generator,
        })
    }

    /// The models.
    pub fn models(&self) -> &[ContinuousLinear<D>] {
        &self.models
    }

    /// Every model over `seconds`, and `transition[i][j] = p(model j at the end | model i at the beginning)`.
    ///
    /// `exp(R t)` is a sum of non-negative terms. Over `h = t / 2^k` with `h max |R_ii| <= 1/2` it is the series of `exp(r h (A - I))` with
    /// `r = max |R_ii|` and the transition matrix `A = I + R / r` (uniformisation). `k` squarings follow. Rows are scaled to sum to one.
    ///
    /// # Errors
    /// If the time is negative or not finite, or so long that a number overflows.
    #[allow(clippy::type_complexity)]
    pub fn over(&self, seconds: f64) -> Result<(Vec<AffineGaussian<D>>, Vec<Vec<f64>>), Error> {
        let models = self
            .models
            .iter()
            .map(|model| model.over(seconds))
            .collect::<Result<_, _>>()?;
        let n = self.models.len();
        let rate = self.rates.diagonal().amax();
        let changes = finite("seconds", rate * seconds)?;
        let doublings = if changes > 0.5 {
            (2.0 * changes).log2().ceil() as i32
        } else {
            0
        };
        let mut transition = DMatrix::identity(n, n);
        if changes > 0.0 {
            // Over the short interval: Poisson-weighted powers of the chain that changes at a common rate, up to a factor.
            let mean = changes * 0.5_f64.powi(doublings);
            let asked = DMatrix::identity(n, n) + &self.rates / rate;
            let mut term = DMatrix::identity(n, n);
            for k in 1..=16 {
                term = term * &asked * (mean / f64::from(k));
                transition += &term;
            }
            normalise(&mut transition);
            // Double the interval: the transition matrix is squared.
            for _ in 0..doublings {
                transition = &transition * &transition;
                normalise(&mut transition);
            }
        }
        let rows = transition.row_iter().map(|row| row.iter().copied().collect()).collect();
        Ok((models, rows))
    }
}

/// Scales rows to sum to one.
fn normalise(transition: &mut DMatrix<f64>) {
    for mut row in transition.row_iter_mut() {
        let total = row.sum();
        row /= total;
    }
}

impl Switching<4> {
    /// A target in a plane, state `[x, x velocity, y, y velocity]`, driven by white acceleration of `density` and by an acceleration of
    /// `0`, `+magnitude` or `-magnitude` along each axis. This makes nine models; the acceleration along y varies fastest in their order.
    /// `[begin, end]` are the rates per second at which an axis begins an acceleration (in either direction with equal probability) and
    /// ends it.
    ///
    /// # Errors
    /// If an argument is negative or not finite.
    pub fn manoeuvring(density: f64, magnitude: f64, [begin, end]: [f64; 2]) -> Result<Self, Error> {
        non_negative("magnitude", magnitude)?;
        let free = ContinuousLinear::nearly_constant_velocity_2d(density)?;
        let values = [0.0, magnitude, -magnitude];
        let pairs = || (0..9).map(|mode| (mode / 3, mode % 3));
        let models = pairs().map(|(x, y)| {
            let push: SVector<f64, 4> = Vector4::new(0.0, values[x], 0.0, values[y]);
            ContinuousLinear::new(*free.drift(), push, *free.density())
        });
        let axis = |from: usize, to: usize| match (from, to) {
            (0, 0) => 0.0,
            (0, _) => 0.5 * begin,
            (_, 0) => end,
            _ => 0.0,
        };
        let row = |(x, y): (usize, usize)| {
            let rate = |(to_x, to_y): (usize, usize)| match (x == to_x, y == to_y) {
                (true, false) => axis(y, to_y),
                (false, true) => axis(x, to_x),
                _ => 0.0,
            };
            pairs().map(rate).collect()
        };
        Self::new(models.collect::<Result<_, _>>()?, &pairs().map(row).collect::<Vec<Vec<f64>>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::evolution;

    #[test]
    fn stretches_compose_and_two_models_have_their_closed_form() {
        let target = Switching::manoeuvring(0.02, 0.1, [0.1, 0.2]).unwrap();
        for [a, b] in [[0.0, 1.0], [0.3, 0.9], [40.0, 1e3]] {
            let product =
                |a: &[Vec<f64>], b: &[Vec<f64>], i: usize, j: usize| -> f64 { (0..9).map(|k| a[i][k] * b[k][j]).sum() };
            let [first, second, whole] = [a, b, a + b].map(|t| target.over(t).unwrap().1);
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                assert!((product(&first, &second, i, j) - whole[i][j]).abs() < 1e-12, "{a} {b} {i} {j}");
            }
            for model in target.models() {
                let at = [Vector4::new(1.0, -2.0, 3.0, 0.5)];
                evolution::stretches_compose(model, [a, b], &at, 1e-12).unwrap();
            }
        }
        // On and off: p(on | off) = r / (r + s) (1 - exp(-(r + s) t)).
        let walk = ContinuousLinear::random_walk(1.0).unwrap();
        let two = Switching::new(vec![walk; 2], &[vec![9.0, 0.3], vec![0.7, 9.0]]).unwrap();
        for t in [1e-9, 0.2, 3.0, 1e3] {
            let expected = -0.3 * f64::exp_m1(-t);
            assert!((two.over(t).unwrap().1[0][1] / expected - 1.0).abs() < 1e-12, "{t}");
        }
    }

    #[test]
    fn bad_rates_and_times_are_refused() {
        let walk = ContinuousLinear::random_walk(1.0).unwrap();
        assert!(Switching::<1>::new(vec![], &[]).is_err() && Switching::new(vec![walk], &[vec![]]).is_err());
        assert!(Switching::new(vec![walk; 2], &[vec![0.0, -1.0], vec![0.0, 0.0]]).is_err());
        let still = Switching::new(vec![walk; 2], &[vec![0.0; 2], vec![0.0; 2]]).unwrap();
        assert_eq!(still.over(7.0).unwrap().1, [[1.0, 0.0], [0.0, 1.0]]);
        assert!([-1.0, f64::NAN, f64::INFINITY].iter().all(|t| still.over(*t).is_err()));
        assert!(Switching::manoeuvring(0.1, -1.0, [0.1, 0.1]).is_err());
    }
}
