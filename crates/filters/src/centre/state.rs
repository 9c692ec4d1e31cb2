//! What a centre knows, as a value that is stored and goes on to the bit.

use super::health::Monitor;
use super::presence::Presence;
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{BitString, Observation};
use fewbits_numerics::error::{finite, positive, refuse};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The version of the stored form.
const VERSION: u32 = 1;

/// What is known of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MemberState {
    pub presence: Presence,
    pub monitor: Monitor,
    #[serde(default, with = "fewbits_numerics::stored")]
    pub last_residual: Option<f64>,
    pub excluded: bool,
    /// Observations since the last alarm.
    pub quiet: u32,
}

impl MemberState {
    pub fn new() -> Self {
        Self {
            presence: Presence::new(),
            monitor: Monitor::default(),
            last_residual: None,
            excluded: false,
            quiet: 0,
        }
    }
}

/// The belief before an instant, and what was observed in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Checkpoint<B> {
    #[serde(with = "fewbits_numerics::stored")]
    pub time: f64,
    pub belief: B,
    pub slots: Vec<StoredSlot>,
}

/// A slot as bytes, with what was supposed of its sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredSlot {
    pub sensor: u32,
    feedback: (Vec<u8>, usize),
    observation: Observation<(Vec<u8>, usize)>,
    #[serde(with = "fewbits_numerics::stored")]
    pub working: f64,
    pub used: bool,
}

impl StoredSlot {
    pub fn new(slot: &Slot, working: f64, used: bool) -> Self {
        let bytes = |bits: &BitString| (bits.bytes().to_vec(), bits.bits());
        Self {
            sensor: slot.sensor,
            feedback: bytes(&slot.feedback),
            observation: slot.observation.clone().map(|bits| bytes(&bits)),
            working,
            used,
        }
    }

    pub fn bits(&self) -> Result<(BitString, Observation<BitString>), Error> {
        let bits = |(bytes, count): &(Vec<u8>, usize)| BitString::from_bytes(bytes.clone(), *count);
        let observation = match &self.observation {
            Observation::Received(report) => Observation::Received(bits(report)?),
            Observation::Nothing => Observation::Nothing,
            Observation::Lost => Observation::Lost,
        };
        Ok((bits(&self.feedback)?, observation))
    }
}

/// What a centre knows: everything but its models, its filter and its settings, which the program states again.
///
/// A centre that is restored goes on with the same bits, given the same random stream: floats are stored exactly whatever the format does
/// ([`fewbits_numerics::stored`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CentreState<B> {
    version: u32,
    #[serde(with = "fewbits_numerics::stored")]
    now: f64,
    #[serde(with = "fewbits_numerics::stored")]
    noise_scale: f64,
    belief: B,
    members: BTreeMap<u32, MemberState>,
    monitor: Monitor,
    history: Vec<Checkpoint<B>>,
    dropped: u64,
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// What the centre knows.
    pub fn state(&self) -> CentreState<F::Belief> {
        CentreState {
            version: VERSION,
            now: self.now,
            noise_scale: self.noise_scale,
            belief: self.belief.clone(),
            members: self
                .members
                .iter()
                .map(|(number, m)| (*number, m.state.clone()))
                .collect(),
            monitor: self.monitor,
            history: self.history.clone(),
            dropped: self.dropped,
        }
    }

    /// Goes on from a stored state. The same sensors must have joined.
    ///
    /// # Errors
    /// If the state is of another version, a number in it is not finite, or it knows other sensors. The centre is then as it was.
    pub fn restore(&mut self, state: CentreState<F::Belief>) -> Result<(), Error> {
        if state.version != VERSION {
            return refuse("version", state.version, format!("{VERSION}"));
        }
        finite("now", state.now)?;
        positive("noise_scale", state.noise_scale)?;
        if !state.members.keys().eq(self.members.keys()) {
            let expected = format!("the sensors {:?}", self.members.keys().collect::<Vec<_>>());
            return refuse("state", format!("of the sensors {:?}", state.members.keys().collect::<Vec<_>>()), expected);
        }
        for (member, stored) in self.members.values_mut().zip(state.members.into_values()) {
            member.state = stored;
        }
        self.now = state.now;
        self.noise_scale = state.noise_scale;
        self.belief = state.belief;
        self.monitor = state.monitor;
        self.history = state.history;
        self.dropped = state.dropped;
        Ok(())
    }
}
