//! Bits and joules spent, per node and over all messages.

use crate::medium::Radio;
use crate::units::{Bits, Instant, Joules, Seconds};
use serde::{Deserialize, Serialize};

/// Bits, energy and time spent by one node, without its idle energy.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Account {
    /// Payload bits sent, without repetitions.
    pub payload: Bits,
    /// All bits sent on air: preambles, headers, checks, acknowledgements, repetitions.
    pub air: Bits,
    /// Number of frames sent, with repetitions, without acknowledgements.
    pub frames: u32,
    /// Number of acknowledgements sent.
    pub acknowledgements: u32,
    /// Energy of sending.
    pub sending: Joules,
    /// Energy of receiving, also of frames that were for others or damaged.
    pub receiving: Joules,
    /// Time in which the radio was awake.
    pub awake: Seconds,
    /// When the node died; `None` while it lives.
    pub died: Option<Instant>,
}

impl Account {
    /// Idle energy until `now`: the baseline power, and the sleeping radio while it was not awake.
    pub fn idle(&self, radio: &Radio, now: Instant) -> Joules {
        let alive = self.died.map_or(now, |died| died.min(now)).since_start();
        radio.baseline * alive + radio.sleep * (alive - self.awake)
    }

    /// Total energy until `now`: sending, receiving and idle.
    pub(crate) fn total(&self, radio: &Radio, now: Instant) -> Joules {
        self.sending + self.receiving + self.idle(radio, now)
    }
}

/// Cost of all messages, summed over messages.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    /// Number of messages. A batch counts as one; repetitions and acknowledgements do not count.
    pub messages: u64,
    /// Payload bits.
    pub payload: Bits,
    /// Bits on air.
    pub air: Bits,
    /// Energy of senders.
    pub sending: Joules,
    /// Energy of receivers.
    pub receiving: Joules,
}

/// Numbers of faults by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Faults {
    /// Frames that failed their check or could not be decoded: malformed, truncated, damaged.
    pub damaged: u64,
    /// Transmissions and acknowledgements that never arrived: lost on the channel, or sender or receiver out of service or dead.
    pub lost: u64,
    /// Messages that were not acknowledged after all repetitions.
    pub given_up: u64,
    /// Steps of estimators and sensors that failed.
    pub failures: u64,
    /// Updates that succeeded only without the sensors from which nothing arrived.
    pub silence_ignored: u64,
    /// Frames that arrived a second time.
    pub duplicates: u64,
    /// Frames that arrived too late.
    pub late: u64,
    /// How often a node detected that the other end had another state.
    pub disagreements: u64,
    /// How often a replica took over the state of another node.
    pub resynchronisations: u64,
}

/// One account per node, and the same costs summed over messages.
///
/// Invariant: bits and energies summed over accounts equal those summed over messages. The remaining energy is idle energy.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    pub(crate) accounts: Vec<Account>,
    pub(crate) messages: Totals,
    pub(crate) faults: Faults,
}

impl Ledger {
    pub(crate) fn new(nodes: usize) -> Self {
        Self {
            accounts: vec![Account::default(); nodes],
            ..Self::default()
        }
    }

    /// One account for each node.
    pub fn accounts(&self) -> &[Account] {
        &self.accounts
    }

    /// Cost of all messages.
    pub fn messages(&self) -> &Totals {
        &self.messages
    }

    /// Numbers of faults by kind.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Sum of the accounts, in the order of the nodes.
    pub fn sum(&self) -> Totals {
        let mut sum = Totals {
            messages: self.messages.messages,
            ..Totals::default()
        };
        for account in &self.accounts {
            sum.payload += account.payload;
            sum.air += account.air;
            sum.sending += account.sending;
            sum.receiving += account.receiving;
        }
        sum
    }
}
