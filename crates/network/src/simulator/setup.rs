//! All settings of a simulated network except the behaviour of its nodes.

use super::log::Detail;
use crate::error::Error;
use crate::medium::{Channel, Field, Loss, Radio};
use crate::units::{Seconds, SensorId};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::{at_least_one, refuse, within};
use fewbits_protocol::Check;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Frames to one receiver wait until `max_frames` of them are there, at most `hold` after the first. They then share one preamble and
/// link header. A frame that would make the batch longer than a link frame starts the next batch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Batching {
    /// Number of frames of a full batch.
    pub max_frames: usize,
    /// Longest wait of the first frame.
    pub hold: Seconds,
}

impl Batching {
    /// Every frame is sent at once and alone.
    pub const NONE: Self = Self {
        max_frames: 1,
        hold: Seconds::ZERO,
    };
}

/// How nodes share the medium.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Access {
    /// An ideal schedule: a transmission begins when the medium is free around its sender and around all nodes that hear it. There are no
    /// collisions.
    #[default]
    Scheduled,
    /// Nodes wait at random, listen, and send if they hear no transmission: see [`CarrierSense`].
    CarrierSense(CarrierSense),
}

/// Carrier sense with random waits: the unslotted CSMA-CA of IEEE 802.15.4.
///
/// ```text
/// e = least
/// repeat tries times:  wait 0 to 2^e - 1 units;  if nobody is heard: send;  e = min(e + 1, most)
/// the frame is lost
/// ```
/// A transmission that began less than `blind` ago is not heard. If two nodes send at once, both frames are lost at every node in range of
/// both, and at a node that sends itself. Acknowledgements are sent without listening. They are heard and destroy other frames, but are
/// not destroyed themselves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarrierSense {
    /// Unit of the random waits.
    pub unit: Seconds,
    /// Exponent `e` of the first wait, which is 0 to `2^e - 1` units.
    pub least: u32,
    /// Largest exponent of a wait, at most 16.
    pub most: u32,
    /// How often a node listens before it drops the frame, at least once.
    pub tries: u32,
    /// Time from listening to sending.
    pub blind: Seconds,
}

impl CarrierSense {
    /// The defaults of IEEE 802.15.4 at 2.4 GHz: units of 320 us, exponents 3 to 5, five tries, 192 us from listening to sending.
    pub const IEEE_802_15_4: Self = Self {
        unit: Seconds::trusted(320e-6),
        least: 3,
        most: 5,
        tries: 5,
        blind: Seconds::trusted(192e-6),
    };
}

/// A fault of a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Time since the start of the run.
    pub at: Seconds,
    /// The node affected.
    pub node: SensorId,
    /// Kind of the fault.
    pub kind: FaultKind,
}

/// Kinds of faults.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// The node dies.
    Death,
    /// The node loses its memory and all frames that are not sent yet, and starts again.
    Restart,
    /// The node's radio neither sends nor receives for this duration.
    Outage(Seconds),
}

/// All settings of a network except the behaviour of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The radio of every node that is not in `radios`.
    pub radio: Radio,
    /// Radios of single nodes. Their bit rate and framing must equal those of `radio`.
    pub radios: BTreeMap<SensorId, Radio>,
    /// Loss, inverted bits and delay of every link.
    pub channel: Channel,
    /// Loss of single links, from the first node to the second. It replaces the channel's, also for acknowledgements.
    pub link_loss: BTreeMap<(SensorId, SensorId), Loss>,
    /// Largest number of repetitions of a frame that is not acknowledged; `None` for no acknowledgements.
    pub retries: Option<u32>,
    /// Time from the end of a frame until its sender stops waiting for the acknowledgement. `None`: one nanosecond more than an
    /// acknowledgement needs over a channel with the fixed delay of `channel` and no jitter.
    pub ack_timeout: Option<Seconds>,
    /// How nodes share the medium.
    pub access: Access,
    /// Whether frames to one receiver are sent together.
    pub batching: Batching,
    /// What the check of a report covers. The check of other frames covers the whole frame.
    pub report_check: Check,
    /// Rate errors of the nodes' clocks: a clock with 1e-5 gains 10 us per second. Other clocks are exact.
    pub drift: BTreeMap<SensorId, f64>,
    /// Faults of the nodes.
    pub faults: Vec<Fault>,
    /// How much is logged.
    pub detail: Detail,
    /// Root of all randomness of the network. Every frame has its own stream.
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
            access: Access::Scheduled,
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
    pub(crate) fn radio_of(&self, node: SensorId) -> &Radio {
        if self.radios.is_empty() {
            return &self.radio;
        }
        self.radios.get(&node).unwrap_or(&self.radio)
    }

    /// Loss from one node to another.
    #[inline]
    pub(crate) fn loss_of(&self, from: SensorId, to: SensorId) -> &Loss {
        if self.link_loss.is_empty() {
            return &self.channel.loss;
        }
        self.link_loss.get(&(from, to)).unwrap_or(&self.channel.loss)
    }

    /// # Errors
    /// If a number is out of range, a node does not exist, a link has nodes out of range of each other, or two radios have different bit
    /// rates or framings.
    pub(super) fn check(&self, field: &Field) -> Result<(), Error> {
        self.radio.checked()?;
        self.channel.checked()?;
        at_least_one("max_frames", self.batching.max_frames)?;
        for (node, radio) in &self.radios {
            field.check(*node)?;
            radio.checked()?;
            // Receivers are charged the duration that the sender computed, so all radios must give the same.
            if !radio.understands(&self.radio) {
                let expected = "bit rate, preamble, header, acknowledgement and mtu of the others";
                return refuse("radios", format!("another radio at {node}"), expected);
            }
        }
        for ((from, to), loss) in &self.link_loss {
            field.check_link(*from, *to)?;
            loss.checked()?;
        }
        if let Access::CarrierSense(sense) = self.access {
            at_least_one("tries", sense.tries as usize)?;
            within("most", f64::from(sense.most), f64::from(sense.least), 16.0)?;
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
