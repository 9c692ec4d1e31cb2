//! Where the concentration exceeds a threshold, with the certainty that the belief gives.

use crate::posterior::Posterior;
use crate::{Error, RateModel, SourceLikelihood};
use fewbits_models::diffusion::{Air, Ground, ImpulseResponse};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive, within};
use fewbits_numerics::normal::interval;
use nalgebra::{Vector2, Vector3};

/// Cells that stand for the posterior; more add nothing to quantiles.
const MOST: usize = 4000;
/// Bisections of a quantile.
const BISECTIONS: usize = 60;

/// A posterior over position and rate, asked about concentrations on impermeable ground.
#[derive(Debug, Clone)]
pub struct Envelope {
    air: Air,
    points: Vec<Point>,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    position: Vector2<f64>,
    weight: f64,
    rate: Rate,
}

#[derive(Debug, Clone, Copy)]
enum Rate {
    Known(f64),
    /// Normal of this mean and deviation, cut to an interval.
    Cut { mean: f64, deviation: f64, low: f64, high: f64 },
}

impl Rate {
    /// `P(rate > level)`.
    fn exceeds(&self, level: f64) -> f64 {
        match *self {
            Self::Known(rate) => f64::from(u8::from(rate > level)),
            Self::Cut { low, .. } if level <= low => 1.0,
            Self::Cut { high, .. } if level >= high => 0.0,
            Self::Cut { mean, deviation, low, high } => {
                let z = |x: f64| (x - mean) / deviation;
                let (above, below) = (interval(z(level), z(high)), interval(z(low), z(level)));
                let total = above + below;
                if total > 0.0 { above / total } else { f64::from(u8::from(mean > level)) }
            }
        }
    }
}

impl Envelope {
    /// The envelope of a posterior; `likelihood` holds the records that it was formed from, and what was assumed of the rate.
    ///
    /// # Errors
    /// If the rate was redrawn for each node or sample: it then has no posterior.
    pub fn new(posterior: &Posterior, likelihood: &SourceLikelihood) -> Result<Self, Error> {
        let sensor = likelihood.records().first().map(|r| r.sensor().clone());
        let Some(sensor) = sensor else {
            return Err(ArgumentError::new("records", "empty", "at least one").into());
        };
        let air = Air::new(sensor.air().diffusivity(), *sensor.air().wind(), Ground::Impermeable)?;
        let [x, y] = posterior.cells.columns();
        let weights = posterior.cells.weights();
        let mut order: Vec<usize> = (0..weights.len()).collect();
        if order.len() > MOST {
            order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]));
            order.truncate(MOST);
        }
        let total: f64 = order.iter().map(|i| weights[*i]).sum();
        let mut points = Vec::with_capacity(order.len());
        for i in order {
            let position = Vector2::new(x[i], y[i]);
            let rate = match likelihood.rate() {
                RateModel::Known(rate) => Rate::Known(*rate),
                RateModel::Joint(range) => {
                    let sums = likelihood.sums(&position);
                    // No response at all leaves the uniform prior: a normal far wider than the range.
                    let a = sums.response.max(1e-12 / (range.high() * range.high()));
                    Rate::Cut {
                        mean: if sums.response > 0.0 { sums.correlation / a } else { range.middle() },
                        deviation: a.sqrt().recip(),
                        low: range.low(),
                        high: range.high(),
                    }
                }
                other => {
                    return Err(ArgumentError::new("rate", format!("{other:?}"), "a known or a joint rate").into());
                }
            };
            points.push(Point {
                position,
                weight: weights[i] / total,
                rate,
            });
        }
        Ok(Self { air, points })
    }

    /// `P(c > threshold)` (kg/m^3) at a place on the ground, `age` seconds after the release began: the posterior average of the
    /// probability that the rate exceeds what that concentration takes.
    ///
    /// # Errors
    /// If `threshold` is not a positive number.
    pub fn exceedance(&self, place: &Vector2<f64>, age: f64, threshold: f64) -> Result<f64, Error> {
        positive("threshold", threshold)?;
        let field = Vector3::new(place.x, place.y, 0.0);
        let at = |p: &Point| {
            let response = self.air.concentration(&field, &Vector3::new(p.position.x, p.position.y, 0.0), age);
            p.weight * if response > 0.0 { p.rate.exceeds(threshold / response) } else { 0.0 }
        };
        Ok(self.points.iter().map(at).sum())
    }

    /// Quantile of how far the area above the threshold reaches from `origin` along the direction (radians from the x axis), m:
    /// of `(source - origin) . e + R`, with `R` the distance along `e` from the source at which the threshold is crossed.
    ///
    /// # Errors
    /// If `threshold` is not a positive number, `angle` is not finite or `level` is outside `[0, 1]`.
    pub fn reach(&self, origin: &Vector2<f64>, angle: f64, age: f64, threshold: f64, level: f64) -> Result<f64, Error> {
        positive("threshold", threshold)?;
        finite("angle", angle)?;
        within("level", level, 0.0, 1.0)?;
        let ray = Vector2::new(angle.cos(), angle.sin());
        let start = Vector3::zeros();
        // Beyond `reach` with probability: sum of those whose threshold is crossed farther out.
        let beyond = |reach: f64| -> f64 {
            let at = |p: &Point| {
                let radius = reach - (p.position - origin).dot(&ray);
                if radius <= 0.0 {
                    return p.weight;
                }
                let response = self.air.concentration(&Vector3::new(ray.x * radius, ray.y * radius, 0.0), &start, age);
                p.weight * if response > 0.0 { p.rate.exceeds(threshold / response) } else { 0.0 }
            };
            self.points.iter().map(at).sum()
        };
        let along = |p: &Point| (p.position - origin).dot(&ray);
        let mut low = self.points.iter().map(along).fold(f64::INFINITY, f64::min);
        let farthest = self.points.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        let largest = self.points.iter().map(|p| match p.rate {
            Rate::Known(rate) => rate,
            Rate::Cut { high, .. } => high,
        });
        let widest = largest.fold(0.0, f64::max) / (std::f64::consts::TAU * self.air.diffusivity() * threshold);
        let mut high = farthest + widest;
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if beyond(middle) > 1.0 - level { low = middle } else { high = middle }
            if high - low < 1e-9 * widest {
                break;
            }
        }
        Ok(0.5 * (low + high))
    }
}
