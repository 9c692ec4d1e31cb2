//! Who talks to whom: protocols over the simulator that run any [`Estimator`](crate::Estimator) or [`Walker`].

pub(crate) mod ad_hoc;
pub(crate) mod bit_star;
pub(crate) mod slot;
pub(crate) mod star;
pub(crate) mod walk;

pub use ad_hoc::{AdHoc, Peer};
pub use bit_star::{BitNode, BitStar};
pub use star::{Centre, Feedback, Sensor, Star, StarNode};
pub use walk::{Lead, Walk, WalkNode, Walker};
