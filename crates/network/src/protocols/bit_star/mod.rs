//! A star whose nodes run the state machines of `fewbits-protocol`: the machines of real sensors.
//!
//! `centre` and `sensor` do what the machines ask for, `node` has what they hold, `translation` their frames and notes.

mod centre;
mod node;
mod sensor;
pub(crate) mod translation;

pub use node::{BitNode, CentreNode, SensingNode, SlotEstimate, StoredBitNode};

use crate::clock::Clock;
use crate::error::Error;
use crate::measurements::Measurements;
use crate::medium::{Field, Frame, Kind};
use crate::note::Note;
use crate::simulator::transmission::air_time;
use crate::simulator::{Context, Protocol, Setup, Simulator, Storable};
use crate::units::{Bits, SensorId};
use fewbits_core::SensorNode;
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{
    BoxError, Centre, CentreSettings, CentreTimer, Feedback, Member, Receiver, ReportLength, Sensor,
    SensorSettings, SensorTimer, Slot,
};
use nalgebra::SVector;
use node::{Failures, StoredNode};
use std::fmt;
use std::sync::Arc;
use translation::machine_frame;

const CENTRE: SensorId = SensorId(0);
/// Timers of nodes: a slot begins; the deadline of a centre, or a missing acknowledgement (with the slot above) of a sensor.
const SLOT_BEGINS: u32 = 0;
const OTHER: u32 = 1;

/// A fusion centre (node 0) and its sensors (nodes 1, 2, ...), of which nothing is known but bits: any [`Receiver`] at the centre, any
/// [`SensorNode`] at the sensors.
///
/// ```text
/// slot k, centre:  predict;  broadcast feedback or echo, with a digest
///         sensor:  check the digest;  measure;  report, with the digest of what it was told
///         centre, at the deadline:  update with the reports of the right slot and digest
/// ```
/// The nodes are driven as `fewbits-link` drives them over sockets. The receiver of a real centre and the sensors' halves run here unchanged.
/// Where an update fails (nothing came over a link that is thought to lose nothing), the sensors of which nothing came are left out, and that is
/// noted. A node that fails in more than half of the slots ends the run.
#[derive(Clone)]
pub struct BitStar<R, const M: usize> {
    receiver: Arc<MakeReceiver<R>>,
    members: Vec<Member>,
    node: Arc<MakeNode<M>>,
    measurements: Measurements<SVector<f64, M>>,
    clock: Clock,
    stream: Stream,
    arrives: Option<Arc<Arrives>>,
}

type MakeReceiver<R> = dyn Fn() -> Result<R, BoxError> + Send + Sync;
type MakeNode<const M: usize> = dyn Fn(usize) -> Box<dyn SensorNode<M>> + Send + Sync;
type Arrives = dyn Fn(u32, usize) -> bool + Send + Sync;

impl<R, const M: usize> fmt::Debug for BitStar<R, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BitStar")
            .field("members", &self.members)
            .finish_non_exhaustive()
    }
}

impl<R: Receiver, const M: usize> BitStar<R, M> {
    /// A star in which all sensors learn what they must know in the same way. `receiver` makes the estimator before its first slot, which a
    /// restarted centre begins with too; `node` makes the half of a sensor (the first is 0).
    ///
    /// # Errors
    /// If the estimator cannot be made, a slot of a table has not one measurement per sensor, or there are 2^23 slots or more.
    pub fn new(
        receiver: impl Fn() -> Result<R, BoxError> + Send + Sync + 'static,
        feedback: Feedback,
        report: ReportLength,
        node: impl Fn(usize) -> Box<dyn SensorNode<M>> + Send + Sync + 'static,
        measurements: impl Into<Measurements<SVector<f64, M>>>,
        clock: Clock,
        stream: Stream,
    ) -> Result<Self, Error> {
        let measurements = measurements.into();
        let sensors = receiver()
            .map_err(|error| Error::estimator("receiver", error))?
            .sensors();
        measurements.check(sensors)?;
        Ok(Self {
            members: vec![Member { feedback, report }; sensors],
            receiver: Arc::new(receiver),
            node: Arc::new(node),
            measurements,
            clock,
            stream,
            arrives: None,
        })
    }

    /// The same where one sensor (the first is 0) learns what it must know, or reports, in another way.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn with_member(mut self, sensor: usize, member: Member) -> Result<Self, Error> {
        let nodes = self.members.len();
        let place = self.members.get_mut(sensor);
        *place.ok_or(Error::UnknownNode { node: sensor, nodes })? = member;
        Ok(self)
    }

    /// The same with losses that were recorded: a report reaches the centre only if `arrives(slot, sensor)`. The channel's losses come on top.
    #[must_use]
    pub fn with_recorded_losses(mut self, arrives: impl Fn(u32, usize) -> bool + Send + Sync + 'static) -> Self {
        self.arrives = Some(Arc::new(arrives));
        self
    }

    /// The slots.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The network before its first slot: the centre in the middle of its sensors, `radius` metres away.
    ///
    /// # Errors
    /// As [`simulate_on`](Self::simulate_on); if the radius is out of range.
    pub fn simulate(self, radius: f64, setup: Setup) -> Result<Simulator<Self>, Error> {
        let field = Field::star(self.members.len(), radius)?;
        self.simulate_on(field, setup)
    }

    /// The network before its first slot, on a field of one's own: node 0 is the centre, and every sensor must be in range of it.
    ///
    /// # Errors
    /// If the setup is out of range, the field has not one node per sensor and one for the centre; [`Error::OutOfRange`] if a sensor does not
    /// reach the centre; [`Error::SlotTooShort`] if a slot has no time for a report of every sensor.
    pub fn simulate_on(self, field: Field, setup: Setup) -> Result<Simulator<Self>, Error> {
        for sensor in 1..=self.members.len() as u32 {
            field.check_link(SensorId(sensor), CENTRE)?;
        }
        self.check_fits(&setup)?;
        let mut nodes = vec![BitNode::Centre(Box::new(CentreNode {
            machine: Centre::new(CentreSettings::new(self.members.clone(), self.clock.schedule())),
            receiver: self.started()?,
            estimates: Vec::new(),
            failures: Failures::default(),
        }))];
        for (i, member) in self.members.iter().enumerate() {
            let mut settings = SensorSettings::new(member.feedback);
            settings.schedule = Some(self.clock.schedule());
            nodes.push(BitNode::Sensor(Box::new(SensingNode {
                machine: Sensor::new(settings),
                half: (self.node)(i),
                counted: 0,
                replica: self.replica(i)?,
                failures: Failures::default(),
            })));
        }
        let first = self.clock.start(1);
        let clocked = |(_, member): &(u32, &Member)| member.feedback == Feedback::Clock;
        let clocked: Vec<_> = (1..).zip(&self.members).filter(clocked).map(|(node, _)| node).collect();
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        for node in [0].into_iter().chain(clocked) {
            simulator.start(SensorId(node), first, SLOT_BEGINS)?;
        }
        Ok(simulator)
    }

    /// The estimator before its first slot.
    fn started(&self) -> Result<R, Error> {
        (self.receiver)().map_err(|error| Error::estimator("receiver", error))
    }

    /// The estimator of a sensor that follows the centre.
    fn replica(&self, sensor: usize) -> Result<Option<R>, Error> {
        let follows = self.members.get(sensor).is_some_and(|m| m.feedback == Feedback::Echoed);
        follows.then(|| self.started()).transpose()
    }

    /// Checks that a slot has time for what the centre sends in the first slot, and for a report of each sensor. Echoes are counted with a bit
    /// per sensor, reports without payload, since their lengths are not known beforehand.
    fn check_fits(&self, setup: &Setup) -> Result<(), Error> {
        let mut receiver = self.started()?;
        let (told, state) = self
            .predict(&mut receiver, 1)
            .map_err(|error| Error::estimator("receiver", error))?;
        let members = || self.members.iter().zip(&told);
        let mut bodies: Vec<u64> = members()
            .filter(|(member, _)| member.feedback == Feedback::Told)
            .map(|(_, told)| u64::from(Frame::overhead(Kind::Question)) + told.bits() as u64)
            .collect();
        if bodies.len() == told.len() && told.windows(2).all(|pair| pair[0] == pair[1]) {
            bodies.truncate(1);
        }
        bodies.extend(state.map(|_| u64::from(Frame::overhead(Kind::Echo)) + told.len() as u64));
        bodies.extend(told.iter().map(|_| u64::from(Frame::overhead(Kind::Report))));
        let frames = bodies.len();
        let mut needed = air_time(&setup.radio, bodies.into_iter().map(Bits));
        if setup.retries.is_some() {
            needed += std::iter::repeat_n(setup.radio.answer_time(), told.len()).sum();
        }
        let available = self.clock.reporting_time();
        if needed > available {
            return Err(Error::SlotTooShort {
                frames,
                needed,
                available,
            });
        }
        Ok(())
    }
}

impl<R: Receiver, const M: usize> Protocol for BitStar<R, M> {
    type Node = BitNode<R, M>;

    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        let now = context.now().0;
        match node {
            BitNode::Centre(centre) => {
                let timer = match token {
                    SLOT_BEGINS => CentreTimer::SlotBegins,
                    _ => CentreTimer::Deadline,
                };
                if timer == CentreTimer::SlotBegins && centre.machine.slot() >= u64::from(self.measurements.slots()) {
                    return Ok(());
                }
                let mut actions = Vec::new();
                centre.machine.on_timer(now, timer, &mut actions);
                self.carry_out(centre, context, actions)
            }
            BitNode::Sensor(sensor) => {
                let timer = match token {
                    SLOT_BEGINS => SensorTimer::SlotBegins,
                    _ => SensorTimer::Unacknowledged {
                        slot: Slot::of_count(u64::from(token >> 1)),
                    },
                };
                if timer == SensorTimer::SlotBegins && self.clock.slot(context.now()) > self.measurements.slots() {
                    return Ok(());
                }
                let reaction = sensor.machine.on_timer(now, timer);
                self.react(sensor, context, reaction)
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
        let Some(decoded) = machine_frame(frame) else {
            context.note(Note::Malformed);
            return Ok(());
        };
        match node {
            BitNode::Centre(centre) => {
                let Some(sensor) = from.index().checked_sub(1) else {
                    return Ok(());
                };
                let recorded = self.arrives.as_ref().filter(|_| frame.kind == Kind::Report);
                if recorded.is_some_and(|arrives| !arrives(frame.slot, sensor)) {
                    return Ok(());
                }
                let mut actions = Vec::new();
                centre.machine.on_decoded(sensor, &decoded, &mut actions);
                self.carry_out(centre, context, actions)
            }
            // Frames of other sensors are in range, and for the centre.
            BitNode::Sensor(_) if from != CENTRE => Ok(()),
            BitNode::Sensor(sensor) => {
                let reaction = sensor.machine.on_decoded(context.now().0, decoded);
                self.react(sensor, context, reaction)
            }
        }
    }

    /// Slots tell whose report it was: it is known to be lost.
    fn on_damaged(&self, node: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let (BitNode::Centre(centre), Some(sensor)) = (node, from.index().checked_sub(1)) {
            centre.machine.on_damaged(sensor);
        }
        Ok(())
    }

    /// The centre begins with what it knew before the first slot; a sensor knows that it must ask.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error> {
        match node {
            BitNode::Centre(centre) => {
                centre.receiver = self.started()?;
                centre.machine.on_memory_lost();
            }
            BitNode::Sensor(sensor) => {
                let index = context.id().index() - 1;
                (sensor.half, sensor.counted) = ((self.node)(index), 0);
                sensor.replica = self.replica(index)?;
                sensor.machine.on_memory_lost();
            }
        }
        Ok(())
    }
}

impl<R: Receiver, const M: usize> Storable for BitStar<R, M> {
    type Stored = StoredBitNode;

    fn store(&self, node: &Self::Node) -> Result<StoredBitNode, BoxError> {
        node.stored()
    }

    fn revive(&self, index: usize, stored: StoredBitNode) -> Result<Self::Node, BoxError> {
        match (index.checked_sub(1), stored.0) {
            (None, StoredNode::Centre(machine, state, estimates, failures)) => {
                let mut receiver = (self.receiver)()?;
                receiver.restore(&state.0)?;
                Ok(BitNode::Centre(Box::new(CentreNode {
                    machine,
                    receiver,
                    estimates,
                    failures,
                })))
            }
            (Some(sensor), StoredNode::Sensor(machine, memory, counted, state, failures))
                if sensor < self.members.len() =>
            {
                let (mut half, mut replica) = ((self.node)(sensor), self.replica(sensor)?);
                half.restore(&memory.0)?;
                if let (Some(replica), Some(state)) = (&mut replica, &state) {
                    replica.restore(&state.0)?;
                }
                Ok(BitNode::Sensor(Box::new(SensingNode {
                    machine,
                    half,
                    counted,
                    replica,
                    failures,
                })))
            }
            (Some(_), StoredNode::Sensor(..)) => Err("more sensors than the star has".into()),
            _ => Err("a centre where a sensor is, or a sensor where the centre is".into()),
        }
    }
}
