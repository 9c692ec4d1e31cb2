//! `fewbits centre`: a fusion centre over UDP, MQTT or zenoh. Each slot's estimate is a row on standard output.

mod calibrated;
mod configuration;
mod entries;
mod home;
mod init;
mod log;
mod rows;

use crate::Ending;
use crate::arguments::CentreOptions;
use crate::error::{Error, Failure};
use crate::place::Place;
use crate::private::configured;
use crate::say::say;
use configuration::{Configuration, Faults, Sensor};
use entries::Model;
use fewbits_core::{Evolution, Gaussian, Link};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::FusionCentre;
use fewbits_link::{FusionReceiver, Output, Peer, Start, Station, Store, Transport, Udp, run_station};
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{CentreSettings, Feedback, Member, Receiver, Schedule};
use log::Log;
use nalgebra::{SMatrix, SVector};
pub(crate) use rows::RowFormat;
use rows::Rows;
use std::num::NonZeroU64;
use std::ops::ControlFlow;
use std::path::Path;

/// Runs the task until it is stopped.
pub(crate) fn run(options: &CentreOptions) -> Result<Ending, Error> {
    let file = &options.configuration;
    if options.init {
        return init::run(options);
    }
    let given = Configuration::read(file)?;
    if let Some(number) = options.sensor_file {
        return init::print_sensor(file, &given, number);
    }
    match Place::of(&given.listen).map_err(configured(file))? {
        Place::Udp(address) => over(options, &given, Some(|| Ok(Udp::bind(address)?))),
        #[cfg(feature = "mqtt")]
        Place::Mqtt { broker, fleet } => over(
            options,
            &given,
            Some(|| {
                let broker = crate::place::mqtt(broker).map_err(configured(file))?;
                Ok(fewbits_link::mqtt::Mqtt::centre(broker, fleet)?)
            }),
        ),
        #[cfg(feature = "mqtt")]
        Place::Lorawan { broker, server, port } => over(
            options,
            &given,
            Some(|| {
                let broker = crate::place::mqtt(broker).map_err(configured(file))?;
                Ok(fewbits_link::mqtt::Lorawan::centre(broker, server, port)?)
            }),
        ),
        #[cfg(feature = "zenoh")]
        Place::Zenoh { endpoint, fleet } => over(
            options,
            &given,
            Some(|| {
                let session = crate::place::zenoh(endpoint, true).map_err(configured(file))?;
                Ok(fewbits_link::zenoh::Zenoh::centre(session, fleet)?)
            }),
        ),
    }
}

/// Runs `check`: names all faults of a configuration of a centre or a sensor without using it.
pub(crate) fn check(file: &Path) -> Result<Ending, Error> {
    let table = crate::private::table(file)?;
    if table.contains_key("centre") && !table.contains_key("listen") {
        return crate::sensor::check(file);
    }
    let given = Configuration::read(file)?;
    let options = CentreOptions::of(file);
    // Only addresses over UDP are texts with a form.
    match Place::of(&given.listen).map_err(configured(file))? {
        Place::Udp(_) => over::<Udp, fn() -> Result<Udp, Error>>(&options, &given, None)?,
        #[cfg(any(feature = "mqtt", feature = "zenoh"))]
        _ => Ending::Good,
    };
    let (name, sensors, period) = (file.display(), given.sensors.len(), given.period);
    crate::output::print(&format!(
        "{name}: no fault; {sensors} sensors, slots of {period} s
"
    ))?;
    Ok(Ending::Good)
}

/// Runs the task over the transport that `open` returns. It is called after everything else has been checked; without it, that is all.
fn over<T: Transport, O: FnOnce() -> Result<T, Error>>(
    options: &CentreOptions,
    given: &Configuration,
    open: Option<O>,
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
    open: Option<impl FnOnce() -> Result<T, Error>>,
    world: Result<impl Evolution<D> + 'static, fewbits_models::Error>,
) -> Result<Ending, Error> {
    let file = &options.configuration;
    let mut faults = Faults::default();
    let world = world.map_err(configured(file))?;
    let prior = |numbers: &[f64]| SVector::<f64, D>::from_fn(|i, _| numbers.get(i).copied().unwrap_or_default());
    let variances = prior(&given.prior.deviation).map(|deviation| deviation * deviation);
    let prior =
        Gaussian::new(prior(&given.prior.mean), SMatrix::from_diagonal(&variances)).map_err(configured(file))?;
    let stream = Stream::new(given.seed);
    let mut centre =
        FusionCentre::new(&mut stream.named("prior").rng(), world, MomentFilter, &prior).map_err(configured(file))?;
    let mut peers = Vec::new();
    for sensor in &given.sensors {
        let number = sensor.number;
        if let Err(error) = join(&mut centre, sensor) {
            faults.add(format_args!("sensor {number}: {error}"));
        }
        let address = sensor.address.as_ref().and_then(|text| {
            let address = text.parse().ok();
            if address.is_none() {
                faults.add(format_args!("sensor {number}: {text} is no address"));
            }
            address
        });
        peers.push(Peer {
            number,
            key: sensor.key.clone(),
            address,
        });
    }
    if !faults.0.is_empty() {
        return Err(faults.error(file));
    }
    let Some(open) = open else { return Ok(Ending::Good) };
    let period = NonZeroU64::new((given.period * 1e9).round() as u64).unwrap_or(NonZeroU64::MIN);
    let member = |sensor: &Sensor| Member {
        feedback: Feedback::Told,
        report: sensor.report.length(),
    };
    let members = given.sensors.iter().map(member).collect();
    let mut settings = CentreSettings::new(members, Schedule::new(period));
    let meaning = |sensor: &Sensor| sensor.report.meaning(sensor.deviation(), (D, sensor.measured.reads));
    settings.meanings = given.sensors.iter().map(meaning).collect();
    let store = given.state.clone().map(|path| match given.durable {
        true => Store::new(path).durable(),
        false => Store::new(path),
    });
    let receiver = FusionReceiver::new(centre, given.period, stream);
    if store.is_none() {
        say!("note: no `state`: frames that were accepted before this start cannot be refused as replays");
    }
    let start = match options.new_start {
        true => Start::Anew,
        false => Start::Continue,
    };
    let mut station = Station::starting(start, settings, receiver, peers, store)?;
    serve(options, given, open()?, &mut station, D)
}

fn join<const D: usize>(centre: &mut FusionCentre<D, MomentFilter>, sensor: &Sensor) -> Result<(), Failure> {
    let remote = sensor.report.remote(sensor.measured, Link::lossy(sensor.loss)?)?;
    Ok(centre.join_boxed(sensor.number, remote)?)
}

fn serve<R: Receiver, T: Transport>(
    options: &CentreOptions,
    given: &Configuration,
    mut transport: T,
    station: &mut Station<R, T::Address>,
    coordinates: usize,
) -> Result<Ending, Error> {
    let numbers: Vec<u32> = given.sensors.iter().map(|sensor| sensor.number).collect();
    let mut rows = Rows::new(options.format(), coordinates, given.period, numbers.clone());
    let reports = given.sensors.iter().map(|sensor| sensor.report).collect();
    let mut log = Log::new(numbers.clone(), reports, given.period);
    rows.head()?;
    // The last step may not have been written before the process was stopped.
    if let Some(step) = station.last_step() {
        rows.write(step, 0)?;
    }
    let page = match options.live {
        Some(address) => {
            let page = fewbits_link::LivePage::serve(address, numbers.clone(), given.period)?;
            let name = |(name, unit): (String, String)| {
                if unit.is_empty() {
                    name
                } else {
                    format!("{name} ({unit})")
                }
            };
            let page = page.with_names(given.named().into_iter().map(name).collect());
            say!("page at http://{}/", page.address());
            Some(page)
        }
        None => None,
    };
    let home = home::Home::open(given, &numbers)?;
    let mut remaining = options.slots;
    // A signal ends the centre after the step of the slot, which is stored: another process goes on with the next slot.
    let stopped = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let stop = stopped.clone();
    crate::interrupt::on_stop(move || {
        say!("stopping after this slot; a second signal stops at once");
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    let mut has_step = false;
    // What is called at each step can only say whether to go on: its error is kept until the station has ended.
    let mut outcome = Ok(());
    run_station(&mut transport, station, |station, outputs| {
        for output in outputs {
            log.take(output);
            if let Output::Step(step) = output {
                outcome = rows.write(step, station.counts().refused());
                if let Some(page) = &page {
                    page.show(step, station.counts());
                }
                if let Some(home) = &home {
                    home.show(step);
                }
                has_step = true;
                if let Some(remaining) = &mut remaining {
                    *remaining = remaining.saturating_sub(1);
                }
            }
        }
        log.look(station);
        let is_over = std::mem::take(&mut has_step) && stopped.load(std::sync::atomic::Ordering::Relaxed);
        match outcome.is_err() || remaining == Some(0) || is_over {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })?;
    outcome?;
    if transport.dropped() > 0 {
        say!("{} datagrams were dropped: they came faster than they could be read", transport.dropped());
    }
    log.finish(station, options.json)
}
