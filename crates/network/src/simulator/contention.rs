//! Carrier sense: waiting, listening, and collisions.

use super::core::{OnAir, Outgoing, SimulatorCore};
use super::queue::EventKind;
use super::setup::Access;
use crate::units::{Bits, Instant, SensorId};
use rand::RngExt;

impl SimulatorCore {
    /// Whether nodes use carrier sense.
    pub(super) fn contends(&self) -> bool {
        self.setup.access != Access::Scheduled
    }

    /// How often a node listens before it drops a frame.
    pub(super) fn tries(&self) -> u32 {
        match self.setup.access {
            Access::CarrierSense(sense) => sense.tries,
            Access::Scheduled => 1,
        }
    }

    /// Schedules the next listening after a random wait.
    pub(super) fn contend(&mut self, number: u32, outgoing: Outgoing) {
        let Access::CarrierSense(sense) = self.setup.access else {
            return;
        };
        let exponent = sense.least.saturating_add(outgoing.heard).min(sense.most);
        // The last index separates these streams from those of frames.
        let stream = self.air.indexed(u64::from(outgoing.from.0)).indexed(u64::from(number));
        let stream = stream
            .indexed(u64::from(outgoing.attempts))
            .indexed(2 + u64::from(outgoing.heard));
        let units = stream.fast_rng().random_range(0..1_u32 << exponent.min(16));
        let wait = sense.unit.value() * f64::from(units);
        let at = self.state.now.after(crate::units::Seconds::trusted(wait));
        let from = outgoing.from;
        self.state.outgoing.insert(number, outgoing);
        self.schedule(at, from, EventKind::Transmit(number));
    }

    /// Whether a node that listens now hears a transmission, its own included.
    pub(super) fn hears_others(&self, node: SensorId) -> bool {
        let Access::CarrierSense(sense) = self.setup.access else {
            return false;
        };
        let now = self.state.now;
        let mut audible = self
            .state
            .on_air
            .iter()
            .filter(|one| one.end > now && one.start.after(sense.blind) <= now);
        audible.any(|one| one.from == node || self.reaches(one.from, node))
    }

    fn reaches(&self, from: SensorId, to: SensorId) -> bool {
        self.field.graph().neighbours(from.index()).binary_search(&to.0).is_ok()
    }

    /// A node begins to send. Destroys all frames on their way to nodes in range of it, and to itself. Returns the other senders.
    pub(super) fn collide(&mut self, sender: SensorId) -> Vec<SensorId> {
        if !self.contends() {
            return Vec::new();
        }
        let now = self.state.now;
        let mut on_air = std::mem::take(&mut self.state.on_air);
        on_air.retain(|one| one.end > now);
        for (to, place) in on_air.iter().flat_map(|one| &one.arrivals) {
            if (*to == sender || self.reaches(sender, *to)) && self.state.queue.destroy(*place) {
                self.state.ledger.faults.lost += 1;
            }
        }
        let senders = on_air.iter().map(|one| one.from).collect();
        self.state.on_air = on_air;
        senders
    }

    /// Whether a node cannot receive a frame that begins now, because it sends or hears one of `senders`.
    pub(super) fn is_garbled(&self, senders: &[SensorId], to: SensorId) -> bool {
        senders.iter().any(|from| *from == to || self.reaches(*from, to))
    }

    /// Records a transmission on air that begins at `start`.
    pub(super) fn occupy(&mut self, from: SensorId, start: Instant, air: Bits, arrivals: Vec<(SensorId, u32)>) {
        if self.contends() {
            let end = start.after(self.setup.radio_of(from).duration(air));
            self.state.on_air.push(OnAir {
                from,
                start,
                end,
                arrivals,
            });
        }
    }
}
