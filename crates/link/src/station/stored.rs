//! What a station keeps of each sensor, and its state in the store.

use super::address::Addresses;
use super::output::{Counts, Peer, Start, Step};
use crate::base64;
use crate::envelope::{Key, ReplayWindow};
use fewbits_core::BitString;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt::Display;
use std::str::FromStr;

const STATE_VERSION: u32 = 2;

/// A sensor with all that the station keeps of it.
#[derive(Debug)]
pub(super) struct Remote<A> {
    pub(super) number: u32,
    pub(super) key: Key,
    pub(super) addresses: Addresses<A>,
    pub(super) window: ReplayWindow,
    /// Number of envelopes sent to it in this slot.
    pub(super) sent: u64,
    /// Whether it was asked in this slot.
    pub(super) asked: bool,
    pub(super) counts: Counts,
}

impl<A: PartialEq + Clone> Remote<A> {
    pub(super) fn new(peer: Peer<A>) -> Self {
        Self {
            number: peer.number,
            key: peer.key,
            addresses: Addresses::new(peer.address),
            window: ReplayWindow::default(),
            sent: 0,
            asked: false,
            counts: Counts::default(),
        }
    }
}

/// The stored state of a station.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stored {
    version: u32,
    sensors: Vec<u32>,
    /// Fingerprints of their keys. Version 1 had none.
    #[serde(default)]
    keys: Vec<String>,
    /// The last slot that may have begun.
    pub(super) slot: u64,
    /// The last number from which counters were made. Version 1 used `slot`.
    #[serde(default)]
    pub(super) counted: u64,
    windows: Vec<ReplayWindow>,
    /// Last addresses of the sensors: a restarted centre need not wait until they send.
    addresses: Vec<Option<String>>,
    /// Base64 of the bytes; earlier programs wrote a list of them with their number of bits.
    receiver: AnyState,
    pub(super) last: Option<Step>,
}

/// The estimator's state.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum AnyState {
    Text(String),
    Bits(BitString),
}

/// The text of an estimator's state in the store.
pub(super) fn text_of(state: &BitString) -> String {
    format!("{}:{}", state.bits(), base64::encode(state.bytes()))
}

fn state_of(text: &str) -> Option<BitString> {
    let (bits, bytes) = text.split_once(':')?;
    BitString::from_bytes(base64::decode(bytes)?, bits.parse().ok()?).ok()
}

impl Stored {
    pub(super) fn new<A: Display + PartialEq + Clone>(
        remotes: &[Remote<A>],
        (slot, counted): (u64, u64),
        receiver: String,
        last: Option<Step>,
    ) -> Self {
        let address = |remote: &Remote<A>| remote.addresses.confirmed().map(A::to_string);
        Self {
            version: STATE_VERSION,
            sensors: remotes.iter().map(|remote| remote.number).collect(),
            keys: remotes.iter().map(|remote| remote.key.fingerprint()).collect(),
            slot,
            counted,
            windows: remotes.iter().map(|remote| remote.window).collect(),
            addresses: remotes.iter().map(address).collect(),
            receiver: AnyState::Text(receiver),
            last,
        }
    }

    /// The estimator's state; `None` if it is not readable.
    pub(super) fn receiver(&self) -> Option<BitString> {
        match &self.receiver {
            AnyState::Bits(state) => Some(state.clone()),
            AnyState::Text(text) => state_of(text),
        }
    }

    /// Hands windows and addresses to the sensors. Returns why the state is refused otherwise.
    pub(super) fn take_remotes<A: FromStr + PartialEq + Clone>(
        &self,
        start: Start,
        remotes: &mut [Remote<A>],
        places: &HashMap<u32, usize>,
    ) -> Result<(), String> {
        if !(1..=STATE_VERSION).contains(&self.version) {
            return Err(format!("version {}, expected {STATE_VERSION}", self.version));
        }
        let is_same = self.sensors.iter().eq(remotes.iter().map(|remote| &remote.number));
        if self.windows.len() != self.sensors.len() || start == Start::Continue && !is_same {
            let known = &self.sensors;
            return Err(format!("it knows the sensors {known:?}; a new start keeps what protects against replays"));
        }
        for (i, (number, window)) in self.sensors.iter().zip(&self.windows).enumerate() {
            let Some(remote) = places.get(number).and_then(|place| remotes.get_mut(*place)) else {
                continue;
            };
            // Under a new key no envelope was accepted yet.
            if self.keys.get(i).is_none_or(|key| *key == remote.key.fingerprint()) {
                remote.window = *window;
            }
            let stored = self.addresses.get(i).and_then(|address| address.as_ref()?.parse().ok());
            if stored.is_some() {
                remote.addresses = Addresses::new(stored);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn both_forms_of_an_estimators_state_are_read() {
        let state = BitString::from_bytes(vec![0xa5, 0x80], 9).unwrap();
        let old = serde_json::to_string(&state).unwrap();
        assert!(matches!(serde_json::from_str(&old).unwrap(), AnyState::Bits(read) if read == state));
        let new = serde_json::to_string(&AnyState::Text(text_of(&state))).unwrap();
        assert!(
            matches!(serde_json::from_str(&new).unwrap(), AnyState::Text(text) if state_of(&text).as_ref() == Some(&state))
        );
        assert!(state_of("9:pYA").is_some() && state_of("pYA=").is_none() && state_of("40:pYA=").is_none());
    }
}
