//! Finding a diffusive source by a belief that travels from sensor to sensor.

mod belief;
mod chain;
mod envelope;
mod error;
pub mod information;
mod likelihood;
pub mod message;
mod posterior;
mod project;
mod rate;
mod record;
mod select;
mod sensor;
mod target;

pub use belief::{JointBelief, PositionBelief, Prior, SearchBox};
pub use chain::{Outcome, Search, Status, Step};
pub use envelope::Envelope;
pub use error::Error;
pub use likelihood::{RateLikelihood, SourceLikelihood};
pub use posterior::Posterior;
pub use project::{Form, Travelling, project};
pub use rate::{RateModel, RateRange, RateSums, log_sample_marginal};
pub use record::Record;
pub use select::{Rule, Selector};
pub use sensor::SourceSensor;
