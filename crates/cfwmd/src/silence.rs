//! What the silence of a scalar sensor says.

use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{non_negative, positive};
use fewbits_numerics::normal;

/// `ln p(nothing arrived | h(x) = prediction + mu)` of a censoring sensor with scalar measurements.
///
/// The sensor is silent if its innovation lies in `(-c, c)`, `c = sqrt(eta s)`; what it sends is lost with probability
/// `loss`, and the fusion centre cannot tell the two apart:
///
/// `p = loss + (1 - loss) pi`, `pi = Phi((c - mu)/sqrt r) - Phi((-c - mu)/sqrt r)`.
///
/// The root in `c` covers `eta s` only; the paper's printed formulas let it cover `mu` too, which is NaN for `mu > eta s`
/// (erratum `cfwmd-1`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SilentFactor {
    half_width: f64,
    deviation: f64,
    loss: f64,
}

impl SilentFactor {
    /// The factor for half-width `c >= 0` (measurement units), noise variance `r > 0` and `loss` in `[0, 1)`.
    ///
    /// # Errors
    /// Arguments out of range. `c = 0` without loss is an impossible event: [`Error::ImpossibleSilence`] (of sensor 0; the
    /// fusion filters name the sensor).
    pub fn new(half_width: f64, noise_variance: f64, loss: f64) -> Result<Self, Error> {
        non_negative("half_width", half_width)?;
        positive("noise_variance", noise_variance)?;
        check_loss(loss)?;
        if half_width == 0.0 && loss == 0.0 {
            return Err(Error::ImpossibleSilence { sensor: 0 });
        }
        Ok(Self {
            half_width,
            deviation: noise_variance.sqrt(),
            loss,
        })
    }

    /// Half-width `c` of the interval of silence.
    pub fn half_width(&self) -> f64 {
        self.half_width
    }

    /// `ln p(nothing arrived | mu)`; finite for every finite `mu` unless the interval is empty.
    #[inline]
    pub fn log_probability(&self, mu: f64) -> f64 {
        self.mixed(self.log_inside(mu))
    }

    #[inline]
    fn log_inside(&self, mu: f64) -> f64 {
        normal::log_interval((-self.half_width - mu) / self.deviation, (self.half_width - mu) / self.deviation)
    }

    #[inline]
    fn mixed(&self, log_inside: f64) -> f64 {
        if self.loss == 0.0 {
            log_inside
        } else {
            (self.loss + (1.0 - self.loss) * log_inside.exp()).ln()
        }
    }

    /// Value, first and second derivative of `ln pi` with respect to `u = mu / sqrt r`.
    fn jet(&self, u: f64) -> [f64; 3] {
        let k = self.half_width / self.deviation;
        let inside = normal::log_interval(-k - u, k - u);
        let near = (normal::log_pdf(k - u) - inside).exp();
        let far = (normal::log_pdf(k + u) - inside).exp();
        let slope = far - near;
        [inside, slope, -(k - u) * near - (k + u) * far - slope * slope]
    }
}

/// Accepts `loss` in `[0, 1)`.
pub(crate) fn check_loss(loss: f64) -> Result<f64, ArgumentError> {
    if (0.0..1.0).contains(&loss) {
        Ok(loss)
    } else {
        Err(ArgumentError::new("loss", loss, "a probability in [0, 1)"))
    }
}

/// Cells per standard deviation of the measurement noise.
const CELLS: f64 = 8.0;
/// Standard deviations covered on either side of the edge of the interval.
const REACH: f64 = 10.0;
/// Below this many evaluations a table costs more than it saves.
const WORTHWHILE: usize = 400;

/// A [`SilentFactor`] made cheap for a whole cloud of particles.
///
/// `ln pi` is a smooth even function of `mu`, flat inside the interval and close to a parabola outside. Ten standard
/// deviations around the edge are covered by quintic Hermite pieces that match value, slope and curvature (error below
/// 2e-10); nearer the centre it is constant, farther out the exact function is called. One table costs 160 exact
/// evaluations and makes one particle about ten times cheaper. Keep it between steps: it reuses its memory.
#[derive(Debug, Clone)]
pub struct SilentTable {
    factor: SilentFactor,
    pieces: Vec<[f64; 6]>,
    /// Position `|mu| scale - offset` counts cells.
    scale: f64,
    offset: f64,
    flat: f64,
}

impl SilentTable {
    /// Prepares `factor` for `evaluations` calls; for few the table stays empty and the exact function is used.
    pub fn new(factor: SilentFactor, evaluations: usize) -> Self {
        let mut table = Self {
            factor,
            pieces: Vec::new(),
            scale: 0.0,
            offset: 0.0,
            flat: 0.0,
        };
        table.prepare(factor, evaluations);
        table
    }

    /// The same in the memory of an older table.
    pub fn prepare(&mut self, factor: SilentFactor, evaluations: usize) {
        self.factor = factor;
        self.pieces.clear();
        if evaluations < WORTHWHILE {
            return;
        }
        let k = factor.half_width / factor.deviation;
        let start = (k - REACH).max(0.0);
        self.tabulate(start, ((k + REACH - start) * CELLS).ceil() as usize);
        self.scale = CELLS / factor.deviation;
        self.offset = start * CELLS;
        self.flat = factor.log_probability(0.0);
    }

    /// The factor behind the table.
    pub fn factor(&self) -> &SilentFactor {
        &self.factor
    }

    /// Adds `multiplicity` times the factor at `values[i] - centre` to `log_weights[i]`.
    pub fn add(&self, multiplicity: f64, centre: f64, values: &[f64], log_weights: &mut [f64]) {
        for (log_weight, value) in log_weights.iter_mut().zip(values) {
            *log_weight += multiplicity * self.log_probability(value - centre);
        }
    }

    /// The factor at `mu`, from the table where there is one.
    #[inline]
    pub fn log_probability(&self, mu: f64) -> f64 {
        let position = mu.abs() * self.scale - self.offset;
        let cell = position as usize;
        match self.pieces.get(cell) {
            Some(_) if position < 0.0 => self.flat,
            Some(c) => {
                let t = position - cell as f64;
                self.factor
                    .mixed(((((c[5] * t + c[4]) * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0])
            }
            None => self.factor.log_probability(mu),
        }
    }

    /// Quintic Hermite pieces on cells of width `1/CELLS`, in the local coordinate `t` of `[0, 1)`.
    fn tabulate(&mut self, start: f64, cells: usize) {
        let factor = self.factor;
        let step = 1.0 / CELLS;
        let jet = |i: usize| {
            let [value, slope, bend] = factor.jet(start + i as f64 * step);
            [value, slope * step, 0.5 * bend * step * step]
        };
        let mut left = jet(0);
        for i in 0..cells {
            let right = jet(i + 1);
            // The polynomial with these values, slopes and half curvatures at t = 0 and t = 1.
            let rise = right[0] - left[0] - left[1] - left[2];
            let turn = right[1] - left[1] - 2.0 * left[2];
            let curl = right[2] - left[2];
            self.pieces.push([
                left[0],
                left[1],
                left[2],
                10.0 * rise - 4.0 * turn + curl,
                -15.0 * rise + 7.0 * turn - 2.0 * curl,
                6.0 * rise - 3.0 * turn + curl,
            ]);
            left = right;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{SilentFactor, SilentTable};

    #[test]
    fn the_table_is_the_function() {
        for (c, r, loss) in [
            (1.1, 1.0, 0.0),
            (1e-6, 1.0, 0.0),
            (0.3, 4.0, 0.2),
            (50.0, 0.25, 0.0),
            (2.6, 1.0, 0.01),
            (3.0, 1.0, 1e-12),
        ] {
            let factor = SilentFactor::new(c, r, loss).unwrap();
            let reach = c + 14.0 * r.sqrt();
            let values: Vec<f64> = (0..=4000).map(|i| 7.0 + reach * (i as f64 / 2000.0 - 1.0)).collect();
            let mut sums = vec![0.0; values.len()];
            SilentTable::new(factor, values.len()).add(2.0, 7.0, &values, &mut sums);
            for (value, sum) in values.iter().zip(&sums) {
                let exact = 2.0 * factor.log_probability(value - 7.0);
                assert!(
                    (sum - exact).abs() < 1e-9 * exact.abs().max(1.0),
                    "c={c} loss={loss} at {value}: {sum} {exact}"
                );
            }
        }
    }

    #[test]
    fn absurd_offsets_stay_finite() {
        let factor = SilentFactor::new(1.0, 1.0, 0.0).unwrap();
        for mu in [0.0, 1.0, -40.0, 1e4, -1e8] {
            let value = factor.log_probability(mu);
            assert!(value.is_finite() && value <= 0.0, "{mu}: {value}");
        }
        // The square root covers eta s only: an offset beyond eta s is no NaN.
        assert!(factor.log_probability(2.0) < factor.log_probability(1.0));
    }

    #[test]
    fn a_lossy_link_bounds_the_factor_below() {
        let factor = SilentFactor::new(1.0, 1.0, 0.1).unwrap();
        assert!((factor.log_probability(1e6) - 0.1_f64.ln()).abs() < 1e-15);
        let clean = SilentFactor::new(1.0, 1.0, 0.0).unwrap().log_probability(0.4).exp();
        assert!((factor.log_probability(0.4).exp() - (0.1 + 0.9 * clean)).abs() < 1e-15);
    }

    #[test]
    fn impossible_silence_and_bad_numbers_are_refused() {
        assert!(SilentFactor::new(0.0, 1.0, 0.0).is_err());
        assert_eq!(SilentFactor::new(0.0, 1.0, 0.5).unwrap().log_probability(3.0), 0.5_f64.ln());
        for (c, r, loss) in [
            (-1.0, 1.0, 0.0),
            (1.0, 0.0, 0.0),
            (1.0, 1.0, 1.0),
            (f64::NAN, 1.0, 0.0),
            (1.0, 1.0, -0.1),
        ] {
            assert!(SilentFactor::new(c, r, loss).is_err());
        }
    }
}
