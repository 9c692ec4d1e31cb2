//! Estimates from tables of measurements: a level that several sensors measure, a place from ranges, a leak in a building, and the calibration of
//! sensors.
//!
//! This is what the tasks `track`, `ranges`, `leak` and `fit` of the command `fewbits` do, without files and options. A tracker takes the rows of a
//! table one by one and says after each what is known. What nobody states it finds from the first rows (noise of each sensor, change of the level,
//! steps of rounding, detection limits, angles) or while rows come (sensors that fail, noise that changes). At the end it says what it found, in numbers
//! and in sentences.
//!
//! ```
//! use fewbits_tracking::{Instant, Instants, LevelOptions, LevelTracker};
//!
//! // Two sensors of a level that rises from 20 to 26. The second one falls silent half-way.
//! let rows = (0..600_u32).map(|k| {
//!     let (time, level) = (f64::from(k), 20.0 + 0.01 * f64::from(k));
//!     let read = |seed: f64| level + 0.4 * (seed * time * time).sin();
//!     Instant::new(u64::from(k) + 1, time, &[Some(read(1.3)), (k < 300).then(|| read(2.9))])
//! });
//! let mut rows = Instants::listed(["near", "far"], rows);
//! let mut tracker = LevelTracker::new(&LevelOptions::default(), &mut rows)?;
//! let mut last = None;
//! while let Some(instant) = rows.next()? {
//!     last = tracker.step(rows.names(), &instant)?;
//! }
//! let (level, deviation) = last.ok_or("there are rows")?.estimate[0];
//! assert!((level - 25.99).abs() < 3.0 * deviation && deviation < 0.3);
//! let summary = tracker.finish(&rows);
//! assert!(summary.sensors[0].used && !summary.sensors[1].used);
//! assert!(summary.lines().contains(&"far is not used any more: it is silent".to_owned()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | task | in | out |
//! |---|---|---|
//! | a level | [`LevelOptions`] | [`LevelTracker`]: [`LevelRow`], [`LevelSummary`] |
//! | a place from distances to anchors | [`RangesOptions`] | [`RangesTracker`]: [`RangesRow`], [`RangesSummary`] |
//! | the room of a leak | [`Rooms`] | [`LeakTracker`]: [`LeakEstimate`], [`LeakSummary`] |
//! | calibration | [`CalibrationOptions`] | [`calibrate`]: [`Calibrated`]; [`Calibration::apply`] hands it to a level |
//!
//! **Rows.** A source of rows implements [`Rows`]; [`Instants`] puts them in order, joins single reports of one time, drops copies, and can be looked
//! at before it is used up. Rows that are there need no source: [`Instants::listed`]. A sensor is its place among [`Instants::names`], which grow
//! where each row is the report of a sensor ([`RowOptions::single_reports`]).
//!
//! **Units.** Times are seconds since the first row. Values, noises and levels have the unit of the table, places and ranges that of the anchors.
//! Nothing depends on the unit. A pair of numbers is a mean and a standard deviation, unless its field says otherwise.
//!
//! **Sentences.** Hints and summaries are sentences for people. They name options as the command does, `--noise` for [`LevelOptions::noise`]: the
//! name of the field, with hyphens. Messages of [`Error`] name the field.
//!
//! **Errors.** A call that refuses a row leaves the tracker as it was, as far as its page does not say otherwise.
//!
//! Not here: tables as text (`fewbits-table`), files and options (`fewbits-cli`), the filters (`fewbits-filters`), the tracker of ranges
//! (`fewbits-pf-mpa`), the belief of a leak (`fewbits-diffusion`).

mod error;
mod first;
mod fit;
mod leak;
mod level;
mod ranges;
mod rows;
mod text;

pub use error::{Error, Failure};
pub use fewbits_filters::fit::{Fit, Request, SensorModel};
pub use fewbits_pf_mpa::{Mistake, RangeEstimate, Travel};
pub use fewbits_table::Side;
pub use fit::calibration::{CalibratedSensor, Calibration};
pub use fit::{Calibrated, CalibrationOptions, calibrate};
pub use leak::rooms::{RoomSensor, Rooms};
pub use leak::{LeakEstimate, LeakSummary, LeakTracker};
pub use level::LevelTracker;
pub use level::estimator::{Event, LevelRow};
pub use level::options::{Known, LevelOptions, Model, PerSensor};
pub use level::report::Report;
pub use level::summary::{EventSummary, LevelSummary, SensorSummary};
pub use ranges::settings::{RangesOptions, Strengths};
pub use ranges::summary::{AnchorSummary, RangesSummary};
pub use ranges::{RangesRow, RangesTracker};
pub use rows::correction::Correction;
pub use rows::instant::{Instant, Qualifier};
pub use rows::transform::Transform;
pub use rows::{Instants, Listed, RowOptions, Rows};
pub use text::short;
