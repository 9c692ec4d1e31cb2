//! Everything about a simulated network except the behaviour of its nodes.

use super::log::Detail;
use crate::error::Error;
use crate::medium::{Channel, Check, Field, Loss, Radio};
use crate::units::{Seconds, SensorId};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, within};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Frames to one receiver wait until `max_frames` of them are there, at most `hold` after the first, and share one preamble and link header.
/// A frame that would make the batch longer than a link frame starts the next batch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Batching {
    /// Frames of a full batch.
    pub max_frames: usize,
    /// How long the first frame waits.
    pub hold: Seconds,
}

impl Batching {
    /// Every frame is sent at once and alone.
    pub const NONE: Self = Self {
        max_frames: 1,
        hold: Seconds::ZERO,
    };
}

/// A fault of a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Time since the start of the run.
    pub at: Seconds,
    /// The node.
    pub node: SensorId,
    /// What happens to it.
    pub kind: FaultKind,
}

/// What can happen to a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// The node dies.
    Death,
    /// The node loses its memory, and frames that its radio has not sent, and begins anew.
    Restart,
    /// The node's radio neither sends nor receives for this time.
    Outage(Seconds),
}

/// Everything about a network except the behaviour of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The radio of every node that is not in `radios`.
    pub radio: Radio,
    /// Radios of single nodes. Bit rate and framing must be those of `radio`.
    pub radios: BTreeMap<SensorId, Radio>,
    /// What the air does.
    pub channel: Channel,
    /// Loss of single links, from the first node to the second, in place of the channel's. Loss of acknowledgements too.
    pub link_loss: BTreeMap<(SensorId, SensorId), Loss>,
    /// Repetitions of a frame to one receiver until it is acknowledged; `None` for no acknowledgements.
    pub retries: Option<u32>,
    /// From the end of a frame until its sender gives up waiting for the acknowledgement. `None`: one nanosecond more than an acknowledgement needs
    /// over a channel with the fixed delay of `channel` and no jitter.
    pub ack_timeout: Option<Seconds>,
    /// Whether frames to one receiver are sent together.
    pub batching: Batching,
    /// What the check of a report covers. Other frames are checked whole.
    pub report_check: Check,
    /// Rates of the nodes' clocks, less one: a clock with 1e-5 gains 10 us in a second. Others are exact.
    pub drift: BTreeMap<SensorId, f64>,
    /// Faults of the nodes.
    pub faults: Vec<Fault>,
    /// How much is logged.
    pub detail: Detail,
    /// All randomness of the network: every frame has a stream of its own.
    pub stream: Stream,
}

impl Setup {
    /// A network without faults.
    pub fn new(radio: Radio, stream: Stream) -> Self {
        Self {
            radio,
            radios: BTreeMap::new(),
            channel: Channel::PERFECT,
            link_loss: BTreeMap::new(),
            retries: None,
            ack_timeout: None,
            batching: Batching::NONE,
            report_check: Check::Whole,
            drift: BTreeMap::new(),
            faults: Vec::new(),
            detail: Detail::Notes,
            stream,
        }
    }

    /// The radio of a node.
    #[inline]
    pub fn radio_of(&self, node: SensorId) -> &Radio {
        if self.radios.is_empty() {
            return &self.radio;
        }
        self.radios.get(&node).unwrap_or(&self.radio)
    }

    /// Loss from one node to another.
    #[inline]
    pub fn loss_of(&self, from: SensorId, to: SensorId) -> &Loss {
        if self.link_loss.is_empty() {
            return &self.channel.loss;
        }
        self.link_loss.get(&(from, to)).unwrap_or(&self.channel.loss)
    }

    /// # Errors
    /// If a number is out of range, a node does not exist, a link has nodes that are not in range of each other, or two radios do not understand
    /// each other.
    pub(super) fn check(&self, field: &Field) -> Result<(), Error> {
        self.radio.checked()?;
        self.channel.checked()?;
        at_least_one("max_frames", self.batching.max_frames)?;
        for (node, radio) in &self.radios {
            field.check(*node)?;
            radio.checked()?;
            if !radio.understands(&self.radio) {
                let expected = "bit rate, preamble, header, acknowledgement and mtu of the others";
                return Err(ArgumentError::new("radios", format!("another radio at {node}"), expected).into());
            }
        }
        for ((from, to), loss) in &self.link_loss {
            field.check_link(*from, *to)?;
            loss.checked()?;
        }
        for (node, rate) in &self.drift {
            field.check(*node)?;
            within("drift", *rate, -0.5, 0.5)?;
        }
        for fault in &self.faults {
            field.check(fault.node)?;
        }
        Ok(())
    }
}
