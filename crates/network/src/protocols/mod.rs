//! Who talks to whom: drivers that run the machines of `fewbits-protocol` over the simulator.

pub(crate) mod bit_star;
pub(crate) mod walk;

pub use bit_star::{BitNode, BitStar, CentreNode, SensingNode, SlotEstimate, StoredBitNode};
pub use walk::{Walk, WalkNode};
