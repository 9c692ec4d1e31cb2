//! Protocols: drivers that run the state machines of `fewbits-protocol` on the simulator.

pub(crate) mod bit_star;
pub(crate) mod walk;

use crate::error::Error;
use crate::note::Note;
use crate::units::SensorId;
use fewbits_protocol::{Check, Frame};

/// The note about a frame that no state machine accepts.
fn malformed(with: SensorId, frame: &Frame<'_>) -> Note {
    let note = fewbits_protocol::Note::Malformed { slot: frame.slot };
    Note::Frame { with, note }
}

/// Decodes a frame that a state machine has written.
fn decoded(bytes: &[u8]) -> Result<Frame<'_>, Error> {
    Frame::decode(bytes, Check::Whole).map_err(|error| Error::estimator("protocol", error))
}

pub use bit_star::{BitNode, BitStar, CentreNode, SensingNode, SlotEstimate, StoredBitNode};
pub use walk::{Walk, WalkNode};
