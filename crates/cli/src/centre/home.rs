//! Estimates for Home Assistant, through its broker.

use super::Configuration;
use crate::error::Error;
use fewbits_link::Step;

/// Broker and name of the fleet in `mqtt://[user:password@]host[:port]/fleet`.
pub(super) fn parts(text: &str) -> Result<(&str, &str), String> {
    let parts = text.strip_prefix("mqtt://").and_then(|rest| rest.split_once('/'));
    match parts.filter(|(broker, fleet)| !(broker.is_empty() || fleet.is_empty())) {
        Some(_) if cfg!(not(feature = "mqtt")) => {
            Err("home_assistant: this program was built without MQTT: build it with `--features mqtt`".to_owned())
        }
        Some(parts) => Ok(parts),
        None => {
            let expected = "mqtt://[user:password@]host[:port]/fleet";
            Err(format!("home_assistant is {}: expected {expected}", crate::place::shown(text)))
        }
    }
}

/// The connection to the broker of Home Assistant.
pub(super) struct Home {
    #[cfg(feature = "mqtt")]
    fleet: fewbits_link::doors::home_assistant::Fleet,
    #[cfg(feature = "mqtt")]
    broker: fewbits_link::mqtt::Messages,
}

#[cfg(feature = "mqtt")]
impl Home {
    /// Connects, and says what is to be found. `None` if the configuration names no broker.
    pub(super) fn open(given: &Configuration, numbers: &[u32], coordinates: usize) -> Result<Option<Self>, Error> {
        let Some(text) = &given.home_assistant else {
            return Ok(None);
        };
        let refused = |reason: String| Error::content("home_assistant", reason);
        let (broker, fleet) = parts(text).map_err(refused)?;
        let named = |i: usize| match given.coordinates.get(i) {
            Some(coordinate) => (coordinate.name.clone(), coordinate.unit.clone()),
            None => (format!("estimate {i}"), String::new()),
        };
        let fleet = fewbits_link::doors::home_assistant::Fleet {
            name: fleet.to_owned(),
            period: given.period,
            sensors: numbers.to_vec(),
            coordinates: (0..coordinates).map(named).collect(),
        };
        let broker = fewbits_link::mqtt::Messages::open(crate::place::mqtt(broker).map_err(refused)?, Vec::new())?;
        fleet.discovery().iter().for_each(|message| broker.publish(message));
        Ok(Some(Self { fleet, broker }))
    }

    pub(super) fn show(&self, step: &Step) {
        self.broker.publish(&self.fleet.state(step));
    }
}

#[cfg(not(feature = "mqtt"))]
impl Home {
    /// A configuration that names a broker was refused.
    pub(super) fn open(given: &Configuration, _: &[u32], _: usize) -> Result<Option<Self>, Error> {
        let _ = (&given.home_assistant, given.coordinates.iter().map(|c| (&c.name, &c.unit)).count());
        Ok(None)
    }

    pub(super) fn show(&self, _: &Step) {}
}
