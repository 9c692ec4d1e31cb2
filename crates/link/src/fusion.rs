//! The fusion centre of `fewbits-filters` as a [`Receiver`] over bits.

use fewbits_core::{BitString, Event, Observation};
use fewbits_filters::centre::{CentreState, FusionCentre, Slot};
use fewbits_filters::contract::StateFilter;
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{BoxError, Receiver, SensorHealth};
use serde::{Serialize, de::DeserializeOwned};

/// First byte of a state: CBOR follows behind two numbers. JSON begins otherwise.
const COMPACT: u8 = 1;

/// A [`FusionCentre`] that advances by one period per slot. Sensors are numbered in increasing order of their numbers there.
///
/// The random stream of a slot is a function of seed and slot, so a stopped centre continues with the same draws.
pub struct FusionReceiver<const D: usize, F: StateFilter<D>> {
    centre: FusionCentre<D, F>,
    numbers: Vec<u32>,
    period: f64,
    stream: Stream,
    /// The slot at whose time the prior applies: the one before the first predicted slot.
    origin: Option<u64>,
    slot: u64,
    /// Events of the last update.
    events: Vec<Event>,
}

impl<const D: usize, F: StateFilter<D>> std::fmt::Debug for FusionReceiver<D, F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FusionReceiver")
            .field("slot", &self.slot)
            .finish_non_exhaustive()
    }
}

impl<const D: usize, F: StateFilter<D>> FusionReceiver<D, F> {
    /// A receiver for all sensors that have joined `centre`, with slots of `period` seconds. The prior applies one period before the first
    /// slot that is predicted.
    pub fn new(centre: FusionCentre<D, F>, period: f64, stream: Stream) -> Self {
        Self {
            numbers: centre.sensors().collect(),
            centre,
            period,
            stream,
            origin: None,
            slot: 0,
            events: Vec::new(),
        }
    }

    /// The centre.
    pub fn centre(&self) -> &FusionCentre<D, F> {
        &self.centre
    }
}

impl<const D: usize, F: StateFilter<D>> Receiver for FusionReceiver<D, F>
where
    F::Belief: Serialize + DeserializeOwned,
{
    fn sensors(&self) -> usize {
        self.numbers.len()
    }

    fn predict(&mut self, slot: u64) -> Result<(), BoxError> {
        let origin = self.origin.unwrap_or_else(|| slot.saturating_sub(1));
        let time = slot.saturating_sub(origin) as f64 * self.period;
        let mut rng = self.stream.named("predict").indexed(slot).rng();
        self.centre.advance(&mut rng, time)?;
        (self.origin, self.slot) = (Some(origin), slot);
        Ok(())
    }

    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError> {
        let number = self.numbers.get(sensor).ok_or("no such sensor")?;
        Ok(self.centre.feedback(*number)?)
    }

    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError> {
        let slots = observed.iter().map(|(sensor, observation)| {
            let number = *self.numbers.get(*sensor).ok_or("no such sensor")?;
            Ok(Slot::new(number, self.centre.feedback(number)?, observation.clone()))
        });
        let slots = slots.collect::<Result<Vec<_>, BoxError>>()?;
        let mut rng = self.stream.named("update").indexed(self.slot).rng();
        self.events.clear();
        self.events = self.centre.receive(&mut rng, &slots)?.events;
        Ok(())
    }

    fn estimate(&self) -> Vec<(f64, f64)> {
        let estimate = self.centre.estimate();
        let deviation = |i: usize| estimate.covariance()[(i, i)].max(0.0).sqrt();
        (0..D).map(|i| (estimate.mean()[i], deviation(i))).collect()
    }

    fn health(&self) -> Vec<SensorHealth> {
        let judged = self.numbers.iter().map(|number| {
            let state = self.centre.sensor(*number).ok()?;
            Some(SensorHealth {
                working: state.working,
                dead: state.declared_dead,
                excluded: state.excluded,
            })
        });
        // All numbers are those of sensors that have joined.
        judged.collect::<Option<_>>().unwrap_or_default()
    }

    fn events(&self) -> Vec<Event> {
        let place = |number| self.numbers.binary_search(&number).ok().map(|place| place as u32);
        self.events.iter().filter_map(|event| event.renumbered(place)).collect()
    }

    fn state(&self) -> Result<BitString, BoxError> {
        let mut bytes = vec![COMPACT];
        bytes.extend(self.origin.unwrap_or(u64::MAX).to_be_bytes());
        bytes.extend(self.slot.to_be_bytes());
        bytes.extend(self.centre.state().to_bytes()?);
        let bits = 8 * bytes.len();
        Ok(BitString::from_bytes(bytes, bits)?)
    }

    fn restore(&mut self, state: &BitString) -> Result<(), BoxError> {
        let (origin, slot, state) = match state.bytes() {
            [COMPACT, rest @ ..] => {
                let short = "the state ends too early";
                let (origin, rest) = rest.split_first_chunk().ok_or(short)?;
                let (slot, rest) = rest.split_first_chunk().ok_or(short)?;
                let origin = Some(u64::from_be_bytes(*origin)).filter(|origin| *origin != u64::MAX);
                (origin, u64::from_be_bytes(*slot), CentreState::<F::Belief>::from_bytes(rest)?)
            }
            _ => return Err("a state of another version".into()),
        };
        self.centre.restore(state)?;
        (self.origin, self.slot) = (origin, slot);
        Ok(())
    }
}
