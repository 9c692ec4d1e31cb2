//! Estimates for Home Assistant, through its broker.

use super::Configuration;
use crate::error::Error;
use fewbits_link::Step;
use fewbits_link::doors::home_assistant::Fleet;

#[cfg(feature = "mqtt")]
type Broker = fewbits_link::mqtt::Messages;

#[cfg(feature = "mqtt")]
fn connect(broker: &str) -> Result<Broker, Error> {
    let options = crate::place::mqtt(broker).map_err(|error| Error::content("home_assistant", error))?;
    Ok(Broker::open(options, Vec::new())?)
}

/// There is none without MQTT.
#[cfg(not(feature = "mqtt"))]
enum Broker {}

#[cfg(not(feature = "mqtt"))]
impl Broker {
    fn publish(&self, _: &fewbits_link::doors::home_assistant::Message) {
        match *self {}
    }
}

#[cfg(not(feature = "mqtt"))]
fn connect(_: &str) -> Result<Broker, Error> {
    Err(Error::content("home_assistant", crate::place::NO_MQTT))
}

/// A fleet at the broker of Home Assistant.
pub(super) struct Home {
    fleet: Fleet,
    broker: Broker,
}

impl Home {
    /// Connects, and says what is to be found. `None` if the configuration names no broker.
    pub(super) fn open(given: &Configuration, numbers: &[u32]) -> Result<Option<Self>, Error> {
        let Some(text) = &given.home_assistant else {
            return Ok(None);
        };
        let (broker, fleet) =
            crate::place::home_assistant(text).map_err(|error| Error::content("home_assistant", error))?;
        let fleet = Fleet {
            name: fleet.to_owned(),
            period: given.period,
            sensors: numbers.to_vec(),
            coordinates: given.named(),
        };
        let broker = connect(broker)?;
        fleet.discovery().iter().for_each(|message| broker.publish(message));
        Ok(Some(Self { fleet, broker }))
    }

    pub(super) fn show(&self, step: &Step) {
        self.broker.publish(&self.fleet.state(step));
    }
}
