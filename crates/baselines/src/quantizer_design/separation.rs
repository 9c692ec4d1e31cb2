//! Quantizers with the largest distance between two hypotheses, one sensor at a time (Poor and Thomas).

use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::Error;
use fewbits_quantizer_design::engine::Active;
use fewbits_quantizer_design::engine::Deadline;
use fewbits_quantizer_design::engine::LOG_FLOOR;
use fewbits_quantizer_design::engine::{Objective, climb};
use fewbits_quantizer_design::observation_model::{Noise, ObservationModel, Prior};
use fewbits_quantizer_design::system::System;
use fewbits_quantizer_design::{Derivatives, Newton};
use fewbits_quantizers::Channel;
use fewbits_quantizers::Quantizer;
use nalgebra::{DMatrix, DVector};

/// A distance between the distributions `p0`, `p1` of the received symbol under two hypotheses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Separation {
    /// `sum (sqrt p0 - sqrt p1)^2 = 2 (1 - sum sqrt(p0 p1))`.
    Matusita,
    /// `-ln sum sqrt(p0 p1)`: a function of the Matusita distance, so it has the same optimum.
    Bhattacharyya,
    /// `sum (p1 - p0) ln(p1 / p0)`.
    JDivergence,
}

/// Bhattacharyya coefficient: 1 if the distributions are equal, 0 if no symbol has positive probability under both.
fn affinity(p0: &[f64], p1: &[f64]) -> f64 {
    p0.iter().zip(p1).map(|(a, b)| (a * b).sqrt()).sum()
}

impl Separation {
    /// The distance of two distributions; the J-divergence is infinite if a symbol has probability zero under only one of them.
    pub fn of(self, p0: &[f64], p1: &[f64]) -> f64 {
        match self {
            Self::Matusita => p0.iter().zip(p1).map(|(a, b)| (a.sqrt() - b.sqrt()).powi(2)).sum(),
            Self::Bhattacharyya => -affinity(p0, p1).ln(),
            Self::JDivergence => p0
                .iter()
                .zip(p1)
                .filter(|(a, b)| a != b)
                .map(|(a, b)| (b - a) * (b / a).ln())
                .sum(),
        }
    }

    /// First and second derivatives of a symbol's term with respect to `p0` and `p1`.
    fn bend(self, a: f64, b: f64) -> ([f64; 2], [f64; 3]) {
        let (a, b) = (a.max(LOG_FLOOR), b.max(LOG_FLOOR));
        match self {
            Self::Matusita | Self::Bhattacharyya => {
                let ratio = (b / a).sqrt();
                ([-ratio, -1.0 / ratio], [0.5 * ratio / a, -0.5 / (a * b).sqrt(), 0.5 / (ratio * b)])
            }
            Self::JDivergence => {
                let log = (b / a).ln();
                let slope = [-log - (b - a) / a, log + (b - a) / b];
                (slope, [(1.0 + b / a) / a, -1.0 / a - 1.0 / b, (1.0 + a / b) / b])
            }
        }
    }
}

/// The quantizer of one sensor with the largest distance between the hypotheses 0 and `signal`, and the distance.
///
/// `start` gives the number of levels, the labels and the first breakpoints; `deviation` is the noise's standard deviation. With
/// equal noise under both hypotheses the optimum is symmetric about `signal / 2`.
///
/// # Errors
/// [`Error::NotConverged`]; [`Error::Argument`] if `signal` is 0 or not finite, `deviation` is not positive, or the channel does not
/// fit the quantizer.
pub fn separate(
    distance: Separation,
    signal: f64,
    deviation: f64,
    start: &Quantizer,
    channel: &Channel,
    newton: &Newton,
) -> Result<(Quantizer, f64), Error> {
    if signal == 0.0 {
        return refuse("signal", signal, "a signal other than 0");
    }
    let model = ObservationModel::new(Prior::binary(signal, 0.5)?, Noise::independent_with_deviations(&[deviation])?)?;
    let system = System::distinct(model, vec![start.clone()], vec![channel.clone()])?;
    let objective = Separated {
        distance,
        sensor: Active::new(&system, 0)?,
    };
    let found = climb(&objective, &mut start.breakpoints().to_vec(), deviation, newton, Deadline::NEVER)?;
    let (p0, p1) = objective.distributions(&found.point);
    Ok((start.with_breakpoints(found.point)?, distance.of(&p0, &p1)))
}

struct Separated<'a> {
    distance: Separation,
    sensor: Active<'a>,
}

impl Separated<'_> {
    fn distributions(&self, b: &[f64]) -> (Vec<f64>, Vec<f64>) {
        self.sensor.symbols(b).iter().map(|p| (p[0], p[1])).unzip()
    }
}

impl Objective for Separated<'_> {
    fn value(&self, b: &[f64]) -> f64 {
        let (p0, p1) = self.distributions(b);
        match self.distance {
            // Both distances increase as the coefficient decreases. The coefficient keeps its digits if the distance is close to its limit.
            Separation::Matusita | Separation::Bhattacharyya => -2.0 * affinity(&p0, &p1),
            Separation::JDivergence => self.distance.of(&p0, &p1),
        }
    }

    fn derivatives(&self, b: &[f64]) -> Derivatives {
        let (densities, slopes) = self.sensor.densities(b);
        let n = b.len();
        let mut gradient = DVector::zeros(n);
        let mut hessian = DMatrix::zeros(n, n);
        for (t, p) in self.sensor.symbols(b).iter().enumerate() {
            let (slope, bend) = self.distance.bend(p[0], p[1]);
            for i in 0..n {
                let c = self.sensor.exchange[i][t];
                let d = [0, 1].map(|x| c * densities.row(i)[x]);
                gradient[i] += slope[0] * d[0] + slope[1] * d[1];
                hessian[(i, i)] += c * (slope[0] * slopes.row(i)[0] + slope[1] * slopes.row(i)[1]);
                for j in 0..n {
                    let e = self.sensor.exchange[j][t];
                    let e = [0, 1].map(|x| e * densities.row(j)[x]);
                    let cross = bend[1] * (d[0] * e[1] + d[1] * e[0]);
                    hessian[(i, j)] += bend[0] * d[0] * e[0] + cross + bend[2] * d[1] * e[1];
                }
            }
        }
        Derivatives {
            value: self.value(b),
            gradient,
            hessian,
        }
    }

    fn blocks(&self) -> Vec<usize> {
        vec![self.sensor.exchange.len()]
    }

    fn unit(&self, value: f64) -> f64 {
        value.abs()
    }
}
