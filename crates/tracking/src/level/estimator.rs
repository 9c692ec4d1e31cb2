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

/// What was otherwise than supposed in the last instants.
pub(crate) struct Revision<'a> {
    /// Noise of sensors.
    pub(crate) noises: Vec<(usize, f64)>,
    /// Factor of the change's variance, if it is another.
    pub(crate) scale: Option<f64>,
    /// In how many of the last instants, at least.
    pub(crate) instants: usize,
    /// The last instants, at least so many.
    pub(crate) last: &'a [Instant],
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
    /// Goes through the last instants again under other noises or another change: what is known after the last one, if any was gone through.
    /// If they give no valid model, nothing is changed.
    fn revise(&mut self, revision: &Revision<'_>) -> Result<Option<LevelRow>, Failure>;
    /// States the error of estimates under noise that lasts.
    fn under(&mut self, lasting: &Lasting);
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
