//! `fewbits centre`: a fusion centre over UDP, MQTT or zenoh. Each slot's estimate is a row on standard output.

use crate::Ending;
use crate::arguments::CentreOptions;
use crate::error::{Error, Failure};
use crate::place::Place;
use crate::report::{Report, configuration, configured};
use fewbits_core::Evolution;
use fewbits_core::{Gaussian, Link};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::FusionCentre;
use fewbits_link::{FusionReceiver, Key, Output, Peer, Station, Step, Store, Transport, Udp, run_station};
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{CentreSettings, Feedback, Member, Receiver, ReportLength, Schedule};
use nalgebra::{SMatrix, SVector};
use serde::Deserialize;
use std::collections::HashSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::num::NonZeroU64;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Content of `centre.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Configuration {
    /// Address and port to listen at, or broker or endpoint with fleet.
    listen: String,
    /// Length of a slot in seconds. All sensors that report by the clock must have the same.
    period: f64,
    /// File that stores the state between runs.
    state: Option<PathBuf>,
    /// Whether every write waits for the disk.
    #[serde(default)]
    durable: bool,
    #[serde(default)]
    seed: u64,
    model: Model,
    prior: Prior,
    #[serde(rename = "sensor")]
    sensors: Vec<Sensor>,
}

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Model {
    RandomWalk {
        density: f64,
    },
    OrnsteinUhlenbeck {
        mean: f64,
        time_constant: f64,
        variance: f64,
    },
    ConstantVelocity {
        density: f64,
    },
    ConstantVelocity2d {
        density: f64,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Prior {
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sensor {
    number: u32,
    key: String,
    /// Address of the sensor, if it is known beforehand.
    address: Option<String>,
    /// Index of the coordinate of the state that the sensor measures.
    #[serde(default)]
    reads: usize,
    /// Standard deviation of its measurement noise.
    deviation: f64,
    report: Report,
    /// Probability that a question or its report is lost.
    #[serde(default)]
    loss: f64,
}

/// Runs the task until it is stopped.
pub(crate) fn run(options: &CentreOptions) -> Result<Ending, Error> {
    let file = &options.configuration;
    let given: Configuration = configuration(file)?;
    match Place::of(&given.listen).map_err(configured(file))? {
        Place::Udp(address) => over(options, &given, || Ok(Udp::bind(address)?)),
        #[cfg(feature = "mqtt")]
        Place::Mqtt { broker, fleet } => over(options, &given, || {
            let broker = crate::place::mqtt(broker).map_err(configured(file))?;
            Ok(fewbits_link::mqtt::Mqtt::centre(broker, fleet)?)
        }),
        #[cfg(feature = "zenoh")]
        Place::Zenoh { endpoint, fleet } => over(options, &given, || {
            let session = crate::place::zenoh(endpoint, true).map_err(configured(file))?;
            Ok(fewbits_link::zenoh::Zenoh::centre(session, fleet)?)
        }),
    }
}

/// Runs the task over the transport that `open` returns. It is called after everything else has been checked.
fn over<T: Transport>(
    options: &CentreOptions,
    given: &Configuration,
    open: impl FnOnce() -> Result<T, Error>,
) -> Result<Ending, Error> {
    match given.model {
        Model::RandomWalk { density } => with(options, given, open, ContinuousLinear::random_walk(density)),
        Model::OrnsteinUhlenbeck {
            mean,
            time_constant,
            variance,
        } => with(options, given, open, ContinuousLinear::ornstein_uhlenbeck(mean, time_constant, variance)),
        Model::ConstantVelocity { density } => {
            with(options, given, open, ContinuousLinear::nearly_constant_velocity(density))
        }
        Model::ConstantVelocity2d { density } => {
            with(options, given, open, ContinuousLinear::nearly_constant_velocity_2d(density))
        }
    }
}

fn with<const D: usize, T: Transport>(
    options: &CentreOptions,
    given: &Configuration,
    open: impl FnOnce() -> Result<T, Error>,
    world: Result<impl Evolution<D> + 'static, fewbits_models::Error>,
) -> Result<Ending, Error> {
    let file = &options.configuration;
    let world = world.map_err(configured(file))?;
    let refused = configured::<String>(file);
    let expected = || refused(format!("prior: expected {D} means and {D} deviations, one per coordinate of the model"));
    let mean: [f64; D] = given.prior.mean.clone().try_into().map_err(|_| expected())?;
    let deviation: [f64; D] = given.prior.deviation.clone().try_into().map_err(|_| expected())?;
    let variances = SVector::from(deviation.map(|d| d * d));
    let prior = Gaussian::new(mean.into(), SMatrix::from_diagonal(&variances)).map_err(configured(file))?;
    let stream = Stream::new(given.seed);
    let mut centre =
        FusionCentre::new(&mut stream.named("prior").rng(), world, MomentFilter, &prior).map_err(configured(file))?;
    // The order in which the receiver counts sensors.
    let mut sensors: Vec<&Sensor> = given.sensors.iter().collect();
    sensors.sort_by_key(|sensor| sensor.number);
    let mut peers = Vec::new();
    let mut seen = HashSet::new();
    for sensor in sensors {
        let number = sensor.number;
        if !seen.insert(number) {
            return Err(refused(format!("sensor {number} stands twice")));
        }
        join(&mut centre, sensor).map_err(|error| refused(format!("sensor {number}: {error}")))?;
        let no_address = |text: &String| refused(format!("sensor {number}: {text} is no address"));
        let address = sensor.address.as_ref();
        peers.push(Peer {
            number,
            key: Key::from_hex(&sensor.key).map_err(|error| refused(format!("sensor {number}: {error}")))?,
            address: address
                .map(|text| text.parse().map_err(|_| no_address(text)))
                .transpose()?,
        });
    }
    let nanoseconds = (given.period * 1e9).round();
    let period = (1e6..=1e15)
        .contains(&nanoseconds)
        .then(|| NonZeroU64::new(nanoseconds as u64))
        .flatten();
    let period =
        period.ok_or_else(|| refused(format!("period is {}: expected .001 to 1000000 seconds", given.period)))?;
    let member = Member {
        feedback: Feedback::Told,
        report: ReportLength::Varying,
    };
    let settings = CentreSettings::new(vec![member; peers.len()], Schedule::new(period));
    let store = given.state.clone().map(|path| match given.durable {
        true => Store::new(path).durable(),
        false => Store::new(path),
    });
    let receiver = FusionReceiver::new(centre, given.period, stream);
    let mut station = Station::new(settings, receiver, peers, store)?;
    serve(options, given, open()?, &mut station, D)
}

fn join<const D: usize>(centre: &mut FusionCentre<D, MomentFilter>, sensor: &Sensor) -> Result<(), Failure> {
    let (variance, link) = (sensor.deviation * sensor.deviation, Link::lossy(sensor.loss)?);
    let remote = sensor.report.remote(sensor.reads, variance, link)?;
    Ok(centre.join_boxed(sensor.number, remote)?)
}

fn serve<R: Receiver, T: Transport>(
    options: &CentreOptions,
    _given: &Configuration,
    mut transport: T,
    station: &mut Station<R, T::Address>,
    coordinates: usize,
) -> Result<Ending, Error> {
    let mut sink = std::io::stdout().lock();
    let failed = Error::io("standard output", "write");
    let mut head = "slot,reports".to_owned();
    for i in 0..coordinates {
        let _ = write!(head, ",mean{i},deviation{i}");
    }
    writeln!(sink, "{head}").map_err(&failed)?;
    // The last step may not have been written before the process was stopped.
    if let Some(step) = station.last_step() {
        writeln!(sink, "{}", row(step)).map_err(&failed)?;
    }
    #[cfg(feature = "live")]
    let page = match options.live {
        Some(address) => {
            let mut numbers: Vec<u32> = _given.sensors.iter().map(|sensor| sensor.number).collect();
            numbers.sort_unstable();
            let page = fewbits_link::LivePage::serve(address, numbers, _given.period)?;
            eprintln!("page at http://{}/", page.address());
            Some(page)
        }
        None => None,
    };
    let mut remaining = options.slots;
    // What is called at each step can only say whether to go on: its error is kept until the station has ended.
    let mut outcome = Ok(());
    run_station(&mut transport, station, |_station, outputs| {
        for output in outputs {
            match output {
                Output::Step(step) => {
                    outcome = writeln!(sink, "{}", row(step))
                        .and_then(|()| sink.flush())
                        .map_err(&failed);
                    #[cfg(feature = "live")]
                    if let Some(page) = &page {
                        page.show(step, _station.counts());
                    }
                    if let Some(trouble) = &step.trouble {
                        eprintln!("slot {}: {trouble}", step.slot);
                    }
                    if let Some(remaining) = &mut remaining {
                        *remaining = remaining.saturating_sub(1);
                    }
                }
                Output::Passed { slot, reason } => eprintln!("slot {slot} passed: {reason}"),
                Output::Note { sensor, note } => eprintln!("sensor {sensor}: {note}"),
                _ => {}
            }
        }
        match outcome.is_err() || remaining == Some(0) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })?;
    outcome.map(|()| Ending::Good)
}

fn row(step: &Step) -> String {
    let received = |o: &&fewbits_core::Observation<_>| matches!(o, fewbits_core::Observation::Received(_));
    let mut row = format!("{},{}", step.slot, step.observed.iter().filter(received).count());
    for (mean, deviation) in &step.estimate {
        let _ = write!(row, ",{mean},{deviation}");
    }
    row
}
