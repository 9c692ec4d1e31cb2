//! The two worlds of the comparison, and every scheme over them.
//!
//! A scheme that is added is in all figures: give it a [`Scheme`], its label, and an arm of [`World::run`].

use super::schemes::{Scheme, Talk};
use crate::prelude::*;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Decoder, PatternSensor, Source};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::factor::Value;
use fewbits_core::{Belief, Gaussian, LinearDynamics, Link, NumberFormat, Observed, Sensing};
use fewbits_densities::Mixture;
use fewbits_dymbo::{CountFusion, InnovationWord, MultibitFilter, ParallelFilter, Prediction, ScalarPlant};
use fewbits_filters::{MomentFilter, kalman};
use fewbits_handoff::{Coded, HandoffFilter};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::WireFormat;
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, PLANE_POSITION, constant_velocity_2d};
use fewbits_network::estimators::{
    CensoringEstimator, DymboEstimator, Followers, Leaders, LookUp, ParallelDymboEstimator, Patterns, Reporting,
    SendAll,
};
use fewbits_network::{Clock, Field, Ledger, Radio, Replicable, Seconds, SensorId, Setup, Star, Walk};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use fewbits_quantizer_design::{Criterion, Newton, Scene, System, design};
use fewbits_quantizers::{Labelling, Quantizer, QuantizingSensor, lloyd_max};
use nalgebra::{Matrix4, SVector, Vector1, Vector4};

/// Sensors of either world; their noise has unit variance.
pub(super) const SENSORS: usize = 4;
/// Coefficient of the scalar world.
pub(super) const COEFFICIENT: f64 = 0.95;
/// Process variance of the scalar world.
pub(super) const PROCESS: f64 = 0.2;
/// Acceleration variance of the target in the plane.
const ACCELERATION: f64 = 0.05;
/// Slots before errors count.
const WARM_UP: usize = 20;
/// Length of a slot of the comparison.
const PERIOD: f64 = 0.1;
/// Distance of the sensors from the centre, metres.
pub(super) const RADIUS: f64 = 20.0;

/// Distance of the range sensors from where the target starts; it covers some 300 in the standard run.
const FAR: f64 = 10_000.0;

/// What one run came to, a slot on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bill {
    /// Squared error.
    pub(super) squared: f64,
    /// Payload bits of reports, or of beliefs that travel.
    pub(super) reports: f64,
    /// Bits on air with everything.
    pub(super) air: f64,
    /// Energy of all radios, J.
    pub(super) joules: f64,
    /// Energy of the busiest sensor's radio beyond what it takes asleep, J.
    pub(super) busiest: f64,
}

impl Bill {
    pub(super) fn numbers(&self) -> [f64; 5] {
        [self.squared, self.reports, self.air, self.joules, self.busiest]
    }

    /// `first` is the first node that is a sensor.
    fn of(ledger: &Ledger, first: usize, squared: f64, slots: usize) -> Self {
        let (n, all) = (slots as f64, ledger.messages());
        let sensors = &ledger.accounts()[first..];
        let asleep = Radio::cc2420(0.0).map_or(0.0, |radio| radio.sleep.value());
        let spent = |a: &fewbits_network::Account| a.sending.value() + a.receiving.value() - asleep * a.awake.value();
        Self {
            squared,
            reports: sensors.iter().map(|account| account.payload.0 as f64).sum::<f64>() / n,
            air: all.air.0 as f64 / n,
            joules: (all.sending.value() + all.receiving.value()) / n,
            busiest: sensors.iter().map(spent).fold(0.0, f64::max) / n,
        }
    }
}

/// A world: how it moves, who senses it, and what is known of it beforehand.
#[derive(Debug, Clone)]
pub(super) struct World<const D: usize, G> {
    dynamics: G,
    sensors: Vec<LinearSensor<D, 1>>,
    start: Gaussian<D>,
    /// What all-send and the censoring sensors send in.
    fine: NumberFormat,
    coarse: NumberFormat,
    /// How far from its start the state may get, for codes of where it is.
    reach: f64,
    /// Coordinates that count.
    counted: &'static [usize],
}

type Truths<const D: usize> = Vec<SVector<f64, D>>;
type Measurements = Vec<Vec<Vector1<f64>>>;

/// The scalar world, in its stationary state.
pub(super) fn scalar() -> Result<World<1, Ar1>, Error> {
    let dynamics = Ar1::new(COEFFICIENT, PROCESS)?;
    let variance = dynamics.stationary_variance()?;
    Ok(World {
        dynamics,
        sensors: vec![LinearSensor::direct(1.0)?; SENSORS],
        start: Gaussian::scalar(0.0, variance)?,
        fine: NumberFormat::Single,
        coarse: NumberFormat::fixed(-8.0, 8.0, 8)?,
        reach: 16.0,
        counted: &[0],
    })
}

/// A target in the plane at about constant velocity; two sensors of either coordinate.
pub(super) fn plane() -> Result<World<4, LinearGaussian<4, 2>>, Error> {
    let along = [Vector4::new(1.0, 0.0, 0.0, 0.0), Vector4::new(0.0, 0.0, 1.0, 0.0)];
    let sensor = |i: usize| LinearSensor::scalar(along[i % 2], 1.0).map_err(Error::failed);
    Ok(World {
        dynamics: constant_velocity_2d(1.0, ACCELERATION)?,
        sensors: (0..SENSORS).map(sensor).collect::<Result<_, _>>()?,
        start: Gaussian::new(Vector4::new(0.0, 1.0, 0.0, -1.0), Matrix4::identity() * 0.5)?,
        fine: NumberFormat::Single,
        coarse: NumberFormat::fixed(-4096.0, 4096.0, 13)?,
        // The acceleration takes it 700 away in 300 slots, one standard deviation.
        reach: 1e4,
        counted: &[0, 2],
    })
}

/// The question of an innovation word under unit noise.
fn asked(expected: &Gaussian<1>) -> Prediction {
    Prediction {
        mean: expected.mean()[0],
        deviation: (expected.covariance()[0] + 1.0).sqrt(),
    }
}

fn nothing(_: &Gaussian<1>) {}

impl<const D: usize, G: LinearDynamics<D> + Clone> World<D, G> {
    /// The least squared error of all measurements, by the Kalman filter that has them all: before and after those of a slot.
    pub(super) fn everything(&self) -> Result<[f64; 2], Error> {
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

    fn draw(&self, sensors: &[impl Sensing<D, 1>], stream: Stream, slots: usize) -> (Truths<D>, Measurements) {
        let mut rng = stream.named("world").rng();
        let mut state = self.start.sample(&mut rng);
        let slot = |_| {
            state = self.dynamics.propagate(&mut rng, &state);
            let measured = sensors.iter().map(|sensor| sensor.sample(&mut rng, &state));
            (state, measured.collect())
        };
        (0..slots).map(slot).unzip()
    }

    fn squared(&self, truths: &Truths<D>, estimates: &[Vec<f64>]) -> f64 {
        let pairs = truths.iter().zip(estimates).skip(WARM_UP);
        let count = pairs.len().max(1) as f64;
        let error = |(truth, estimate): (&SVector<f64, D>, &Vec<f64>)| {
            let gap = |i: &usize| (truth[*i] - estimate.get(*i).copied().unwrap_or(0.0)).powi(2);
            self.counted.iter().map(gap).sum::<f64>()
        };
        pairs.map(error).sum::<f64>() / count
    }

    fn over_star<E>(&self, e: E, talk: Talk, stream: Stream, slots: usize) -> Result<Bill, Error>
    where
        E: Replicable<Measurement = Vector1<f64>>,
    {
        self.over_star_of(&self.sensors, e, talk, stream, slots)
    }

    /// The same with measurements of other sensors.
    fn over_star_of<E>(
        &self,
        sensors: &[impl Sensing<D, 1>],
        e: E,
        talk: Talk,
        stream: Stream,
        slots: usize,
    ) -> Result<Bill, Error>
    where
        E: Replicable<Measurement = Vector1<f64>>,
    {
        let (truths, mut measurements) = self.draw(sensors, stream, slots);
        measurements.iter_mut().for_each(|slot| slot.truncate(e.sensors()));
        let clock = clock()?;
        let own = stream.named("filter");
        let star = match talk {
            Talk::Told => Star::told(e, measurements, clock, own),
            Talk::Echoed => Star::echoed(e, measurements, clock, own),
        };
        let mut network = star.and_then(|star| star.simulate(RADIUS, setup(stream)?))?;
        network.run_until(clock.end(slots as u32))?;
        let squared = self.squared(&truths, network.nodes()[0].estimates());
        Ok(Bill::of(network.ledger(), 1, squared, slots))
    }

    fn words(&self, bits: usize) -> Result<impl Replicable<Measurement = Vector1<f64>> + use<D, G>, Error> {
        Ok(Reporting {
            dynamics: self.dynamics.clone(),
            sensors: self.sensors.clone(),
            scheme: InnovationWord::new(1.0, bits)?,
            link: Link::PERFECT,
            filter: MomentFilter,
            broadcast: asked as fn(&Gaussian<1>) -> Prediction,
            start: self.start,
        })
    }

    fn censors(
        &self,
        threshold: f64,
        format: NumberFormat,
        shared: bool,
        slots: usize,
    ) -> Result<CensoringEstimator<G, LinearSensor<D, 1>, D, 1>, Error> {
        let network = Network::new(self.sensors.clone(), threshold, Link::PERFECT)?;
        if shared {
            return Ok(CensoringEstimator::told(network, format, self.dynamics.clone(), self.start));
        }
        Ok(CensoringEstimator::own(network, format, self.dynamics.clone(), self.start, slots)?)
    }

    fn handed(&self, components: usize, resolution: f64, stream: Stream, slots: usize) -> Result<Bill, Error> {
        let (truths, measurements) = self.draw(&self.sensors, stream, slots);
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
        let leaders: Vec<_> = (0..slots).map(|k| SensorId((k % SENSORS) as u32)).collect();
        let walker = Leaders {
            filter: HandoffFilter::new(300, reducer)?,
            dynamics: self.dynamics.clone(),
            start: Mixture::single(&self.start)?,
            readings: readings.collect::<Result<Vec<Vec<_>>, Error>>()?,
            leaders,
        };
        let clock = clock()?;
        let walk = Walk::new(walker, clock, slots as u32, stream.named("filter"));
        let field = Field::ring(SENSORS, RADIUS)?;
        let run = || -> Result<_, fewbits_network::Error> {
            let mut network = walk.simulate(field, SensorId(0), setup(stream)?)?;
            network.run_until(clock.end(slots as u32))?;
            Ok(network)
        };
        let network = run()?;
        let mut estimates = vec![Vec::new(); slots];
        for (slot, mean) in network.nodes().iter().flat_map(|node| node.estimates()) {
            if let Some(place) = estimates.get_mut(*slot as usize - 1) {
                place.clone_from(mean);
            }
        }
        Ok(Bill::of(network.ledger(), 0, self.squared(&truths, &estimates), slots))
    }

    /// A scheme that both worlds have; none if only the scalar one does.
    fn shared(&self, scheme: Scheme, stream: Stream, slots: usize) -> Result<Option<Bill>, Error> {
        Ok(Some(match scheme {
            Scheme::Words { bits, talk } => self.over_star(self.words(bits)?, talk, stream, slots)?,
            Scheme::Censored { messages, shared, talk } => {
                let threshold = Budget::new(messages, SENSORS).and_then(|b| b.threshold(1))?;
                self.over_star(self.censors(threshold, self.fine, shared, slots)?, talk, stream, slots)?
            }
            Scheme::AllSend { coarse } => {
                let all = Reporting {
                    dynamics: self.dynamics.clone(),
                    sensors: self.sensors.clone(),
                    scheme: SendAll::new(1.0, if coarse { self.coarse } else { self.fine })?,
                    link: Link::PERFECT,
                    filter: MomentFilter,
                    broadcast: nothing as fn(&Gaussian<1>),
                    start: self.start,
                };
                self.over_star(all, Talk::Told, stream, slots)?
            }
            Scheme::Handoff { components, resolution } => self.handed(components, resolution, stream, slots)?,
            Scheme::Followed { delta } => {
                let followers = Followers {
                    dynamics: self.dynamics.clone(),
                    sensors: self.sensors.clone(),
                    noise_variance: 1.0,
                    config: fewbits_adaptive::Config::new(delta)?,
                    start: self.start,
                };
                self.over_star(followers, Talk::Told, stream, slots)?
            }
            _ => return Ok(None),
        }))
    }
}

impl World<4, LinearGaussian<4, 2>> {
    pub(super) fn run(&self, scheme: Scheme, stream: Stream, slots: usize) -> Result<Bill, Error> {
        if let Scheme::Ranges { bits, talk } = scheme {
            return self.ranges(bits, talk, stream, slots);
        }
        let only = || fewbits_numerics::ArgumentError::new("scheme", scheme.family(), "one of the plane");
        Ok(self.shared(scheme, stream, slots)?.ok_or_else(only)?)
    }

    /// Range sensors of unit noise at [`FAR`] on the axes: to first order each has the coordinate that the world's own sensors have.
    fn ranges(&self, bits: usize, talk: Talk, stream: Stream, slots: usize) -> Result<Bill, Error> {
        let noise = RangeNoise::constant(1.0)?;
        let places = [[-FAR, 0.0], [0.0, -FAR], [FAR, 0.0], [0.0, FAR]];
        let sensor = |place: [f64; 2]| {
            RangeSensor::new(place.into(), noise)
                .and_then(|sensor| sensor.on_axes::<4>(PLANE_POSITION))
                .map_err(Error::failed)
        };
        let sensors = places.map(sensor).into_iter().collect::<Result<Vec<_>, _>>()?;
        let loading = optimal_loading(1 << bits)?;
        let ranges = Reporting {
            dynamics: self.dynamics,
            sensors: sensors.clone(),
            scheme: QuantizedRange::new(1 << bits, noise)?,
            link: Link::PERFECT,
            filter: MomentFilter,
            // In single precision, as it travels.
            broadcast: move |expected: &Gaussian<1>| RangeReference {
                centre: f64::from(expected.mean()[0] as f32),
                half_width: f64::from((loading * (expected.covariance()[0] + 1.0).sqrt()) as f32),
            },
            start: self.start,
        };
        self.over_star_of(&sensors, ranges, talk, stream, slots)
    }
}

impl World<1, Ar1> {
    pub(super) fn run(&self, scheme: Scheme, stream: Stream, slots: usize) -> Result<Bill, Error> {
        if let Some(bill) = self.shared(scheme, stream, slots)? {
            return Ok(bill);
        }
        let plant = ScalarPlant::new(COEFFICIENT, PROCESS, 1.0)?;
        let (start, deviation) = (self.start, self.start.standard_deviations()[0]);
        let scene = || Scene::gaussian_with_deviations(deviation, &[1.0; SENSORS]).map_err(Error::failed);
        let table = |system: &System| {
            let look_up = LookUp::new(system, 10_000)?;
            self.over_star(look_up, Talk::Told, stream, slots)
        };
        match scheme {
            Scheme::SignBits { sensors, talk } => {
                let filter = ParallelFilter::new(plant, sensors, CountFusion::Exact)?;
                let counted = ParallelDymboEstimator::new(filter, start)?;
                self.over_star(counted, talk, stream, slots)
            }
            Scheme::Word { bits, talk } => {
                let filter = MultibitFilter::new(plant, bits)?;
                self.over_star(DymboEstimator { filter, start }, talk, stream, slots)
            }
            Scheme::Information { levels } => {
                let from = System::lloyd_max(scene()?, levels)?;
                let best = design::joint(&from, Criterion::MutualInformation, &Newton::default());
                table(&best?.system)
            }
            Scheme::LloydMax { levels } => table(&System::lloyd_max(scene()?, levels)?),
            Scheme::Patterned => {
                let edges = [vec![0.0], vec![-1.0, 1.0], vec![0.0], vec![-1.5, 0.0, 1.5]];
                let sensor = |edges: Vec<f64>| {
                    let cells = BinaryQuantizer::new(edges.iter().map(|e| e * deviation).collect())?;
                    PatternSensor::with_deviation(cells, 1.0)
                };
                let sensors: Vec<_> = edges.into_iter().map(sensor).collect::<Result<_, _>>()?;
                let source = Source::gaussian_with_deviation(deviation)?;
                let table = Bank::new(source, sensors.clone()).and_then(|bank| bank.table(Decoder::Mmse));
                let patterns = Patterns::new(sensors, table?, deviation * deviation);
                self.over_star(patterns?, Talk::Told, stream, slots)
            }
            Scheme::Filtered { levels } => {
                let spread = (deviation * deviation + 1.0).sqrt();
                let design = lloyd_max::gaussian(levels).and_then(|design| design.affine(0.0, spread));
                let quantizer = Quantizer::from(&design?);
                let labels = Labelling::gray(levels)?;
                let reporting = Reporting {
                    dynamics: self.dynamics,
                    sensors: self.sensors.clone(),
                    scheme: QuantizingSensor::with_variance(quantizer, labels, 1.0)?,
                    link: Link::PERFECT,
                    filter: MomentFilter,
                    broadcast: nothing as fn(&Gaussian<1>),
                    start,
                };
                self.over_star(reporting, Talk::Told, stream, slots)
            }
            other => {
                Err(fewbits_numerics::ArgumentError::new("scheme", other.family(), "one of the scalar world").into())
            }
        }
    }
}

pub(super) fn clock() -> Result<Clock, Error> {
    Ok(Clock::new(Seconds::new(PERIOD)?)?)
}

pub(super) fn setup(stream: Stream) -> Result<Setup, fewbits_numerics::ArgumentError> {
    Ok(Setup::new(Radio::cc2420(0.0)?, stream.named("network")))
}
