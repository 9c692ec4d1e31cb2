//! Sensors without a centre: every node receives every report and runs the filter.

use crate::clock::Clock;
use crate::error::Error;
use crate::estimator::Replicable;
use crate::measurements::Measurements;
use crate::medium::{Field, Frame, Kind, digest, frame::stored};
use crate::note::{Note, Stage};
use crate::protocols::slot::{Arrived, Failures, check_fits, from_prior, own, predict, update_or_discard};
use crate::simulator::{Context, Protocol, Setup, Simulator};
use crate::units::SensorId;
use fewbits_core::{BitString, Message};
use fewbits_monte_carlo::Stream;
use serde::{Deserialize, Serialize};

const ANCHOR: SensorId = SensorId(0);
/// Timer: a slot begins.
const BEGIN: u32 = 0;
/// Timer: reports of the slot are awaited no longer.
const DEADLINE: u32 = 1;

/// Sensors that broadcast their reports to each other; every one of them estimates.
///
/// ```text
/// slot k, every node:  predicted = predict(belief);  question and report of its own;  broadcast it with a digest of its belief
///         at the deadline:  belief = update(predicted, reports of the same digest)
/// ```
/// Node 0 is the anchor: who hears another digest from it than its own has missed something, notes it, is silent and asks; the
/// anchor then broadcasts its belief. An anchor with nothing to report sends its digest alone every so many slots.
#[derive(Debug, Clone)]
pub struct AdHoc<E: Replicable> {
    estimator: E,
    measurements: Measurements<E::Measurement>,
    clock: Clock,
    stream: Stream,
    beacon: u32,
}

/// What a node heard from another in a slot.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
enum Heard {
    #[default]
    Nothing,
    Damaged,
    Frame {
        digest: u32,
        #[serde(with = "stored")]
        report: BitString,
    },
    /// A digest alone: silence, for certain.
    Digest(u32),
}

/// A node of an [`AdHoc`] network.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Peer<B, Y> {
    memory: Y,
    belief: B,
    predicted: Option<B>,
    slot: u32,
    digest: u32,
    heard: Vec<Heard>,
    /// It knows that it differs from the anchor.
    lost: bool,
    /// At the anchor: somebody needs the belief.
    asked: bool,
    failures: Failures,
    estimates: Vec<Vec<f64>>,
}

impl<B, Y> Peer<B, Y> {
    /// Its estimates, slot by slot.
    pub fn estimates(&self) -> &[Vec<f64>] {
        &self.estimates
    }

    /// Its belief after its last slot.
    pub fn belief(&self) -> &B {
        &self.belief
    }

    /// Whether it knows that it differs from the anchor.
    pub fn is_lost(&self) -> bool {
        self.lost
    }
}

impl<E: Replicable> AdHoc<E> {
    /// A network without a centre. `beacon` is after how many slots a silent anchor sends its digest; `stream` is what the estimator draws from.
    ///
    /// # Errors
    /// If a slot of a table has not one measurement per sensor, there are 2^29 slots or more, or `beacon` is zero.
    pub fn new(
        estimator: E,
        measurements: impl Into<Measurements<E::Measurement>>,
        clock: Clock,
        beacon: u32,
        stream: Stream,
    ) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("beacon", beacon as usize)?;
        let measurements = measurements.into();
        measurements.check(estimator.sensors())?;
        Ok(Self {
            estimator,
            measurements,
            clock,
            stream,
            beacon,
        })
    }

    /// The network before its first slot: all nodes on a circle of the given radius, in range of each other.
    ///
    /// # Errors
    /// If the setup or radius is out of range; [`Error::SlotTooShort`] if a slot has no time for a report of every node.
    pub fn simulate(self, radius: f64, setup: Setup) -> Result<Simulator<Self>, Error> {
        let sensors = self.estimator.sensors();
        check_fits(&self.clock, &setup, None, sensors)?;
        let start = self.estimator.start();
        let nodes = (0..sensors).map(|i| Peer {
            memory: self.estimator.memory(i),
            belief: start.clone(),
            predicted: None,
            slot: 0,
            digest: 0,
            heard: Vec::new(),
            lost: false,
            asked: false,
            failures: Failures::default(),
            estimates: Vec::new(),
        });
        let (nodes, clock) = (nodes.collect(), self.clock);
        let mut simulator = Simulator::new(self, nodes, Field::ring(sensors, radius)?, setup)?;
        for node in 0..sensors as u32 {
            simulator.start(SensorId(node), clock.start(1), BEGIN)?;
        }
        Ok(simulator)
    }

    fn digest(&self, slot: u32, belief: &E::Belief) -> Result<u32, Error> {
        Ok(digest(u64::from(slot), &self.estimator.belief_bits(belief)?))
    }

    fn begin(&self, peer: &mut Peer<E::Belief, E::Memory>, context: &mut Context<'_>) -> Result<(), Error> {
        let slot = self.clock.slot(context.now());
        let slots = self.measurements.slots();
        if slot > slots {
            return Ok(());
        }
        context.at(self.clock.deadline(slot), DEADLINE);
        context.at(self.clock.start(slot + 1), BEGIN);
        let index = context.id().index();
        peer.slot = slot;
        peer.digest = self.digest(slot - 1, &peer.belief)?;
        peer.heard = vec![Heard::Nothing; self.estimator.sensors()];
        let predicted = predict(&self.estimator, self.stream, slot, &peer.belief);
        let failed = predicted.as_ref().err().map(Error::in_full);
        peer.predicted = predicted.ok();
        if peer.lost {
            if context.id() != ANCHOR {
                let request = Frame::new(Kind::Request, slot, peer.digest, BitString::default());
                context.send(ANCHOR, &request)?;
            }
            return Ok(());
        }
        let Some(predicted) = &peer.predicted else {
            let (stage, reason) = (Stage::Prediction, failed.unwrap_or_default());
            return peer.failures.note(context, slots, Note::Failed { stage, slot, reason });
        };
        let anchor = context.id() == ANCHOR;
        if anchor && std::mem::take(&mut peer.asked) {
            let bits = self.estimator.belief_bits(&peer.belief)?;
            context.broadcast(&Frame::new(Kind::Snapshot, slot, peer.digest, bits))?;
        }
        let format = self.estimator.question_format(index);
        let question = self.estimator.question(slot, predicted, index)?.to_bits(&format)?;
        let question = E::Question::from_bits(&format, &question)?;
        let mut rng = own(self.stream, index, slot);
        let memory = &mut peer.memory;
        let report = self.measurements.with(slot, index, |measurement| {
            self.estimator
                .report(&mut rng, slot, index, memory, measurement, &question)
        });
        if report.is_none() {
            context.note(Note::NotMeasured { slot });
        }
        match report.unwrap_or(Ok(None)) {
            Ok(Some(report)) => {
                let report = report.to_bits(&self.estimator.report_format(index))?;
                peer.heard[index] = Heard::Frame {
                    digest: peer.digest,
                    report: report.clone(),
                };
                context.broadcast(&Frame::new(Kind::Report, slot, peer.digest, report))?;
            }
            Ok(None) => {
                if anchor && slot.is_multiple_of(self.beacon) {
                    context.broadcast(&Frame::new(Kind::Beacon, slot, peer.digest, BitString::default()))?;
                }
            }
            Err(error) => peer.failures.record(context, slots, Stage::Report, slot, &error)?,
        }
        Ok(())
    }

    fn finish(&self, peer: &mut Peer<E::Belief, E::Memory>, context: &mut Context<'_>) -> Result<(), Error> {
        let (slot, anchor) = (peer.slot, context.id() == ANCHOR);
        let mut differs = None;
        let arrived = peer.heard.iter().enumerate().map(|(i, heard)| match heard {
            Heard::Nothing => Arrived::Nothing,
            Heard::Damaged => Arrived::Lost,
            Heard::Digest(sum) | Heard::Frame { digest: sum, .. } if *sum != peer.digest => {
                if anchor || i == ANCHOR.index() {
                    differs = Some(SensorId(i as u32));
                }
                Arrived::Lost
            }
            Heard::Digest(_) => Arrived::Nothing,
            Heard::Frame { report, .. } => Arrived::Report(report.clone()),
        });
        let mut arrived: Vec<Arrived> = arrived.collect();
        if let Some(with) = differs {
            context.note(Note::Disagreement { with, slot });
            if anchor {
                peer.asked = true;
            } else {
                peer.lost = true;
            }
        }
        let mut note = None;
        if let Some(predicted) = peer.predicted.take() {
            let after = update_or_discard(&self.estimator, self.stream, slot, &predicted, &mut arrived);
            (peer.belief, note) = after;
        }
        peer.estimates.resize(slot as usize - 1, Vec::new());
        peer.estimates.push(self.estimator.mean(&peer.belief));
        match note {
            Some(note) => peer.failures.note(context, self.measurements.slots(), note),
            None => Ok(()),
        }
    }

    /// Takes the belief that the anchor has sent.
    fn adopt(
        &self,
        peer: &mut Peer<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        frame: &Frame,
    ) -> Result<(), Error> {
        let slot = frame.slot;
        let belief = self.estimator.belief_of(&frame.payload);
        let agreed = digest(u64::from(slot - 1), &frame.payload) == frame.digest;
        let Some(belief) = belief.ok().filter(|_| agreed) else {
            context.note(Note::Malformed);
            return Ok(());
        };
        if frame.digest == peer.digest && !peer.lost {
            return Ok(());
        }
        let predicted = match predict(&self.estimator, self.stream, slot, &belief) {
            Ok(predicted) => predicted,
            Err(error) => {
                let slots = self.measurements.slots();
                return peer.failures.record(context, slots, Stage::Prediction, slot, &error);
            }
        };
        peer.belief = belief;
        peer.predicted = Some(predicted);
        peer.digest = frame.digest;
        peer.lost = false;
        context.note(Note::Resynchronised { slot });
        Ok(())
    }
}

impl<E: Replicable> Protocol for AdHoc<E> {
    type Node = Peer<E::Belief, E::Memory>;

    fn on_timer(&self, peer: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        if token == BEGIN {
            return self.begin(peer, context);
        }
        self.finish(peer, context)
    }

    fn on_frame(
        &self,
        peer: &mut Self::Node,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        let slot = frame.slot;
        if frame.kind == Kind::Request {
            if context.id() == ANCHOR {
                context.note(Note::Disagreement { with: from, slot });
                peer.asked = true;
            }
            return Ok(());
        }
        let open = slot == peer.slot && slot > 0 && context.now() < self.clock.deadline(slot);
        if !open {
            context.note(Note::Late);
            return Ok(());
        }
        let sender = from.index();
        match frame.kind {
            Kind::Snapshot if from == ANCHOR => self.adopt(peer, context, frame)?,
            Kind::Report | Kind::Beacon if sender < peer.heard.len() => {
                if !matches!(peer.heard[sender], Heard::Nothing) {
                    context.note(Note::Duplicate);
                    return Ok(());
                }
                let malformed = || E::Report::from_bits(&self.estimator.report_format(sender), &frame.payload).is_err();
                peer.heard[sender] = if frame.kind == Kind::Beacon {
                    Heard::Digest(frame.digest)
                } else if malformed() {
                    context.note(Note::Malformed);
                    Heard::Damaged
                } else {
                    Heard::Frame {
                        digest: frame.digest,
                        report: frame.payload.clone(),
                    }
                };
            }
            _ => context.note(Note::Malformed),
        }
        Ok(())
    }

    fn on_damaged(&self, peer: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let Some(heard @ Heard::Nothing) = peer.heard.get_mut(from.index()) {
            *heard = Heard::Damaged;
        }
        Ok(())
    }

    /// A node begins with what is known without reports and knows that it must ask; the anchor's is what all must take.
    fn on_restart(&self, peer: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error> {
        let slot = self.clock.slot(context.now()).min(self.measurements.slots());
        if let Ok(belief) = from_prior(&self.estimator, self.stream, slot) {
            peer.belief = belief;
        }
        peer.memory = self.estimator.memory(context.id().index());
        peer.predicted = None;
        peer.heard = Vec::new();
        let anchor = context.id() == ANCHOR;
        peer.asked = anchor;
        peer.lost = !anchor;
        Ok(())
    }
}
