//! A star whose nodes run the state machines of `fewbits-protocol`: the machines, and the bytes, of real sensors.

mod translation;

use super::star::CENTRE;
use crate::clock::Clock;
use crate::error::Error;
use crate::measurements::Measurements;
use crate::medium::{Field, Frame, Kind};
use crate::note::{Note, Stage};
use crate::simulator::{Context, Protocol, Setup, Simulator};
use crate::units::{Instant, SensorId};
use fewbits_core::{BitString, SensorNode};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::refuse;
use fewbits_protocol as machines;
use fewbits_protocol::{
    Action, Centre, CentreSettings, CentreTimer, Feedback, Member, Outcome, Payload, Reaction, Receiver, Recipient,
    ReportLength, Schedule, Sensor, SensorSettings, SensorTimer, Slot, Task, reports_of, update_or_drop,
};
use nalgebra::SVector;
use std::fmt;
use std::num::NonZeroU64;
use std::sync::Arc;
use translation::{failed, machine_frame, noted, of, simulated};

/// Timers of nodes: a slot begins; the deadline of a centre, or a missing acknowledgement (with the slot above) of a sensor.
const SLOT_BEGINS: u32 = 0;
const OTHER: u32 = 1;

/// A fusion centre (node 0) and its sensors, of which nothing is known but bits: any [`Receiver`] at the centre, any [`SensorNode`] at the sensors.
///
/// The nodes are driven as `fewbits-link` drives them over sockets. The receiver of a real centre and the sensors' halves run here unchanged.
pub struct BitStar<R, const M: usize> {
    receiver: Arc<dyn Fn() -> Result<R, machines::BoxError> + Send + Sync>,
    members: Vec<Member>,
    node: Arc<dyn Fn(usize) -> Box<dyn SensorNode<M>> + Send + Sync>,
    measurements: Measurements<SVector<f64, M>>,
    clock: Clock,
    stream: Stream,
    arrives: Option<Arc<Arrives>>,
}

type Arrives = dyn Fn(u32, usize) -> bool + Send + Sync;

impl<R, const M: usize> fmt::Debug for BitStar<R, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BitStar").finish_non_exhaustive()
    }
}

/// A node of a [`BitStar`].
#[non_exhaustive]
pub enum BitNode<R, const M: usize> {
    /// The fusion centre: machine, estimator, and mean and deviation of each coordinate after each slot with an update.
    Centre(Box<Centre>, R, Vec<(u32, Vec<(f64, f64)>)>),
    /// A sensor: machine, its half of the scheme, and the centre's estimator where it follows by echo.
    Sensor(Box<Sensor>, Box<dyn SensorNode<M>>, Option<R>),
}

impl<R, const M: usize> fmt::Debug for BitNode<R, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BitNode").finish_non_exhaustive()
    }
}

impl<R, const M: usize> BitNode<R, M> {
    /// The centre's estimates: slot, and mean and deviation of each coordinate. Empty at a sensor.
    pub fn estimates(&self) -> &[(u32, Vec<(f64, f64)>)] {
        match self {
            Self::Centre(_, _, estimates) => estimates,
            Self::Sensor(..) => &[],
        }
    }
}

impl<R: Receiver, const M: usize> BitStar<R, M> {
    /// A star in which all sensors learn what they must know in the same way. `receiver` makes the estimator before its first slot, which a
    /// restarted centre begins with too; `node` makes the half of a sensor (the first is 0).
    ///
    /// # Errors
    /// If the estimator cannot be made, a slot of a table has not one measurement per sensor, or there are 2^23 slots or more.
    pub fn new(
        receiver: impl Fn() -> Result<R, machines::BoxError> + Send + Sync + 'static,
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
        if measurements.slots() >= 1 << (machines::SLOT_BITS - 1) {
            return refuse("measurements", measurements.slots(), "fewer than 2^23 slots");
        }
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

    /// The same with losses that were recorded: a report reaches the centre only if `arrives(slot, sensor)`. The channel's losses come on top.
    #[must_use]
    pub fn with_recorded_losses(mut self, arrives: impl Fn(u32, usize) -> bool + Send + Sync + 'static) -> Self {
        self.arrives = Some(Arc::new(arrives));
        self
    }

    /// The network before its first slot, on a field of one's own: node 0 is the centre, and every sensor must be in range of it.
    ///
    /// # Errors
    /// If the setup is out of range, the field has not one node per sensor and one for the centre, or a sensor does not reach the centre.
    pub fn simulate_on(self, field: Field, setup: Setup) -> Result<Simulator<Self>, Error> {
        let sensors = self.members.len();
        for sensor in 1..=sensors as u32 {
            field.check_link(SensorId(sensor), CENTRE)?;
        }
        let (first, schedule) = (self.clock.start(1), self.schedule());
        let centre = Centre::new(CentreSettings::new(self.members.clone(), schedule));
        let mut nodes = vec![BitNode::Centre(Box::new(centre), self.started()?, Vec::new())];
        let clocked: Vec<bool> = self.members.iter().map(|m| m.feedback == Feedback::Clock).collect();
        for (i, member) in self.members.iter().enumerate() {
            let mut settings = SensorSettings::new(member.feedback);
            settings.schedule = Some(schedule);
            let replica = (member.feedback == Feedback::Echoed)
                .then(|| self.started())
                .transpose()?;
            nodes.push(BitNode::Sensor(Box::new(Sensor::new(settings)), (self.node)(i), replica));
        }
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        simulator.start(CENTRE, first, SLOT_BEGINS)?;
        for (sensor, _) in (1..).zip(clocked).filter(|(_, clocked)| *clocked) {
            simulator.start(SensorId(sensor), first, SLOT_BEGINS)?;
        }
        Ok(simulator)
    }

    /// The estimator before its first slot.
    fn started(&self) -> Result<R, Error> {
        (self.receiver)().map_err(|error| Error::estimator("receiver", error))
    }

    fn schedule(&self) -> Schedule {
        // A clock's period is a microsecond or more.
        Schedule::new(NonZeroU64::new(self.clock.start(1).0).unwrap_or(NonZeroU64::MIN))
    }

    fn carry_out(
        &self,
        centre: &mut Centre,
        receiver: &mut R,
        estimates: &mut Vec<(u32, Vec<(f64, f64)>)>,
        context: &mut Context<'_>,
        actions: Vec<Action>,
    ) -> Result<(), Error> {
        for action in actions {
            match action {
                Action::SetTimer { at, timer } => {
                    let token = if timer == CentreTimer::SlotBegins {
                        SLOT_BEGINS
                    } else {
                        OTHER
                    };
                    context.at(Instant(at), token);
                }
                Action::Note { sensor, note } => context.note(noted(SensorId(sensor as u32 + 1), note)),
                Action::Send { to, frame } => {
                    let frame = simulated(&frame)?;
                    match to {
                        Recipient::All => context.broadcast(&frame)?,
                        Recipient::Sensor(i) => drop(context.send(SensorId(i as u32 + 1), &frame)?),
                    }
                }
                Action::Predict { slot } if slot > u64::from(self.measurements.slots()) => {}
                Action::Predict { slot } => {
                    let follows = self.members.iter().any(|m| m.feedback == Feedback::Echoed);
                    let prepared = (|| {
                        let state = if follows { Some(receiver.state()?) } else { None };
                        receiver.predict(slot)?;
                        let feedback = (0..self.members.len()).map(|i| receiver.feedback(i));
                        Ok::<_, machines::BoxError>((feedback.collect::<Result<Vec<_>, _>>()?, state))
                    })();
                    match prepared {
                        Ok((feedback, state)) => {
                            let mut sent = Vec::new();
                            centre.on_predicted(&feedback, state.as_ref(), &mut sent);
                            self.carry_out(centre, receiver, estimates, context, sent)?;
                        }
                        Err(error) => context.note(failed(Stage::Prediction, slot as u32, &error)),
                    }
                }
                Action::Update { slot, observed } => {
                    let slot = slot as u32;
                    match update_or_drop(receiver, &observed) {
                        Outcome::Used => {}
                        Outcome::SilentDropped(error) => {
                            let reason = error.to_string();
                            context.note(Note::SilenceIgnored { slot, reason });
                        }
                        Outcome::Failed(error) => context.note(failed(Stage::Update, slot, &error)),
                    }
                    estimates.push((slot, receiver.estimate()));
                }
            }
        }
        Ok(())
    }

    fn react(
        &self,
        machine: &mut Sensor,
        half: &mut dyn SensorNode<M>,
        replica: &mut Option<R>,
        context: &mut Context<'_>,
        reaction: Reaction<'_>,
    ) -> Result<(), Error> {
        if let Some((at, timer)) = reaction.timer {
            let token = match timer {
                SensorTimer::Unacknowledged { slot } => OTHER | slot.number() << 1,
                _ => SLOT_BEGINS,
            };
            context.at(Instant(at), token);
        }
        if let Some(note) = reaction.note {
            context.note(noted(CENTRE, note));
        }
        let (index, now) = (context.id().index() - 1, context.now().0);
        match reaction.task {
            // The radio repeats by itself.
            Task::Wait | Task::SendAgain => Ok(()),
            Task::Send(frame) => context.send(CENTRE, &of(&frame)).map(drop),
            Task::Follow { slot, kind, payload } => {
                let digest = replica.as_mut().and_then(|replica| {
                    let state = self.followed(replica, slot, kind, payload.into()).ok()?;
                    Some(machines::digest(slot.before(), Payload::from(&state)))
                });
                let reaction = machine.on_followed(digest);
                self.react(machine, half, replica, context, reaction)
            }
            Task::Sample { slot, feedback } => {
                let number = slot.number();
                if number > self.measurements.slots() {
                    return Ok(());
                }
                let feedback = match replica {
                    None => feedback.into(),
                    // What is shared is asked as it would travel.
                    Some(replica) => match replica
                        .predict(u64::from(number))
                        .and_then(|()| replica.feedback(index))
                    {
                        Ok(feedback) => feedback,
                        Err(error) => {
                            context.note(failed(Stage::Prediction, number, &error));
                            return Ok(());
                        }
                    },
                };
                let mut rng = super::slot::own(self.stream, index, number);
                let reported = self
                    .measurements
                    .with(number, index, |measurement| half.report(&mut rng, measurement, &feedback));
                let report = match reported {
                    Some(Ok(report)) => report,
                    Some(Err(error)) => {
                        context.note(failed(Stage::Report, number, &error.into()));
                        None
                    }
                    None => {
                        context.note(Note::NotMeasured { slot: number });
                        None
                    }
                };
                let reaction = machine.on_sample(now, report.as_ref().map(Payload::from));
                self.react(machine, half, replica, context, reaction)
            }
        }
    }

    /// Brings a replica to the end of the slot before `slot`, and returns its state.
    fn followed(
        &self,
        replica: &mut R,
        slot: Slot,
        kind: machines::Kind,
        told: BitString,
    ) -> Result<BitString, machines::BoxError> {
        if kind == machines::Kind::Snapshot {
            replica.restore(&told)?;
        } else if slot.number() > 1 {
            // The replica has predicted into that slot when it was asked.
            let lengths: Vec<_> = self.members.iter().map(|member| member.report).collect();
            update_or_drop(replica, &reports_of(&told, &lengths)?);
        }
        replica.state()
    }
}

impl<R: Receiver, const M: usize> Protocol for BitStar<R, M> {
    type Node = BitNode<R, M>;

    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        let now = context.now().0;
        match node {
            BitNode::Centre(centre, receiver, estimates) => {
                let timer = if token == SLOT_BEGINS {
                    CentreTimer::SlotBegins
                } else {
                    CentreTimer::Deadline
                };
                if timer == CentreTimer::SlotBegins && centre.slot() >= u64::from(self.measurements.slots()) {
                    return Ok(());
                }
                let mut actions = Vec::new();
                centre.on_timer(now, timer, &mut actions);
                self.carry_out(centre, receiver, estimates, context, actions)
            }
            BitNode::Sensor(machine, half, replica) => {
                let timer = match token {
                    SLOT_BEGINS => SensorTimer::SlotBegins,
                    _ => SensorTimer::Unacknowledged {
                        slot: Slot::of_count(u64::from(token >> 1)),
                    },
                };
                if timer == SensorTimer::SlotBegins && self.clock.slot(context.now()) > self.measurements.slots() {
                    return Ok(());
                }
                let reaction = machine.on_timer(now, timer);
                self.react(machine, &mut **half, replica, context, reaction)
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
            BitNode::Centre(centre, receiver, estimates) => {
                let Some(sensor) = from.index().checked_sub(1) else {
                    return Ok(());
                };
                let recorded = self.arrives.as_ref().filter(|_| frame.kind == Kind::Report);
                if recorded.is_some_and(|arrives| !arrives(frame.slot, sensor)) {
                    return Ok(());
                }
                let mut actions = Vec::new();
                centre.on_decoded(sensor, &decoded, &mut actions);
                self.carry_out(centre, receiver, estimates, context, actions)
            }
            // Frames of other sensors are in range, and for the centre.
            BitNode::Sensor(..) if from != CENTRE => Ok(()),
            BitNode::Sensor(machine, half, replica) => {
                let reaction = machine.on_decoded(context.now().0, decoded);
                self.react(machine, &mut **half, replica, context, reaction)
            }
        }
    }

    fn on_damaged(&self, node: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let (BitNode::Centre(centre, ..), Some(sensor)) = (node, from.index().checked_sub(1)) {
            centre.on_damaged(sensor);
        }
        Ok(())
    }

    /// The centre begins with what it knew before the first slot; a sensor knows that it must ask.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error> {
        match node {
            BitNode::Centre(centre, receiver, _) => {
                *receiver = self.started()?;
                centre.on_memory_lost();
            }
            BitNode::Sensor(machine, half, replica) => {
                *half = (self.node)(context.id().index() - 1);
                if let Some(replica) = replica {
                    *replica = self.started()?;
                }
                machine.on_memory_lost();
            }
        }
        Ok(())
    }
}
