//! Who talks to whom: drivers that run the machines of `fewbits-protocol` over the simulator.

pub(crate) mod bit_star;
pub(crate) mod walk;

use crate::error::Error;
use crate::note::Note;
use crate::units::SensorId;
use fewbits_protocol::{Check, Frame};

/// The note of a frame that no machine takes.
fn malformed(with: SensorId, frame: &Frame<'_>) -> Note {
    let note = fewbits_protocol::Note::Malformed { slot: frame.slot };
    Note::Frame { with, note }
}

/// The frame that a machine has written.
fn decoded(bytes: &[u8]) -> Result<Frame<'_>, Error> {
    Frame::decode(bytes, Check::Whole).map_err(|error| Error::estimator("protocol", error))
}

pub use bit_star::{BitNode, BitStar, CentreNode, SensingNode, SlotEstimate, StoredBitNode};
pub use walk::{Walk, WalkNode};
