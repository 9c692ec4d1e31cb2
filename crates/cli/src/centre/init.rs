//! `fewbits centre --init`: a commented configuration, the fleet's key, and the files of its sensors, all readable by their owner only.

use super::calibrated;
use super::configuration::Configuration;
use crate::Ending;
use crate::arguments::CentreOptions;
use crate::error::Error;
use crate::report::Report;
use crate::say::say;
use fewbits_link::{FleetKey, write_private};
use fewbits_tracking::Calibration;
use std::io::Read;
use std::path::Path;

/// Bytes of a key.
const KEY_BYTES: usize = 32;

/// What moves, what is known of it, and the sensors, in words that a person edits. `settings`: the file of `fit`, as the configuration names it.
fn world(sensors: u32, settings: Option<(&str, &Calibration)>) -> String {
    const MODELS: &str = "# How the state moves: random-walk (density), ornstein-uhlenbeck (mean, time_constant, variance),\n\
        # constant-velocity (density), constant-velocity2d (density).\n";
    const PRIOR: &str = "# What is known before the first slot, per coordinate of the state.\n\
        prior = { mean = [0.0], deviation = [10.0] }\n";
    const REPORT: &str = "report = \"bit\"               # \"bit\", \"word:2\" to \"word:4\", \"value\", or \"silent:1.5\" (standard deviations)\n";
    const LOSS: &str = "loss = 0.05                  # probability that a question or its report is lost\n\
        # key_version = 2            # after a sensor has lost its key or its state\n";
    let Some((path, found)) = settings else {
        return format!(
            "{MODELS}model = {{ kind = \"random-walk\", density = 0.01 }}\n{PRIOR}\n[[sensor]]\n\
             numbers = \"1-{sensors}\"          # or `number = 1` for a sensor with settings of its own\n\
             deviation = 0.5              # standard deviation of its measurement noise\n\
             {REPORT}reads = 0                    # the coordinate that it measures\n{LOSS}"
        );
    };
    let path = toml::Value::String(path.to_owned());
    let mut text = format!(
        "# Model, noises, offsets, gains and thresholds, by the names of sensors. `model`, `prior`, `deviation`, `offset`, `gain` and\n\
         # `threshold` come before it.\nsettings = {path}\n"
    );
    if found.prior().is_none() {
        // A level that wanders may begin anywhere.
        text += PRIOR;
    }
    for (i, sensor) in found.sensors.iter().enumerate() {
        let name = toml::Value::String(sensor.name.clone());
        text += &format!("\n[[sensor]]\nnumber = {}\nname = {name}\n{REPORT}{LOSS}", i + 1);
    }
    text
}

fn template(sensors: u32, settings: Option<(&str, &Calibration)>) -> String {
    format!(
        r#"# A fusion centre: run it with `fewbits centre FILE`, check it with `fewbits check FILE`.

listen = "0.0.0.0:7070"      # or "mqtt://user:password@broker/plant", "zenoh://host:7447/plant"
period = 1.0                 # seconds of a slot
state = "centre.state"       # what survives the process; `durable = true`: a power failure too
fleet_key_file = "fleet.key" # the keys of all sensors without a `key` follow from it
revoked = []                 # numbers of sensors whose frames are refused, as [3, 7]

{}"#,
        world(sensors, settings)
    )
}

/// The file of one sensor. `coordinates` and `reads`: of a sensor that is told the covariance of the state.
fn sensor(
    number: u32,
    key: &str,
    centre: &str,
    (deviation, report): (f64, Report),
    told: Option<(usize, usize)>,
) -> String {
    let mut text = format!(
        "centre = \"{centre}\"   # the centre's address, as this sensor reaches it\nnumber = {number}\nkey = \"{key}\"\n\
         deviation = {deviation}\nreport = \"{}\"               # as in the centre's file\nstate = \"sensor-{number}.state\"\n",
        report.word()
    );
    if let Some((coordinates, reads)) = told {
        text += &format!("coordinates = {coordinates}\nreads = {reads}\n");
    }
    text
}

/// Writes the files. None of them may exist.
pub(super) fn run(options: &CentreOptions) -> Result<Ending, Error> {
    let (file, settings) = (&options.configuration, &options.settings);
    let folder = file.parent().unwrap_or(Path::new(""));
    let found = settings.as_deref().map(calibrated::read).transpose()?;
    let path = settings.as_deref().map(|path| from(folder, path)).transpose()?;
    let sensors = found
        .as_ref()
        .map_or(options.sensors, |found| found.sensors.len() as u32);
    let mut bytes = [0; KEY_BYTES];
    let random = "/dev/urandom";
    let read = std::fs::File::open(random).and_then(|mut source| source.read_exact(&mut bytes));
    read.map_err(Error::io(random, "read"))?;
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let fleet = FleetKey::new(&bytes)?;
    let mut files = vec![
        (file.to_owned(), template(sensors, path.as_deref().zip(found.as_ref()))),
        (folder.join("fleet.key"), hex + "\n"),
    ];
    for number in 1..=sensors {
        let own = found.as_ref().map(|found| &found.sensors[number as usize - 1].model);
        let kind = (own.map_or(0.5, |own| own.noise), Report::Sign);
        let text = sensor(number, &fleet.hex_of(number, 1)?, "192.168.1.5:7070", kind, None);
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

/// A path as seen from a folder: below it, or from the root.
fn from(folder: &Path, path: &Path) -> Result<String, Error> {
    let whole = |path: &Path| {
        path.canonicalize()
            .map_err(Error::io(&path.display().to_string(), "read"))
    };
    let here = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let (folder, path) = (whole(here)?, whole(path)?);
    Ok(path.strip_prefix(&folder).unwrap_or(&path).display().to_string())
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
    let told = like.report.needs_coordinates();
    let told = told.then_some((given.model.coordinates(), like.measured.reads));
    // The version is not kept: the key whose fingerprint is that of the configuration is the one.
    for version in 1..=u32::from(u16::MAX) {
        if fleet.key_of(number, version)?.fingerprint() == like.key.fingerprint() {
            crate::output::text(
                None,
                &sensor(
                    number,
                    &fleet.hex_of(number, version)?,
                    &crate::place::shown(&given.listen),
                    (like.deviation(), like.report),
                    told,
                ),
            )?;
            return Ok(Ending::Good);
        }
    }
    Err(Error::content(&name, format_args!("sensor {number} has a key of its own")))
}
