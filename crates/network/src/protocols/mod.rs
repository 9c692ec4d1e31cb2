//! Who talks to whom: protocols over the simulator that run any [`Estimator`](crate::Estimator) or [`Walker`].

pub(crate) mod bit_star;
pub(crate) mod slot;
pub(crate) mod star;
pub(crate) mod walk;

pub use bit_star::{BitNode, BitStar};
pub use star::{Centre, Feedback, Sensor, Star, StarNode};
pub use walk::{Lead, Walk, WalkNode, Walker};
