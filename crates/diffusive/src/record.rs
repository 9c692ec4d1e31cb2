//! The samples of one node, with tabulated responses for fast likelihoods.

use crate::rate::RateSums;
use crate::sensor::SourceSensor;
use fewbits_core::Error;
use fewbits_models::diffusion::Profile;
use fewbits_models::{Homogeneous, Receptor};
use fewbits_numerics::error::{all_finite, entries, positive};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::Vector2;

/// A table with more panels than this is not made.
const MAX_PANELS: f64 = 2000.0;
/// Number of panels of a finer table.
const PANELS: f64 = 32.0;
/// Smallest width of a panel as a share of the widest. Height differences below 1e-5 of a diffusion length change the responses by less
/// than the rounding of the widest panels.
const MIN_WIDTH_RATIO: f64 = 1e-5;
/// Number of instants whose concentrations are computed together.
const TOGETHER: usize = 16;

/// The samples of one node, bias subtracted, with what the likelihood of a source position needs.
///
/// In a medium that is homogeneous along the ground, the responses depend only on the horizontal distance; with wind they have the
/// further factor `exp((v . d - V rho) / 2 kappa)`. The sums over the instants are then tabulated over the distance once. A look-up
/// costs two polynomials for any number of samples. Other models are evaluated at every position.
#[derive(Debug, Clone)]
pub struct Record {
    sensor: SourceSensor,
    /// The receptor of the model, and the origin of its coordinates. In a homogeneous medium the sensor is at the origin, so that
    /// small offsets keep their digits.
    receptor: Receptor,
    origin: Vector2<f64>,
    node: Vector2<f64>,
    samples: Vec<f64>,
    noise: f64,
    energy: f64,
    log_noise: f64,
    /// Tables; only in a homogeneous medium.
    along: Option<Along>,
}

/// Tables of a record under a homogeneous model.
#[derive(Debug, Clone, PartialEq)]
struct Along {
    wind: Vector2<f64>,
    /// Whether there is wind.
    tilted: bool,
    diffusivity: f64,
    closest: f64,
    /// `r^2 sum f_j^2 / sigma^2` and `r sum f_j y_j / sigma^2` downwind, as functions of the horizontal distance; `r` is the distance
    /// in space. From finer to coarser tables: each begins where the one before ends.
    tables: Vec<Profile<2>>,
    /// Largest `|y|` (at least the noise) and largest `2 |y| / (4 kappa t)`, both divided by the noise: they bound how fast
    /// the response changes.
    steepness: [f64; 2],
    /// Wind speed over diffusivity, 1/m.
    drift: f64,
}

impl SourceSensor {
    /// A record of the samples of a node, from which likelihoods are computed.
    ///
    /// # Errors
    /// If the number of samples is not that of the instants, one is not finite, or the model has no concentrations at `node`.
    pub fn record(&self, node: &Vector2<f64>, samples: &[f64]) -> Result<Record, Error> {
        entries("samples", samples.len(), self.instants().len())?;
        all_finite("samples", samples)?;
        Record::new(self, node, samples.iter().map(|y| y - self.bias()).collect(), self.noise())
    }
}

impl Record {
    pub(crate) fn new(
        sensor: &SourceSensor,
        node: &Vector2<f64>,
        samples: Vec<f64>,
        noise: f64,
    ) -> Result<Self, Error> {
        positive("noise", noise)?;
        let homogeneous = sensor.homogeneous();
        let receptor = sensor.receptor(node)?;
        // In a homogeneous model only the offset from the node matters: the receptor moves to the origin.
        let (receptor, origin) = match homogeneous {
            Some(_) => (sensor.receptor(&Vector2::zeros())?, *node),
            None => (receptor, Vector2::zeros()),
        };
        let mut record = Self {
            receptor,
            origin,
            sensor: sensor.clone(),
            node: *node,
            energy: samples.iter().map(|y| (y / noise) * (y / noise)).sum(),
            log_noise: samples.len() as f64 * (noise.ln() + LN_SQRT_2PI),
            samples,
            noise,
            along: None,
        };
        if let Some(homogeneous) = homogeneous {
            record.along = Some(record.along(&homogeneous)?);
        }
        Ok(record)
    }

    fn along(&self, homogeneous: &Homogeneous) -> Result<Along, Error> {
        let diffusivity = homogeneous.diffusivity;
        let mut steepness = [0.0_f64; 2];
        for (y, age) in self.samples.iter().zip(self.sensor.ages()) {
            let size = y.abs().max(self.noise) / self.noise;
            if *age > 0.0 {
                steepness[0] = steepness[0].max(size);
                steepness[1] = steepness[1].max(size * 2.0 / (4.0 * diffusivity * age));
            }
        }
        Ok(Along {
            wind: homogeneous.wind,
            tilted: homogeneous.wind != Vector2::zeros(),
            diffusivity,
            closest: homogeneous.closest,
            tables: self.tabulate(homogeneous)?,
            steepness,
            drift: homogeneous.speed / diffusivity,
        })
    }

    fn tabulate(&self, homogeneous: &Homogeneous) -> Result<Vec<Profile<2>>, Error> {
        // Widest panels: a quarter of the shortest diffusion length.
        let widest = 0.25 * (4.0 * homogeneous.diffusivity * self.sensor.shortest_age()).sqrt();
        if self.sensor.reach() / widest > MAX_PANELS {
            return Ok(Vec::new());
        }
        let downwind = homogeneous.wind.try_normalize(0.0).unwrap_or_else(Vector2::x);
        let table = |end: f64, width: f64| {
            Profile::new(end, width, |distance| {
                // With a height difference the lower limit `closest` is not needed, and its kink would spoil the first panel.
                let apart = self.sensor.height_difference() > 0.0;
                let rho = if apart {
                    distance
                } else {
                    distance.max(homogeneous.closest)
                };
                let [a, b] = self.sums_by_model(&(-downwind * rho));
                let r = rho.hypot(self.sensor.height_difference());
                [r * r * a, r * b]
            })
        };
        // Heights of source and image relative to the sensor: the responses vary over such distances.
        let heights = [
            self.sensor.height_difference(),
            self.sensor.source_height() + self.sensor.sensor_height(),
        ];
        let least = heights.into_iter().filter(|h| *h > 0.0).fold(f64::INFINITY, f64::min);
        let (mut tables, mut width) = (Vec::new(), (0.25 * least).max(MIN_WIDTH_RATIO * widest));
        // Beyond some panels of one width the distance itself is the scale: use wider panels.
        while width < widest && PANELS * width < self.sensor.reach() {
            tables.push(table(PANELS * width, width)?);
            width *= 2.0;
        }
        tables.push(table(self.sensor.reach(), width.min(widest))?);
        Ok(tables)
    }

    /// Position of the node, m.
    pub fn node(&self) -> &Vector2<f64> {
        &self.node
    }

    /// Samples without bias, kg/m^3.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Standard deviation of the samples' noise, kg/m^3.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// The sensor that sampled.
    pub fn sensor(&self) -> &SourceSensor {
        &self.sensor
    }

    /// The sums for the likelihood of the samples, with the source at `position`.
    #[inline]
    pub fn sums(&self, position: &Vector2<f64>) -> RateSums {
        let [response, correlation] = match &self.along {
            Some(along) => self.sums_along(along, &(self.node - position)),
            None => self.sums_by_model(&(position - self.origin)),
        };
        self.with_constants(response, correlation)
    }

    #[inline]
    fn with_constants(&self, response: f64, correlation: f64) -> RateSums {
        RateSums {
            response,
            correlation,
            energy: self.energy,
            log_noise: self.log_noise,
        }
    }

    #[inline]
    fn sums_along(&self, along: &Along, offset: &Vector2<f64>) -> [f64; 2] {
        let rho = offset.norm().max(along.closest);
        match along.tables.iter().find(|table| rho <= table.end()) {
            Some(table) => {
                let [a, b] = table.at(rho);
                let height = self.sensor.height_difference();
                let inverse = if height > 0.0 { rho.hypot(height) } else { rho }.recip();
                if !along.tilted {
                    return [a.max(0.0) * inverse * inverse, b * inverse];
                }
                let wind = along.wind;
                let speed = wind.x.hypot(wind.y);
                let lag = (wind.x * offset.x + wind.y * offset.y - speed * offset.norm()) / (2.0 * along.diffusivity);
                let scale = lag.exp() * inverse;
                [a.max(0.0) * scale * scale, b * scale]
            }
            None => self.sums_by_model(&-offset),
        }
    }

    /// Calls `f` with every sample and its response, for a source at `position` less the origin.
    fn each_response(&self, position: &Vector2<f64>, mut f: impl FnMut(f64, f64)) {
        let source = self.sensor.source_at(position);
        let mut responses = [0.0; TOGETHER];
        for (ages, samples) in self.sensor.ages().chunks(TOGETHER).zip(self.samples.chunks(TOGETHER)) {
            let responses = &mut responses[..ages.len()];
            self.sensor
                .model()
                .concentrations(&self.receptor, &source, ages, responses);
            samples.iter().zip(responses).for_each(|(y, a)| f(*y, *a));
        }
    }

    fn sums_by_model(&self, position: &Vector2<f64>) -> [f64; 2] {
        let (mut a, mut b) = (0.0, 0.0);
        self.each_response(position, |y, response| {
            let f = response / self.noise;
            a += f * f;
            b += f * y / self.noise;
        });
        [a, b]
    }

    /// The sums, and the share of the samples' information that is kept for a cell of the given half width: the square of the change of
    /// the response across the cell is added to the noise variance. `rate` is the largest possible one.
    #[inline]
    pub(crate) fn blurred_sums(&self, position: &Vector2<f64>, half_width: f64, rate: f64) -> (RateSums, f64) {
        let Some(along) = &self.along else {
            let source = self.sensor.source_at(position);
            let change = |age: &f64| self.sensor.model().variation(&self.receptor, &source, half_width, *age);
            let largest = self.sensor.ages().iter().map(change).fold(0.0, f64::max);
            let change = rate * largest / self.noise;
            return (self.sums(position), (1.0 + change * change).recip());
        };
        let offset = self.node - position;
        let height = self.sensor.height_difference();
        let rho = (offset.norm_squared() + height * height).sqrt();
        let near = (rho - 1.4 * half_width).max(0.6 * half_width).max(along.closest);
        let change = half_width * (along.steepness[0] * (near.recip() + along.drift) + along.steepness[1] * rho);
        let [response, correlation] = self.sums_along(along, &offset);
        (self.with_constants(response, correlation), (1.0 + change * change).recip())
    }

    /// Calls `visit` with the sums of every single sample, for a source at `position`.
    pub(crate) fn each_sample(&self, position: &Vector2<f64>, mut visit: impl FnMut(RateSums)) {
        self.each_response(&(position - self.origin), |y, response| {
            let (y, a) = (y / self.noise, response / self.noise);
            visit(RateSums {
                response: a * a,
                correlation: a * y,
                energy: y * y,
                log_noise: self.noise.ln() + LN_SQRT_2PI,
            });
        });
    }
}
