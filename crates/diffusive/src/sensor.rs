//! What a node samples: the concentration at its place at a few instants, with bias and noise.

use crate::{Error, Record};
use fewbits_models::diffusion::Air;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, at_least_one, finite, non_negative, positive};
use nalgebra::{Vector2, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// The sensors of a network, all of one kind, and the medium between them and the source:
/// `y_j = mu a_j(theta) + bias + e_j`, `e_j ~ N(0, sigma^2)`, with `a_j` the concentration per unit rate at instant `t_j`.
///
/// Sensors and source stand at known heights; the position searched for is horizontal.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceSensor {
    air: Air,
    instants: Vec<f64>,
    start: f64,
    noise: f64,
    bias: f64,
    source_height: f64,
    sensor_height: f64,
    reach: f64,
}

impl SourceSensor {
    /// Sensors on the ground that sample at the given instants (s) with noise of the given standard deviation (kg/m^3); a source
    /// on the ground that began at time 0, no bias.
    ///
    /// # Errors
    /// If there is no instant, one is not finite or none is after 0, or `noise` is not a positive number.
    pub fn new(air: Air, instants: Vec<f64>, noise: f64) -> Result<Self, Error> {
        at_least_one("instants", instants.len())?;
        all_finite("instants", &instants)?;
        positive("noise", noise)?;
        let sensor = Self {
            air,
            instants,
            start: 0.0,
            noise,
            bias: 0.0,
            source_height: 0.0,
            sensor_height: 0.0,
            reach: 250.0,
        };
        sensor.with_start(0.0)
    }

    /// With a known bias, kg/m^3.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn with_bias(self, bias: f64) -> Result<Self, Error> {
        finite("bias", bias)?;
        Ok(Self { bias, ..self })
    }

    /// With a release that began at `start`, s.
    ///
    /// # Errors
    /// If it is not finite, or [`Error::NothingReleased`] if no instant of sampling is after it.
    pub fn with_start(self, start: f64) -> Result<Self, Error> {
        finite("start", start)?;
        if self.instants.iter().all(|t| *t <= start) {
            return Err(Error::NothingReleased { start });
        }
        Ok(Self { start, ..self })
    }

    /// With source and sensors at the given heights, m.
    ///
    /// # Errors
    /// If one is negative or not finite.
    pub fn with_heights(self, source_height: f64, sensor_height: f64) -> Result<Self, Error> {
        non_negative("source_height", source_height)?;
        non_negative("sensor_height", sensor_height)?;
        Ok(Self {
            source_height,
            sensor_height,
            ..self
        })
    }

    /// With responses tabulated up to `reach` metres from a sensor (250 unless told); beyond, the closed form is evaluated.
    ///
    /// # Errors
    /// If it is not a positive number.
    pub fn with_reach(self, reach: f64) -> Result<Self, Error> {
        positive("reach", reach)?;
        Ok(Self { reach, ..self })
    }

    /// The medium.
    pub fn air(&self) -> &Air {
        &self.air
    }

    /// Instants of sampling, s.
    pub fn instants(&self) -> &[f64] {
        &self.instants
    }

    /// Standard deviation of the noise, kg/m^3.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Bias, kg/m^3.
    pub fn bias(&self) -> f64 {
        self.bias
    }

    /// Start of the release, s.
    pub fn start(&self) -> f64 {
        self.start
    }

    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Height difference of source and sensor, m.
    pub(crate) fn drop(&self) -> f64 {
        (self.source_height - self.sensor_height).abs()
    }

    /// The shortest diffusion length `sqrt(4 kappa age)` of the instants, m.
    pub(crate) fn shortest_length(&self) -> f64 {
        use fewbits_models::diffusion::ImpulseResponse;
        let ages = self.instants.iter().map(|t| t - self.start).filter(|age| *age > 0.0);
        (4.0 * self.air.diffusivity() * ages.fold(f64::INFINITY, f64::min)).sqrt()
    }

    /// Concentration per unit rate at instant `j` at horizontal offset `node - source`.
    pub(crate) fn response(&self, j: usize, offset: &Vector2<f64>) -> f64 {
        let field = Vector3::new(offset.x, offset.y, self.sensor_height);
        let source = Vector3::new(0.0, 0.0, self.source_height);
        self.air.concentration(&field, &source, self.instants[j] - self.start)
    }

    /// Concentrations per unit rate at a node, one for each instant: kg/m^3 per kg/s.
    pub fn responses(&self, node: &Vector2<f64>, source: &Vector2<f64>) -> Vec<f64> {
        let offset = node - source;
        (0..self.instants.len()).map(|j| self.response(j, &offset)).collect()
    }

    /// Gradient of the response at instant `j` with respect to the horizontal position of the source, and the response.
    pub fn response_gradient(&self, j: usize, node: &Vector2<f64>, source: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let field = Vector3::new(node.x, node.y, self.sensor_height);
        let at = Vector3::new(source.x, source.y, self.source_height);
        let age = self.instants.get(j).map_or(0.0, |t| t - self.start);
        let g = self.air.source_gradient(&field, &at, age);
        (g.value, Vector2::new(g.gradient.x, g.gradient.y))
    }

    /// Draws what a node samples of a source that releases at `rate`, kg/s.
    pub fn sample<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        node: &Vector2<f64>,
        source: &Vector2<f64>,
        rate: f64,
    ) -> Vec<f64> {
        let clean = self.responses(node, source);
        clean
            .into_iter()
            .map(|a| rate * a + self.bias + self.noise * rng.sample::<f64, _>(StandardNormal))
            .collect()
    }

    /// What was sampled at a node, ready for likelihoods.
    ///
    /// # Errors
    /// If the number of samples is not that of the instants, or one is not finite.
    pub fn record(&self, node: &Vector2<f64>, samples: &[f64]) -> Result<Record, Error> {
        if samples.len() != self.instants.len() {
            let expected = format!("{}, one for each instant", self.instants.len());
            return Err(ArgumentError::new("samples", samples.len(), expected).into());
        }
        all_finite("samples", samples)?;
        all_finite("node", node.as_slice())?;
        Record::new(self, node, samples.iter().map(|y| y - self.bias).collect(), self.noise)
    }
}
