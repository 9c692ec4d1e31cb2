//! The two worlds of the comparison, and what a scheme costs over them.
//!
//! A scheme of your own needs its two halves: [`World::of_scheme`] or [`World::star`] makes an [`Entry`] of them, which runs on the same
//! truths, noise and radio as those of [`schemes`](super::schemes).

use super::receivers::{each, mixed, over_bits};
use crate::prelude::*;
use fewbits_baselines::over_bits::Estimator;
use fewbits_core::factor::Value;
use fewbits_core::{LinearDynamics, MeasurementNoise, NumberFormat, Scheme, SensorNode};
use fewbits_densities::Mixture;
use fewbits_filters::kalman;
use fewbits_handoff::{Coded, HandoffFilter, Leaders};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::WireFormat;
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, constant_velocity_2d};
use fewbits_network::{Account, BitStar, Clock, Field, Ledger, Radio, Seconds, SensorId, Setup, Walk};
use fewbits_protocol::{BoxError, Feedback, Member, Receiver, ReportLength};

/// Sensors of either world; their noise has unit variance.
pub const SENSORS: usize = 4;
/// Coefficient of the scalar world.
pub const COEFFICIENT: f64 = 0.95;
/// Process variance of the scalar world.
pub const PROCESS: f64 = 0.2;
/// Acceleration variance of the target in the plane.
const ACCELERATION: f64 = 0.05;
/// Slots before errors count.
const WARM_UP: usize = 20;
/// Length of a slot of the comparison.
const PERIOD: f64 = 0.1;
/// Distance of the sensors from the centre, metres.
pub(super) const RADIUS: f64 = 20.0;

/// A world: how it moves, who senses it, and what is known of it beforehand.
#[derive(Debug, Clone)]
pub struct World<const D: usize, G> {
    pub(super) dynamics: G,
    pub(super) sensors: Vec<LinearSensor<D, 1>>,
    pub(super) start: Gaussian<D>,
    /// What all-send and the censoring sensors send in.
    pub(super) fine: NumberFormat,
    /// Largest size of what all-send sends in few bits, and how many.
    pub(super) coarse: (f64, u32),
    /// How far from its start the state may get, for codes of where it is.
    reach: f64,
    /// Coordinates that count.
    counted: &'static [usize],
    /// Slots of a run.
    pub(super) slots: usize,
}

type Truths<const D: usize> = Vec<SVector<f64, D>>;
type Measurements = Vec<Vec<Vector1<f64>>>;

/// The scalar world, in its stationary state.
///
/// # Errors
/// Never for the constants here.
pub fn scalar(slots: usize) -> Result<World<1, Ar1>, Error> {
    let dynamics = Ar1::new(COEFFICIENT, PROCESS)?;
    let variance = dynamics.stationary_variance()?;
    Ok(World {
        dynamics,
        sensors: vec![LinearSensor::direct(1.0)?; SENSORS],
        start: Gaussian::scalar(0.0, variance)?,
        fine: NumberFormat::Single,
        coarse: (8.0, 8),
        reach: 16.0,
        counted: &[0],
        slots,
    })
}

/// A target in the plane at about constant velocity; two sensors of either coordinate.
///
/// # Errors
/// Never for the constants here.
pub fn plane(slots: usize) -> Result<World<4, LinearGaussian<4, 2>>, Error> {
    let along = [Vector4::new(1.0, 0.0, 0.0, 0.0), Vector4::new(0.0, 0.0, 1.0, 0.0)];
    let sensor = |i: usize| LinearSensor::scalar(along[i % 2], 1.0);
    Ok(World {
        dynamics: constant_velocity_2d(1.0, ACCELERATION)?,
        sensors: (0..SENSORS).map(sensor).collect::<Result<_, _>>()?,
        start: Gaussian::new(Vector4::new(0.0, 1.0, 0.0, -1.0), Matrix4::identity() * 0.5)?,
        fine: NumberFormat::Single,
        coarse: (4096.0, 13),
        // The acceleration takes it 700 away in 300 slots, one standard deviation.
        reach: 1e4,
        counted: &[0, 2],
        slots,
    })
}

/// What one run came to, a slot on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bill {
    /// Squared error.
    pub squared: f64,
    /// Payload bits of reports, or of beliefs that travel.
    pub reports: f64,
    /// Bits on air with everything.
    pub air: f64,
    /// Energy of all radios, J.
    pub joules: f64,
    /// Energy of the busiest sensor's radio beyond what it takes asleep, J.
    pub busiest: f64,
}

impl Bill {
    /// `first` is the first node that is a sensor.
    fn of(ledger: &Ledger, first: usize, squared: f64, slots: usize) -> Self {
        let (n, all) = (slots as f64, ledger.messages());
        let sensors = &ledger.accounts()[first..];
        let asleep = Radio::cc2420(0.0).map_or(0.0, |radio| radio.sleep.value());
        let spent = |a: &Account| a.sending.value() + a.receiving.value() - asleep * a.awake.value();
        Self {
            squared,
            reports: sensors.iter().map(|account| account.payload.0 as f64).sum::<f64>() / n,
            air: all.air.0 as f64 / n,
            joules: (all.sending.value() + all.receiving.value()) / n,
            busiest: sensors.iter().map(spent).fold(0.0, f64::max) / n,
        }
    }
}

type Run = dyn Fn(Stream) -> Result<Bill, Error> + Send + Sync;

/// A scheme at one setting in one world.
pub struct Entry {
    /// The scheme without its setting.
    pub family: &'static str,
    /// Its setting.
    pub setting: String,
    /// How sensors learn the question.
    pub feedback: &'static str,
    run: Box<Run>,
}

impl Entry {
    /// One run on the truth, noise and radio of a trial's stream.
    ///
    /// # Errors
    /// If an estimator or a sensor fails.
    pub fn run(&self, stream: Stream) -> Result<Bill, Error> {
        (self.run)(stream)
    }
}

/// Least root mean squared error at `rate` bits a slot: the error of the Kalman filter of all measurements, and on top the causal
/// rate-distortion function of its estimate, an AR(1) process of innovation variance `before - after`.
pub fn floor_at(rate: f64, [before, after]: [f64; 2]) -> f64 {
    (after + (before - after) / (4.0_f64.powf(rate) - COEFFICIENT * COEFFICIENT)).sqrt()
}

/// A scheme and its setting.
pub(super) type Name = (&'static str, String);

impl<const D: usize, G: LinearDynamics<D> + Clone + Send + Sync + 'static> World<D, G> {
    /// The least squared error of all measurements, by the Kalman filter that has them all: before and after those of a slot.
    ///
    /// # Errors
    /// If a covariance is singular.
    pub fn everything(&self) -> Result<[f64; 2], Error> {
        let of = |b: &Gaussian<D>| self.counted.iter().map(|i| b.covariance()[(*i, *i)]).sum();
        let (mut belief, mut last) = (self.start, [0.0; 2]);
        for _ in 0..500 {
            let predicted = kalman::predict(&self.dynamics, &belief);
            belief = predicted;
            for sensor in &self.sensors {
                let expected = sensor.mean(belief.mean());
                belief = kalman::update(sensor, &belief, &expected)?.0;
            }
            last = [of(&predicted), of(&belief)];
        }
        Ok(last)
    }

    /// Truth and measurements of a trial.
    pub(super) fn draw(&self, sensors: &[impl Sensing<D, 1>], stream: Stream) -> (Truths<D>, Measurements) {
        let mut rng = stream.named("world").rng();
        let mut state = self.start.sample(&mut rng);
        let slot = |_| {
            state = self.dynamics.propagate(&mut rng, &state);
            let measured = sensors.iter().map(|sensor| sensor.sample(&mut rng, &state));
            (state, measured.collect())
        };
        (0..self.slots).map(slot).unzip()
    }

    /// Mean squared error after the first slots.
    pub(super) fn squared(&self, truths: &Truths<D>, estimates: &[Vec<f64>]) -> f64 {
        let pairs = truths.iter().zip(estimates).skip(WARM_UP);
        let count = pairs.len().max(1) as f64;
        let error = |(truth, estimate): (&SVector<f64, D>, &Vec<f64>)| {
            let gap = |i: &usize| (truth[*i] - estimate.get(*i).copied().unwrap_or(0.0)).powi(2);
            self.counted.iter().map(gap).sum::<f64>()
        };
        pairs.map(error).sum::<f64>() / count
    }

    /// Both halves of a scheme over a star: `centre` makes the receiver before its first slot, `node` the half of a sensor (the first is 0).
    /// The receiver says how many of the `sensors` report.
    pub fn star<R, S, C, N>(&self, (family, setting): Name, sensors: &[S], member: Member, centre: C, node: N) -> Entry
    where
        R: Receiver + 'static,
        S: Sensing<D, 1> + Clone + Send + Sync + 'static,
        C: Fn() -> Result<R, BoxError> + Clone + Send + Sync + 'static,
        N: Fn(usize) -> Box<dyn SensorNode<1>> + Clone + Send + Sync + 'static,
    {
        let (world, sensors) = (self.clone(), sensors.to_vec());
        let run = move |stream: Stream| {
            let (truths, mut measurements) = world.draw(&sensors, stream);
            let reporting = centre().map_err(Error::failed)?.sensors();
            measurements.iter_mut().for_each(|slot| slot.truncate(reporting));
            let (clock, own) = (clock()?, stream.named("filter"));
            let Member { feedback, report } = member;
            let star = BitStar::new(centre.clone(), feedback, report, node.clone(), measurements, clock, own)?;
            let mut network = star.simulate(RADIUS, setup(stream)?)?;
            network.run_until(clock.end(world.slots as u32))?;
            let squared = world.squared(&truths, &network.nodes()[0].means());
            Ok(Bill::of(network.ledger(), 1, squared, world.slots))
        };
        Entry {
            family,
            setting,
            feedback: match member.feedback {
                Feedback::Told => "told",
                Feedback::Echoed => "echoed",
                _ => "none",
            },
            run: Box::new(run),
        }
    }

    /// Sensors that all report by one scheme without memory, under the fusion centre of `fewbits-filters`. `ask` makes of a predicted
    /// measurement what its sensor is told.
    pub fn of_scheme<S, C>(
        &self,
        name: Name,
        sensors: &[S],
        member: Member,
        scheme: C,
        ask: impl Fn(&Gaussian<1>) -> C::Feedback + Clone + Send + Sync + 'static,
    ) -> Entry
    where
        S: Sensing<D, 1> + Clone + Send + Sync + 'static,
        C: Scheme<1> + MeasurementNoise<1> + Clone + Send + Sync + 'static,
        C::State: 'static,
        C::Factor: 'static,
    {
        let centre = mixed(self.dynamics.clone(), self.start, sensors.to_vec(), scheme.clone(), ask);
        self.star(name, sensors, member, centre, each(vec![scheme]))
    }

    /// The world's sensors under an estimator of their own.
    pub fn of_estimator<E>(
        &self,
        name: Name,
        member: Member,
        estimator: E,
        node: impl Fn(usize) -> Box<dyn SensorNode<1>> + Clone + Send + Sync + 'static,
    ) -> Entry
    where
        E: Estimator + Clone + Send + Sync + 'static,
    {
        self.star(name, &self.sensors, member, over_bits(estimator), node)
    }

    /// A coded mixture that travels from leader to leader.
    pub(super) fn hand_off(&self, components: usize, resolution: f64) -> Entry {
        let world = self.clone();
        Entry {
            family: "hand-off",
            setting: format!("M={components} r={resolution}"),
            feedback: "travels",
            run: Box::new(move |stream| world.handed(components, resolution, stream)),
        }
    }

    fn handed(&self, components: usize, resolution: f64, stream: Stream) -> Result<Bill, Error> {
        let (truths, measurements) = self.draw(&self.sensors, stream);
        let reading =
            |(i, z): (usize, &Vector1<f64>)| Ok(Observed::new(self.sensors[i], Value::new(*z, [[1.0]].into())?));
        let readings = measurements
            .iter()
            .map(|slot| slot.iter().enumerate().map(reading).collect());
        let format = WireFormat::new(SVector::zeros(), self.reach, 1.0, &[resolution])?;
        let reducer = Coded {
            components,
            reduction: Reduction::default(),
            format,
            resolution: 0,
        };
        let walker = Leaders {
            filter: HandoffFilter::new(300, reducer)?,
            dynamics: self.dynamics.clone(),
            start: Mixture::single(&self.start)?,
            readings: readings.collect::<Result<Vec<Vec<_>>, Error>>()?,
            leaders: (0..self.slots).map(|k| (k % SENSORS) as u32).collect(),
        };
        let clock = clock()?;
        let walk = Walk::new(walker, clock, self.slots as u32, stream.named("filter"))?;
        let mut network = walk.simulate(Field::ring(SENSORS, RADIUS)?, SensorId(0), setup(stream)?)?;
        network.run_until(clock.end(self.slots as u32))?;
        let mut estimates = vec![Vec::new(); self.slots];
        for (slot, mean) in network.nodes().iter().flat_map(|node| node.estimates()) {
            if let Some(place) = estimates.get_mut(*slot as usize - 1) {
                place.clone_from(mean);
            }
        }
        Ok(Bill::of(network.ledger(), 0, self.squared(&truths, &estimates), self.slots))
    }
}

/// Sensors whose reports have so many bits.
pub fn member(feedback: Feedback, bits: u32) -> Member {
    Member {
        feedback,
        report: ReportLength::Fixed(bits),
    }
}

pub(super) fn clock() -> Result<Clock, Error> {
    Ok(Clock::new(Seconds::new(PERIOD)?)?)
}

pub(super) fn setup(stream: Stream) -> Result<Setup, fewbits_numerics::ArgumentError> {
    Ok(Setup::new(Radio::cc2420(0.0)?, stream.named("network")))
}
