//! The nodes of a star, and how they are stored.

use crate::error::Error;
use crate::note::Note;
use crate::simulator::Context;
use fewbits_core::{BitString, SensorNode};
use fewbits_protocol::{BoxError, Centre, Receiver, Sensor};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A slot, and mean and standard deviation of each coordinate after it.
pub type SlotEstimate = (u32, Vec<(f64, f64)>);

/// A node of a [`BitStar`](super::BitStar).
#[non_exhaustive]
pub enum BitNode<R, const M: usize> {
    /// The fusion centre.
    Centre(Box<CentreNode<R>>),
    /// A sensor.
    Sensor(Box<SensingNode<R, M>>),
}

/// State of a fusion centre: its state machine and its estimator.
#[derive(Debug)]
pub struct CentreNode<R> {
    pub(super) machine: Centre,
    pub(super) receiver: R,
    pub(super) estimates: Vec<SlotEstimate>,
    pub(super) failures: Failures,
}

/// State of a sensor: its state machine, its half of the scheme, and a copy of the centre's estimator if it follows by echo.
pub struct SensingNode<R, const M: usize> {
    pub(super) machine: Sensor,
    pub(super) half: Box<dyn SensorNode<M>>,
    /// The last slot that the sensor's half was told of.
    pub(super) counted: u32,
    pub(super) replica: Option<R>,
    /// The last slot whose broadcast the sensor forwarded.
    pub(super) passed: u32,
    pub(super) failures: Failures,
}

/// The stored form of a [`BitNode`] in a snapshot.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StoredBitNode(pub(super) StoredNode);

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum StoredNode {
    Centre(Centre, BitString, Vec<SlotEstimate>, Failures),
    Sensor(Sensor, BitString, [u32; 2], Option<BitString>, Failures),
}

impl<R, const M: usize> fmt::Debug for BitNode<R, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let machine: &dyn fmt::Debug = match self {
            Self::Centre(centre) => &centre.machine,
            Self::Sensor(sensor) => &sensor.machine,
        };
        f.debug_struct("BitNode")
            .field("machine", machine)
            .finish_non_exhaustive()
    }
}

impl<R, const M: usize> fmt::Debug for SensingNode<R, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SensingNode")
            .field("machine", &self.machine)
            .finish_non_exhaustive()
    }
}

impl<R, const M: usize> BitNode<R, M> {
    /// The centre's estimates of the slots with an update. Empty at a sensor.
    pub fn estimates(&self) -> &[SlotEstimate] {
        match self {
            Self::Centre(centre) => &centre.estimates,
            Self::Sensor(_) => &[],
        }
    }

    /// The means of the centre's estimates, slot by slot from 1 on; a slot without update is empty. Empty at a sensor.
    pub fn means(&self) -> Vec<Vec<f64>> {
        let mut means = Vec::new();
        for (slot, estimate) in self.estimates() {
            means.resize((*slot as usize).saturating_sub(1), Vec::new());
            means.push(estimate.iter().map(|(mean, _)| *mean).collect());
        }
        means
    }

    /// The estimator: the centre's own, or that of a sensor which follows by echo. `None` at other sensors.
    pub fn receiver(&self) -> Option<&R> {
        match self {
            Self::Centre(centre) => Some(&centre.receiver),
            Self::Sensor(sensor) => sensor.replica.as_ref(),
        }
    }

    /// The last slot in which a sensor answered or began to. `None` before the first, and at the centre.
    pub fn answered(&self) -> Option<u32> {
        match self {
            Self::Centre(_) => None,
            Self::Sensor(sensor) => sensor.machine.answered().map(|slot| slot.number()),
        }
    }
}

impl<R: Receiver, const M: usize> BitNode<R, M> {
    pub(super) fn stored(&self) -> Result<StoredBitNode, BoxError> {
        Ok(StoredBitNode(match self {
            Self::Centre(centre) => StoredNode::Centre(
                centre.machine.clone(),
                centre.receiver.state()?,
                centre.estimates.clone(),
                centre.failures,
            ),
            Self::Sensor(sensor) => StoredNode::Sensor(
                sensor.machine.clone(),
                sensor
                    .half
                    .stored()
                    .ok_or("the sensor's half is of a kind that cannot be stored")?,
                [sensor.counted, sensor.passed],
                sensor.replica.as_ref().map(Receiver::state).transpose()?,
                sensor.failures,
            ),
        }))
    }
}

/// Number of slots in which one node failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Failures(u32);

impl Failures {
    /// Writes a note into the log, and counts it if it is a failure.
    ///
    /// # Errors
    /// [`Error::MostSlotsFailed`] once the node has failed in more than half of the `slots` slots of the run.
    pub(super) fn note(&mut self, context: &mut Context<'_>, slots: u32, note: Note) -> Result<(), Error> {
        context.note(note.clone());
        if let Note::Failed { .. } = note {
            self.0 += 1;
            if self.0 > slots / 2 {
                return Err(Error::MostSlotsFailed {
                    node: context.id(),
                    failed: self.0,
                    slots,
                    last: note,
                });
            }
        }
        Ok(())
    }
}
