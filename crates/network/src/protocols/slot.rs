//! One slot at the receiver: what was heard, what it means, and how it is told to others.

use crate::error::Error;
use crate::estimator::Estimator;
use crate::frame::stored;
use crate::log::Note;
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

/// What is known in a slot without any report: the start, predicted on.
pub(crate) fn from_prior<E: Estimator>(e: &E, stream: Stream, slot: u32) -> Result<E::Belief, Error> {
    (1..=slot).try_fold(e.start(), |belief, at| predict(e, stream, at, &belief))
}

/// The belief after a slot. What is impossible is tried once more with all that did not come taken as lost; `arrived` then says so.
/// If the estimator still refuses, the slot passes without reports.
pub(crate) fn settle<E: Estimator>(
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
        if e.mean(&belief).iter().all(|x| x.is_finite()) {
            Ok(belief)
        } else {
            Err(Error::Impossible)
        }
    };
    if let Ok(belief) = attempt(arrived) {
        return (belief, None);
    }
    for nothing in arrived.iter_mut().filter(|a| **a == Arrived::Nothing) {
        *nothing = Arrived::Lost;
    }
    if let Ok(belief) = attempt(arrived) {
        return (belief, Some(Note::Impossible { slot }));
    }
    arrived.fill(Arrived::Lost);
    (predicted.clone(), Some(Note::Refused { slot }))
}

/// What a centre tells those that follow it: for each sensor `0` for nothing, `10` for lost, `11` and the report.
pub(crate) fn echo_bits(arrived: &[Arrived]) -> Result<BitString, CodecError> {
    let mut writer = BitWriter::new();
    for arrived in arrived {
        match arrived {
            Arrived::Nothing => writer.write(0, 1)?,
            Arrived::Lost => writer.write(0b10, 2)?,
            Arrived::Report(bits) => {
                writer.write(0b11, 2)?;
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
            Ok(match (reader.read_bit()?, sensor) {
                (false, _) => Arrived::Nothing,
                (true, sensor) => {
                    if reader.read_bit()? {
                        let format = e.report_format(sensor);
                        Arrived::Report(E::Report::decode(&format, &mut reader)?.to_bits(&format)?)
                    } else {
                        Arrived::Lost
                    }
                }
            })
        })
        .collect::<Result<_, CodecError>>()?;
    reader.finish()?;
    Ok(all)
}
