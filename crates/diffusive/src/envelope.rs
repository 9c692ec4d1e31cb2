//! The region in which the concentration exceeds a threshold, with its probability under the belief.

use crate::posterior::Posterior;
use crate::{Error, RateModel, SourceLikelihood, SourceSensor};
use fewbits_densities::systematic;
use fewbits_models::{Homogeneous, Receptor};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, finite, positive, refuse, within};
use fewbits_numerics::golden::maximum;
use fewbits_numerics::normal::interval;
use nalgebra::Vector2;

/// Largest number of cells that represent the posterior; more do not change the quantiles.
const MAX_CELLS: usize = 1500;
/// Number of bisections for a quantile.
const BISECTIONS: usize = 60;

/// Number of distances at which the concentration along a ray is evaluated to find its maximum.
const DISTANCES: usize = 128;
/// Relative tolerance of the distance of the maximum.
const PEAK_TOLERANCE: f64 = 1e-8;

/// Concentrations at the height of the sensors, as predicted by a posterior over position and rate.
#[derive(Debug, Clone)]
pub struct Envelope {
    sensor: SourceSensor,
    points: Vec<Point>,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    position: Vector2<f64>,
    weight: f64,
    rate: Rate,
}

/// A normal of this mean and deviation, truncated to an interval. For a known rate both ends are equal.
#[derive(Debug, Clone, Copy)]
struct Rate {
    mean: f64,
    deviation: f64,
    low: f64,
    high: f64,
}

impl Rate {
    /// `P(rate > level)`.
    fn exceeds(&self, level: f64) -> f64 {
        if level >= self.high {
            return 0.0;
        }
        if level <= self.low {
            return 1.0;
        }
        let z = |x: f64| (x - self.mean) / self.deviation;
        let (above, below) = (interval(z(level), z(self.high)), interval(z(self.low), z(level)));
        let total = above + below;
        if total > 0.0 {
            above / total
        } else {
            f64::from(u8::from(self.mean > level))
        }
    }
}

impl Envelope {
    /// The envelope of a posterior. `likelihood` holds the records that it was formed from and the model of the rate.
    ///
    /// # Errors
    /// If the rate is redrawn for each node or sample: then it has no posterior.
    pub fn new(posterior: &Posterior, likelihood: &SourceLikelihood) -> Result<Self, Error> {
        let sensor = likelihood.records().first().map(|r| r.sensor().clone());
        let Some(sensor) = sensor else {
            return refuse("records", "empty", "at least one");
        };
        let [x, y] = posterior.cells.columns();
        let weights = posterior.cells.weights();
        // Cells at equal steps of the cumulative weight. Neighbours in the order of splitting are near each other in space.
        let order = systematic(weights, weights.len().min(MAX_CELLS), 0.5);
        let mut points = Vec::with_capacity(order.len());
        let share = 1.0 / order.len().max(1) as f64;
        for i in order {
            let position = Vector2::new(x[i], y[i]);
            let rate = match likelihood.rate() {
                RateModel::Known(rate) => Rate {
                    mean: *rate,
                    deviation: 0.0,
                    low: *rate,
                    high: *rate,
                },
                RateModel::Joint(range) => {
                    let sums = likelihood.sums(&position);
                    // Response zero leaves the uniform prior: a normal much wider than the range.
                    let a = sums.response.max(1e-12 / (range.high() * range.high()));
                    Rate {
                        mean: if sums.response > 0.0 {
                            sums.correlation / a
                        } else {
                            range.middle()
                        },
                        deviation: a.sqrt().recip(),
                        low: range.low(),
                        high: range.high(),
                    }
                }
                other => {
                    return refuse("rate", format!("{other:?}"), "a known or a joint rate");
                }
            };
            points.push(Point {
                position,
                weight: share,
                rate,
            });
        }
        Ok(Self { sensor, points })
    }

    /// `P(c > threshold)` (kg/m^3) at a place, `age` seconds after the release began: the posterior mean of the probability that
    /// the rate exceeds the one that causes `threshold` there.
    ///
    /// # Errors
    /// If `threshold` is not a positive number, `age` is NaN, or the model has no concentrations at the place.
    pub fn exceedance(&self, place: &Vector2<f64>, age: f64, threshold: f64) -> Result<f64, Error> {
        positive("threshold", threshold)?;
        number("age", age)?;
        let receptor = self.sensor.receptor(place)?;
        let at = |p: &Point| {
            let source = self.sensor.source_at(&p.position);
            p.exceeds(self.sensor.model().concentration(&receptor, &source, age), threshold)
        };
        Ok(self.points.iter().map(at).sum())
    }

    /// Quantile `level` of how far the area above the threshold reaches from `origin` in the direction `e` at `angle` (radians from the
    /// x axis), m. The distance is `(source - origin) . e + R`, `R` the largest distance from the source along `e` at which the threshold
    /// is exceeded. `None` if with probability `level` or more it is exceeded nowhere on that ray.
    ///
    /// # Errors
    /// If `threshold` is not a positive number, `angle` is not finite, `age` is NaN, `level` is outside `[0, 1]`, or
    /// the model changes along the ground.
    pub fn reach(
        &self,
        origin: &Vector2<f64>,
        angle: f64,
        age: f64,
        threshold: f64,
        level: f64,
    ) -> Result<Option<f64>, Error> {
        positive("threshold", threshold)?;
        finite("angle", angle)?;
        number("age", age)?;
        within("level", level, 0.0, 1.0)?;
        all_finite("origin", origin.as_slice())?;
        let Some(medium) = self.sensor.model().homogeneous() else {
            return refuse("model", "one with concentrations at its receptors only", "a homogeneous one");
        };
        let ray = Vector2::new(angle.cos(), angle.sin());
        let along = |p: &Point| (p.position - origin).dot(&ray);
        let widest = self.widest(&medium, threshold);
        let along_ray = AlongRay::new(&self.sensor, &ray, age, widest)?;
        // P(distance > reach): sum over the sources for which the threshold is exceeded at or beyond it.
        let beyond = |reach: f64| -> f64 {
            let at = |p: &Point| p.exceeds(along_ray.highest_beyond(reach - along(p)), threshold);
            self.points.iter().map(at).sum()
        };
        let mut low = self.points.iter().map(along).fold(f64::INFINITY, f64::min);
        let mut high = self.points.iter().map(along).fold(f64::NEG_INFINITY, f64::max) + widest;
        if beyond(low) <= 1.0 - level {
            return Ok(None);
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if beyond(middle) > 1.0 - level {
                low = middle
            } else {
                high = middle
            }
            if high - low < 1e-7 * widest {
                break;
            }
        }
        Ok(Some(0.5 * (low + high)))
    }

    /// Distance beyond which no concentration exceeds the threshold: in the steady state over impermeable ground the concentration is
    /// `mu / (2 pi kappa R)`.
    fn widest(&self, medium: &Homogeneous, threshold: f64) -> f64 {
        let largest = self.points.iter().map(|p| p.rate.high);
        largest.fold(0.0, f64::max) / (std::f64::consts::TAU * medium.diffusivity * threshold)
    }
}

impl Point {
    /// Weight of this point times the probability that a concentration of `response` per unit rate exceeds the threshold.
    fn exceeds(&self, response: f64, threshold: f64) -> f64 {
        if response > 0.0 {
            self.weight * self.rate.exceeds(threshold / response)
        } else {
            0.0
        }
    }
}

/// Concentration per unit rate along a horizontal ray from the source.
struct AlongRay<'a> {
    sensor: &'a SourceSensor,
    receptor: Receptor,
    ray: &'a Vector2<f64>,
    age: f64,
    /// Distance and value of the highest concentration. It is not at the source if sensor and source have different heights.
    peak: (f64, f64),
}

impl<'a> AlongRay<'a> {
    fn new(sensor: &'a SourceSensor, ray: &'a Vector2<f64>, age: f64, widest: f64) -> Result<Self, Error> {
        let mut along = Self {
            receptor: sensor.receptor(&Vector2::zeros())?,
            sensor,
            ray,
            age,
            peak: (0.0, 0.0),
        };
        along.peak = (0.0, along.at(0.0));
        if sensor.height_difference() == 0.0 {
            return Ok(along);
        }
        // Distances in geometric progression over six decades; then golden section between the neighbours of the best.
        let distance = |i: usize| widest * 1e-6_f64.powf(1.0 - i as f64 / (DISTANCES - 1) as f64);
        let mut best = 0;
        for i in 0..DISTANCES {
            let value = along.at(distance(i));
            if value > along.peak.1 {
                (best, along.peak) = (i, (distance(i), value));
            }
        }
        let (low, high) = (distance(best.saturating_sub(1)), distance((best + 1).min(DISTANCES - 1)));
        let (place, value) = maximum(|x| along.at(x), low, high, PEAK_TOLERANCE);
        if value > along.peak.1 {
            along.peak = (place, value);
        }
        Ok(along)
    }

    fn at(&self, radius: f64) -> f64 {
        let source = self.sensor.source_at(&(self.ray * -radius));
        self.sensor.model().concentration(&self.receptor, &source, self.age)
    }

    /// The highest concentration at this distance from the source or farther.
    fn highest_beyond(&self, radius: f64) -> f64 {
        if radius <= self.peak.0 {
            self.peak.1
        } else {
            self.at(radius)
        }
    }
}

/// Checks that a number is not NaN; infinities are allowed.
fn number(name: &'static str, value: f64) -> Result<f64, ArgumentError> {
    if value.is_nan() {
        return Err(ArgumentError::new(name, value, "a number"));
    }
    Ok(value)
}
