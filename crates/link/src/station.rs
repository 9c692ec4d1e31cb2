//! The centre behind its link: protocol, estimator, keys and store, still without socket and clock.

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

/// Envelopes of one slot that a centre can send to one sensor.
const COUNTERS_PER_SLOT: u64 = 1 << 16;
const STATE_VERSION: u32 = 1;

/// A sensor that a centre takes frames from.
#[derive(Debug, Clone)]
pub struct Peer<A = SocketAddr> {
    /// Its number on the wire.
    pub number: u32,
    /// The key that it shares with the centre.
    pub key: Key,
    /// Where it is, if that is known before it has sent anything.
    pub address: Option<A>,
}

/// One slot as it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Step {
    /// The slot.
    pub slot: u64,
    /// What was observed of each sensor.
    pub observed: Vec<Observation<BitString>>,
    /// Whether each sensor was asked, and answered what it was asked. One whose address is not known yet cannot be asked; that nothing comes
    /// of it says nothing.
    pub asked: Vec<bool>,
    /// Mean and standard deviation of each coordinate.
    pub estimate: Vec<(f64, f64)>,
    /// Why the update did not use all observations.
    pub trouble: Option<String>,
    /// How each sensor is judged after it; empty if the estimator does not judge them.
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

    /// What was observed of the sensors that were asked.
    pub fn observed_when_asked(&self) -> Vec<(usize, Observation<BitString>)> {
        let all = self.observed.iter().cloned().enumerate();
        all.filter(|(sensor, _)| self.asked.get(*sensor) != Some(&false))
            .collect()
    }
}

/// What leaves a station.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Output<A = SocketAddr> {
    /// A datagram.
    Datagram {
        /// To where.
        to: A,
        /// An envelope.
        bytes: Vec<u8>,
    },
    /// A slot has ended, and its outcome is stored.
    Step(Step),
    /// A slot passed without prediction.
    Passed {
        /// The slot.
        slot: u64,
        /// Why.
        reason: String,
    },
    /// Something was noticed of the sensor at this place of the list.
    Note {
        /// Place in the list of peers.
        sensor: usize,
        /// What was noticed.
        note: Note,
    },
}

/// How many envelopes were taken, and refused for which reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Taken.
    pub taken: u64,
    /// Too short.
    pub short: u64,
    /// Of unknown sensors.
    pub unknown: u64,
    /// Forged.
    pub forged: u64,
    /// Replayed.
    pub replayed: u64,
}

/// What a station stores.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    version: u32,
    sensors: Vec<u32>,
    /// The last slot that may have begun.
    slot: u64,
    windows: Vec<ReplayWindow>,
    /// Where sensors were last: a centre that goes on need not wait until they speak.
    addresses: Vec<Option<String>>,
    receiver: BitString,
    last: Option<Step>,
}

/// A centre: datagrams and time in, [`Output`]s out.
///
/// ```text
/// slot begins:  store (the slot has begun);  predict;  feedback under each sensor's key
/// datagram:     known sensor, right code, new counter -> the protocol's machine
/// deadline:     update;  store;  Step
/// ```
/// A step is stored before it is published, and a slot before anything of it is sent. A station that is stopped at any moment and made anew
/// with the same store goes on from the last stored step, which it publishes again ([`Station::last_step`]); the slot in which it was stopped
/// passes, and its reports are lost.
#[derive(Debug)]
pub struct Station<R, A = SocketAddr> {
    centre: Centre,
    receiver: R,
    peers: Vec<Peer<A>>,
    places: HashMap<u32, usize>,
    windows: Vec<ReplayWindow>,
    /// Envelopes sent to each sensor in this slot.
    sent: Vec<u64>,
    /// Whether each sensor was asked in this slot.
    asked: Vec<bool>,
    timers: BTreeMap<u64, Vec<CentreTimer>>,
    store: Option<Store>,
    counts: Counts,
    last: Option<Step>,
}

impl<R: Receiver, A: Clone + Display + FromStr> Station<R, A> {
    /// A centre with these sensors, in the order of the receiver's. It goes on from the store if that holds anything.
    ///
    /// # Errors
    /// If the numbers of sensors of settings, receiver and peers differ, a number stands twice, or the store cannot be read or is of another
    /// centre.
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

    /// The protocol's machine.
    pub fn centre(&self) -> &Centre {
        &self.centre
    }

    /// The last step: after a start from a store, the one that may not have been published.
    pub fn last_step(&self) -> Option<&Step> {
        self.last.as_ref()
    }

    /// What was taken and refused.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// When [`on_time`](Self::on_time) must be called next, in nanoseconds.
    pub fn next_timer(&self) -> Option<u64> {
        self.timers.keys().next().copied()
    }

    /// Time has passed. Timers that are due fire.
    ///
    /// # Errors
    /// If the store cannot be written: nothing of the step has left then.
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

    /// A datagram has come from `from`.
    ///
    /// # Errors
    /// As [`on_time`](Self::on_time). A datagram that is refused is no error: see [`counts`](Self::counts).
    pub fn on_datagram(&mut self, from: A, bytes: &[u8], outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        let opened = sensor_of(bytes).ok_or(Refusal::TooShort).and_then(|number| {
            let place = *self.places.get(&number).ok_or(Refusal::Unknown)?;
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
        // Whoever has the key says where it is.
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
        // Before anything is sent it is known that the slot has begun.
        self.save()?;
        let members = &self.centre.settings().members;
        // A sensor that must be told something, and whose address is not known, is not asked.
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
        // Slots never begin twice, so that no counter is used twice.
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
