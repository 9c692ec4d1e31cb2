//! What a centre of any number of coordinates does.

use crate::error::Failure;
use crate::first::lasting::Lasting;
use crate::level::meaning::Seat;
use crate::rows::instant::Instant;

/// A deviation from the model that a row shows: what happened, and the sensor; `None` if it concerns all.
pub type Event = (&'static str, Option<usize>);

/// What is known of a level after a row.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelRow {
    /// Level, slope and curvature, as many as the model has, each with its standard deviation.
    pub estimate: Vec<(f64, f64)>,
    /// Number of bits sent.
    pub bits: usize,
    /// Number of reports.
    pub reports: usize,
    /// How many of them were not used because they were too unlikely.
    pub rejected: usize,
    /// What happened.
    pub events: Vec<Event>,
    /// Mean and variance of the level before the reports.
    pub forecast: (f64, f64),
    /// Number of sensors whose reports are used.
    pub used: usize,
    /// Factor of the variance of the change.
    pub noise_scale: f64,
    /// The level by the same values without quantization, if sensors quantize them here.
    pub full: Option<f64>,
}

/// A centre of any number of coordinates.
pub(crate) trait Estimator {
    /// Adds the next sensor.
    fn join(&mut self, seat: Seat) -> Result<(), Failure>;
    /// Number of sensors added.
    fn seated(&self) -> usize;
    /// Processes one instant.
    fn step(&mut self, instant: &Instant) -> Result<LevelRow, Failure>;
    /// Returns to the state before the last step, with the same sensors.
    fn undo(&mut self);
    /// Sets the factor of the change's variance.
    fn rescale(&mut self, scale: f64) -> Result<(), Failure>;
    /// Sets the noise of sensors.
    fn set_noises(&mut self, noises: &[(usize, f64)]) -> Result<(), Failure>;
    /// States the error of estimates under noise that lasts.
    fn under(&mut self, lasting: &Lasting);
    /// Returns to a state that is at least so many instants back, as far as they are kept: the number of instants since then.
    fn back(&mut self, instants: usize) -> Option<usize>;
    /// Probability that a sensor works, and whether its reports are used.
    fn health(&self, sensor: usize) -> (f64, bool);
    /// Number of its reports that were rejected.
    fn rejected(&self, sensor: usize) -> u64;
    /// Of a sensor that sends bits: by how many deviations unlikely ones came more often than predicted.
    fn surprise(&self, sensor: usize) -> Option<f64>;
    /// The estimates of all steps given all reports, or those up to so many seconds later.
    fn smoothed(&self, lag: Option<f64>) -> Result<Vec<Vec<(f64, f64)>>, Failure>;
}

/// Purpose of the centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Use {
    /// Cells are measurements, which sensors of this program quantize.
    Measurements,
    /// Cells are reports.
    Reports,
    /// Unquantized measurements and no adaptation: the centre serves to compare likelihoods.
    Comparison,
}
