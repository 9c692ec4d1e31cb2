//! Several models of the medium, of which one is right: for example winds or diffusivities on a small grid.

use crate::{Error, SourceSensor};
use fewbits_numerics::error::{entries, probabilities, refuse};

/// One sensor model per model of the medium, with the models' prior probabilities.
///
/// ```
/// use fewbits_diffusive::{ModelGrid, SourceSensor};
/// use fewbits_models::diffusion::{Air, Ground};
/// use nalgebra::Vector3;
/// // A wind of 2 m/s from one of eight directions.
/// let winds = (0..8).map(|i| {
///     let angle = std::f64::consts::FRAC_PI_4 * f64::from(i);
///     let air = Air::new(40.0, Vector3::new(angle.cos(), angle.sin(), 0.0) * 2.0, Ground::Impermeable)?;
///     Ok(SourceSensor::new(air, vec![5.0, 10.0], 8e-6)?)
/// });
/// let grid = ModelGrid::uniform(winds.collect::<Result<_, fewbits_diffusive::Error>>()?)?;
/// assert_eq!(grid.len(), 8);
/// # Ok::<(), fewbits_diffusive::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct ModelGrid {
    sensors: Vec<SourceSensor>,
    weights: Vec<f64>,
}

/// One model alone.
impl From<SourceSensor> for ModelGrid {
    fn from(sensor: SourceSensor) -> Self {
        Self {
            sensors: vec![sensor],
            weights: vec![1.0],
        }
    }
}

impl ModelGrid {
    /// The models with the prior probabilities `weights`. The sensors may differ in the model of the medium and what follows from it, but
    /// they are the same sensors: their instants, noise and bias are equal.
    ///
    /// # Errors
    /// If there is none, the weights are no probabilities or not one for each, or the sensors differ in instants, noise or bias.
    pub fn new(sensors: Vec<SourceSensor>, weights: &[f64]) -> Result<Self, Error> {
        probabilities("weights", weights)?;
        entries("weights", weights.len(), sensors.len())?;
        if let Some(other) = sensors.iter().find(|s| s.instants() != sensors[0].instants()) {
            let expected = format!("{:?}, those of the first model", sensors[0].instants());
            return refuse("instants", format!("{:?}", other.instants()), expected);
        }
        let differs = |s: &&SourceSensor| s.noise() != sensors[0].noise() || s.bias() != sensors[0].bias();
        if let Some(other) = sensors.iter().find(differs) {
            let sent = |s: &SourceSensor| format!("noise {:e} and bias {:e}", s.noise(), s.bias());
            return refuse("sensors", sent(other), format!("{}, those of the first model", sent(&sensors[0])));
        }
        Ok(Self {
            sensors,
            weights: weights.to_vec(),
        })
    }

    /// Equally probable models.
    ///
    /// # Errors
    /// As [`ModelGrid::new`].
    pub fn uniform(sensors: Vec<SourceSensor>) -> Result<Self, Error> {
        let weights = vec![(sensors.len().max(1) as f64).recip(); sensors.len()];
        Self::new(sensors, &weights)
    }

    /// Number of models.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.sensors.len()
    }

    /// The instants at which the sensors sample, s.
    pub(crate) fn instants(&self) -> &[f64] {
        self.sensors.first().map_or(&[], SourceSensor::instants)
    }

    /// Standard deviation of the sensors' noise, kg/m^3.
    pub(crate) fn noise(&self) -> f64 {
        // There is at least one model.
        self.sensors.first().map_or(f64::NAN, SourceSensor::noise)
    }

    /// The models with their prior probabilities.
    pub fn iter(&self) -> impl Iterator<Item = (&SourceSensor, f64)> {
        self.sensors.iter().zip(self.weights.iter().copied())
    }
}
