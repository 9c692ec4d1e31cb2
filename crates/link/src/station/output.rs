//! What a station is given and what it returns.

use crate::envelope::{Key, Refusal};
use fewbits_core::{BitString, Event, Observation};
use fewbits_protocol::{Note, SensorHealth};
use serde::{Deserialize, Serialize};
use std::net::SocketAddr;

/// A sensor as its centre knows it.
#[derive(Debug, Clone)]
pub struct Peer<A = SocketAddr> {
    /// Number of the sensor in envelopes.
    pub number: u32,
    /// The key that it shares with the centre.
    pub key: Key,
    /// Address of the sensor, if it is known before it has sent anything.
    pub address: Option<A>,
}

/// The result of one slot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Step {
    /// The slot.
    pub slot: u64,
    /// The observation of each sensor.
    pub observed: Vec<Observation<BitString>>,
    /// Whether each sensor was asked, and answered what it was asked. A sensor whose address is not known yet cannot be asked; its silence
    /// is not used.
    pub asked: Vec<bool>,
    /// Mean and standard deviation of each coordinate of the state.
    pub estimate: Vec<(f64, f64)>,
    /// Why the update did not use all observations; `None` if it did.
    pub trouble: Option<String>,
    /// The estimator's judgement of each sensor after the slot; empty if it does not judge them.
    #[serde(default)]
    pub health: Vec<SensorHealth>,
    /// What the update found out about sensors, counted from 0, and model.
    #[serde(default)]
    pub events: Vec<Event>,
}

impl Step {
    /// A step in which all sensors were asked, and whose update used all observations.
    pub fn new(slot: u64, observed: Vec<Observation<BitString>>, estimate: Vec<(f64, f64)>) -> Self {
        Self {
            slot,
            asked: vec![true; observed.len()],
            observed,
            estimate,
            trouble: None,
            health: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Number of reports that came.
    pub fn reports(&self) -> usize {
        let received = |o: &&Observation<_>| matches!(o, Observation::Received(_));
        self.observed.iter().filter(received).count()
    }

    /// The observations of the sensors that were asked, each with its index.
    pub fn observed_when_asked(&self) -> Vec<(usize, Observation<BitString>)> {
        let all = self.observed.iter().cloned().enumerate();
        all.filter(|(sensor, _)| self.asked.get(*sensor) != Some(&false))
            .collect()
    }
}

/// Outputs of a station.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Output<A = SocketAddr> {
    /// A datagram.
    Datagram {
        /// Address of the receiver.
        to: A,
        /// An envelope.
        bytes: Vec<u8>,
    },
    /// A slot has ended, and its result is stored.
    Step(Step),
    /// A slot passed without update, because the prediction failed or the state could not be stored.
    Passed {
        /// The slot.
        slot: u64,
        /// Error of the prediction or of the store.
        reason: String,
    },
    /// The clock is behind the last slot, so that no slot begins: it was ahead, or was set back. Said once a minute.
    ClockBehind {
        /// Nanoseconds until the next slot begins.
        wait: u64,
    },
    /// A note about a sensor.
    Note {
        /// Index of the sensor in the list of peers.
        sensor: usize,
        /// The note.
        note: Note,
    },
}

/// How a station begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Start {
    /// With the slot and the estimator's state of the store.
    #[default]
    Continue,
    /// With the estimator's own state, in the slot of the clock, with any sensors. What protects against replays, and addresses, are those
    /// of the store. For a store whose clock was ahead, or whose sensors have changed.
    Anew,
}

/// Numbers of accepted envelopes, and of refused ones by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Accepted.
    pub taken: u64,
    /// Refused because they are too short.
    pub short: u64,
    /// Refused because the sensor is unknown.
    pub unknown: u64,
    /// Refused because the authentication code does not match.
    pub forged: u64,
    /// Refused because the counter was accepted before or is too old.
    pub replayed: u64,
}

impl Counts {
    /// Number of refused envelopes.
    pub fn refused(&self) -> u64 {
        self.short + self.unknown + self.forged + self.replayed
    }

    pub(crate) fn add(&mut self, refusal: Refusal) {
        *match refusal {
            Refusal::TooShort => &mut self.short,
            Refusal::Unknown => &mut self.unknown,
            Refusal::Forged => &mut self.forged,
            Refusal::Replayed => &mut self.replayed,
        } += 1;
    }
}
