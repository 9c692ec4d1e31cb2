//! Divergences by quadrature over all of space, in one to three dimensions.

use fewbits_core::Columns;
use fewbits_densities::Mixture;
use fewbits_mixture_codec::Error;
use fewbits_numerics::error::{positive, refuse};
use serde::{Deserialize, Serialize};

/// KL and L1 by quadrature, and the integral of each density over the grid. How close these are to one shows whether the grid is large
/// enough.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Integrated {
    /// `int p ln(p/q)` in nats.
    pub kl: f64,
    /// `int abs(p - q)`.
    pub l1: f64,
    /// `int p` over the grid.
    pub mass_p: f64,
    /// `int q` over the grid.
    pub mass_q: f64,
}

/// An axis-aligned box with equal steps along each axis, for the trapezoidal rule. If the integrand is negligible at the ends,
/// the error falls faster than any power of the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadratureGrid<const D: usize> {
    lower: [f64; D],
    steps: [f64; D],
    counts: [usize; D],
}

/// The largest number of nodes that a grid may have.
const MAX_NODES: f64 = 5e7;

impl<const D: usize> QuadratureGrid<D> {
    /// A grid over `[lower, upper]` with steps of at most `step` along each axis.
    ///
    /// # Errors
    /// If an end or step is not finite, an interval is empty, a step is not above 0, or there would be over 5e7 nodes.
    pub fn new(lower: [f64; D], upper: [f64; D], step: [f64; D]) -> Result<Self, Error> {
        let mut counts = [0; D];
        let mut steps = [0.0; D];
        let mut nodes = 1.0;
        for d in 0..D {
            let width = positive("upper - lower", upper[d] - lower[d])?;
            let intervals = (width / positive("step", step[d])?).ceil().max(1.0);
            nodes *= intervals + 1.0;
            if nodes > MAX_NODES {
                return refuse("step", step[d], format!("steps for at most {MAX_NODES} nodes"));
            }
            counts[d] = intervals as usize + 1;
            steps[d] = width / intervals;
        }
        Ok(Self { lower, steps, counts })
    }

    /// A grid that covers every component of both mixtures up to `reach` standard deviations, with steps of `fineness` times the
    /// smallest standard deviation in any direction.
    ///
    /// # Errors
    /// As [`QuadratureGrid::new`].
    fn covering(p: &Mixture<D>, q: &Mixture<D>, reach: f64, fineness: f64) -> Result<Self, Error> {
        let mut lower = [f64::INFINITY; D];
        let mut upper = [f64::NEG_INFINITY; D];
        let mut step = [f64::INFINITY; D];
        for c in p.components().iter().chain(q.components()) {
            for d in 0..D {
                let s = c.covariance()[(d, d)].sqrt();
                // Standard deviation along the axis given the other coordinates: the integrand varies over this distance.
                let narrow = 1.0 / c.factor().whitener.column(d).norm();
                lower[d] = lower[d].min(c.mean()[d] - reach * s);
                upper[d] = upper[d].max(c.mean()[d] + reach * s);
                step[d] = step[d].min(fineness * narrow);
            }
        }
        Self::new(lower, upper, step)
    }

    /// KL and L1 of two log densities, each given as a function that writes the log densities of columns of points.
    pub fn integrate(
        &self,
        p: impl Fn(Columns<'_, D>, &mut [f64]),
        q: impl Fn(Columns<'_, D>, &mut [f64]),
    ) -> Integrated {
        let row = self.counts[D - 1];
        let rows: usize = self.counts[..D - 1].iter().product();
        let mut columns: [Vec<f64>; D] = std::array::from_fn(|_| vec![0.0; row]);
        for (k, x) in columns[D - 1].iter_mut().enumerate() {
            *x = self.lower[D - 1] + k as f64 * self.steps[D - 1];
        }
        let (mut log_p, mut log_q) = (vec![0.0; row], vec![0.0; row]);
        let mut total = [0.0; 4];
        // The index of the row, in mixed radix, gives the coordinates that are constant along it.
        for r in 0..rows {
            let mut rest = r;
            for d in (0..D - 1).rev() {
                let x = self.lower[d] + (rest % self.counts[d]) as f64 * self.steps[d];
                columns[d].fill(x);
                rest /= self.counts[d];
            }
            let view = columns.each_ref().map(Vec::as_slice);
            p(view, &mut log_p);
            q(view, &mut log_q);
            let mut sums = [0.0; 4];
            for (lp, lq) in log_p.iter().zip(&log_q) {
                let (a, b) = (lp.exp(), lq.exp());
                // If p underflows, its term of the divergence is zero.
                if a > 0.0 {
                    sums[0] += a * (lp - lq);
                }
                sums[1] += (a - b).abs();
                sums[2] += a;
                sums[3] += b;
            }
            total.iter_mut().zip(sums).for_each(|(t, s)| *t += s);
        }
        let cell: f64 = self.steps.iter().product();
        let [kl, l1, mass_p, mass_q] = total.map(|t| t * cell);
        Integrated { kl, l1, mass_p, mass_q }
    }
}

/// KL and L1 of two mixtures by quadrature: the KL with an error of about 1e-9, the L1, whose integrand has kinks, of about 1e-4. The step
/// depends on the narrowest component, the width of the grid on all of them.
///
/// # Errors
/// If `D` is 0 or the grid would need over 5e7 nodes.
pub fn integrated<const D: usize>(p: &Mixture<D>, q: &Mixture<D>) -> Result<Integrated, Error> {
    if D == 0 {
        return refuse("D", 0, "at least 1");
    }
    let fineness = match D {
        1 => 0.05,
        2 => 0.2,
        _ => 0.35,
    };
    let grid = QuadratureGrid::covering(p, q, 8.5, fineness)?;
    Ok(grid.integrate(|x, out| p.log_pdf_columns(x, out), |x, out| q.log_pdf_columns(x, out)))
}
