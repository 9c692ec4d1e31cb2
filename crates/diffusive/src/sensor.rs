//! Sensors: samples of the concentration at a node at a few instants, with bias and noise.

use crate::Error;
use fewbits_models::{Homogeneous, Receptor, SourceGradient, SourceModel};
use fewbits_numerics::error::{all_finite, at_least_one, finite, non_negative, positive, refuse};
use nalgebra::{Vector2, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// The sensors of a network, all alike, and the medium between them and the source:
/// `y_j = mu a_j(theta) + bias + e_j`, `e_j ~ N(0, sigma^2)`, with `a_j` the concentration per unit rate at instant `t_j`.
///
/// Sensors and source are at known heights; the unknown position is horizontal. The model describes how the substance spreads:
/// [`Air`](fewbits_models::diffusion::Air) has closed forms; any other [`SourceModel`] may be used. Clones share it.
#[derive(Clone)]
pub struct SourceSensor {
    model: Arc<dyn SourceModel + Send + Sync>,
    instants: Vec<f64>,
    /// Seconds from `start` to each of `instants`.
    ages: Vec<f64>,
    start: f64,
    noise: f64,
    bias: f64,
    source_height: f64,
    sensor_height: f64,
    reach: f64,
}

impl Debug for SourceSensor {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("SourceSensor");
        shown.field("instants", &self.instants).field("noise", &self.noise);
        shown.finish_non_exhaustive()
    }
}

impl SourceSensor {
    /// Sensors on the ground that sample at the given instants (s) with noise of the given standard deviation (kg/m^3). The source is
    /// on the ground and began to release at time 0; there is no bias.
    ///
    /// # Errors
    /// If there is no instant, one is not finite or none is after 0, or `noise` is not a positive number.
    pub fn new(model: impl SourceModel + Send + Sync + 'static, instants: Vec<f64>, noise: f64) -> Result<Self, Error> {
        at_least_one("instants", instants.len())?;
        all_finite("instants", &instants)?;
        if instants.iter().all(|t| *t <= 0.0) {
            return refuse("instants", "none above 0", "at least one after the release began");
        }
        positive("noise", noise)?;
        let sensor = Self {
            model: Arc::new(model),
            ages: instants.clone(),
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

    /// The same sensors with a known bias, kg/m^3.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn with_bias(self, bias: f64) -> Result<Self, Error> {
        finite("bias", bias)?;
        Ok(Self { bias, ..self })
    }

    /// The same sensors with a release that began at `start`, s.
    ///
    /// # Errors
    /// If it is not finite, or no instant of sampling is after it.
    pub fn with_start(self, start: f64) -> Result<Self, Error> {
        finite("start", start)?;
        if self.instants.iter().all(|t| *t <= start) {
            return refuse("start", start, "a time before the last instant of sampling");
        }
        let ages = self.instants.iter().map(|t| t - start).collect();
        Ok(Self { ages, start, ..self })
    }

    /// The same sensors with source and sensors at the given heights above the ground, m.
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

    /// Sets the distance up to which responses are tabulated, m (250 by default); beyond it the model is evaluated. It has no
    /// effect on a model that is not [`Homogeneous`].
    ///
    /// # Errors
    /// If it is not a positive number.
    pub fn with_reach(self, reach: f64) -> Result<Self, Error> {
        positive("reach", reach)?;
        Ok(Self { reach, ..self })
    }

    /// Model of the medium.
    pub fn model(&self) -> &dyn SourceModel {
        &*self.model
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

    /// Height of the sensors, m.
    pub(crate) fn sensor_height(&self) -> f64 {
        self.sensor_height
    }

    /// Height of the source, m.
    pub(crate) fn source_height(&self) -> f64 {
        self.source_height
    }

    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Seconds from the start of the release to each instant.
    pub(crate) fn ages(&self) -> &[f64] {
        &self.ages
    }

    /// Height difference of source and sensor, m.
    pub(crate) fn height_difference(&self) -> f64 {
        (self.source_height - self.sensor_height).abs()
    }

    /// The shortest time from the start to an instant, s.
    pub(crate) fn shortest_age(&self) -> f64 {
        let ages = self.ages.iter().copied().filter(|age| *age > 0.0);
        ages.fold(f64::INFINITY, f64::min)
    }

    /// The place of a source, m.
    pub(crate) fn source_at(&self, position: &Vector2<f64>) -> Vector3<f64> {
        Vector3::new(position.x, position.y, self.source_height)
    }

    /// Whether a source can be in the square of the given half width about `position`.
    pub(crate) fn admits(&self, position: &Vector2<f64>, half_width: f64) -> bool {
        self.model.admits(&self.source_at(position), half_width)
    }

    pub(crate) fn homogeneous(&self) -> Option<Homogeneous> {
        self.model.homogeneous()
    }

    /// The receptor of a sensor at `node`, m.
    ///
    /// # Errors
    /// If `node` is not finite, or the model has no concentrations there.
    pub fn receptor(&self, node: &Vector2<f64>) -> Result<Receptor, Error> {
        all_finite("node", node.as_slice())?;
        self.model.receptor(&Vector3::new(node.x, node.y, self.sensor_height))
    }

    /// Concentrations per unit rate at a receptor, one for each instant: kg/m^3 per kg/s.
    pub(crate) fn responses_at(&self, receptor: &Receptor, source: &Vector2<f64>) -> Vec<f64> {
        let mut out = vec![0.0; self.ages.len()];
        self.model
            .concentrations(receptor, &self.source_at(source), &self.ages, &mut out);
        out
    }

    /// The response at instant `j` and its gradient with respect to the position of the source; zero if there is no such instant.
    pub(crate) fn response_gradient_at(&self, j: usize, receptor: &Receptor, source: &Vector2<f64>) -> SourceGradient {
        let age = self.ages.get(j).copied().unwrap_or(0.0);
        self.model.source_gradient(receptor, &self.source_at(source), age)
    }

    /// Concentrations per unit rate at a node, one for each instant: kg/m^3 per kg/s.
    ///
    /// # Errors
    /// As [`receptor`](Self::receptor).
    pub fn responses(&self, node: &Vector2<f64>, source: &Vector2<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.responses_at(&self.receptor(node)?, source))
    }

    /// Draws the samples of a node, kg/m^3, with a source at `source` that releases at `rate`, kg/s.
    ///
    /// # Errors
    /// As [`receptor`](Self::receptor).
    pub fn sample<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        node: &Vector2<f64>,
        source: &Vector2<f64>,
        rate: f64,
    ) -> Result<Vec<f64>, Error> {
        let clean = self.responses(node, source)?;
        Ok(clean
            .into_iter()
            .map(|a| rate * a + self.bias + self.noise * rng.sample::<f64, _>(StandardNormal))
            .collect())
    }
}
