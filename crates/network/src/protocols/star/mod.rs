//! Sensors around a fusion centre that talks back.
//!
//! `centre` and `sensor` have the two halves.

mod centre;
mod sensor;

pub use centre::Centre;
pub use sensor::Sensor;

use crate::clock::Clock;
use crate::error::Error;
use crate::estimator::{Estimator, Replicable};
use crate::measurements::Measurements;
use crate::medium::{Field, Frame, Kind};
use crate::protocols::slot::{check_fits, predict};
use crate::simulator::{Context, Protocol, Setup, Simulator};
use crate::units::SensorId;
use fewbits_core::{BitString, Message};
use fewbits_monte_carlo::Stream;
use serde::{Deserialize, Serialize};

pub(super) const CENTRE: SensorId = SensorId(0);
/// Timer: a slot begins.
const BEGIN: u32 = 0;
/// Timer: reports of the slot are awaited no longer.
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
/// disagreement: noted, and taken as lost. Where the update fails (nothing came over a link that is thought to lose nothing), what did not come is
/// taken as lost, and noted. A node that fails in more than half of the slots ends the run.
///
/// A sensor whose question has no bits reports by the clock, whatever the others are told.
#[derive(Debug, Clone)]
pub struct Star<E: Estimator> {
    estimator: E,
    measurements: Measurements<E::Measurement>,
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

impl<B, Y> StarNode<B, Y> {
    /// The centre's estimates, slot by slot; a slot that it missed is empty. Empty at a sensor.
    pub fn estimates(&self) -> &[Vec<f64>] {
        match self {
            Self::Centre(centre) => &centre.estimates,
            Self::Sensor(_) => &[],
        }
    }

    /// A belief and the slot after which it holds: the centre's own, or the one that a sensor shares. `None` at a sensor that shares none.
    pub fn belief(&self) -> Option<(u32, &B)> {
        match self {
            Self::Centre(centre) => Some((centre.slot, &centre.belief)),
            Self::Sensor(sensor) => sensor.replica.as_ref().map(|(slot, belief)| (*slot, belief)),
        }
    }

    /// The last slot in which a sensor answered; 0 before the first, `None` at the centre.
    pub fn answered(&self) -> Option<u32> {
        match self {
            Self::Centre(_) => None,
            Self::Sensor(sensor) => Some(sensor.answered),
        }
    }
}

impl<E: Estimator> Star<E> {
    /// A star in which sensors are told what they must know. `stream` is what the estimator draws from.
    ///
    /// # Errors
    /// If a slot of a table has not one measurement per sensor, or there are 2^29 slots or more.
    pub fn told(
        estimator: E,
        measurements: impl Into<Measurements<E::Measurement>>,
        clock: Clock,
        stream: Stream,
    ) -> Result<Self, Error> {
        let measurements = measurements.into();
        measurements.check(estimator.sensors())?;
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
        measurements: impl Into<Measurements<E::Measurement>>,
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
    /// As [`Star::simulate_on`]; if the radius is out of range.
    pub fn simulate(self, radius: f64, setup: Setup) -> Result<Simulator<Self>, Error> {
        let field = Field::star(self.estimator.sensors(), radius)?;
        self.simulate_on(field, setup)
    }

    /// The network before its first slot on a field of one's own: node 0 is the centre, and every sensor must be in range of it.
    ///
    /// # Errors
    /// If the setup is out of range, the field has not one node per sensor and one for the centre; [`Error::OutOfRange`] if a sensor does not reach the
    /// centre; [`Error::SlotTooShort`] if a slot has no time for a report of every sensor.
    pub fn simulate_on(self, field: Field, setup: Setup) -> Result<Simulator<Self>, Error> {
        let sensors = self.estimator.sensors();
        for sensor in 1..=sensors as u32 {
            field.check_link(SensorId(sensor), CENTRE)?;
        }
        let clock = self.clock;
        let self_timed = self.self_timed()?;
        check_fits(&clock, &setup, self.broadcast_bits()?, sensors)?;
        let nodes = self.nodes();
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        simulator.start(CENTRE, clock.start(1), BEGIN)?;
        for (sensor, self_timed) in (1..).zip(self_timed) {
            if self_timed {
                simulator.start(SensorId(sensor), clock.start(1), BEGIN)?;
            }
        }
        Ok(simulator)
    }

    /// The nodes before the first slot, the centre first.
    pub fn nodes(&self) -> Vec<StarNode<E::Belief, E::Memory>> {
        let sensor = |i| StarNode::Sensor(Sensor::new(self.estimator.memory(i), self.estimator.start()));
        std::iter::once(StarNode::Centre(Centre::new(self.estimator.start())))
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
        self.measurements.slots()
    }

    fn question(&self, slot: u32, predicted: &E::Belief, sensor: usize) -> Result<BitString, Error> {
        let question = self.estimator.question(slot, predicted, sensor)?;
        Ok(question.to_bits(&self.estimator.question_format(sensor))?)
    }

    /// For each sensor whether its question has no bits, so that it reports by the clock. Judged in the first slot.
    fn self_timed(&self) -> Result<Vec<bool>, Error> {
        let sensors = self.estimator.sensors();
        if self.feedback == Feedback::Echoed {
            return Ok(vec![false; sensors]);
        }
        let predicted = predict(&self.estimator, self.stream, 1, &self.estimator.start())?;
        (0..sensors)
            .map(|i| Ok(self.question(1, &predicted, i)?.bits() == 0))
            .collect()
    }

    /// Bits of the frames that the centre sends in the first slot, without payload of an echo; `None` if it sends nothing.
    fn broadcast_bits(&self) -> Result<Option<u64>, Error> {
        if self.feedback == Feedback::Echoed {
            return Ok(Some(u64::from(Frame::overhead(Kind::Echo)) + self.estimator.sensors() as u64));
        }
        let predicted = predict(&self.estimator, self.stream, 1, &self.estimator.start())?;
        let mut longest = None;
        for sensor in 0..self.estimator.sensors() {
            let bits = self.question(1, &predicted, sensor)?.bits() as u64;
            if bits > 0 {
                longest = longest.max(Some(u64::from(Frame::overhead(Kind::Question)) + bits));
            }
        }
        Ok(longest)
    }

    fn belief_bits(&self, belief: &E::Belief) -> Result<BitString, Error> {
        match &self.codec {
            Some(codec) => (codec.write)(&self.estimator, belief),
            None => Ok(BitString::default()),
        }
    }
}

impl<E: Estimator> Protocol for Star<E> {
    type Node = StarNode<E::Belief, E::Memory>;

    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        match node {
            StarNode::Centre(centre) if token == BEGIN => self.begin(centre, context),
            StarNode::Centre(centre) => self.finish(centre, context),
            StarNode::Sensor(sensor) => self.by_the_clock(sensor, context),
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
                self.on_report(centre, context, from, frame);
                Ok(())
            }
            StarNode::Sensor(sensor) => self.on_broadcast(sensor, context, from, frame),
        }
    }

    /// Slots tell whose report it was: it is known to be lost.
    fn on_damaged(&self, node: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let StarNode::Centre(centre) = node {
            centre.damaged(from);
        }
        Ok(())
    }

    /// The centre begins with what it knows without reports; a sensor knows that it must ask.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error> {
        match node {
            StarNode::Centre(centre) => self.restart(centre, context),
            StarNode::Sensor(sensor) => sensor.restart(self.estimator.memory(context.id().index() - 1)),
        }
        Ok(())
    }
}
