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
    /// A report was sent and not understood.
    Lost,
    /// The report answers another prediction than the receiver's: no observation.
    Foreign,
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
/// 2. If that fails, update again without the sensors of which nothing arrived; return [`Note::SilenceIgnored`] with the first error.
///    Whether these were silent or lost is unknown, so that they give no observation.
/// 3. If that fails too, return `predicted` with [`Note::Failed`] and the first error.
///
/// An update fails if a report does not decode, the estimator returns an error, or the mean is not finite. Whoever is told `arrived` gets the
/// same belief from the same prediction.
pub(crate) fn update_or_discard<E: Estimator>(
    e: &E,
    stream: Stream,
    slot: u32,
    predicted: &E::Belief,
    arrived: &[Arrived],
) -> (E::Belief, Option<Note>) {
    let attempt = |silence_counts: bool| {
        let observations = arrived.iter().enumerate().map(|(sensor, arrived)| {
            Ok(match arrived {
                Arrived::Nothing => silence_counts.then_some(Observation::Nothing),
                Arrived::Foreign => None,
                Arrived::Lost => Some(Observation::Lost),
                Arrived::Report(bits) => {
                    Some(Observation::Received(E::Report::from_bits(&e.report_format(sensor), bits)?))
                }
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
    let first = match attempt(true) {
        Ok(belief) => return (belief, None),
        Err(error) => error,
    };
    let reason = first.in_full();
    if arrived.contains(&Arrived::Nothing)
        && let Ok(belief) = attempt(false)
    {
        return (belief, Some(Note::SilenceIgnored { slot, reason }));
    }
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

/// What a centre tells those that follow it: for each sensor `0` for nothing, `100` for lost, `101` for no observation, `11` and the report. Before a report that does not
/// say where it ends goes its length.
pub(crate) fn echo_bits(arrived: &[Arrived], end: ReportEnd) -> Result<BitString, CodecError> {
    let mut writer = BitWriter::new();
    for arrived in arrived {
        match arrived {
            Arrived::Nothing => writer.write(0, 1)?,
            Arrived::Lost => writer.write(0b100, 3)?,
            Arrived::Foreign => writer.write(0b101, 3)?,
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
                return Ok(if reader.read_bit()? {
                    Arrived::Foreign
                } else {
                    Arrived::Lost
                });
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

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Sign;

    /// Two sensors that always speak, so that nothing from one is impossible. The belief is what the update was told of each sensor.
    struct Strict {
        refuses_all: bool,
    }

    impl Estimator for Strict {
        type Belief = Vec<Option<Observation<Sign>>>;
        type Measurement = ();
        type Question = ();
        type Report = Sign;
        type Memory = ();

        fn sensors(&self) -> usize {
            2
        }

        fn start(&self) -> Self::Belief {
            Vec::new()
        }

        fn memory(&self, _: usize) {}

        fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Self::Belief) -> Result<Self::Belief, Error> {
            Ok(belief.clone())
        }

        fn question(&self, _: u32, _: &Self::Belief, _: usize) -> Result<(), Error> {
            Ok(())
        }

        fn question_format(&self, _: usize) {}

        fn report_format(&self, _: usize) {}

        fn report(
            &self,
            _: &mut Pcg64Dxsm,
            _: u32,
            _: usize,
            (): &mut (),
            (): &(),
            (): &(),
        ) -> Result<Option<Sign>, Error> {
            Ok(Some(Sign::Above))
        }

        fn update(
            &self,
            _: &mut Pcg64Dxsm,
            _: u32,
            _: &Self::Belief,
            observations: &[Option<Observation<Sign>>],
        ) -> Result<Self::Belief, Error> {
            if self.refuses_all || observations.contains(&Some(Observation::Nothing)) {
                return Err(Error::Impossible);
            }
            Ok(observations.to_vec())
        }

        fn mean(&self, _: &Self::Belief) -> Vec<f64> {
            vec![0.0]
        }
    }

    fn report() -> Arrived {
        Arrived::Report(Sign::Above.to_bits(&()).unwrap())
    }

    #[test]
    fn an_impossible_silence_is_no_observation() {
        let update = |refuses_all, arrived: &[Arrived]| {
            update_or_discard(&Strict { refuses_all }, Stream::new(1), 1, &Vec::new(), arrived)
        };
        let (received, lost) = (Some(Observation::Received(Sign::Above)), Some(Observation::Lost));
        let (belief, note) = update(false, &[report(), Arrived::Nothing]);
        assert_eq!(belief, [received, None]);
        assert!(matches!(note, Some(Note::SilenceIgnored { .. })), "{note:?}");
        assert_eq!(update(false, &[Arrived::Lost, Arrived::Foreign]), (vec![lost, None], None));
        let (belief, note) = update(true, &[report(), Arrived::Nothing]);
        assert!(belief.is_empty() && matches!(note, Some(Note::Failed { .. })), "{note:?}");
    }

    #[test]
    fn echoes_tell_what_arrived() {
        let kinds = [Arrived::Nothing, Arrived::Lost, Arrived::Foreign, report()];
        for (a, b) in kinds.iter().flat_map(|a| kinds.iter().map(move |b| (a, b))) {
            let arrived = vec![a.clone(), b.clone()];
            let bits = echo_bits(&arrived, ReportEnd::InReport).unwrap();
            assert_eq!(echo_of(&Strict { refuses_all: false }, &bits), Ok(arrived));
        }
    }
}
