//! Sensors around a fusion centre that talks back.

use crate::clock::Clock;
use crate::error::Error;
use crate::estimator::{Estimator, Replicable, check_measurements};
use crate::exchange::{Arrived, echo_bits, echo_of, from_prior, own, predict, settle};
use crate::field::Field;
use crate::frame::{Frame, Kind, digest};
use crate::log::Note;
use crate::simulator::{Context, Protocol, Setup, Simulator};
use crate::units::SensorId;
use fewbits_core::{BitString, Message};
use fewbits_monte_carlo::Stream;
use serde::{Deserialize, Serialize};

const CENTRE: SensorId = SensorId(0);
const BEGIN: u32 = 0;
const DEADLINE: u32 = 1;

/// How sensors learn what they must know before they measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Feedback {
    /// The centre sends it in full, once if it is the same for all sensors. Nothing is sent where there is nothing to tell.
    Told,
    /// Sensors run the centre's filter too; the centre sends back which reports came. Where a sensor sees by the digest that it no longer
    /// agrees, it asks for the whole belief.
    Echoed,
}

/// A fusion centre (node 0) and its sensors (nodes 1, 2, ...), slot by slot.
///
/// ```text
/// slot k, centre:  predicted = predict(belief);  broadcast question or echo, with a digest
///         sensor:  check the digest;  measure;  report, with the digest of what it was told
///         centre, at the deadline:  belief = update(predicted, reports of the right slot and digest)
/// ```
/// Reports are told apart by their slot: late ones and repetitions are noted and dropped. A report to another digest is a
/// disagreement: noted, and taken as lost. Where the observations are impossible under the belief (nothing came over a link that is
/// thought to lose nothing), what did not come is taken as lost, and noted.
#[derive(Debug, Clone)]
pub struct Star<E: Estimator> {
    estimator: E,
    measurements: Vec<Vec<E::Measurement>>,
    clock: Clock,
    feedback: Feedback,
    stream: Stream,
    /// The belief as bits; only for what follows the centre.
    codec: Option<Codec<E>>,
}

type Written<B> = Result<B, Error>;

/// How a belief is written and read.
struct Codec<E: Estimator> {
    write: fn(&E, &E::Belief) -> Written<BitString>,
    read: fn(&E, &BitString) -> Written<E::Belief>,
}

impl<E: Estimator> std::fmt::Debug for Codec<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Codec")
    }
}

impl<E: Estimator> Clone for Codec<E> {
    fn clone(&self) -> Self {
        Self {
            write: self.write,
            read: self.read,
        }
    }
}

/// A node of a [`Star`].
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StarNode<B, Y> {
    /// The fusion centre.
    Centre(Centre<B>),
    /// A sensor.
    Sensor(Sensor<B, Y>),
}

/// The fusion centre.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Centre<B> {
    slot: u32,
    belief: B,
    predicted: Option<B>,
    /// Of what each sensor was told.
    digests: Vec<u32>,
    arrived: Vec<Arrived>,
    /// Somebody asked for the whole belief.
    asked: bool,
    estimates: Vec<Vec<f64>>,
}

/// A sensor.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sensor<B, Y> {
    memory: Y,
    /// The last slot that it answered in.
    answered: u32,
    /// The belief that it shares with the centre, and after which slot; none while it knows that it does not.
    replica: Option<(u32, B)>,
}

impl<B, Y> StarNode<B, Y> {
    /// The centre's estimates, slot by slot; a slot that it missed is empty.
    pub fn estimates(&self) -> &[Vec<f64>] {
        match self {
            Self::Centre(centre) => &centre.estimates,
            Self::Sensor(_) => &[],
        }
    }

    /// The belief: the centre's after the last slot, or the one that a sensor shares, and after which slot.
    pub fn belief(&self) -> Option<(u32, &B)> {
        match self {
            Self::Centre(centre) => Some((centre.slot, &centre.belief)),
            Self::Sensor(sensor) => sensor.replica.as_ref().map(|(slot, belief)| (*slot, belief)),
        }
    }

    /// The last slot in which a sensor answered.
    pub fn answered(&self) -> Option<u32> {
        match self {
            Self::Centre(_) => None,
            Self::Sensor(sensor) => Some(sensor.answered),
        }
    }
}

impl<E: Estimator> Star<E> {
    /// A star in which sensors are told what they must know. `measurements[k][i]` is what sensor `i` measures in slot `k + 1`;
    /// `stream` is what the estimator draws from.
    ///
    /// # Errors
    /// If a slot has not one measurement for each sensor, or there are 2^29 slots or more.
    pub fn told(
        estimator: E,
        measurements: Vec<Vec<E::Measurement>>,
        clock: Clock,
        stream: Stream,
    ) -> Result<Self, Error> {
        check_measurements(estimator.sensors(), &measurements)?;
        Ok(Self {
            estimator,
            measurements,
            clock,
            feedback: Feedback::Told,
            stream,
            codec: None,
        })
    }

    /// The same with sensors that follow the centre by what it echoes.
    ///
    /// # Errors
    /// As [`Star::told`].
    pub fn echoed(
        estimator: E,
        measurements: Vec<Vec<E::Measurement>>,
        clock: Clock,
        stream: Stream,
    ) -> Result<Self, Error>
    where
        E: Replicable,
    {
        Ok(Self {
            feedback: Feedback::Echoed,
            codec: Some(Codec {
                write: E::belief_bits,
                read: E::belief_of,
            }),
            ..Self::told(estimator, measurements, clock, stream)?
        })
    }

    /// The network before its first slot: the centre in the middle of its sensors, `radius` metres away.
    ///
    /// # Errors
    /// If the setup or radius is out of range.
    pub fn simulate(self, radius: f64, setup: Setup) -> Result<Simulator<Self>, Error> {
        let sensors = self.estimator.sensors();
        let clock = self.clock;
        let self_timed = self.is_self_timed()?;
        let nodes = self.nodes();
        let mut simulator = Simulator::new(self, nodes, Field::star(sensors, radius)?, setup)?;
        simulator.start(CENTRE, clock.start(1), BEGIN)?;
        if self_timed {
            for sensor in 1..=sensors as u32 {
                simulator.start(SensorId(sensor), clock.start(1), BEGIN)?;
            }
        }
        Ok(simulator)
    }

    /// The nodes before the first slot, the centre first.
    pub fn nodes(&self) -> Vec<StarNode<E::Belief, E::Memory>> {
        let sensor = |i| {
            StarNode::Sensor(Sensor {
                memory: self.estimator.memory(i),
                answered: 0,
                replica: Some((0, self.estimator.start())),
            })
        };
        let centre = StarNode::Centre(Centre {
            slot: 0,
            belief: self.estimator.start(),
            predicted: None,
            digests: Vec::new(),
            arrived: Vec::new(),
            asked: false,
            estimates: Vec::new(),
        });
        std::iter::once(centre)
            .chain((0..self.estimator.sensors()).map(sensor))
            .collect()
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// The slots.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    fn last_slot(&self) -> u32 {
        self.measurements.len() as u32
    }

    fn question(&self, slot: u32, predicted: &E::Belief, sensor: usize) -> Result<BitString, Error> {
        let question = self.estimator.question(slot, predicted, sensor)?;
        Ok(question.to_bits(&self.estimator.question_format(sensor))?)
    }

    /// Whether there is nothing to tell, so that sensors report by the clock.
    fn is_self_timed(&self) -> Result<bool, Error> {
        if self.feedback == Feedback::Echoed {
            return Ok(false);
        }
        let predicted = predict(&self.estimator, self.stream, 1, &self.estimator.start())?;
        let mut sensors = 0..self.estimator.sensors();
        sensors.try_fold(true, |none, i| Ok(none && self.question(1, &predicted, i)?.bits() == 0))
    }

    fn belief_bits(&self, belief: &E::Belief) -> Result<BitString, Error> {
        match &self.codec {
            Some(codec) => (codec.write)(&self.estimator, belief),
            None => Ok(BitString::default()),
        }
    }

    /// The centre begins a slot.
    fn begin(&self, centre: &mut Centre<E::Belief>, context: &mut Context<'_>) -> Result<(), Error> {
        let slot = self.clock.slot(context.now());
        if slot > self.last_slot() {
            return Ok(());
        }
        context.at(self.clock.deadline(slot), DEADLINE);
        context.at(self.clock.start(slot + 1), BEGIN);
        let previous = std::mem::take(&mut centre.arrived);
        centre.slot = slot;
        centre.arrived = vec![Arrived::Nothing; self.estimator.sensors()];
        let predicted = match predict(&self.estimator, self.stream, slot, &centre.belief) {
            Ok(predicted) => predicted,
            Err(_) => {
                context.note(Note::Refused { slot });
                centre.predicted = None;
                return Ok(());
            }
        };
        match self.feedback {
            Feedback::Told => self.tell(centre, slot, &predicted, context)?,
            Feedback::Echoed => {
                let shared = self.belief_bits(&centre.belief)?;
                let sum = digest(u64::from(slot - 1), &shared);
                centre.digests = vec![sum; self.estimator.sensors()];
                let frame = if std::mem::take(&mut centre.asked) {
                    Frame::new(Kind::Snapshot, slot, sum, shared)
                } else {
                    Frame::new(Kind::Echo, slot, sum, echo_bits(&previous)?)
                };
                context.broadcast(frame)?;
            }
        }
        centre.predicted = Some(predicted);
        Ok(())
    }

    fn tell(
        &self,
        centre: &mut Centre<E::Belief>,
        slot: u32,
        predicted: &E::Belief,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let sensors = self.estimator.sensors();
        let questions = (0..sensors).map(|i| self.question(slot, predicted, i));
        let questions = questions.collect::<Result<Vec<_>, Error>>()?;
        centre.digests = questions.iter().map(|bits| digest(u64::from(slot), bits)).collect();
        let alike = questions.windows(2).all(|pair| pair[0] == pair[1]);
        for (sensor, (bits, sum)) in questions.into_iter().zip(centre.digests.clone()).enumerate() {
            if bits.bits() == 0 {
                continue;
            }
            let frame = Frame::new(Kind::Question, slot, sum, bits);
            if alike {
                return context.broadcast(frame);
            }
            context.send(SensorId(sensor as u32 + 1), frame)?;
        }
        Ok(())
    }

    /// The centre ends a slot.
    fn finish(&self, centre: &mut Centre<E::Belief>, context: &mut Context<'_>) {
        let slot = centre.slot;
        if let Some(predicted) = centre.predicted.take() {
            let (belief, note) = settle(&self.estimator, self.stream, slot, &predicted, &mut centre.arrived);
            if let Some(note) = note {
                context.note(note);
            }
            centre.belief = belief;
        }
        centre.estimates.resize(slot as usize - 1, Vec::new());
        centre.estimates.push(self.estimator.mean(&centre.belief));
    }

    fn centre_hears(&self, centre: &mut Centre<E::Belief>, context: &mut Context<'_>, from: SensorId, frame: &Frame) {
        let Some(sensor) = (from.index()).checked_sub(1).filter(|i| *i < self.estimator.sensors()) else {
            return context.note(Note::Malformed);
        };
        match frame.kind {
            Kind::Request => {
                let (with, slot) = (from, frame.slot);
                context.note(Note::Disagreement { with, slot });
                centre.asked = true;
            }
            Kind::Report if frame.slot != centre.slot || centre.predicted.is_none() => context.note(Note::Late),
            Kind::Report if centre.arrived[sensor] != Arrived::Nothing => context.note(Note::Duplicate),
            Kind::Report if frame.digest != centre.digests[sensor] => {
                centre.arrived[sensor] = Arrived::Lost;
                let (with, slot) = (from, frame.slot);
                context.note(Note::Disagreement { with, slot });
            }
            Kind::Report => {
                let format = self.estimator.report_format(sensor);
                centre.arrived[sensor] = match E::Report::from_bits(&format, &frame.payload) {
                    Ok(_) => Arrived::Report(frame.payload.clone()),
                    Err(_) => {
                        context.note(Note::Malformed);
                        Arrived::Lost
                    }
                };
            }
            _ => context.note(Note::Malformed),
        }
    }

    /// A sensor measures and reports.
    fn answer(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        slot: u32,
        sum: u32,
        question: &E::Question,
    ) -> Result<(), Error> {
        let index = context.id().index() - 1;
        let measured = (slot as usize).checked_sub(1).and_then(|k| self.measurements.get(k));
        let Some(measurement) = measured.and_then(|all| all.get(index)) else {
            return Ok(());
        };
        sensor.answered = slot;
        let mut rng = own(self.stream, index, slot);
        match self
            .estimator
            .report(&mut rng, slot, index, &mut sensor.memory, measurement, question)
        {
            Ok(Some(report)) => {
                let payload = report.to_bits(&self.estimator.report_format(index))?;
                context
                    .send(CENTRE, Frame::new(Kind::Report, slot, sum, payload))
                    .map(|_| ())
            }
            Ok(None) => Ok(()),
            Err(_) => {
                context.note(Note::Refused { slot });
                Ok(())
            }
        }
    }

    fn sensor_hears(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        let slot = frame.slot;
        // Only the centre's frames are for sensors; those of other sensors are in range but addressed to it.
        if from != CENTRE || !matches!(frame.kind, Kind::Question | Kind::Echo | Kind::Snapshot) {
            context.note(Note::Malformed);
            return Ok(());
        }
        if slot <= sensor.answered || slot != self.clock.slot(context.now()) {
            let again = slot == sensor.answered;
            context.note(if again { Note::Duplicate } else { Note::Late });
            return Ok(());
        }
        let index = context.id().index() - 1;
        match frame.kind {
            Kind::Question => {
                let sum = digest(u64::from(slot), &frame.payload);
                if sum != frame.digest {
                    context.note(Note::Disagreement { with: from, slot });
                    return Ok(());
                }
                match E::Question::from_bits(&self.estimator.question_format(index), &frame.payload) {
                    Ok(question) => self.answer(sensor, context, slot, sum, &question),
                    Err(_) => {
                        context.note(Note::Malformed);
                        Ok(())
                    }
                }
            }
            _ => self.follow(sensor, context, index, frame),
        }
    }

    /// A sensor brings its replica up to the centre's, or asks for the whole.
    fn follow(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        index: usize,
        frame: &Frame,
    ) -> Result<(), Error> {
        let Some(codec) = &self.codec else {
            context.note(Note::Malformed);
            return Ok(());
        };
        let slot = frame.slot;
        let fresh = match frame.kind {
            Kind::Snapshot => (codec.read)(&self.estimator, &frame.payload).ok(),
            _ => self.caught_up(sensor, slot, &frame.payload),
        };
        // The digest is taken of the belief, not of the frame: it is what must be shared.
        let agreed = match fresh {
            Some(belief) => {
                let bits = (codec.write)(&self.estimator, &belief)?;
                (digest(u64::from(slot - 1), &bits) == frame.digest).then_some(belief)
            }
            None => None,
        };
        let Some(belief) = agreed else {
            sensor.replica = None;
            context.note(Note::Disagreement { with: CENTRE, slot });
            let request = Frame::new(Kind::Request, slot, 0, BitString::default());
            return context.send(CENTRE, request).map(|_| ());
        };
        if frame.kind == Kind::Snapshot && sensor.replica.as_ref().is_none_or(|(at, _)| at + 2 < slot) {
            context.note(Note::Resynchronised { slot });
        }
        let predicted = predict(&self.estimator, self.stream, slot, &belief);
        sensor.replica = Some((slot - 1, belief));
        let Ok(predicted) = predicted else {
            context.note(Note::Refused { slot });
            return Ok(());
        };
        // What is shared is asked as it would travel.
        let bits = self.question(slot, &predicted, index)?;
        let question = E::Question::from_bits(&self.estimator.question_format(index), &bits)?;
        self.answer(sensor, context, slot, frame.digest, &question)
    }

    /// The replica after the slot before `slot`, by the echo of that slot; none if it is not at the slot before that.
    fn caught_up(&self, sensor: &Sensor<E::Belief, E::Memory>, slot: u32, echo: &BitString) -> Option<E::Belief> {
        let (at, belief) = sensor.replica.as_ref()?;
        if slot == 1 && *at == 0 {
            return Some(belief.clone());
        }
        if at + 2 != slot {
            return None;
        }
        let mut arrived = echo_of(&self.estimator, echo).ok()?;
        let predicted = predict(&self.estimator, self.stream, slot - 1, belief).ok()?;
        Some(settle(&self.estimator, self.stream, slot - 1, &predicted, &mut arrived).0)
    }
}

impl<E: Estimator> Protocol for Star<E> {
    type Node = StarNode<E::Belief, E::Memory>;

    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        match node {
            StarNode::Centre(centre) if token == BEGIN => self.begin(centre, context),
            StarNode::Centre(centre) => {
                self.finish(centre, context);
                Ok(())
            }
            StarNode::Sensor(sensor) => {
                let slot = self.clock.slot(context.now());
                if slot > self.last_slot() {
                    return Ok(());
                }
                context.at(self.clock.start(slot + 1), BEGIN);
                let (index, nothing) = (context.id().index() - 1, BitString::default());
                let question = E::Question::from_bits(&self.estimator.question_format(index), &nothing)?;
                self.answer(sensor, context, slot, digest(u64::from(slot), &nothing), &question)
            }
        }
    }

    fn on_frame(
        &self,
        node: &mut Self::Node,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        match node {
            StarNode::Centre(centre) => {
                self.centre_hears(centre, context, from, frame);
                Ok(())
            }
            StarNode::Sensor(sensor) => self.sensor_hears(sensor, context, from, frame),
        }
    }

    /// Slots tell whose report it was: it is known to be lost.
    fn on_damaged(&self, node: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let StarNode::Centre(centre) = node
            && let Some(arrived) = from.index().checked_sub(1).and_then(|i| centre.arrived.get_mut(i))
            && *arrived == Arrived::Nothing
            && centre.predicted.is_some()
        {
            *arrived = Arrived::Lost;
        }
        Ok(())
    }

    /// The centre begins with what it knows without reports; a sensor knows that it must ask.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error> {
        match node {
            StarNode::Centre(centre) => {
                let slot = self.clock.slot(context.now()).min(self.last_slot());
                if let Ok(belief) = from_prior(&self.estimator, self.stream, slot) {
                    centre.belief = belief;
                }
                centre.predicted = None;
                centre.arrived = Vec::new();
                centre.asked = true;
            }
            StarNode::Sensor(sensor) => {
                sensor.memory = self.estimator.memory(context.id().index() - 1);
                sensor.replica = None;
            }
        }
        Ok(())
    }
}
