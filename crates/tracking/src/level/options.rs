//! What is known of a level and its sensors.

use super::report::Report;
use crate::error::Error;

/// Values of the sensors, by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PerSensor<T> {
    /// Names, and their values.
    pub named: Vec<(String, T)>,
    /// The value of all other sensors.
    pub others: T,
}

impl<T> PerSensor<T> {
    /// One value for all sensors.
    pub fn all(value: T) -> Self {
        Self {
            named: Vec::new(),
            others: value,
        }
    }

    /// The value of a sensor.
    pub fn of(&self, name: &str) -> &T {
        let named = self.named.iter().find(|(known, _)| known == name);
        named.map_or(&self.others, |(_, value)| value)
    }

    fn values(&self) -> impl Iterator<Item = &T> {
        self.named.iter().map(|(_, value)| value).chain([&self.others])
    }
}

impl<T> PerSensor<Option<T>> {
    /// Whether it says anything of any sensor.
    pub(crate) fn is_stated(&self) -> bool {
        self.others.is_some() || !self.named.is_empty()
    }
}

/// Dynamics of a level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Model {
    /// Level: random walk.
    Walk,
    /// Level and slope: the slope is a random walk (nearly constant velocity).
    Velocity,
    /// Level, slope and curvature: the curvature is a random walk (nearly constant acceleration).
    Acceleration,
    /// Level: Ornstein-Uhlenbeck process that returns to the mean of [`LevelOptions::prior`].
    Returning,
}

/// What is known of a number that rows may show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Known<T> {
    /// It is found from the first rows, if they show one.
    #[default]
    Found,
    /// There is none.
    No,
    /// It is this.
    Is(T),
}

/// What is known of a level and its sensors. What is not stated is found from the first rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LevelOptions {
    /// Dynamics. Default: a walk, or a level with a slope if the first rows decide for one and `change` is not stated.
    pub model: Option<Model>,
    /// What each sensor sends.
    pub send: PerSensor<Report>,
    /// Cells are reports: a value, a bit as 1, or 0 or -1, or the number of a quantizer cell. Otherwise they are measurements, which are
    /// quantized.
    pub reports: bool,
    /// Fixed thresholds of bits. Default: the prediction.
    pub threshold: PerSensor<Option<f64>>,
    /// Rows state thresholds of bits: [`Qualifier::threshold`](crate::Qualifier::threshold).
    pub has_thresholds: bool,
    /// Rows state the accuracy of their values: [`Qualifier::accuracy`](crate::Qualifier::accuracy).
    pub has_accuracies: bool,
    /// Cells may be limits: [`Qualifier::limit`](crate::Qualifier::limit).
    pub has_limits: bool,
    /// Step of which values are multiples, as they are rounded.
    pub rounded: Known<f64>,
    /// An empty cell says that the measurement is within this of the sensor's last value, as of sensors that send on change.
    pub silent_within: Option<f64>,
    /// Lower and upper detection limit: a value at or beyond one says only that the measurement is beyond it.
    pub limits: Known<(Option<f64>, Option<f64>)>,
    /// Standard deviations of the measurement noise.
    pub noise: PerSensor<Option<f64>>,
    /// Standard deviation of the level from its forecast, and after how many seconds.
    pub change: Option<(f64, f64)>,
    /// Mean and standard deviation of the level before the first row.
    pub prior: Option<(f64, f64)>,
    /// Whether the change is adapted during the run. Default: it is, unless `change` is stated or cells are intervals.
    pub learning: Option<bool>,
    /// Mean and standard deviation of the slope per second before the first row.
    pub slope: Option<(f64, f64)>,
    /// All estimates are kept, for [`LevelTracker::smoothed`](crate::LevelTracker::smoothed).
    pub smooth: bool,
    /// Period of a level that is an angle.
    pub period: Known<f64>,
    /// Number of the first rows from which offsets between sensors are found and taken off. The median of all offsets is zero.
    pub align: Option<usize>,
}

/// Refuses a number that is not above 0.
fn above_zero(argument: &'static str, number: f64) -> Result<(), Error> {
    if number > 0.0 && number.is_finite() {
        return Ok(());
    }
    Err(Error::Argument {
        argument,
        value: number.to_string(),
        expected: "a finite number above 0",
    })
}

impl LevelOptions {
    /// Refuses numbers that are out of their range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let noises = self.noise.values().flatten();
        noises.copied().try_for_each(|noise| above_zero("noise", noise))?;
        let change = self.change.iter().flat_map(|(size, time)| [*size, *time]);
        change.into_iter().try_for_each(|number| above_zero("change", number))?;
        for (argument, stated) in [("prior", self.prior), ("slope", self.slope)] {
            if let Some((mean, deviation)) = stated {
                above_zero(argument, deviation)?;
                above_zero(argument, 1.0 + mean.abs())?;
            }
        }
        self.silent_within
            .map_or(Ok(()), |width| above_zero("silent_within", width))?;
        for (argument, stated) in [("rounded", self.rounded), ("period", self.period)] {
            if let Known::Is(number) = stated {
                above_zero(argument, number)?;
            }
        }
        self.send.values().try_for_each(|report| report.check())
    }
}
