//! The centre with protocol, estimator, keys and store, without socket and clock.

use crate::envelope::{Direction, Key, Refusal, ReplayWindow, sensor_of};
use crate::error::Error;
use crate::store::Store;
use fewbits_core::{BitString, Observation};
use fewbits_numerics::error::refuse;
use fewbits_protocol::{
    Action, Centre, CentreSettings, CentreTimer, Feedback, Note, Outcome, Receiver, Recipient, SensorHealth,
    predict_and_ask, update_asked,
};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::net::SocketAddr;
use std::str::FromStr;

/// Largest number of envelopes to one sensor in one slot.
const COUNTERS_PER_SLOT: u64 = 1 << 16;
const STATE_VERSION: u32 = 1;

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
        }
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
    /// A slot passed without update, because the prediction failed.
    Passed {
        /// The slot.
        slot: u64,
        /// Error of the prediction.
        reason: String,
    },
    /// A note about a sensor.
    Note {
        /// Index of the sensor in the list of peers.
        sensor: usize,
        /// The note.
        note: Note,
    },
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

/// The stored state of a station.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    version: u32,
    sensors: Vec<u32>,
    /// The last slot that may have begun.
    slot: u64,
    windows: Vec<ReplayWindow>,
    /// Last addresses of the sensors: a restarted centre need not wait until they send.
    addresses: Vec<Option<String>>,
    receiver: BitString,
    last: Option<Step>,
}

/// A centre. Its inputs are datagrams and time, its outputs [`Output`]s.
///
/// ```text
/// slot begins:  store (the slot has begun);  predict;  feedback under each sensor's key
/// datagram:     known sensor, right code, new counter -> the protocol's machine
/// deadline:     update;  store;  Step
/// ```
/// A step is stored before it is published, and a slot before anything of it is sent. A station may be stopped at any moment. A new one
/// with the same store continues from the last stored step and publishes it again ([`Station::last_step`]). The slot in which it was
/// stopped passes without update, and its reports are lost.
#[derive(Debug)]
pub struct Station<R, A = SocketAddr> {
    centre: Centre,
    receiver: R,
    peers: Vec<Peer<A>>,
    places: HashMap<u32, usize>,
    windows: Vec<ReplayWindow>,
    /// Number of envelopes sent to each sensor in this slot.
    sent: Vec<u64>,
    /// Whether each sensor was asked in this slot.
    asked: Vec<bool>,
    timers: BTreeMap<u64, Vec<CentreTimer>>,
    store: Option<Store>,
    counts: Counts,
    last: Option<Step>,
}

impl<R: Receiver, A: Clone + Display + FromStr> Station<R, A> {
    /// A centre with these sensors, in the order of the receiver's. It continues from the store if that holds a state.
    ///
    /// # Errors
    /// If settings, receiver and peers have different numbers of sensors, a sensor number occurs twice, or the store cannot be read or is
    /// of another centre.
    pub fn new(
        settings: CentreSettings,
        mut receiver: R,
        mut peers: Vec<Peer<A>>,
        store: Option<Store>,
    ) -> Result<Self, Error> {
        let sensors = receiver.sensors();
        for (name, found) in [("members", settings.members.len()), ("peers", peers.len())] {
            if found != sensors {
                return refuse(name, found, format!("{sensors}, as many as the receiver has sensors"));
            }
        }
        let mut places = HashMap::new();
        for (place, peer) in peers.iter().enumerate() {
            if places.insert(peer.number, place).is_some() {
                return refuse("sensor number", peer.number, "each number once");
            }
        }
        let mut centre = Centre::new(settings);
        let mut windows = vec![ReplayWindow::default(); sensors];
        let mut last = None;
        if let Some(store) = &store
            && let Some(stored) = store.load::<Stored>()?
        {
            let refused = |reason: String| Error::State {
                path: store.path().to_owned(),
                reason,
            };
            if stored.version != STATE_VERSION {
                return Err(refused(format!("version {}, expected {STATE_VERSION}", stored.version)));
            }
            if !stored.sensors.iter().eq(peers.iter().map(|peer| &peer.number)) || stored.windows.len() != sensors {
                return Err(refused(format!("it knows the sensors {:?}", stored.sensors)));
            }
            receiver
                .restore(&stored.receiver)
                .map_err(|error| refused(error.to_string()))?;
            centre.resume(stored.slot);
            windows = stored.windows;
            for (peer, stored) in peers.iter_mut().zip(stored.addresses) {
                let stored = stored.and_then(|address| address.parse().ok());
                peer.address = stored.or(peer.address.take());
            }
            last = stored.last;
        }
        Ok(Self {
            centre,
            receiver,
            places,
            windows,
            sent: vec![0; sensors],
            asked: vec![false; sensors],
            timers: BTreeMap::from([(0, vec![CentreTimer::SlotBegins])]),
            store,
            counts: Counts::default(),
            last,
            peers,
        })
    }

    /// The estimator.
    pub fn receiver(&self) -> &R {
        &self.receiver
    }

    /// The state machine of the protocol.
    pub fn centre(&self) -> &Centre {
        &self.centre
    }

    /// The last step. After a start from a store it may not have been published.
    pub fn last_step(&self) -> Option<&Step> {
        self.last.as_ref()
    }

    /// Numbers of accepted and refused envelopes.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Time at which [`on_time`](Self::on_time) must be called next, in nanoseconds; `None` if no timer runs.
    pub fn next_timer(&self) -> Option<u64> {
        self.timers.keys().next().copied()
    }

    /// The time is `now`, in nanoseconds. Timers that are due fire.
    ///
    /// # Errors
    /// If the store cannot be written. Then nothing of the step is among the outputs.
    pub fn on_time(&mut self, now: u64, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        while let Some(entry) = self.timers.first_entry().filter(|entry| *entry.key() <= now) {
            for timer in entry.remove() {
                let mut actions = Vec::new();
                self.centre.on_timer(now, timer, &mut actions);
                self.carry_out(actions, outputs)?;
            }
        }
        Ok(())
    }

    /// A datagram has arrived from the address `from`.
    ///
    /// # Errors
    /// As [`on_time`](Self::on_time). A datagram that is refused is no error: see [`counts`](Self::counts).
    pub fn on_datagram(&mut self, from: A, bytes: &[u8], outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        let opened = sensor_of(bytes).ok_or(Refusal::TooShort).and_then(|number| {
            let place = *self.places.get(&number).ok_or(Refusal::Unknown)?;
            // First the code, then the counter: a forged envelope must not use up a counter.
            let (counter, frame) = self.peers[place].key.open(Direction::ToCentre, bytes)?;
            self.windows[place].take(counter)?;
            Ok((place, frame))
        });
        let (place, frame) = match opened {
            Ok(opened) => opened,
            Err(refusal) => {
                *match refusal {
                    Refusal::TooShort => &mut self.counts.short,
                    Refusal::Unknown => &mut self.counts.unknown,
                    Refusal::Forged => &mut self.counts.forged,
                    Refusal::Replayed => &mut self.counts.replayed,
                } += 1;
                return Ok(());
            }
        };
        self.counts.taken += 1;
        // An authentic datagram updates the sensor's address.
        self.peers[place].address = Some(from);
        let mut actions = Vec::new();
        self.centre.on_frame(place, frame, &mut actions);
        self.carry_out(actions, outputs)
    }

    fn carry_out(&mut self, actions: Vec<Action>, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        for action in actions {
            match action {
                Action::SetTimer { at, timer } => self.timers.entry(at).or_default().push(timer),
                Action::Note { sensor, note } => outputs.push(Output::Note { sensor, note }),
                Action::Send { to, frame } => match to {
                    Recipient::All => (0..self.peers.len()).for_each(|place| self.send(place, &frame, outputs)),
                    Recipient::Sensor(place) => self.send(place, &frame, outputs),
                },
                Action::Predict { slot } => self.predict(slot, outputs)?,
                Action::Update { slot, observed } => {
                    let asked = self.asked.iter().zip(&observed);
                    let asked = asked.map(|(asked, observed)| *asked && observed.is_some()).collect();
                    let observed = observed.into_iter().map(|o| o.unwrap_or(Observation::Nothing));
                    let mut step = Step::new(slot, observed.collect(), Vec::new());
                    step.asked = asked;
                    step.trouble = match update_asked(&mut self.receiver, step.observed_when_asked()) {
                        Outcome::Used => None,
                        Outcome::SilentDropped(error) => Some(format!("silent sensors were left out: {error}")),
                        Outcome::Failed(error) => Some(format!("nothing was used: {error}")),
                    };
                    step.estimate = self.receiver.estimate();
                    step.health = self.receiver.health();
                    self.last = Some(step.clone());
                    self.save()?;
                    outputs.push(Output::Step(step));
                }
            }
        }
        Ok(())
    }

    fn predict(&mut self, slot: u64, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        self.sent.fill(0);
        // Store that the slot has begun before anything is sent.
        self.save()?;
        let members = &self.centre.settings().members;
        // A sensor that needs feedback and whose address is unknown is not asked.
        let reached = members.iter().zip(&self.peers);
        self.asked = reached
            .map(|(member, peer)| member.feedback == Feedback::Clock || peer.address.is_some())
            .collect();
        match predict_and_ask(&mut self.receiver, members, slot) {
            Ok((feedback, state)) => {
                let mut actions = Vec::new();
                self.centre.on_predicted(&feedback, state.as_ref(), &mut actions);
                self.carry_out(actions, outputs)
            }
            Err(error) => {
                let reason = error.to_string();
                outputs.push(Output::Passed { slot, reason });
                Ok(())
            }
        }
    }

    fn send(&mut self, place: usize, frame: &[u8], outputs: &mut Vec<Output<A>>) {
        let peer = &self.peers[place];
        let Some(to) = peer.address.clone() else { return };
        self.sent[place] += 1;
        // A slot never begins twice, so no counter is used twice.
        let counter = self.centre.slot() * COUNTERS_PER_SLOT + self.sent[place].min(COUNTERS_PER_SLOT - 1);
        let bytes = peer.key.seal(Direction::ToSensor, peer.number, counter, frame);
        outputs.push(Output::Datagram { to, bytes });
    }

    fn save(&self) -> Result<(), Error> {
        let Some(store) = &self.store else { return Ok(()) };
        store.save(&Stored {
            version: STATE_VERSION,
            sensors: self.peers.iter().map(|peer| peer.number).collect(),
            slot: self.centre.slot(),
            windows: self.windows.clone(),
            addresses: self
                .peers
                .iter()
                .map(|peer| peer.address.as_ref().map(A::to_string))
                .collect(),
            receiver: self.receiver.state().map_err(Error::Estimator)?,
            last: self.last.clone(),
        })
    }
}
