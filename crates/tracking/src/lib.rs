//! Estimates from tables of measurements.

mod error;
mod first;
mod fit;
mod leak;
mod level;
mod ranges;
mod rows;
mod text;

pub use error::{Error, Failure};
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
