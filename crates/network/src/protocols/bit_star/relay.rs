//! Frames over several hops: what sensors pass on for others.

use super::BitStar;
use super::node::SensingNode;
use super::routes::{CENTRE, Routes};
use super::translation::{goes_up, is_for_all};
use crate::error::Error;
use crate::medium::{Check, Field, Frame, Kind};
use crate::note::Note;
use crate::simulator::Context;
use crate::units::SensorId;

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
    pub(super) fn send_up(&self, context: &mut Context<'_>, frame: &Frame) -> Result<(), Error> {
        match self.parent(context) {
            CENTRE => context.send(CENTRE, frame).map(drop),
            parent => {
                let relayed = frame.relayed(context.id().0)?;
                context.send(parent, &relayed).map(drop)
            }
        }
    }

    /// Sends a frame of the centre to one sensor. Where sensors relay it is always addressed: others are for all.
    pub(super) fn send_down(&self, context: &mut Context<'_>, to: SensorId, frame: &Frame) -> Result<(), Error> {
        match self.routes(context.field()).map(|routes| routes.down(CENTRE, to)) {
            None => context.send(to, frame).map(drop),
            Some(hop) => context.send(hop, &frame.relayed(to.0)?).map(drop),
        }
    }

    /// A relayed frame has arrived. Returns the frame within, and whom it is from, where it has come to its end; passes it on elsewhere.
    pub(super) fn relay(&self, context: &mut Context<'_>, frame: &Frame) -> Result<Option<(SensorId, Frame)>, Error> {
        let (id, sensor) = (context.id(), SensorId(frame.destination));
        let inner = Frame::from_bits(&frame.payload, Check::Whole);
        let inner = inner.ok().filter(|inner| inner.kind != Kind::Relayed);
        let (Some(inner), Some(routes)) = (inner, self.routes(context.field())) else {
            context.note(Note::Malformed);
            return Ok(None);
        };
        let exists = sensor != CENTRE && sensor.index() < context.field().len();
        match (goes_up(inner.kind), exists) {
            (_, false) => context.note(Note::Malformed),
            (true, _) if id == CENTRE => return Ok(Some((sensor, inner))),
            (false, _) if id == sensor => return Ok(Some((CENTRE, inner))),
            (true, _) => drop(context.send(routes.parent(id), frame)?),
            (false, _) => {
                let hop = routes.down(id, sensor);
                // A frame that strayed from its route ends here.
                if context.field().check_link(id, hop).is_ok() {
                    context.send(hop, frame)?;
                }
            }
        }
        Ok(None)
    }

    /// Passes on what the centre sends to all, once a slot.
    pub(super) fn pass_on(
        &self,
        sensor: &mut SensingNode<R, M>,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        let passes = |routes: &Routes| routes.passes[context.id().index()] && from == routes.parent(context.id());
        if is_for_all(frame.kind) && frame.slot > sensor.passed && self.routes(context.field()).is_some_and(passes) {
            sensor.passed = frame.slot;
            context.broadcast(frame)?;
        }
        Ok(())
    }
}
