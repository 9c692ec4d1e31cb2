//! Home Assistant over MQTT: messages by which it discovers a centre, and the messages with its estimates.
//!
//! Each coordinate of the state is a sensor with its band as an attribute; each sensor of the fleet is a binary sensor that says whether it is
//! connected. All of them become unavailable when no estimate comes for three slots (`expire_after`).

use crate::station::Step;
use serde_json::{Value, json};

/// A message: topic, content, and whether the broker keeps it for those who come later.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Topic.
    pub topic: String,
    /// JSON.
    pub content: String,
    /// Whether the broker keeps it.
    pub retained: bool,
}

/// What a fleet is called and where its messages go.
#[derive(Debug, Clone)]
pub struct Fleet {
    /// Name of the fleet: a part of topics and identities, as `plant`. Characters other than letters, digits and `_` become `_` there.
    pub name: String,
    /// Seconds of a slot.
    pub period: f64,
    /// Numbers of the sensors.
    pub sensors: Vec<u32>,
    /// Name and unit of each coordinate; a unit may be empty.
    pub coordinates: Vec<(String, String)>,
}

impl Fleet {
    fn identity(&self) -> String {
        let allowed = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        self.name.chars().map(allowed).collect()
    }

    /// Topic of the estimates.
    pub fn state_topic(&self) -> String {
        format!("fewbits/{}/state", self.identity())
    }

    /// The messages by which Home Assistant discovers the fleet. The broker keeps them.
    pub fn discovery(&self) -> Vec<Message> {
        let identity = self.identity();
        let state = self.state_topic();
        let device =
            json!({ "identifiers": [format!("fewbits_{identity}")], "name": self.name, "manufacturer": "fewbits" });
        let expire_after = (3.0 * self.period).ceil().max(1.0) as u64;
        let message = |component: &str, object: String, mut config: Value| {
            config["unique_id"] = format!("fewbits_{identity}_{object}").into();
            config["state_topic"] = state.clone().into();
            config["expire_after"] = expire_after.into();
            config["device"] = device.clone();
            Message {
                topic: format!("homeassistant/{component}/fewbits_{identity}/{object}/config"),
                content: config.to_string(),
                retained: true,
            }
        };
        let coordinate = |(i, (name, unit)): (usize, &(String, String))| {
            let mut config = json!({
                "name": name,
                "value_template": format!("{{{{ value_json.mean{i} }}}}"),
                "json_attributes_topic": state,
                "json_attributes_template":
                    format!("{{{{ {{'deviation': value_json.deviation{i}, 'low': value_json.low{i}, 'high': value_json.high{i}}} | tojson }}}}"),
                "state_class": "measurement",
            });
            if !unit.is_empty() {
                config["unit_of_measurement"] = unit.as_str().into();
            }
            message("sensor", format!("coordinate{i}"), config)
        };
        let sensor = |number: &u32| {
            let config = json!({
                "name": format!("sensor {number}"),
                "device_class": "connectivity",
                "value_template": format!("{{{{ value_json.sensor{number} }}}}"),
            });
            message("binary_sensor", format!("sensor{number}"), config)
        };
        let coordinates = self.coordinates.iter().enumerate().map(coordinate);
        coordinates.chain(self.sensors.iter().map(sensor)).collect()
    }

    /// The message of one step: estimates, their bands of 95 %, and `ON` for each sensor that is neither dead nor excluded. A sensor that
    /// could not be asked, as nothing came from it yet, has no state: it is unknown.
    pub fn state(&self, step: &Step) -> Message {
        let mut content = serde_json::Map::new();
        content.insert("slot".to_owned(), step.slot.into());
        for (i, (mean, deviation)) in step.estimate.iter().enumerate() {
            let half = 1.96 * deviation;
            for (name, value) in [
                ("mean", *mean),
                ("deviation", *deviation),
                ("low", mean - half),
                ("high", mean + half),
            ] {
                content.insert(format!("{name}{i}"), value.into());
            }
        }
        for (i, number) in self.sensors.iter().enumerate() {
            let works = step.health.get(i).is_none_or(|health| !health.dead && !health.excluded);
            let state = match step.asked.get(i) {
                // The template makes `None` of it, which Home Assistant takes for an unknown state.
                Some(false) => Value::Null,
                _ => if works { "ON" } else { "OFF" }.into(),
            };
            content.insert(format!("sensor{number}"), state);
        }
        Message {
            topic: self.state_topic(),
            content: Value::Object(content).to_string(),
            retained: false,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use fewbits_core::Observation;
    use fewbits_protocol::SensorHealth;

    #[test]
    fn every_template_finds_its_value_in_the_state() {
        let fleet = Fleet {
            name: "hall 1/ä".to_owned(),
            period: 0.5,
            sensors: vec![3, 8, 9],
            coordinates: vec![
                ("level".to_owned(), "°C".to_owned()),
                ("slope".to_owned(), String::new()),
            ],
        };
        let mut step = Step::new(4, vec![Observation::Nothing; 3], vec![(1.0, 0.5), (2.0, 0.25)]);
        let health = |dead| SensorHealth {
            working: 0.1,
            dead,
            excluded: false,
        };
        // Nothing came from the last one, of which health therefore knows nothing.
        step.health = vec![health(false), health(true), health(false)];
        step.asked = vec![true, true, false];
        let state = fleet.state(&step);
        let values: Value = serde_json::from_str(&state.content).unwrap();
        assert_eq!(
            (&values["low0"], &values["sensor3"], &values["sensor8"], &values["sensor9"]),
            (&json!(1.0 - 0.98), &json!("ON"), &json!("OFF"), &Value::Null)
        );
        let discovery = fleet.discovery();
        assert_eq!(discovery.len(), 5);
        let mut identities = std::collections::HashSet::new();
        for message in discovery {
            let config: Value = serde_json::from_str(&message.content).unwrap();
            assert!(message.retained && message.topic.starts_with("homeassistant/") && message.topic.is_ascii());
            assert_eq!((&config["state_topic"], &config["expire_after"]), (&json!(state.topic), &json!(2)));
            assert!(identities.insert(config["unique_id"].as_str().unwrap().to_owned()));
            let template = config["value_template"].as_str().unwrap();
            let name = template
                .strip_prefix("{{ value_json.")
                .unwrap()
                .strip_suffix(" }}")
                .unwrap();
            assert!(values.get(name).is_some(), "{name}");
        }
    }
}
