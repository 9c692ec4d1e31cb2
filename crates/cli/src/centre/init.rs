//! `fewbits centre --init`: a commented configuration, the fleet's key, and the files of its sensors, all readable by their owner only.

use super::configuration::Configuration;
use crate::Ending;
use crate::error::Error;
use crate::report::Report;
use crate::say::say;
use fewbits_link::{FleetKey, write_private};
use std::io::Read;
use std::path::Path;

/// Bytes of a key.
const KEY_BYTES: usize = 32;

fn template(sensors: u32) -> String {
    format!(
        r#"# A fusion centre: run it with `fewbits centre FILE`, check it with `fewbits check FILE`.

listen = "0.0.0.0:7070"      # or "mqtt://user:password@broker/plant", "zenoh://host:7447/plant"
period = 1.0                 # seconds of a slot
state = "centre.state"       # what survives the process; `durable = true`: a power failure too
fleet_key_file = "fleet.key" # the keys of all sensors without a `key` follow from it
revoked = []                 # numbers of sensors whose frames are refused, as [3, 7]

# How the state moves: random-walk (density), ornstein-uhlenbeck (mean, time_constant, variance),
# constant-velocity (density), constant-velocity2d (density).
model = {{ kind = "random-walk", density = 0.01 }}
# What is known before the first slot, per coordinate of the state.
prior = {{ mean = [0.0], deviation = [10.0] }}

[[sensor]]
numbers = "1-{sensors}"          # or `number = 1` for a sensor with settings of its own
deviation = 0.5              # standard deviation of its measurement noise
report = "bit"               # "bit", "word:2" to "word:4", "value", or "silent:1.5" (standard deviations)
reads = 0                    # the coordinate that it measures
loss = 0.05                  # probability that a question or its report is lost
# key_version = 2            # after a sensor has lost its key or its state
"#
    )
}

/// The file of one sensor. `given` is the configuration that it must agree with; without it, the template.
fn sensor(number: u32, key: &str, centre: &str, given: Option<(&Configuration, &super::Sensor)>) -> String {
    let (deviation, report) = given.map_or((0.5, Report::Sign), |(_, like)| (like.deviation, like.report));
    let mut text = format!(
        "centre = \"{centre}\"   # the centre's address, as this sensor reaches it\nnumber = {number}\nkey = \"{key}\"\n\
         deviation = {deviation}\nreport = \"{}\"               # as in the centre's file\nstate = \"sensor-{number}.state\"\n",
        report.word()
    );
    if let Some((given, like)) = given.filter(|_| report.needs_coordinates()) {
        // A censoring sensor is told the covariance of the whole state.
        text += &format!("coordinates = {}\nreads = {}\n", given.model.coordinates(), like.reads);
    }
    text
}

/// Writes the files. None of them may exist.
pub(super) fn run(file: &Path, sensors: u32) -> Result<Ending, Error> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut bytes = [0; KEY_BYTES];
    let random = "/dev/urandom";
    let read = std::fs::File::open(random).and_then(|mut source| source.read_exact(&mut bytes));
    read.map_err(Error::io(random, "read"))?;
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let fleet = FleetKey::new(&bytes)?;
    let mut files = vec![
        (file.to_owned(), template(sensors)),
        (folder.join("fleet.key"), hex + "\n"),
    ];
    for number in 1..=sensors {
        let text = sensor(number, &fleet.hex_of(number, 1)?, "192.168.1.5:7070", None);
        files.push((folder.join(format!("sensor-{number}.toml")), text));
    }
    if let Some((path, _)) = files.iter().find(|(path, _)| path.exists()) {
        return Err(Error::content(&path.display().to_string(), "exists already: name another folder, or remove it"));
    }
    for (path, text) in &files {
        write_private(path, text)?;
        say!("{} written", path.display());
    }
    Ok(Ending::Good)
}

/// Prints the configuration of one sensor, with the key that follows from the fleet's.
pub(super) fn print_sensor(file: &Path, given: &Configuration, number: u32) -> Result<Ending, Error> {
    let name = file.display().to_string();
    let Some(like) = given.sensors.iter().find(|sensor| sensor.number == number) else {
        return Err(Error::content(&name, format_args!("sensor {number} is not in it, or revoked")));
    };
    let Some(fleet) = &given.fleet else {
        return Err(Error::content(&name, "no fleet key: the keys of its sensors stand in it"));
    };
    // The version is not kept: the key whose fingerprint is that of the configuration is the one.
    for version in 1..=u32::from(u16::MAX) {
        if fleet.key_of(number, version)?.fingerprint() == like.key.fingerprint() {
            crate::output::text(
                None,
                &sensor(
                    number,
                    &fleet.hex_of(number, version)?,
                    &crate::place::shown(&given.listen),
                    Some((given, like)),
                ),
            )?;
            return Ok(Ending::Good);
        }
    }
    Err(Error::content(&name, format_args!("sensor {number} has a key of its own")))
}
