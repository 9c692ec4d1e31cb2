//! Passes events of the simulator to the state machines, and stores nodes in snapshots.

use super::super::{decoded, malformed};
use super::node::{BitNode, CentreNode, SensingNode, StoredBitNode, StoredNode};
use super::relay::is_for_all;
use super::routes::CENTRE;
use super::{BitStar, SLOT_BEGINS};
use crate::error::Error;
use crate::medium::air::carried;
use crate::simulator::{Context, Protocol, Storable};
use crate::units::SensorId;
use fewbits_protocol::{BoxError, CentreTimer, Frame, Kind, Receiver, SensorTimer, Slot};

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
                // Time by the sensor's own clock, which the centre's frames have set.
                let settings = sensor.machine.settings();
                let count = settings
                    .schedule
                    .map_or(0, |s| s.count(now.saturating_sub(settings.offset)));
                if timer == SensorTimer::SlotBegins && count > u64::from(self.measurements.slots()) {
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
        frame: &Frame<'_>,
    ) -> Result<(), Error> {
        let bytes = carried(frame);
        let inner = bytes.as_deref().and_then(|bytes| decoded(bytes).ok());
        let (from, frame, addressed) = match (frame.kind, &inner) {
            (Kind::Handover, Some(inner)) => match self.relay(context, frame, inner)? {
                Some(origin) => (origin, inner, true),
                None => return Ok(()),
            },
            // A star has no handovers.
            (Kind::Handover, None) => {
                context.note(malformed(from, frame));
                return Ok(());
            }
            _ => (from, frame, false),
        };
        match node {
            BitNode::Centre(centre) => {
                let Some(sensor) = from.index().checked_sub(1) else {
                    return Ok(());
                };
                // A relay repeats a broadcast that the centre itself has sent: ignore it there.
                if !addressed && self.routes.is_some() && is_for_all(frame.kind) {
                    return Ok(());
                }
                let recorded = self.arrives.as_ref().filter(|_| frame.kind == Kind::Report);
                if recorded.is_some_and(|arrives| !arrives(frame.slot.number(), sensor)) {
                    return Ok(());
                }
                let mut actions = Vec::new();
                centre.machine.on_decoded(sensor, frame, &mut actions);
                self.carry_out(centre, context, actions)
            }
            // Frames of other sensors are received too, but are meant for the centre.
            BitNode::Sensor(_) if from != CENTRE && from != self.parent(context) => Ok(()),
            BitNode::Sensor(sensor) => {
                if !addressed {
                    self.pass_on(sensor, context, from, frame)?;
                }
                let reaction = sensor.machine.on_decoded(context.now().0, *frame);
                self.react(sensor, context, reaction)
            }
        }
    }

    /// The slot tells which sensor sent the report, so the report is known to be lost.
    fn on_damaged(&self, node: &mut Self::Node, _: &mut Context<'_>, from: SensorId) -> Result<(), Error> {
        if let (BitNode::Centre(centre), Some(sensor)) = (node, from.index().checked_sub(1)) {
            centre.machine.on_damaged(sensor);
        }
        Ok(())
    }

    /// The centre starts again with its belief before the first slot. A sensor must ask for the state.
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
                receiver.restore(&state)?;
                Ok(BitNode::Centre(Box::new(CentreNode {
                    machine,
                    receiver,
                    estimates,
                    failures,
                })))
            }
            (Some(sensor), StoredNode::Sensor(machine, memory, [counted, passed], state, failures))
                if sensor < self.members.len() =>
            {
                let (mut half, mut replica) = ((self.node)(sensor), self.replica(sensor)?);
                half.restore(&memory)?;
                if let (Some(replica), Some(state)) = (&mut replica, &state) {
                    replica.restore(state)?;
                }
                Ok(BitNode::Sensor(Box::new(SensingNode {
                    machine,
                    half,
                    counted,
                    replica,
                    passed,
                    failures,
                })))
            }
            (Some(_), StoredNode::Sensor(..)) => Err("more sensors than the star has".into()),
            _ => Err("a centre where a sensor is, or a sensor where the centre is".into()),
        }
    }
}
