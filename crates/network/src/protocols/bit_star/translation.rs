//! Frames and notes of the machines as the simulator has them.

use crate::error::{Error, in_full};
use crate::medium::{Frame, Kind};
use crate::note::{Note, Stage};
use crate::units::SensorId;
use fewbits_protocol as machines;
use fewbits_protocol::{Payload, Slot};

const KINDS: [(Kind, machines::Kind); 7] = [
    (Kind::Question, machines::Kind::Feedback),
    (Kind::Report, machines::Kind::Report),
    (Kind::Echo, machines::Kind::Echo),
    (Kind::Snapshot, machines::Kind::Snapshot),
    (Kind::Request, machines::Kind::Request),
    (Kind::Handover, machines::Kind::Handover),
    (Kind::Beacon, machines::Kind::Heartbeat),
];

/// A machine's frame as the simulator charges it: without the padding of its last byte.
pub(crate) fn of(frame: &machines::Frame<'_>) -> Frame {
    // Acknowledgements are the radio's.
    let kind = KINDS
        .iter()
        .find(|(_, kind)| *kind == frame.kind)
        .map_or(Kind::Beacon, |(kind, _)| *kind);
    Frame {
        destination: frame.destination,
        ..Frame::new(kind, frame.slot.number(), frame.digest, frame.payload.into())
    }
}

pub(crate) fn simulated(bytes: &[u8]) -> Result<Frame, Error> {
    let frame = machines::Frame::decode(bytes, machines::Check::Whole);
    Ok(of(&frame.map_err(|error| Error::estimator("protocol", error))?))
}

pub(crate) fn machine_frame(frame: &Frame) -> Option<machines::Frame<'_>> {
    let (_, kind) = KINDS.iter().find(|(kind, _)| *kind == frame.kind)?;
    let slot = Slot::of_count(u64::from(frame.slot));
    Some(machines::Frame {
        destination: frame.destination,
        ..machines::Frame::new(*kind, slot, frame.digest, Payload::from(&frame.payload))
    })
}

/// Whether sensors send frames of this kind to the centre, and not the other way.
pub(super) fn goes_up(kind: Kind) -> bool {
    matches!(kind, Kind::Report | Kind::Request | Kind::Beacon)
}

/// Whether the centre sends frames of this kind to all sensors.
pub(super) fn is_for_all(kind: Kind) -> bool {
    matches!(kind, Kind::Question | Kind::Echo | Kind::Snapshot | Kind::Beacon)
}

pub(crate) fn failed(stage: Stage, slot: u32, error: &machines::BoxError) -> Note {
    let reason = in_full(&**error);
    Note::Failed { stage, slot, reason }
}

/// A machine's note in the log's words.
pub(crate) fn noted(with: SensorId, note: machines::Note) -> Note {
    use machines::Note as Noticed;
    match note {
        Noticed::Damaged(_) | Noticed::FutureVersion { .. } => Note::Damaged,
        Noticed::Duplicate { .. } => Note::Duplicate,
        Noticed::Late { .. } => Note::Late,
        Noticed::Disagreement { slot } => Note::Disagreement {
            with,
            slot: slot.number(),
        },
        Noticed::Retained { slot } => Note::Retained { slot: slot.number() },
        Noticed::Resynchronised { slot } => Note::Resynchronised { slot: slot.number() },
        _ => Note::Malformed,
    }
}
