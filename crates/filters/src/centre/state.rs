//! The state of a centre as a value that can be stored; a restored centre gives the same bits.

use super::alternative::StoredAlternative;
use super::health::Monitor;
use super::presence::{Outage, Presence};
use super::rate::Rate;
use super::repeats::Repeats;
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::StateFilter;
use ciborium::Value;
use fewbits_core::{BitString, Observation};
use fewbits_numerics::error::{finite, positive, refuse};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The version of the stored form.
const VERSION: u32 = 5;

/// State of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MemberState {
    pub presence: Presence,
    pub monitor: Monitor,
    #[serde(default, with = "fewbits_numerics::stored")]
    pub last_residual: Option<f64>,
    /// The same, given only the reports of sensors with smaller numbers at its instant.
    #[serde(default, with = "fewbits_numerics::stored")]
    pub last_in_order: Option<f64>,
    pub excluded: bool,
    /// Whether it contradicts another sensor, and nothing decides which of the two is wrong.
    pub disputed: bool,
    /// Number of observations since the last alarm.
    pub quiet: u32,
    /// How far below the likeliest its reports were of late, in nats; older reports count less and less.
    #[serde(with = "fewbits_numerics::stored")]
    pub depth: f64,
    /// Number of reports that were rejected, in all and since the last that was not.
    pub rejected: u64,
    pub astray: u32,
    /// Number of reports that are none of the scheme.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub unreadable: u64,
    /// Number of copies of reports that were dropped.
    pub copies: u64,
    /// Instant and digest of its last report.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latest: Option<(f64, u64)>,
    pub repeats: Repeats,
    #[serde(default, skip_serializing_if = "Rate::is_empty")]
    pub rate: Rate,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl MemberState {
    pub(crate) fn new() -> Self {
        Self {
            presence: Presence::new(),
            monitor: Monitor::default(),
            last_residual: None,
            last_in_order: None,
            excluded: false,
            disputed: false,
            quiet: 0,
            depth: 0.0,
            rejected: 0,
            astray: 0,
            unreadable: 0,
            copies: 0,
            latest: None,
            repeats: Repeats::new(),
            rate: Rate::default(),
        }
    }

    /// Whether its next reports are not used: it contradicts the others, or is stuck.
    pub(crate) fn is_ignored(&self) -> bool {
        self.excluded || self.repeats.is_stuck
    }

    /// Forgets what was found against a prediction or a set of sensors that is no longer in use.
    pub(crate) fn forget_tests(&mut self) {
        self.monitor = Monitor::default();
        (self.last_residual, self.last_in_order) = (None, None);
        (self.disputed, self.depth, self.astray) = (false, 0.0, 0);
    }
}

/// The belief before an instant, and the slots of that instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Checkpoint<B> {
    pub time: f64,
    pub belief: B,
    pub slots: Vec<StoredSlot>,
}

/// A slot, with the probability that its sensor worked and whether it was used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredSlot {
    pub sensor: u32,
    feedback: BitString,
    observation: Observation<BitString>,
    pub working: f64,
    pub used: bool,
    /// `ln p` of a wrong report, if this one contradicts others of its instant and one of them is taken to be wrong.
    #[serde(default, with = "fewbits_numerics::stored")]
    pub log_wrong: Option<f64>,
}

impl StoredSlot {
    pub(crate) fn new(slot: &Slot, working: f64, used: bool, log_wrong: Option<f64>) -> Self {
        Self {
            sensor: slot.sensor,
            feedback: slot.feedback.clone(),
            observation: slot.observation.clone(),
            working,
            used,
            log_wrong,
        }
    }

    /// A report is not used from now on.
    pub(crate) fn drop_report(&mut self) {
        if self.observation != Observation::Nothing {
            (self.used, self.log_wrong) = (false, None);
        }
    }

    /// Whether this is a report that says the same as `slot`.
    pub(crate) fn is_copied_by(&self, slot: &Slot) -> bool {
        self.sensor == slot.sensor && self.feedback == slot.feedback && self.observation == slot.observation
    }

    pub(crate) fn slot(&self) -> Slot {
        Slot::new(self.sensor, self.feedback.clone(), self.observation.clone())
    }
}

/// The state of a centre: everything except its models, its filter and its settings, which the program must provide again.
///
/// It can be stored as bytes ([`to_bytes`](Self::to_bytes)) or in any format of serde. A restored centre continues with the same bits,
/// given the same random stream. JSON must be read by a parser that rounds correctly ([`mod@fewbits_numerics::stored`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CentreState<B> {
    version: u32,
    now: f64,
    noise_scale: f64,
    belief: B,
    members: BTreeMap<u32, MemberState>,
    outage: Outage,
    monitor: Monitor,
    history: Vec<Checkpoint<B>>,
    dropped: u64,
    astray: u32,
    #[serde(default)]
    alternative: Option<StoredAlternative>,
}

impl<B> CentreState<B> {
    /// The same state with the beliefs in another form.
    fn map<C, E>(&self, form: impl Fn(&B) -> Result<C, E>) -> Result<CentreState<C>, E> {
        let checkpoint = |one: &Checkpoint<B>| {
            Ok(Checkpoint {
                time: one.time,
                belief: form(&one.belief)?,
                slots: one.slots.clone(),
            })
        };
        Ok(CentreState {
            version: self.version,
            now: self.now,
            noise_scale: self.noise_scale,
            belief: form(&self.belief)?,
            members: self.members.clone(),
            outage: self.outage,
            monitor: self.monitor,
            history: self.history.iter().map(checkpoint).collect::<Result<_, E>>()?,
            dropped: self.dropped,
            astray: self.astray,
            alternative: self.alternative.clone(),
        })
    }
}

impl<B: Serialize> CentreState<B> {
    /// The compact binary form: a byte with the version, then CBOR (RFC 8949), in which a double takes at most 9 bytes.
    ///
    /// # Errors
    /// If the belief cannot be serialised.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        match self
            .map(|belief| Value::serialized(belief))
            .map(|state| state.plain_bytes())
        {
            Ok(bytes) => bytes,
            Err(error) => refuse("belief", error, "a belief that serialises"),
        }
    }
}

impl<B: DeserializeOwned> CentreState<B> {
    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// If the bytes are of another version, or do not encode a state with this type of belief.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let plain = CentreState::of_plain_bytes(bytes)?;
        match plain.map(|belief| belief.deserialized()) {
            Ok(state) => Ok(state),
            Err(ciborium::value::Error::Custom(reason)) => refuse("bytes", reason, expected()),
        }
    }
}

/// What is wrong with bytes that are no state.
fn reason(error: &ciborium::de::Error<std::io::Error>, bytes: usize) -> String {
    use ciborium::de::Error::{Io, RecursionLimitExceeded, Semantic, Syntax};
    match error {
        Io(_) => format!("{bytes} bytes that end within a value"),
        Syntax(at) => format!("{bytes} bytes with an unknown one at {at}"),
        Semantic(_, text) => text.clone(),
        RecursionLimitExceeded => format!("{bytes} bytes nested too deeply"),
    }
}

fn expected() -> String {
    format!("the bytes of a centre's state of version {VERSION}")
}

/// A state whose beliefs are plain: all that depends on their type is how they become so.
impl CentreState<Value> {
    fn plain_bytes(&self) -> Result<Vec<u8>, Error> {
        let mut bytes = vec![VERSION as u8];
        match ciborium::into_writer(self, &mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) => refuse("belief", error, "a belief that serialises"),
        }
    }

    fn of_plain_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut rest = match bytes.split_first() {
            Some((version, rest)) if u32::from(*version) == VERSION => rest,
            Some((version, _)) => return refuse("version", version, expected()),
            None => return refuse("bytes", "empty", expected()),
        };
        match ciborium::from_reader(&mut rest) {
            Ok(state) if rest.is_empty() => Ok(state),
            Ok(_) => refuse("bytes", format!("{} bytes too many", rest.len()), expected()),
            Err(error) => refuse("bytes", reason(&error, bytes.len()), expected()),
        }
    }
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// The present state.
    pub fn state(&self) -> CentreState<F::Belief> {
        CentreState {
            version: VERSION,
            now: self.now,
            noise_scale: self.noise_scale,
            belief: self.belief.clone(),
            members: self
                .members
                .iter()
                .map(|member| (member.number, member.state))
                .collect(),
            outage: self.outage,
            monitor: self.monitor,
            history: self.history.clone(),
            dropped: self.dropped,
            astray: self.astray,
            alternative: self.alternative.as_ref().map(StoredAlternative::from),
        }
    }

    /// Continues from a stored state. The same sensors must have joined.
    ///
    /// # Errors
    /// If the state is of another version, a number in it is not finite, or its sensors differ. The centre is then unchanged.
    pub fn restore(&mut self, state: CentreState<F::Belief>) -> Result<(), Error> {
        if state.version != VERSION {
            return refuse("version", state.version, format!("{VERSION}"));
        }
        finite("now", state.now)?;
        positive("noise_scale", state.noise_scale)?;
        // Everything is checked before anything is replaced.
        if !state.members.keys().copied().eq(self.sensors()) {
            let expected = format!("the sensors {:?}", self.sensors().collect::<Vec<_>>());
            return refuse("state", format!("of the sensors {:?}", state.members.keys().collect::<Vec<_>>()), expected);
        }
        let alternative = state.alternative.as_ref().map(StoredAlternative::read).transpose()?;
        for (member, stored) in self.members.iter_mut().zip(state.members.into_values()) {
            member.state = stored;
        }
        self.now = state.now;
        self.noise_scale = state.noise_scale;
        self.belief = state.belief;
        self.outage = state.outage;
        self.monitor = state.monitor;
        self.history = state.history;
        self.dropped = state.dropped;
        self.astray = state.astray;
        self.alternative = alternative;
        Ok(())
    }
}
