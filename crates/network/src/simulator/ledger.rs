//! Bits and joules spent, by node and by message.

use crate::medium::Radio;
use crate::units::{Bits, Instant, Joules, Seconds};
use serde::{Deserialize, Serialize};

/// Bits, energy and time spent by one node, without its idle energy.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Account {
    /// Payload bits that it sent, repetitions not counted.
    pub payload: Bits,
    /// All bits that it put on air: preambles, headers, checks, acknowledgements, repetitions.
    pub air: Bits,
    /// Frames that it sent, repetitions included, acknowledgements not.
    pub frames: u32,
    /// Acknowledgements that it sent.
    pub acknowledgements: u32,
    /// Energy of sending.
    pub sending: Joules,
    /// Energy of receiving, useful or not.
    pub receiving: Joules,
    /// Time neither asleep nor dead.
    pub awake: Seconds,
    /// When its radio last stopped for good.
    pub died: Option<Instant>,
}

impl Account {
    /// Energy of the rest: the baseline always, the sleeping radio when it was not awake.
    pub fn idle(&self, radio: &Radio, now: Instant) -> Joules {
        let alive = self.died.map_or(now, |died| died.min(now)).since_start();
        radio.baseline * alive + radio.sleep * (alive - self.awake)
    }

    /// All energy until now.
    pub fn total(&self, radio: &Radio, now: Instant) -> Joules {
        self.sending + self.receiving + self.idle(radio, now)
    }
}

/// Cost of all messages, summed message by message.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    /// Messages: a batch is one, repetitions and acknowledgements are none.
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
    /// Frames that no check accepted: malformed, truncated, damaged.
    pub damaged: u64,
    /// Transmissions that never arrived: lost, or sender or receiver was out or dead. Acknowledgements too.
    pub lost: u64,
    /// Messages whose sender gave up after all repetitions.
    pub given_up: u64,
    /// Steps of estimators and sensors that failed.
    pub failures: u64,
    /// Updates that succeeded only without the sensors of which nothing arrived.
    pub silence_ignored: u64,
    /// Frames that came a second time.
    pub duplicates: u64,
    /// Frames that came too late.
    pub late: u64,
    /// Times that two ends saw that they disagree.
    pub disagreements: u64,
    /// Times that a replica took the state of another.
    pub resynchronisations: u64,
}

/// One account per node, and the same spending counted by messages.
///
/// Law: bits and energy of all accounts are those of all messages, and what is left of the energy is idle.
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
