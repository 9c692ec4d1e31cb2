//! `fewbits sensor`: samples from standard input, reports over UDP, MQTT or zenoh.

use crate::Ending;
use crate::arguments::SensorOptions;
use crate::error::Error;
use crate::place::Place;
use crate::report::{Report, configuration, configured};
use fewbits_core::{BitString, SensorNode};
use fewbits_link::{Key, Program, SensorLink, Store, Udp, run_sensor};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{Feedback, Note, SensorSettings, Slot};
use nalgebra::Vector1;
use serde::Deserialize;
use std::io::BufRead;
use std::net::ToSocketAddrs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};

/// Content of `sensor.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Configuration {
    /// Address and port of the centre, or broker or endpoint and fleet.
    centre: String,
    number: u32,
    key: String,
    /// File that stores the counter of envelopes between runs. Without it the centre refuses a restarted sensor as a replay.
    state: Option<PathBuf>,
    /// Standard deviation of the measurement noise.
    deviation: f64,
    report: Report,
    /// Number of coordinates of the centre's state, and index of the measured one. For censored reports only.
    #[serde(default = "one")]
    coordinates: usize,
    #[serde(default)]
    reads: usize,
    /// Number of silent slots after which a heartbeat is sent; 0: never.
    #[serde(default)]
    heartbeat_after: u32,
    #[serde(default)]
    seed: u64,
}

fn one() -> usize {
    1
}

/// Runs the task until the samples end.
pub(crate) fn run(options: &SensorOptions) -> Result<Ending, Error> {
    let file = &options.configuration;
    let given: Configuration = configuration(file)?;
    let node = node(file, &given)?;
    let mut settings = SensorSettings::new(Feedback::Told);
    settings.heartbeat_after = given.heartbeat_after;
    let key = Key::from_hex(&given.key).map_err(configured(file))?;
    let mut link = SensorLink::new(settings, given.number, key, given.state.map(Store::new))?;
    let mut program = Samples {
        lines: lines(),
        node,
        stream: Stream::new(given.seed).indexed(u64::from(given.number)),
        refused: None,
    };
    match Place::of(&given.centre).map_err(configured(file))? {
        Place::Udp(address) => {
            let mut addresses = address.to_socket_addrs().map_err(configured(file))?;
            let centre = addresses
                .next()
                .ok_or_else(|| configured(file)("centre: no address of that name"))?;
            let mut socket = Udp::bind(if centre.is_ipv6() { "[::]:0" } else { "0.0.0.0:0" })?;
            run_sensor(&mut socket, &centre, &mut link, &mut program)?;
        }
        #[cfg(feature = "mqtt")]
        Place::Mqtt { broker, fleet } => {
            let broker = crate::place::mqtt(broker).map_err(configured(file))?;
            let mut mqtt = fewbits_link::mqtt::Mqtt::sensor(broker, fleet, given.number)?;
            run_sensor(&mut mqtt, &given.number, &mut link, &mut program)?;
        }
        #[cfg(feature = "zenoh")]
        Place::Zenoh { endpoint, fleet } => {
            let session = crate::place::zenoh(endpoint, false).map_err(configured(file))?;
            let mut zenoh = fewbits_link::zenoh::Zenoh::sensor(session, fleet, given.number)?;
            run_sensor(&mut zenoh, &given.number, &mut link, &mut program)?;
        }
    }
    match program.refused {
        Some(error) => Err(error),
        None => Ok(Ending::Good),
    }
}

type Node = Box<dyn SensorNode<1>>;

fn node(file: &Path, given: &Configuration) -> Result<Node, Error> {
    let (report, reads, variance) = (given.report, given.reads, given.deviation * given.deviation);
    let node = match (report, given.coordinates) {
        (Report::Censored { .. }, 2) => report.node::<2>(reads, variance),
        (Report::Censored { .. }, 4) => report.node::<4>(reads, variance),
        (Report::Censored { .. }, other) if other != 1 => {
            Err(format!("coordinates is {other}: expected 1, 2 or 4").into())
        }
        _ => report.node::<1>(reads, variance),
    };
    node.map_err(configured(file))
}

/// Reads samples, one per line, in a thread, so that a slot never waits for one.
fn lines() -> Receiver<(u64, std::io::Result<String>)> {
    let (sender, receiver) = sync_channel(1024);
    std::thread::spawn(move || {
        for (number, line) in (1..).zip(std::io::stdin().lock().lines()) {
            if sender.send((number, line)).is_err() {
                return;
            }
        }
    });
    receiver
}

struct Samples {
    lines: Receiver<(u64, std::io::Result<String>)>,
    node: Node,
    stream: Stream,
    refused: Option<Error>,
}

impl Samples {
    fn refuse(&mut self, error: Error) -> ControlFlow<(), Option<BitString>> {
        self.refused = Some(error);
        ControlFlow::Break(())
    }
}

impl Program for Samples {
    /// Takes one line per slot. An empty line, or a line that has not come yet, is a missing measurement: silence.
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>> {
        let (number, line) = match self.lines.try_recv() {
            Ok((number, Ok(line))) => (number, line),
            Ok((_, Err(source))) => return self.refuse(Error::io("standard input", "read")(source)),
            Err(TryRecvError::Empty) => return ControlFlow::Continue(None),
            Err(TryRecvError::Disconnected) => return ControlFlow::Break(()),
        };
        let cell = line.trim();
        let sample = match cell.parse::<f64>() {
            Ok(sample) if sample.is_finite() => sample,
            // The first line may be a name.
            Err(_) if cell.is_empty() || number == 1 => return ControlFlow::Continue(None),
            _ => {
                let problem = format!("line {number}: `{cell}` is no finite number");
                return self.refuse(Error::content("standard input", problem));
            }
        };
        let mut rng = self.stream.indexed(u64::from(slot.number())).rng();
        match self.node.report(&mut rng, &Vector1::new(sample), feedback) {
            Ok(report) => ControlFlow::Continue(report),
            Err(error) => {
                eprintln!("slot {}: {error}", slot.number());
                ControlFlow::Continue(None)
            }
        }
    }

    fn note(&mut self, note: Note) {
        eprintln!("{note}");
    }
}
