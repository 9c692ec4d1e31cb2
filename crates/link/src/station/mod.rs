//! The centre with protocol, estimator, keys and store, without socket and clock.

mod address;
mod output;
mod stored;
mod told;

pub use output::{Counts, Output, Peer, Start, Step};

use crate::envelope::{Direction, Refusal, sensor_of};
use crate::error::Error;
use crate::store::Store;
use fewbits_core::{BitString, Observation};
use fewbits_numerics::error::refuse;
use fewbits_protocol::{
    Action, Centre, CentreSettings, CentreTimer, Feedback, Frame, Outcome, Receiver, Recipient, predict_and_ask,
    update_asked,
};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::net::SocketAddr;
use std::str::FromStr;
use stored::{Remote, Stored, text_of};

/// Largest number of envelopes to one sensor in one slot.
const COUNTERS_PER_SLOT: u64 = 1 << 16;

/// A centre. Its inputs are datagrams and time, its outputs [`Output`]s.
///
/// ```text
/// slot begins:  store (the slot has begun);  predict;  feedback under each sensor's key
/// datagram:     known sensor, right code, new counter -> the protocol's machine
/// deadline:     update;  store;  Step
/// ```
/// A step is stored before it is published, and a slot before anything of it is sent. A station may be stopped at any moment. A new one
/// with the same store continues from the last stored step and publishes it again ([`Station::last_step`]). The slot in which it was
/// stopped passes without update, and its reports are lost. If the state cannot be stored, slots pass until it can.
///
/// Without a store, a station that is started again accepts envelopes that were accepted before it was stopped. Reports among them belong
/// to slots that are over and are not used.
#[derive(Debug)]
pub struct Station<R, A = SocketAddr> {
    centre: Centre,
    receiver: R,
    remotes: Vec<Remote<A>>,
    places: HashMap<u32, usize>,
    /// Counters of this slot are made from this number. It rises with each slot, also when the clock was set back.
    counted: u64,
    timers: BTreeMap<u64, Vec<CentreTimer>>,
    store: Option<Store>,
    counts: Counts,
    last: Option<Step>,
    /// Whether the last step is stored but not published, or not even stored.
    is_held: bool,
    /// When it was last said that the clock is behind.
    said_behind: Option<u64>,
    /// Whether a slot has begun since this station was made, so that counters are known that were never used.
    has_begun: bool,
    /// The estimator's state as it is stored, until the estimator changes.
    state: Option<String>,
}

impl<R: Receiver, A: Clone + PartialEq + Display + FromStr> Station<R, A> {
    /// A centre with these sensors, in the order of the receiver's. It continues from the store if that holds a state.
    ///
    /// # Errors
    /// If settings, receiver and peers have different numbers of sensors, a sensor number or a key occurs twice, or the store cannot be
    /// read, is in use or is of another centre.
    pub fn new(
        settings: CentreSettings,
        receiver: R,
        peers: Vec<Peer<A>>,
        store: Option<Store>,
    ) -> Result<Self, Error> {
        Self::starting(Start::Continue, settings, receiver, peers, store)
    }

    /// As [`new`](Self::new), where `start` says what is taken from the store.
    ///
    /// # Errors
    /// As [`new`](Self::new). With [`Start::Anew`] the store may be of other sensors.
    pub fn starting(
        start: Start,
        settings: CentreSettings,
        mut receiver: R,
        peers: Vec<Peer<A>>,
        store: Option<Store>,
    ) -> Result<Self, Error> {
        let sensors = receiver.sensors();
        for (name, found) in [("members", settings.members.len()), ("peers", peers.len())] {
            if found != sensors {
                return refuse(name, found, format!("{sensors}, as many as the receiver has sensors"));
            }
        }
        let mut remotes: Vec<Remote<A>> = peers.into_iter().map(Remote::new).collect();
        let (mut places, mut keys) = (HashMap::new(), HashMap::new());
        for (place, remote) in remotes.iter().enumerate() {
            if places.insert(remote.number, place).is_some() {
                return refuse("sensor number", remote.number, "each number once");
            }
            if let Some(other) = keys.insert(remote.key.fingerprint(), remote.number) {
                let found = format!("that of sensor {other}");
                return refuse("key", found, format!("a key of its own for sensor {}", remote.number));
            }
        }
        let store = store.map(Store::locked).transpose()?;
        let (mut centre, mut last, mut counted) = (Centre::new(settings), None, 0);
        if let Some(store) = &store
            && let Some(stored) = store.load::<Stored>()?
        {
            let refused = |reason: String| Error::State {
                path: store.path().to_owned(),
                reason,
            };
            stored.take_remotes(start, &mut remotes, &places).map_err(refused)?;
            counted = stored.counted.max(stored.slot);
            if start == Start::Continue {
                let state = stored.receiver().ok_or_else(|| refused("its estimator".to_owned()))?;
                receiver.restore(&state).map_err(|error| refused(error.to_string()))?;
                centre.resume(stored.slot);
                last = stored.last;
            }
        }
        Ok(Self {
            centre,
            receiver,
            remotes,
            places,
            counted,
            timers: BTreeMap::from([(0, vec![CentreTimer::SlotBegins])]),
            store,
            counts: Counts::default(),
            last,
            is_held: false,
            said_behind: None,
            has_begun: false,
            state: None,
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

    /// Numbers of accepted and refused envelopes with the number of this sensor, whoever sent them. All zero if there is no such sensor.
    pub fn counts_of(&self, sensor: usize) -> Counts {
        self.remotes
            .get(sensor)
            .map_or_else(Counts::default, |remote| remote.counts)
    }

    /// Whether an address of the sensor is known: it said that it is there, or the configuration says where it is.
    pub fn is_reached(&self, sensor: usize) -> bool {
        self.remotes
            .get(sensor)
            .is_some_and(|remote| remote.addresses.is_known())
    }

    /// Time at which [`on_time`](Self::on_time) must be called next, in nanoseconds; `None` if no timer runs.
    pub fn next_timer(&self) -> Option<u64> {
        self.timers.keys().next().copied()
    }

    /// The time is `now`, in nanoseconds. Timers that are due fire.
    ///
    /// # Errors
    /// If the estimator's state cannot be written.
    pub fn on_time(&mut self, now: u64, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        while let Some(entry) = self.timers.first_entry().filter(|entry| *entry.key() <= now) {
            let due = *entry.key();
            for timer in entry.remove() {
                let mut actions = Vec::new();
                self.centre.on_timer(now, timer, &mut actions);
                self.look_at_start(now, due, timer, outputs);
                self.carry_out(actions, outputs)?;
            }
        }
        self.look_at_clock(now, outputs);
        Ok(())
    }

    /// A datagram has arrived from the address `from`.
    ///
    /// # Errors
    /// As [`on_time`](Self::on_time). A datagram that is refused is no error: see [`counts`](Self::counts).
    pub fn on_datagram(&mut self, from: A, bytes: &[u8], outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        let place = sensor_of(bytes).and_then(|number| self.places.get(&number).copied());
        let opened = match place {
            // First the code, then the counter: a forged envelope must not use up a counter.
            Some(place) => self.remotes[place].key.open(Direction::ToCentre, bytes),
            None if sensor_of(bytes).is_some() => Err(Refusal::Unknown),
            None => Err(Refusal::TooShort),
        };
        let taken = opened.and_then(|(counter, frame)| {
            let Some(remote) = place.and_then(|place| self.remotes.get_mut(place)) else {
                return Err(Refusal::Unknown);
            };
            let taken = remote.window.take(counter);
            if taken.is_err() {
                remote.addresses.on_copy(from.clone(), counter);
            }
            taken.map(|()| (counter, frame))
        });
        let mut counts: Vec<&mut Counts> = vec![&mut self.counts];
        counts.extend(
            place
                .and_then(|place| self.remotes.get_mut(place))
                .map(|remote| &mut remote.counts),
        );
        let (place, (counter, frame)) = match (place, taken) {
            (Some(place), Ok(taken)) => (place, taken),
            (_, outcome) => {
                let refusal = outcome.err().unwrap_or(Refusal::Unknown);
                tracing::debug!(sensor = sensor_of(bytes), ?refusal, "an envelope was refused");
                counts.into_iter().for_each(|counts| counts.add(refusal));
                return Ok(());
            }
        };
        counts.into_iter().for_each(|counts| counts.taken += 1);
        let answers =
            Frame::decode(frame, self.centre.settings().check).is_ok_and(|frame| self.centre.is_answer(place, &frame));
        self.remotes[place].addresses.on_accepted(from, counter, answers);
        let mut actions = Vec::new();
        self.centre.on_frame(place, frame, &mut actions);
        self.carry_out(actions, outputs)?;
        self.answer_hello(place, frame, answers, outputs);
        Ok(())
    }

    fn carry_out(&mut self, actions: Vec<Action>, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        for action in actions {
            match action {
                Action::SetTimer { at, timer } => self.timers.entry(at).or_default().push(timer),
                Action::Note { sensor, note } => outputs.push(Output::Note { sensor, note }),
                Action::Send { to, frame } => match to {
                    Recipient::All => (0..self.remotes.len()).for_each(|place| self.send(place, &frame, outputs)),
                    Recipient::Sensor(place) => self.send(place, &frame, outputs),
                },
                Action::Predict { slot } => self.predict(slot, outputs)?,
                Action::Update { slot, observed } => self.update(slot, observed, outputs)?,
            }
        }
        Ok(())
    }

    fn update(
        &mut self,
        slot: u64,
        observed: Vec<Option<Observation<BitString>>>,
        outputs: &mut Vec<Output<A>>,
    ) -> Result<(), Error> {
        let asked = self.remotes.iter().zip(&observed);
        let asked = asked
            .map(|(remote, observed)| remote.asked && observed.is_some())
            .collect();
        let observed = observed.into_iter().map(|o| o.unwrap_or(Observation::Nothing));
        let mut step = Step::new(slot, observed.collect(), Vec::new());
        step.asked = asked;
        self.state = None;
        step.trouble = match update_asked(&mut self.receiver, step.observed_when_asked()) {
            Outcome::Used => None,
            Outcome::SilentDropped(error) => Some(format!("silent sensors were left out: {error}")),
            Outcome::Failed(error) => Some(format!("nothing was used: {error}")),
        };
        step.estimate = self.receiver.estimate();
        step.health = self.receiver.health();
        step.events = self.receiver.events();
        for event in &step.events {
            let sensor = event
                .sensor()
                .and_then(|sensor| self.remotes.get(sensor as usize))
                .map(|remote| remote.number);
            tracing::info!(slot, sensor, "{}", event.name());
        }
        if let Some(trouble) = &step.trouble {
            tracing::warn!(slot, "{trouble}");
        }
        tracing::debug!(slot, reports = step.reports(), "a slot was updated");
        self.last = Some(step);
        self.is_held = true;
        // If it cannot be stored now, it is published with the next slot that can be.
        self.store_and_publish(slot, outputs).map(drop)
    }

    /// Stores the state, then publishes the last step if that was not done yet. Returns whether the state is stored. If it is not, the slot
    /// passes.
    fn store_and_publish(&mut self, slot: u64, outputs: &mut Vec<Output<A>>) -> Result<bool, Error> {
        match self.save() {
            Ok(()) => {
                let held = std::mem::take(&mut self.is_held);
                outputs.extend(self.last.clone().filter(|_| held).map(Output::Step));
                Ok(true)
            }
            Err(error) if error.is_of_file() => {
                let source = std::error::Error::source(&error).map(ToString::to_string);
                let reason = format!("cannot store the state: {error}: {}", source.unwrap_or_default());
                tracing::warn!(slot, "{reason}");
                outputs.push(Output::Passed { slot, reason });
                Ok(false)
            }
            Err(error) => Err(error),
        }
    }

    fn predict(&mut self, slot: u64, outputs: &mut Vec<Output<A>>) -> Result<(), Error> {
        self.counted = slot.max(self.counted.saturating_add(1));
        for remote in &mut self.remotes {
            (remote.sent, remote.asked) = (0, false);
            remote.addresses.on_slot_begins();
        }
        // Store that the slot has begun before anything is sent.
        if !self.store_and_publish(slot, outputs)? {
            return Ok(());
        }
        self.has_begun = true;
        let members = &self.centre.settings().members;
        // A sensor that needs feedback and whose address is unknown is not asked.
        for (member, remote) in members.iter().zip(&mut self.remotes) {
            remote.asked = member.feedback == Feedback::Clock || remote.addresses.is_known();
        }
        self.state = None;
        match predict_and_ask(&mut self.receiver, members, slot) {
            Ok((feedback, state)) => {
                let mut actions = Vec::new();
                self.centre.on_predicted(&feedback, state.as_ref(), &mut actions);
                self.carry_out(actions, outputs)
            }
            Err(error) => {
                let reason = error.to_string();
                tracing::warn!(slot, "the slot passes: {reason}");
                outputs.push(Output::Passed { slot, reason });
                Ok(())
            }
        }
    }

    fn send(&mut self, place: usize, frame: &[u8], outputs: &mut Vec<Output<A>>) {
        let remote = &mut self.remotes[place];
        if !remote.addresses.is_known() {
            return;
        }
        remote.sent += 1;
        // Each slot has its own range, so no counter is used twice.
        let counter = self.counted * COUNTERS_PER_SLOT + remote.sent.min(COUNTERS_PER_SLOT - 1);
        let bytes = remote.key.seal(Direction::ToSensor, remote.number, counter, frame);
        outputs.extend(remote.addresses.all().map(|to| Output::Datagram {
            to: to.clone(),
            bytes: bytes.clone(),
        }));
    }

    fn save(&mut self) -> Result<(), Error> {
        if self.store.is_none() {
            return Ok(());
        }
        let state = match self.state.take() {
            Some(state) => state,
            None => text_of(&self.receiver.state().map_err(Error::Estimator)?),
        };
        self.state = Some(state.clone());
        let slots = (self.centre.slot(), self.counted);
        let stored = Stored::new(&self.remotes, slots, state, self.last.clone());
        self.store.as_ref().map_or(Ok(()), |store| store.save(&stored))
    }
}
