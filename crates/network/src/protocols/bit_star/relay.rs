//! Frames over several hops: what sensors forward for others.

use super::super::malformed;
use super::BitStar;
use super::node::SensingNode;
use super::routes::{CENTRE, Routes};
use crate::error::Error;
use crate::medium::Field;
use crate::medium::air::{carrying, on_air};
use crate::simulator::Context;
use crate::units::SensorId;
use fewbits_protocol::{Check, Frame, Kind};

/// Whether frames of this kind go from sensors to the centre; others go from the centre to sensors.
fn goes_up(kind: Kind) -> bool {
    matches!(kind, Kind::Report | Kind::Request | Kind::Heartbeat)
}

/// Whether the centre sends frames of this kind to all sensors.
pub(super) fn is_for_all(kind: Kind) -> bool {
    matches!(kind, Kind::Feedback | Kind::Echo | Kind::Snapshot | Kind::Heartbeat)
}

impl<R, const M: usize> BitStar<R, M> {
    /// The routes, if sensors relay.
    pub(super) fn routes(&self, field: &Field) -> Option<&Routes> {
        let routes = self.routes.as_ref()?;
        Some(routes.get_or_init(|| Routes::new(field)))
    }

    /// The node from which the centre's broadcasts come.
    pub(super) fn parent(&self, context: &Context<'_>) -> SensorId {
        self.routes(context.field())
            .map_or(CENTRE, |routes| routes.parent(context.id()))
    }

    /// Sends a sensor's frame to the centre.
    pub(super) fn send_up(&self, context: &mut Context<'_>, frame: &Frame<'_>) -> Result<(), Error> {
        match self.parent(context) {
            CENTRE => context.send(CENTRE, frame).map(drop),
            parent => {
                let bits = on_air(frame, Check::Whole);
                context.send(parent, &carrying(frame, &bits, context.id())).map(drop)
            }
        }
    }

    /// Sends a frame of the centre to one sensor. If sensors relay, the frame is always addressed; a frame without address is for all.
    pub(super) fn send_down(&self, context: &mut Context<'_>, to: SensorId, frame: &Frame<'_>) -> Result<(), Error> {
        match self.routes(context.field()).map(|routes| routes.down(CENTRE, to)) {
            None => context.send(to, frame).map(drop),
            Some(hop) => {
                let bits = on_air(frame, Check::Whole);
                context.send(hop, &carrying(frame, &bits, to)).map(drop)
            }
        }
    }

    /// Handles a frame that contains another one, `inner`. At its destination it returns the original sender, elsewhere it forwards the
    /// frame.
    pub(super) fn relay(
        &self,
        context: &mut Context<'_>,
        frame: &Frame<'_>,
        inner: &Frame<'_>,
    ) -> Result<Option<SensorId>, Error> {
        let (id, sensor) = (context.id(), SensorId(frame.destination));
        let Some(routes) = self.routes(context.field()) else {
            context.note(malformed(sensor, frame));
            return Ok(None);
        };
        let exists = sensor != CENTRE && sensor.index() < context.field().len();
        match (goes_up(inner.kind), exists) {
            (_, false) => context.note(malformed(sensor, frame)),
            (true, _) if id == CENTRE => return Ok(Some(sensor)),
            (false, _) if id == sensor => return Ok(Some(CENTRE)),
            (true, _) => drop(context.send(routes.parent(id), frame)?),
            (false, _) => {
                let hop = routes.down(id, sensor);
                // A frame at a node outside its route is dropped.
                if context.field().check_link(id, hop).is_ok() {
                    context.send(hop, frame)?;
                }
            }
        }
        Ok(None)
    }

    /// Forwards a broadcast of the centre, once per slot.
    pub(super) fn pass_on(
        &self,
        sensor: &mut SensingNode<R, M>,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame<'_>,
    ) -> Result<(), Error> {
        let passes = |routes: &Routes| routes.passes[context.id().index()] && from == routes.parent(context.id());
        if is_for_all(frame.kind)
            && frame.slot.number() > sensor.passed
            && self.routes(context.field()).is_some_and(passes)
        {
            sensor.passed = frame.slot.number();
            context.broadcast(frame);
        }
        Ok(())
    }
}
