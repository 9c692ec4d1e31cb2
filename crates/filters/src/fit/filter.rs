//! The filter of a level and of the offsets that wander.

use super::model::{LevelModel, Scale, SensorModel};

/// What a stretch of time does to the level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub(super) seconds: f64,
    /// Share of the distance from the mean that is kept, and variance that is added.
    kept: f64,
    more: f64,
}

impl Step {
    pub(super) fn new(model: &LevelModel, seconds: f64) -> Self {
        let rate = model.change * model.change;
        let (kept, more) = match model.time_constant {
            Some(constant) => {
                let settled = 0.5 * rate * constant;
                ((-seconds / constant).exp(), -settled * (-2.0 * seconds / constant).exp_m1())
            }
            None => (1.0, rate * seconds),
        };
        Self { seconds, kept, more }
    }
}

/// A Gaussian belief of the level, perhaps with offsets.
pub(super) trait Filter {
    /// Some time passes, in which the level returns to its mean.
    fn predict(&mut self, mean: f64, step: &Step);
    /// Mean and variance of what a sensor measures, without noise and constant offset. The next update is of this sensor.
    fn expected(&mut self, sensor: usize, model: &SensorModel) -> (f64, f64);
    /// The mean moves by `shift` times the covariance with what was expected, the covariance loses `spread` times the square of that.
    fn update(&mut self, shift: f64, spread: f64);
    /// The level has jumped: its variance grows.
    fn widen(&mut self, variance: f64);
}

/// The mean of the level after a step. Of a level that wanders it stays, to the last digit.
fn returned(middle: f64, before: f64, step: &Step) -> f64 {
    if step.kept < 1.0 {
        middle + step.kept * (before - middle)
    } else {
        before
    }
}

/// No offset wanders: the belief is that of the level.
#[derive(Debug, Clone)]
pub(super) struct Steady {
    mean: f64,
    variance: f64,
    /// Covariance of the level and what is expected.
    cross: f64,
}

impl Steady {
    pub(super) fn new(model: &LevelModel, scale: &Scale) -> Self {
        let (mean, variance) = model.first(scale);
        Self {
            mean,
            variance,
            cross: 0.0,
        }
    }
}

impl Filter for Steady {
    fn predict(&mut self, mean: f64, step: &Step) {
        self.mean = returned(mean, self.mean, step);
        self.variance = step.kept * step.kept * self.variance + step.more;
    }

    fn expected(&mut self, _: usize, model: &SensorModel) -> (f64, f64) {
        self.cross = model.gain * self.variance;
        (model.gain * self.mean, model.gain * self.cross)
    }

    fn update(&mut self, shift: f64, spread: f64) {
        self.mean += self.cross * shift;
        self.variance -= self.cross * self.cross * spread;
    }

    fn widen(&mut self, variance: f64) {
        self.variance += variance;
    }
}

/// The level, which is coordinate 0, and the offsets that wander.
#[derive(Debug, Clone)]
pub(super) struct Wandering {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    cross: Vec<f64>,
    /// Coordinate of each sensor's offset, and variance of each after a second.
    place: Vec<Option<usize>>,
    walks: Vec<f64>,
}

impl Wandering {
    pub(super) fn new(model: &LevelModel, scale: &Scale) -> Self {
        let (mut place, mut walks) = (vec![None; model.sensors.len()], Vec::new());
        for (sensor, own) in model.sensors.iter().enumerate() {
            if own.walk > 0.0 {
                place[sensor] = Some(1 + walks.len());
                walks.push(own.walk * own.walk);
            }
        }
        let n = 1 + walks.len();
        let (mut mean, mut covariance) = (vec![0.0; n], vec![0.0; n * n]);
        (mean[0], covariance[0]) = model.first(scale);
        Self {
            mean,
            covariance,
            cross: vec![0.0; n],
            place,
            walks,
        }
    }
}

impl Filter for Wandering {
    fn predict(&mut self, mean: f64, step: &Step) {
        let n = self.mean.len();
        self.mean[0] = returned(mean, self.mean[0], step);
        for j in 0..n {
            self.covariance[j] *= step.kept;
            self.covariance[j * n] *= step.kept;
        }
        self.covariance[0] += step.more;
        for (walk, variance) in self.walks.iter().enumerate() {
            self.covariance[(walk + 1) * (n + 1)] += variance * step.seconds;
        }
    }

    fn expected(&mut self, sensor: usize, model: &SensorModel) -> (f64, f64) {
        let n = self.mean.len();
        let own = self.place[sensor];
        for (cross, row) in self.cross.iter_mut().zip(self.covariance.chunks_exact(n)) {
            *cross = model.gain * row[0] + own.map_or(0.0, |own| row[own]);
        }
        let with = |of: &[f64]| model.gain * of[0] + own.map_or(0.0, |own| of[own]);
        (with(&self.mean), with(&self.cross))
    }

    fn update(&mut self, shift: f64, spread: f64) {
        let n = self.mean.len();
        for (mean, cross) in self.mean.iter_mut().zip(&self.cross) {
            *mean += cross * shift;
        }
        for (row, one) in self.covariance.chunks_exact_mut(n).zip(&self.cross) {
            for (entry, other) in row.iter_mut().zip(&self.cross) {
                *entry -= one * other * spread;
            }
        }
    }

    fn widen(&mut self, variance: f64) {
        self.covariance[0] += variance;
    }
}
