//! The two worlds of the comparison, and every scheme over them.
//!
//! A scheme that is added is in all figures: give it a [`Scheme`], its label, and an arm of [`World::run`].

use super::bill::Bill;
use super::receivers::{Followers, Halves, LookUp, Patterns, SendAll, bits, each, mixed, over_bits};
use super::schemes::{Scheme, Talk};
use crate::prelude::*;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Decoder, PatternSensor, Source};
use fewbits_cfwmd::centre::CensoringEstimator;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::factor::Value;
use fewbits_core::{Belief, Gaussian, LinearDynamics, Link, NumberFormat, Observed, SchemeNode, Sensing, SensorNode};
use fewbits_densities::Mixture;
use fewbits_dymbo::{
    CountFusion, InnovationWord, MultibitFilter, ParallelEstimator, ParallelFilter, Prediction, ScalarEstimator,
    ScalarFilter, ScalarPlant,
};
use fewbits_filters::kalman;
use fewbits_handoff::{Coded, HandoffFilter, Leaders};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::WireFormat;
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, PLANE_POSITION, constant_velocity_2d};
use fewbits_network::{BitStar, Clock, Field, Radio, Seconds, SensorId, Setup, Walk};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use fewbits_protocol::{BoxError, Feedback, Receiver, ReportLength};
use fewbits_quantizer_design::{Criterion, Newton, ObservationModel, System, design};
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

/// What a word of the innovation is told.
fn asked(measured: &Gaussian<1>) -> Prediction {
    Prediction {
        mean: measured.mean()[0],
        deviation: measured.covariance()[0].sqrt(),
    }
}

fn nothing(_: &Gaussian<1>) {}

impl<const D: usize, G: LinearDynamics<D> + Clone + Send + Sync + 'static> World<D, G> {
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

    fn over_star<R, C, N>(&self, halves: Halves<R, C, N>, stream: Stream, slots: usize) -> Result<Bill, Error>
    where
        R: Receiver,
        C: Fn() -> Result<R, BoxError> + Send + Sync + 'static,
        N: Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static,
    {
        self.over_star_of(&self.sensors, halves, stream, slots)
    }

    /// The same with measurements of other sensors.
    fn over_star_of<R, C, N>(
        &self,
        sensors: &[impl Sensing<D, 1>],
        halves: Halves<R, C, N>,
        stream: Stream,
        slots: usize,
    ) -> Result<Bill, Error>
    where
        R: Receiver,
        C: Fn() -> Result<R, BoxError> + Send + Sync + 'static,
        N: Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static,
    {
        let (truths, mut measurements) = self.draw(sensors, stream, slots);
        let reporting = (halves.centre)().map_err(Error::Failed)?.sensors();
        measurements.iter_mut().for_each(|slot| slot.truncate(reporting));
        let (clock, own) = (clock()?, stream.named("filter"));
        let Halves {
            centre,
            feedback,
            report,
            node,
            ..
        } = halves;
        let star = BitStar::new(centre, feedback, report, node, measurements, clock, own);
        let mut network = star.and_then(|star| star.simulate(RADIUS, setup(stream)?))?;
        network.run_until(clock.end(slots as u32))?;
        let squared = self.squared(&truths, &network.nodes()[0].means());
        Ok(Bill::of(network.ledger(), 1, squared, slots))
    }

    fn censors(
        &self,
        threshold: f64,
        shared: bool,
        slots: usize,
    ) -> Result<CensoringEstimator<G, LinearSensor<D, 1>, D, 1>, Error> {
        let network = Network::new(self.sensors.clone(), threshold, Link::PERFECT)?.with_format(self.fine);
        if shared {
            return Ok(CensoringEstimator::told(network, self.dynamics.clone(), self.start));
        }
        Ok(CensoringEstimator::own(network, self.dynamics.clone(), self.start, slots)?)
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
        let leaders: Vec<_> = (0..slots).map(|k| (k % SENSORS) as u32).collect();
        let walker = Leaders {
            filter: HandoffFilter::new(300, reducer)?,
            dynamics: self.dynamics.clone(),
            start: Mixture::single(&self.start)?,
            readings: readings.collect::<Result<Vec<Vec<_>>, Error>>()?,
            leaders,
        };
        let clock = clock()?;
        let walk = Walk::new(walker, clock, slots as u32, stream.named("filter"))?;
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
            Scheme::Words { bits: m, talk } => {
                let scheme = InnovationWord::new(1.0, m)?;
                let centre = mixed(self.dynamics.clone(), self.start, self.sensors.clone(), scheme, asked);
                self.over_star(Halves::new(centre, talk.feedback(), bits(m), each(scheme)), stream, slots)?
            }
            Scheme::Censored { messages, shared, talk } => {
                let threshold = Budget::new(messages, SENSORS).and_then(|b| b.threshold(1))?;
                let censors = self.censors(threshold, shared, slots)?;
                let nodes = censors.clone();
                let node = move |i| -> Box<dyn SensorNode<1>> { Box::new(nodes.node(i)) };
                let length = bits(self.fine.bits() as usize);
                self.over_star(Halves::new(over_bits(censors), talk.feedback(), length, node), stream, slots)?
            }
            Scheme::AllSend { coarse } => {
                let format = if coarse { self.coarse } else { self.fine };
                let scheme = SendAll::new(1.0, format)?;
                let centre = mixed(self.dynamics.clone(), self.start, self.sensors.clone(), scheme.clone(), nothing);
                let length = bits(format.bits() as usize);
                self.over_star(Halves::new(centre, Feedback::Clock, length, each(scheme)), stream, slots)?
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
                let node = followers.nodes();
                let centre = over_bits(followers);
                self.over_star(Halves::new(centre, Feedback::Clock, ReportLength::Varying, node), stream, slots)?
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
    fn ranges(&self, m: usize, talk: Talk, stream: Stream, slots: usize) -> Result<Bill, Error> {
        let noise = RangeNoise::constant(1.0)?;
        let places = [[-FAR, 0.0], [0.0, -FAR], [FAR, 0.0], [0.0, FAR]];
        let sensor = |place: [f64; 2]| {
            RangeSensor::new(place.into(), noise)
                .and_then(|sensor| sensor.on_axes::<4>(PLANE_POSITION))
                .map_err(Error::failed)
        };
        let sensors = places.map(sensor).into_iter().collect::<Result<Vec<_>, _>>()?;
        let loading = optimal_loading(1 << m)?;
        let scheme = QuantizedRange::new(1 << m, noise)?;
        // In single precision, as it travels.
        let asked = move |measured: &Gaussian<1>| RangeReference {
            centre: f64::from(measured.mean()[0] as f32),
            half_width: f64::from((loading * measured.covariance()[0].sqrt()) as f32),
        };
        let centre = mixed(self.dynamics, self.start, sensors.clone(), scheme.clone(), asked);
        self.over_star_of(&sensors, Halves::new(centre, talk.feedback(), bits(m), each(scheme)), stream, slots)
    }
}

impl World<1, Ar1> {
    pub(super) fn run(&self, scheme: Scheme, stream: Stream, slots: usize) -> Result<Bill, Error> {
        if let Some(bill) = self.shared(scheme, stream, slots)? {
            return Ok(bill);
        }
        let plant = ScalarPlant::new(COEFFICIENT, PROCESS, 1.0)?;
        let (start, deviation) = (self.start, self.start.standard_deviations()[0]);
        let scene = || ObservationModel::gaussian_with_deviations(deviation, &[1.0; SENSORS]).map_err(Error::failed);
        let table = |system: &System, levels: usize| {
            let look_up = LookUp::new(system, 10_000)?;
            let schemes = look_up.schemes().to_vec();
            let node = move |i: usize| -> Box<dyn SensorNode<1>> { Box::new(SchemeNode::new(schemes[i].clone())) };
            let length = bits(levels.next_power_of_two().trailing_zeros() as usize);
            self.over_star(Halves::new(over_bits(look_up), Feedback::Clock, length, node), stream, slots)
        };
        match scheme {
            Scheme::SignBits { sensors, talk } => {
                let counted = ParallelEstimator::new(ParallelFilter::new(plant, sensors, CountFusion::Exact)?, start)?;
                let node = each(counted.scheme());
                self.over_star(Halves::new(over_bits(counted), talk.feedback(), bits(1), node), stream, slots)
            }
            Scheme::Word { bits: m, talk } => {
                let filter = MultibitFilter::new(plant, m)?;
                let node = each(filter.scheme());
                let single = over_bits(ScalarEstimator { filter, start });
                self.over_star(Halves::new(single, talk.feedback(), bits(m), node), stream, slots)
            }
            Scheme::Information { levels } => {
                let from = System::lloyd_max(scene()?, levels)?;
                let best = design::joint(&from, Criterion::MutualInformation, &Newton::default());
                table(&best?.system, levels)
            }
            Scheme::LloydMax { levels } => table(&System::lloyd_max(scene()?, levels)?, levels),
            Scheme::Patterned => {
                let edges = [vec![0.0], vec![-1.0, 1.0], vec![0.0], vec![-1.5, 0.0, 1.5]];
                let sensor = |edges: Vec<f64>| {
                    let cells = BinaryQuantizer::new(edges.iter().map(|e| e * deviation).collect())?;
                    PatternSensor::with_deviation(cells, 1.0)
                };
                let sensors: Vec<_> = edges.into_iter().map(sensor).collect::<Result<_, _>>()?;
                let source = Source::gaussian_with_deviation(deviation)?;
                let table = Bank::new(source, sensors.clone()).and_then(|bank| bank.table(Decoder::Mmse));
                let patterns = over_bits(Patterns::new(sensors.len(), table?, deviation * deviation)?);
                let node = move |i: usize| -> Box<dyn SensorNode<1>> { Box::new(SchemeNode::new(sensors[i].clone())) };
                self.over_star(Halves::new(patterns, Feedback::Clock, bits(1), node), stream, slots)
            }
            Scheme::Filtered { levels } => {
                let spread = (deviation * deviation + 1.0).sqrt();
                let design = lloyd_max::gaussian(levels).and_then(|design| design.affine(0.0, spread));
                let quantizer = Quantizer::from(&design?);
                let labels = Labelling::gray(levels)?;
                let scheme = QuantizingSensor::with_variance(quantizer, labels, 1.0)?;
                let centre = mixed(self.dynamics, start, self.sensors.clone(), scheme.clone(), nothing);
                let length = bits(levels.trailing_zeros() as usize);
                self.over_star(Halves::new(centre, Feedback::Clock, length, each(scheme)), stream, slots)
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
