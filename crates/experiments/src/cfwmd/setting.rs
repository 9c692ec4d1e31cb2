//! Parameters of the simulated figures.

use super::rows::Ensemble;
use super::world::{At, Named};
use crate::Argument;
use crate::prelude::*;
use serde::{Serialize, de::DeserializeOwned};

/// Parameters of an experiment whose schemes are simulated on common trials.
pub trait Setting: Clone + Default + Serialize + DeserializeOwned + Argument + Quick + Send + Sync + 'static {
    /// What is sent, and what is made of it.
    type Scheme: Copy;

    /// Message budgets.
    fn messages(&self) -> &[f64];

    /// Runs schemes at one budget.
    ///
    /// # Errors
    /// If a filter fails or the run is cancelled.
    fn run(&self, context: &Context<'_>, at: At<'_>, schemes: &[Named<Self::Scheme>]) -> Result<Vec<Ensemble>, Error>;

    /// Runs schemes at all budgets.
    ///
    /// # Errors
    /// As [`Setting::run`].
    fn at_budgets(
        &self,
        context: &Context<'_>,
        world: &str,
        schemes: &[Named<Self::Scheme>],
    ) -> Result<Vec<Ensemble>, Error> {
        let budgets = self.messages().iter();
        let runs = budgets.map(|l| self.run(context, (world, *l), schemes));
        Ok(runs.collect::<Result<Vec<_>, _>>()?.concat())
    }
}

/// Seconds and bytes of so many trials of ten schemes.
fn cost(trials: u64, steps: u64, budgets: usize, step_seconds: f64) -> Cost {
    let runs = trials as f64 * steps as f64 * budgets as f64 * 10.0;
    Cost::new(runs * step_seconds, runs * 32.0)
}

parameters! {
    /// A target on a line among identical linear sensors.
    #[derive(Debug, Clone)]
    pub struct Linear {
        pub(super) trials: u64 [2..=1_000_000] = 5000 => quick 100 => "Monte-Carlo trials.",
        pub(super) steps: u64 [1..=1000] = 20 => "Time steps of a trial.",
        pub(super) sensors: u64 [1..=100] = 2 => "Sensors.",
        pub(super) messages: Vec<f64> [1e-3..=100.0; 1..=20] = vec![1.0] => "Message budgets, each at most the number of sensors.",
        pub(super) acceleration_variance: f64 [1e-12..=1e6] = 4.0 => "Variance of the acceleration (m²/s⁴).",
        /// Noise variances of what a sensor measures: the position (m²), or position and velocity (m², m²/s²).
        pub(super) noise_variances: Vec<f64> [1e-6..=1e6; 1..=2] = vec![1.0],
        pub(super) start: Vec<f64> [-1e6..=1e6; 2..=2] = vec![0.0, 10.0] => "Mean position (m) and velocity (m/s) at the start.",
        /// Variances of position and velocity at the start, from which the truth is drawn; 0 is known.
        pub(super) start_variances: Vec<f64> [0.0..=1e6; 2..=2] = vec![0.0, 0.0],
        pub(super) start_correlation: f64 [-1.0..=1.0] = 0.0 => "Correlation of position and velocity at the start.",
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub(super) particles: Option<u64> [1..=1_000_000] = None => "Particles of the particle filters.",
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub(super) losses: Option<Vec<f64>> [0.0..=0.99; 1..=20] = None => "Probabilities that the link loses a message.",
    }
    cost |p| {
        let fusion = p.sensors as f64 * 2e-6 + p.cloud() as f64 * 2e-8;
        cost(p.trials, p.steps, p.messages.len(), fusion)
    };
    check |p| {
        let sensors = p.sensors;
        let beyond = |l: &f64| (*l > sensors as f64).then(|| format!("more messages than the {sensors} sensors send"));
        accept_each("messages", &p.messages, beyond)
    };
    quicken |p| p.particles = p.particles.map(|_| 100);
}

impl Linear {
    /// The scalar experiment of so many sensors.
    pub(super) fn scalar(sensors: u64, messages: &[f64]) -> Self {
        Self {
            sensors,
            messages: messages.into(),
            ..Self::default()
        }
    }

    /// The vector experiment of so many sensors. The acceleration variance that fits the printed table is 1, not the 4 of the text.
    pub(super) fn vector(sensors: u64, messages: &[f64]) -> Self {
        Self {
            acceleration_variance: 1.0,
            noise_variances: vec![2.0, 4.0],
            ..Self::scalar(sensors, messages)
        }
    }

    pub(super) fn with_particles(mut self, particles: u64) -> Self {
        self.particles = Some(particles);
        self
    }

    /// So many particles as the particle schemes have.
    pub(super) fn cloud(&self) -> usize {
        self.particles.unwrap_or(1) as usize
    }

    /// The belief about the state before the first step.
    pub(super) fn belief(&self) -> Result<Gaussian<2>, Error> {
        let (position, velocity) = (self.start_variances[0], self.start_variances[1]);
        let common = self.start_correlation * (position * velocity).sqrt();
        let covariance = Matrix2::new(position, common, common, velocity);
        Ok(Gaussian::new(Vector2::new(self.start[0], self.start[1]), covariance)?)
    }

    /// The same with at most so many trials.
    pub(super) fn of_trials(&self, most: u64) -> Self {
        Self {
            trials: self.trials.min(most),
            ..self.clone()
        }
    }
}

parameters! {
    /// A target in a plane among nine sensors of received power.
    #[derive(Debug, Clone)]
    pub struct Field {
        pub(super) trials: u64 [2..=1_000_000] = 200 => quick 24 => "Monte-Carlo trials.",
        pub(super) steps: u64 [1..=1000] = 20 => "Time steps of a trial.",
        pub(super) messages: Vec<f64> [1e-3..=9.0; 1..=20] = vec![2.0] => "Message budgets, each at most nine.",
        pub(super) particles: u64 [2..=1_000_000] = 10_000 => quick 500 => "Particles of every filter.",
        pub(super) spacing_m: f64 [1e-3..=1e6] = 10.0 => "Distance of neighbouring sensors of the 3 by 3 grid (m).",
        pub(super) acceleration_variance: f64 [1e-12..=1e6] = 0.1 => "Variance of the acceleration of each axis (m²/s⁴).",
        pub(super) noise_variance: f64 [1e-6..=1e6] = 1.0 => "Variance of the measurement noise.",
        /// Prior mean of x (m), its velocity (m/s), y and its velocity.
        pub(super) start: Vec<f64> [-1e6..=1e6; 4..=4] = vec![-8.0, 2.0, -8.0, 2.0],
        pub(super) start_variances: Vec<f64> [1e-9..=1e6; 4..=4] = vec![9.0, 4.0, 9.0, 4.0] => "Prior variances of the same.",
        /// Whether the truth is drawn from the prior; the publication's starts at its mean.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub(super) drawn_start: Option<bool> = Some(false),
    }
    cost |p| cost(p.trials, p.steps, p.messages.len(), p.particles as f64 * 1e-7);
}
