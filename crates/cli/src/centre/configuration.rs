//! `centre.toml`: what it contains, and all faults of it at once.

use super::calibrated;
use super::entries::{Entry, Model, Prior, numbers};
use crate::error::Error;
use crate::measured::Measured;
use crate::private;
use crate::report::Report;
use fewbits_link::{FleetKey, Key};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Content of `centre.toml`.
pub(super) struct Configuration {
    /// Address and port to listen at, or broker or endpoint with fleet.
    pub(super) listen: String,
    /// Length of a slot in seconds. All sensors that report by the clock must have the same.
    pub(super) period: f64,
    /// File that stores the state between runs.
    pub(super) state: Option<PathBuf>,
    /// Whether every write waits for the disk.
    pub(super) durable: bool,
    pub(super) seed: u64,
    pub(super) model: Model,
    pub(super) prior: Prior,
    /// In increasing order of their numbers: the order in which the receiver counts sensors.
    pub(super) sensors: Vec<Sensor>,
    /// The secret from which the keys of sensors without one follow.
    pub(super) fleet: Option<FleetKey>,
    /// Broker and name of the fleet at which Home Assistant finds the estimates.
    pub(super) home_assistant: Option<String>,
    /// Names and units of the coordinates of the state there and on the page.
    pub(super) coordinates: Vec<Coordinate>,
}

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct Coordinate {
    pub(super) name: String,
    #[serde(default)]
    pub(super) unit: String,
}

#[derive(Clone)]
pub(super) struct Sensor {
    pub(super) number: u32,
    pub(super) key: Key,
    pub(super) address: Option<String>,
    pub(super) measured: Measured,
    pub(super) report: Report,
    pub(super) loss: f64,
}

/// Collects faults, so that a person mends all of them at once.
#[derive(Default)]
pub(super) struct Faults(pub(super) Vec<String>);

impl Faults {
    pub(super) fn add(&mut self, fault: impl Display) {
        self.0.push(fault.to_string());
    }

    fn keep<T, E: Display>(&mut self, what: &str, outcome: Result<T, E>) -> Option<T> {
        outcome
            .map_err(|error| self.add(format_args!("{what}: {}", one_line(error))))
            .ok()
    }

    /// Takes a value out of a table.
    fn take<T: DeserializeOwned>(&mut self, table: &mut Table, name: &str) -> Option<T> {
        let value = table.remove(name)?;
        self.keep(name, value.try_into())
    }

    fn need<T: DeserializeOwned>(&mut self, table: &mut Table, name: &str) -> Option<T> {
        if !table.contains_key(name) {
            self.add(format_args!("`{name}` is missing"));
        }
        self.take(table, name)
    }

    /// The error with all faults.
    pub(super) fn error(self, file: &Path) -> Error {
        let name = file.display().to_string();
        match &self.0[..] {
            [only] => Error::content(&name, only),
            all => Error::content(&name, format_args!("{} faults\n  {}", all.len(), all.join("\n  "))),
        }
    }
}

/// An error of a value without the excerpt of the file, which may contain a key.
fn one_line(error: impl Display) -> String {
    error.to_string().trim().replace('\n', "; ")
}

impl Configuration {
    /// Name and unit of each coordinate of the state.
    pub(super) fn named(&self) -> Vec<(String, String)> {
        if self.coordinates.is_empty() {
            let names = self.model.names().iter();
            return names.map(|name| ((*name).to_owned(), String::new())).collect();
        }
        let given = self.coordinates.iter();
        given
            .map(|coordinate| (coordinate.name.clone(), coordinate.unit.clone()))
            .collect()
    }

    /// Reads a file.
    ///
    /// # Errors
    /// If it is not TOML, others may read it, or it has faults: all of them are named.
    pub(super) fn read(file: &Path) -> Result<Self, Error> {
        let table = private::table(file)?;
        let mut faults = Faults::default();
        let configuration = Self::of_table(table, file, &mut faults);
        match configuration {
            Some(configuration) if faults.0.is_empty() => Ok(configuration),
            _ => Err(faults.error(file)),
        }
    }

    fn of_table(mut table: Table, file: &Path, faults: &mut Faults) -> Option<Self> {
        let listen = faults.need::<String>(&mut table, "listen");
        if let Some(Err(fault)) = listen.as_deref().map(crate::place::Place::of) {
            faults.add(fault);
        }
        let period = faults.need::<f64>(&mut table, "period");
        if let Some(period) = period.filter(|period| !(1e-3..=1e6).contains(period)) {
            faults.add(format_args!("period is {period}: expected .001 to 1000000 seconds"));
        }
        let (state, durable) = (faults.take(&mut table, "state"), faults.take(&mut table, "durable"));
        let seed = faults.take(&mut table, "seed");
        let found = match faults.take::<PathBuf>(&mut table, "settings") {
            Some(path) => Some(faults.keep("settings", calibrated::read(&beside(file, &path)))?),
            None => None,
        };
        let model = match &found {
            Some(found) if !table.contains_key("model") => Some(calibrated::model(found)),
            _ => faults.need::<Model>(&mut table, "model"),
        };
        let prior = match found.as_ref().and_then(calibrated::prior) {
            Some(prior) if !table.contains_key("prior") => Some(prior),
            _ => faults.need::<Prior>(&mut table, "prior"),
        };
        if let (Some(model), Some(prior)) = (model, &prior) {
            check_prior(model.coordinates(), prior, faults);
        }
        let home_assistant = faults.take::<String>(&mut table, "home_assistant");
        if let Some(Err(fault)) = home_assistant.as_deref().map(crate::place::home_assistant) {
            faults.add(fault);
        }
        let coordinates = faults
            .take::<Vec<Coordinate>>(&mut table, "coordinates")
            .unwrap_or_default();
        if let Some(model) = model.filter(|model| !(coordinates.is_empty() || coordinates.len() == model.coordinates()))
        {
            let expected = model.coordinates();
            faults.add(format_args!(
                "coordinates: {} entries: expected {expected}, as many as the model has",
                coordinates.len()
            ));
        }
        let has_fleet = table.contains_key("fleet_key_file") || table.contains_key("fleet_key");
        let fleet = fleet_key(&mut table, file, faults);
        let revoked = faults.take::<Vec<u32>>(&mut table, "revoked").unwrap_or_default();
        let entries = faults.need::<Vec<Value>>(&mut table, "sensor").unwrap_or_default();
        for name in table.keys() {
            faults.add(format_args!("`{name}` is unknown"));
        }
        let mut sensors = Vec::new();
        for (i, entry) in entries.into_iter().enumerate() {
            let name = match entry.get("number").and_then(Value::as_integer) {
                Some(number) => format!("sensor {number}"),
                None => format!("[[sensor]] {}", i + 1),
            };
            let Some(entry) = faults.keep(&name, entry.try_into::<Entry>()) else {
                continue;
            };
            check_entry(&name, &entry, model.map(Model::coordinates), faults);
            let measured = faults.keep(&name, calibrated::measured(&entry, found.as_ref()));
            // A fault hides no other one of the same sensor.
            let measured = measured.unwrap_or(Measured::of(entry.reads, 1.0));
            let Some(numbers) = faults.keep(&name, numbers(&entry)) else {
                continue;
            };
            // What is wrong with the fleet's key was said once.
            if entry.key.is_none() && fleet.is_none() && has_fleet {
                continue;
            }
            for number in numbers.into_iter().filter(|number| !revoked.contains(number)) {
                // What the key of one of a group lacks, all lack.
                let Some(key) = faults.keep(&format!("sensor {number}"), key(&entry, number, fleet.as_ref())) else {
                    break;
                };
                sensors.push(Sensor::of(&entry, measured, number, key));
            }
        }
        if sensors.is_empty() && faults.0.is_empty() {
            faults.add("no sensor is left: expected at least one that is not revoked");
        }
        sensors.sort_by_key(|sensor| sensor.number);
        check_sensors(&sensors, faults);
        Some(Self {
            listen: listen?,
            period: period?,
            state,
            durable: durable.unwrap_or_default(),
            seed: seed.unwrap_or_default(),
            model: model?,
            prior: prior?,
            sensors,
            fleet,
            home_assistant,
            coordinates,
        })
    }
}

/// A path that a configuration names: beside it, whatever folder the command runs in.
fn beside(file: &Path, path: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(path)
}

fn check_prior(coordinates: usize, prior: &Prior, faults: &mut Faults) {
    if (prior.mean.len(), prior.deviation.len()) != (coordinates, coordinates) {
        faults.add(format_args!(
            "prior: expected {coordinates} means and {coordinates} deviations, one per coordinate of the model"
        ));
    }
    if let Some(deviation) = prior.deviation.iter().find(|d| !(d.is_finite() && **d > 0.0)) {
        faults.add(format_args!("prior: a deviation is {deviation}: expected above 0"));
    }
    if let Some(mean) = prior.mean.iter().find(|mean| !mean.is_finite()) {
        faults.add(format_args!("prior: a mean is {mean}: expected a finite number"));
    }
}

/// The fleet's secret, in the file itself or, better, in one of its own.
fn fleet_key(table: &mut Table, file: &Path, faults: &mut Faults) -> Option<FleetKey> {
    let text = match faults.take::<PathBuf>(table, "fleet_key_file") {
        Some(path) => Some(faults.keep("fleet_key_file", private::text(&beside(file, &path)))?),
        None => faults.take::<String>(table, "fleet_key"),
    };
    faults.keep("fleet key", FleetKey::from_hex(text?.trim()))
}

/// The numbers of an entry, whether it stands for one sensor or many.
fn check_entry(name: &str, entry: &Entry, coordinates: Option<usize>, faults: &mut Faults) {
    if !(0.0..1.0).contains(&entry.loss) {
        faults.add(format_args!("{name}: loss is {}: expected 0 or more, below 1", entry.loss));
    }
    if let Some(coordinates) = coordinates.filter(|coordinates| entry.reads >= *coordinates) {
        faults.add(format_args!(
            "{name}: reads is {}: expected below {coordinates}, the coordinates of the model",
            entry.reads
        ));
    }
}

fn key(entry: &Entry, number: u32, fleet: Option<&FleetKey>) -> Result<Key, Error> {
    match (&entry.key, fleet) {
        (Some(key), _) => Ok(Key::from_hex(key)?),
        (None, Some(fleet)) => Ok(fleet.key_of(number, entry.key_version)?),
        (None, None) => Err(Error::content("key", "expected `key`, or `fleet_key_file` for all sensors")),
    }
}

impl Sensor {
    /// Standard deviation of its noise.
    pub(super) fn deviation(&self) -> f64 {
        self.measured.variance.sqrt()
    }

    fn of(entry: &Entry, measured: Measured, number: u32, key: Key) -> Self {
        Self {
            number,
            key,
            address: entry.address.clone(),
            measured,
            report: entry.report,
            loss: entry.loss,
        }
    }
}

fn check_sensors(sensors: &[Sensor], faults: &mut Faults) {
    let mut keys = HashMap::new();
    for pair in sensors.windows(2) {
        if pair[0].number == pair[1].number {
            faults.add(format_args!("sensor {} stands twice", pair[0].number));
        }
    }
    for sensor in sensors {
        if let Some(other) = keys.insert(sensor.key.fingerprint(), sensor.number)
            && other != sensor.number
        {
            faults.add(format_args!("sensor {}: its key is that of sensor {other}: give each its own", sensor.number));
        }
    }
}
