//! One slot at the receiver: what arrived, the update by it, how it is told to others, and what it takes of the air.

use crate::clock::Clock;
use crate::error::Error;
use crate::estimator::{Estimator, ReportEnd};
use crate::medium::{Frame, Kind, frame::stored};
use crate::note::{Note, Stage};
use crate::simulator::{Context, Setup, transmission::air_time};
use crate::units::Bits;
use fewbits_core::{BitReader, BitString, BitWriter, CodecError, Message, Observation};
use fewbits_monte_carlo::Stream;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

/// What came from one sensor in a slot, as bits.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) enum Arrived {
    #[default]
    Nothing,
    Lost,
    Report(#[serde(with = "stored")] BitString),
}

/// The generator that all ends share in a slot.
pub(crate) fn shared(stream: Stream, purpose: &str, slot: u32) -> Pcg64Dxsm {
    stream.named(purpose).indexed(u64::from(slot)).rng()
}

/// The generator of one sensor in a slot.
pub(crate) fn own(stream: Stream, sensor: usize, slot: u32) -> Pcg64Dxsm {
    stream
        .named("sensor")
        .indexed(sensor as u64)
        .indexed(u64::from(slot))
        .rng()
}

/// The prediction into a slot.
pub(crate) fn predict<E: Estimator>(e: &E, stream: Stream, slot: u32, belief: &E::Belief) -> Result<E::Belief, Error> {
    e.predict(&mut shared(stream, "predict", slot), slot, belief)
}

/// The belief in a slot without any report: the start, predicted on.
pub(crate) fn from_prior<E: Estimator>(e: &E, stream: Stream, slot: u32) -> Result<E::Belief, Error> {
    (1..=slot).try_fold(e.start(), |belief, at| predict(e, stream, at, &belief))
}

/// Updates the predicted belief with what arrived in one slot. Always returns a belief:
/// 1. Update with the observations as they arrived.
/// 2. If that fails, replace every `Nothing` by `Lost` and update again; return [`Note::TakenAsLost`] with the first error.
/// 3. If that fails too, mark all as `Lost` and return `predicted` with [`Note::Failed`] and the first error.
///
/// An update fails if a report does not decode, the estimator returns an error, or the mean is not finite. `arrived` holds what was used.
pub(crate) fn update_or_discard<E: Estimator>(
    e: &E,
    stream: Stream,
    slot: u32,
    predicted: &E::Belief,
    arrived: &mut [Arrived],
) -> (E::Belief, Option<Note>) {
    let attempt = |arrived: &[Arrived]| {
        let observations = arrived.iter().enumerate().map(|(sensor, arrived)| {
            Ok(match arrived {
                Arrived::Nothing => Observation::Nothing,
                Arrived::Lost => Observation::Lost,
                Arrived::Report(bits) => Observation::Received(E::Report::from_bits(&e.report_format(sensor), bits)?),
            })
        });
        let observations = observations.collect::<Result<Vec<_>, CodecError>>()?;
        let belief = e.update(&mut shared(stream, "update", slot), slot, predicted, &observations)?;
        let mean = e.mean(&belief);
        match mean.iter().position(|x| !x.is_finite()) {
            None => Ok(belief),
            Some(coordinate) => Err(Error::NotFinite {
                coordinate,
                value: mean[coordinate],
            }),
        }
    };
    let first = match attempt(arrived) {
        Ok(belief) => return (belief, None),
        Err(error) => error,
    };
    let reason = first.in_full();
    if arrived.contains(&Arrived::Nothing) {
        for nothing in arrived.iter_mut().filter(|a| **a == Arrived::Nothing) {
            *nothing = Arrived::Lost;
        }
        if let Ok(belief) = attempt(arrived) {
            return (belief, Some(Note::TakenAsLost { slot, reason }));
        }
    }
    arrived.fill(Arrived::Lost);
    let stage = Stage::Update;
    (predicted.clone(), Some(Note::Failed { stage, slot, reason }))
}

/// Slots in which one node failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Failures(u32);

impl Failures {
    /// Notes an error of one step of the node.
    ///
    /// # Errors
    /// [`Error::MostSlotsFailed`] once the node has failed in more than half of the `slots` slots of the run.
    pub(crate) fn record(
        &mut self,
        context: &mut Context<'_>,
        slots: u32,
        stage: Stage,
        slot: u32,
        error: &Error,
    ) -> Result<(), Error> {
        let reason = error.in_full();
        self.note(context, slots, Note::Failed { stage, slot, reason })
    }

    /// Writes a note into the log, and counts it if it is a failure.
    ///
    /// # Errors
    /// As [`record`](Self::record).
    pub(crate) fn note(&mut self, context: &mut Context<'_>, slots: u32, note: Note) -> Result<(), Error> {
        context.note(note.clone());
        if let Note::Failed { .. } = note {
            self.0 += 1;
            if self.0 > slots / 2 {
                return Err(Error::MostSlotsFailed {
                    node: context.id(),
                    failed: self.0,
                    slots,
                    last: note,
                });
            }
        }
        Ok(())
    }
}

/// Checks that a slot has time for what the centre broadcasts (`question` bits, with header and check; `None` for nothing) and for one report
/// of each of `sensors` sensors. Reports are counted without payload, since their lengths are not known beforehand.
///
/// # Errors
/// [`Error::SlotTooShort`].
pub(crate) fn check_fits(clock: &Clock, setup: &Setup, question: Option<u64>, sensors: usize) -> Result<(), Error> {
    let report = Bits(u64::from(Frame::overhead(Kind::Report)));
    let bodies = question
        .map(Bits)
        .into_iter()
        .chain(std::iter::repeat_n(report, sensors));
    let mut needed = air_time(&setup.radio, bodies);
    if setup.retries.is_some() {
        needed += std::iter::repeat_n(setup.radio.answer_time(), sensors).sum();
    }
    let available = clock.reporting_time();
    if needed > available {
        return Err(Error::SlotTooShort {
            frames: sensors + usize::from(question.is_some()),
            needed,
            available,
        });
    }
    Ok(())
}

/// Bits of a report's length in an echo, where the report does not say where it ends.
const LENGTH_BITS: u32 = 16;

/// What a centre tells those that follow it: for each sensor `0` for nothing, `10` for lost, `11` and the report. Before a report that does not
/// say where it ends goes its length.
pub(crate) fn echo_bits(arrived: &[Arrived], end: ReportEnd) -> Result<BitString, CodecError> {
    let mut writer = BitWriter::new();
    for arrived in arrived {
        match arrived {
            Arrived::Nothing => writer.write(0, 1)?,
            Arrived::Lost => writer.write(0b10, 2)?,
            Arrived::Report(bits) => {
                writer.write(0b11, 2)?;
                if end == ReportEnd::OfMessage {
                    writer.write(bits.bits() as u64, LENGTH_BITS)?;
                }
                writer.append(bits);
            }
        }
    }
    Ok(writer.finish())
}

/// Reads what [`echo_bits`] wrote. Total.
pub(crate) fn echo_of<E: Estimator>(e: &E, bits: &BitString) -> Result<Vec<Arrived>, CodecError> {
    let mut reader = BitReader::new(bits);
    let all = (0..e.sensors())
        .map(|sensor| {
            if !reader.read_bit()? {
                return Ok(Arrived::Nothing);
            }
            if !reader.read_bit()? {
                return Ok(Arrived::Lost);
            }
            let format = e.report_format(sensor);
            Ok(Arrived::Report(match e.report_end() {
                ReportEnd::InReport => E::Report::decode(&format, &mut reader)?.to_bits(&format)?,
                ReportEnd::OfMessage => {
                    let length = reader.read(LENGTH_BITS)? as usize;
                    reader.read_message(length)?
                }
            }))
        })
        .collect::<Result<_, CodecError>>()?;
    reader.finish()?;
    Ok(all)
}
