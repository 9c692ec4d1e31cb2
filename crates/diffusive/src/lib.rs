//! Finding a diffusive source by a belief that travels from sensor to sensor.

mod error;
mod likelihood;
mod posterior;
mod project;
mod rate;
mod record;
mod sensor;

pub use error::Error;
pub use likelihood::{RateLikelihood, SourceLikelihood};
pub use posterior::{PositionBelief, Posterior, Prior, SearchBox};
pub use project::{Form, Travelling, project};
pub use rate::{RateModel, RateRange, RateSums, log_sample_marginal};
pub use record::Record;
pub use sensor::SourceSensor;
