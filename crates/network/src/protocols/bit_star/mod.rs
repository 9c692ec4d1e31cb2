//! A star network. Its nodes run the state machines of `fewbits-protocol`, as real sensors do.
//!
//! `driver` passes the simulator's events to the machines. `centre` and `sensor` carry out their actions. `relay` forwards frames along
//! `routes`. `node` has the state of the nodes.

mod centre;
mod driver;
mod node;
mod relay;
mod routes;
mod sensor;

pub use node::{BitNode, CentreNode, SensingNode, SlotEstimate, StoredBitNode};

use crate::clock::Clock;
use crate::error::Error;
use crate::measurements::Measurements;
use crate::medium::Field;
use crate::simulator::transmission::air_time;
use crate::simulator::{Setup, Simulator};
use crate::units::{Bits, Instant, Seconds, SensorId};
use fewbits_core::{Scheme, SchemeNode, SensorNode};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{
    BoxError, Centre, CentreSettings, Feedback, Kind, Member, Receiver, ReportLength, Sensor, SensorSettings,
    predict_and_ask,
};
use nalgebra::SVector;
use node::Failures;
use routes::{CENTRE, Routes};
use std::fmt;
use std::sync::{Arc, OnceLock};

/// Timers of nodes: a slot begins; other values are a centre's deadline, or a sensor's missing acknowledgement (with the slot above).
const SLOT_BEGINS: u32 = 0;
const OTHER: u32 = 1;

/// A fusion centre (node 0) and its sensors (nodes 1, 2, ...). They see each other's messages only as bits: any [`Receiver`] at the centre,
/// any [`SensorNode`] at the sensors.
///
/// ```text
/// slot k, centre:  predict;  broadcast feedback or echo, with a digest
///         sensor:  check the digest;  measure;  report, with the digest of what it was told
///         centre, at the deadline:  update with the reports of the right slot and digest
/// ```
/// The nodes are driven as `fewbits-link` drives them over sockets. The receiver of a real centre and the sensors' halves run here
/// unchanged. If an update fails (for example because nothing came over a link that is assumed to lose nothing), it is repeated without the
/// sensors from which nothing came, and a note is written. A node that fails in more than half of the slots ends the run.
pub struct BitStar<R, const M: usize> {
    receiver: Arc<MakeReceiver<R>>,
    members: Vec<Member>,
    node: Arc<MakeNode<M>>,
    measurements: Measurements<SVector<f64, M>>,
    clock: Clock,
    stream: Stream,
    arrives: Option<Arc<Arrives>>,
    routes: Option<Arc<OnceLock<Routes>>>,
    announce_every: u32,
    /// Time from the slot's beginning to the first report by the clock, and between successive sensors.
    offsets: [Seconds; 2],
}

impl<R, const M: usize> Clone for BitStar<R, M> {
    fn clone(&self) -> Self {
        Self {
            receiver: self.receiver.clone(),
            members: self.members.clone(),
            node: self.node.clone(),
            measurements: self.measurements.clone(),
            arrives: self.arrives.clone(),
            routes: self.routes.clone(),
            ..*self
        }
    }
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
    /// A star in which all sensors have the same kind of feedback and length of reports. `receiver` makes the estimator before its first
    /// slot; a restarted centre begins with it too. `node` makes the half of a sensor (numbered from 0).
    ///
    /// # Errors
    /// If `receiver` fails, a slot of a table has not one measurement per sensor, or there are 2^23 slots or more.
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
            routes: None,
            announce_every: 0,
            offsets: [Seconds::ZERO; 2],
        })
    }

    /// A star whose sensors are sent their feedback and all report by one scheme.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_scheme<C>(
        receiver: impl Fn() -> Result<R, BoxError> + Send + Sync + 'static,
        scheme: C,
        measurements: impl Into<Measurements<SVector<f64, M>>>,
        clock: Clock,
        stream: Stream,
    ) -> Result<Self, Error>
    where
        C: Scheme<M> + Clone + Send + Sync + 'static,
        C::State: 'static,
    {
        let node = move |_| -> Box<dyn SensorNode<M>> { Box::new(SchemeNode::new(scheme.clone())) };
        Self::new(receiver, Feedback::Told, ReportLength::Varying, node, measurements, clock, stream)
    }

    /// Gives one sensor (numbered from 0) another kind of feedback or another length of reports.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn with_member(mut self, sensor: usize, member: Member) -> Result<Self, Error> {
        let nodes = self.members.len();
        let place = self.members.get_mut(sensor);
        *place.ok_or(Error::UnknownNode { node: sensor, nodes })? = member;
        Ok(self)
    }

    /// Adds recorded losses: a report reaches the centre only if `arrives(slot, sensor)`. The channel's losses are added to them.
    #[must_use]
    pub fn with_recorded_losses(mut self, arrives: impl Fn(u32, usize) -> bool + Send + Sync + 'static) -> Self {
        self.arrives = Some(Arc::new(arrives));
        self
    }

    /// Lets sensors out of range of the centre send through others, along shortest routes. Every sensor on a route forwards the centre's
    /// broadcasts. A forwarded frame has a second header with the sensor's number.
    #[must_use]
    pub fn relaying(mut self) -> Self {
        self.routes = Some(Arc::default());
        self
    }

    /// Lets the centre send a heartbeat every `every` slots if it broadcasts nothing else. Sensors set their clocks by it.
    #[must_use]
    pub fn announcing(self, every: u32) -> Self {
        Self {
            announce_every: every,
            ..self
        }
    }

    /// Sets when sensors report by the clock: the first one `first` after the slot's beginning, each next one `spacing` later. A sensor's
    /// clock may be ahead by at most `first`.
    #[must_use]
    pub fn reporting_at(self, first: Seconds, spacing: Seconds) -> Self {
        Self {
            offsets: [first, spacing],
            ..self
        }
    }

    /// The network before its first slot: the centre in the middle, the sensors on a circle of `radius` metres.
    ///
    /// # Errors
    /// As [`simulate_on`](Self::simulate_on); if the radius is out of range.
    pub fn simulate(self, radius: f64, setup: Setup) -> Result<Simulator<Self>, Error> {
        let field = Field::star(self.members.len(), radius)?;
        self.simulate_on(field, setup)
    }

    /// The network before its first slot, on a given field: node 0 is the centre, and every sensor must reach it, directly or by
    /// [`relaying`](Self::relaying).
    ///
    /// # Errors
    /// If the setup is out of range, the field has not one node per sensor and one for the centre; [`Error::OutOfRange`] or
    /// [`Error::Disconnected`] if a sensor does not reach the centre; [`Error::SlotTooShort`] if a slot has no time for a report of every sensor.
    pub fn simulate_on(self, field: Field, setup: Setup) -> Result<Simulator<Self>, Error> {
        let sensors = 1..=self.members.len() as u32;
        // Without routes every sensor must hear the centre itself.
        let hops = match self.routes {
            Some(_) => {
                field.routes(CENTRE)?;
                let hops = |sensor| self.routes(&field).map_or(1, |routes| routes.hops(sensor));
                sensors.map(hops).collect()
            }
            None => {
                for sensor in sensors {
                    field.check_link(SensorId(sensor), CENTRE)?;
                }
                vec![1; self.members.len()]
            }
        };
        self.check_fits(&setup, &hops)?;
        let mut settings = CentreSettings::new(self.members.clone(), self.clock.schedule());
        settings.announce_every = self.announce_every;
        let mut nodes = vec![BitNode::Centre(Box::new(CentreNode {
            machine: Centre::new(settings),
            receiver: self.started()?,
            estimates: Vec::new(),
            failures: Failures::default(),
        }))];
        for (i, member) in self.members.iter().enumerate() {
            let mut settings = SensorSettings::new(member.feedback);
            settings.schedule = Some(self.clock.schedule());
            settings.offset = self.offset(i);
            nodes.push(BitNode::Sensor(Box::new(SensingNode {
                machine: Sensor::new(settings),
                half: (self.node)(i),
                counted: 0,
                replica: self.replica(i)?,
                passed: 0,
                failures: Failures::default(),
            })));
        }
        let first = self.clock.start(1);
        // Sensors that report by the clock start on their own; the others wait for the centre.
        let clocked = |(_, member): &(usize, &Member)| member.feedback == Feedback::Clock;
        let clocked = self.members.iter().enumerate().filter(clocked);
        let starts: Vec<_> = clocked
            .map(|(i, _)| (SensorId(i as u32 + 1), Instant(first.0.saturating_add(self.offset(i)))))
            .collect();
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        for (node, at) in [(CENTRE, first)].into_iter().chain(starts) {
            simulator.start(node, at, SLOT_BEGINS)?;
        }
        Ok(simulator)
    }

    /// From the beginning of a slot until a sensor that reports by the clock measures, in nanoseconds.
    fn offset(&self, sensor: usize) -> u64 {
        let before = self.members.iter().take(sensor);
        let before = before.filter(|member| member.feedback == Feedback::Clock).count();
        let [first, spacing] = self.offsets;
        (0..before)
            .fold(Instant::default().after(first), |at, _| at.after(spacing))
            .0
    }

    /// A new estimator before the first slot.
    fn started(&self) -> Result<R, Error> {
        (self.receiver)().map_err(|error| Error::estimator("receiver", error))
    }

    /// The copy of the estimator at a sensor that follows by echo; `None` for others.
    fn replica(&self, sensor: usize) -> Result<Option<R>, Error> {
        let follows = self.members.get(sensor).is_some_and(|m| m.feedback == Feedback::Echoed);
        follows.then(|| self.started()).transpose()
    }

    /// Checks that a slot has time for the centre's frames of the first slot and for a report of each sensor. The lengths of echoes and
    /// reports are not known beforehand: an echo counts one bit per sensor, a report has no payload.
    fn check_fits(&self, setup: &Setup, hops: &[usize]) -> Result<(), Error> {
        let mut receiver = self.started()?;
        let (told, state) =
            predict_and_ask(&mut receiver, &self.members, 1).map_err(|error| Error::estimator("receiver", error))?;
        let members = || self.members.iter().zip(&told);
        let mut bodies: Vec<u64> = members()
            .filter(|(member, _)| member.feedback == Feedback::Told)
            .map(|(_, told)| (8 * Kind::Feedback.overhead() + told.bits()) as u64)
            .collect();
        // The same message to all is broadcast once.
        if bodies.len() == told.len() && told.windows(2).all(|pair| pair[0] == pair[1]) {
            bodies.truncate(1);
        }
        bodies.extend(state.map(|_| (8 * Kind::Echo.overhead() + told.len()) as u64));
        let (report, relayed) = (8 * Kind::Report.overhead() as u64, 8 * Kind::Handover.overhead() as u64);
        // A report is sent again over every hop, with the header of a relayed frame if there is more than one.
        for hops in hops.iter().copied() {
            bodies.extend(std::iter::repeat_n(report + if hops > 1 { relayed } else { 0 }, hops));
        }
        let frames = bodies.len();
        let mut needed = air_time(&setup.radio, bodies.into_iter().map(Bits));
        if setup.retries.is_some() {
            needed += std::iter::repeat_n(setup.radio.answer_time(), hops.iter().sum()).sum();
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
