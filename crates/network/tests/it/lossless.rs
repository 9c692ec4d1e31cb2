//! A network without faults gives, to the last bit, the estimates of the estimator alone, and its ledger has the estimator's bits.

use crate::worlds::{TwoSided, clock, counted, plane, plane_sensors, plane_start, plant, scalar, setup, start};
use fewbits_adaptive::{Config, Receiver};
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Decoder, PatternSensor, Source};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_core::factor::{InCell, Value};
use fewbits_core::{
    BitString, Cell, Dynamics, Gaussian, Link, Message, NumberFormat, Observation, Observed, Scheme, Sensing, Sign,
};
use fewbits_densities::{Grid, Mixture, PointMass};
use fewbits_diffusive::{RateModel, RateRange, Search, SearchBox, SourceSensor, Status};
use fewbits_dymbo::{
    CountFusion, DymboFilter, InnovationWord, MultibitFilter, ParallelFilter, Prediction, ScalarFilter,
};
use fewbits_filters::{MomentFilter, PointMassFilter, PointMasses, assumed_density, kalman};
use fewbits_handoff::{Coded, HandoffFilter};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::WireFormat;
use fewbits_models::diffusion::{Air, Ground};
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use fewbits_network::estimators::{
    CensoringEstimator, DymboEstimator, Followers, Leaders, LookUp, Patterns, Reporting, SourceChain,
};
use fewbits_network::{Estimator, Field, Ledger, Replicable, SensorId, Star, Walk};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor};
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::{Scene, System};
use fewbits_quantizers::Symbol;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Matrix4, RowVector4, Vector1, Vector2, Vector3};

const SLOTS: usize = 40;

/// Bits that the sensors reported, and what the centre told.
#[derive(Debug, PartialEq)]
struct Price {
    up: u64,
    down: u64,
}

impl Price {
    fn of(up: u64, down: u64) -> Self {
        Self { up, down }
    }
}

fn price(ledger: &Ledger) -> Price {
    Price {
        up: ledger.accounts()[1..].iter().map(|account| account.payload.0).sum(),
        down: ledger.accounts()[0].payload.0,
    }
}

fn told<E: Estimator>(estimator: E, measurements: &[Vec<E::Measurement>]) -> (Vec<Vec<f64>>, Price)
where
    E::Measurement: Clone,
{
    let star = Star::told(estimator, measurements.to_vec(), clock(), Stream::new(9)).unwrap();
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(measurements.len() as u32)).unwrap();
    assert_eq!(network.log().entries, []);
    (network.nodes()[0].estimates().to_vec(), price(network.ledger()))
}

/// The same by echo and without a centre: the same estimates, and every replica has them.
fn everywhere<E: Replicable + Clone>(estimator: &E, measurements: &[Vec<E::Measurement>], alone: &[Vec<f64>], up: u64)
where
    E::Measurement: Clone,
    E::Belief: PartialEq + std::fmt::Debug,
{
    let slots = measurements.len() as u32;
    let star = Star::echoed(estimator.clone(), measurements.to_vec(), clock(), Stream::new(9)).unwrap();
    let mut network = star.simulate(10.0, setup(2)).unwrap();
    network.run_until(clock().end(slots)).unwrap();
    assert_eq!(network.nodes()[0].estimates(), alone);
    assert_eq!((network.log().entries.len(), price(network.ledger()).up), (0, up));
    for sensor in &network.nodes()[1..] {
        let (slot, belief) = sensor.belief().unwrap();
        assert_eq!((slot, estimator.mean(belief)), (slots - 1, alone[slots as usize - 2].clone()));
    }
}

fn mean(belief: &Gaussian<1>) -> Vec<f64> {
    vec![belief.mean()[0]]
}

#[test]
fn one_bit_a_sample() {
    let (filter, measurements) = (DymboFilter::new(plant()), scalar(1, SLOTS, 1));
    let (mut belief, mut bits) = (start(), 0);
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let bit = Sign::of(z[0][0], filter.threshold(&belief)).unwrap();
            let (next, info) = filter.step(&belief, &Observation::Received(bit)).unwrap();
            (belief, bits) = (next, bits + u64::from(info.bits));
            mean(&belief)
        })
        .collect();
    let estimator = DymboEstimator { filter, start: start() };
    let (estimates, price) = told(estimator.clone(), &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(bits, 64 * SLOTS as u64));
    everywhere(&estimator, &measurements, &alone, bits);
}

#[test]
fn one_to_eight_bits_a_sample() {
    let measurements = scalar(1, SLOTS, 2);
    for bits in 1..=8 {
        let filter = MultibitFilter::new(plant(), bits).unwrap();
        let (mut belief, mut sent, mut rng) = (start(), 0, Stream::new(0).rng());
        let alone: Vec<_> = measurements
            .iter()
            .map(|z| {
                let (next, info) = filter.exchange(&mut rng, &belief, z[0][0]).unwrap();
                (belief, sent) = (next, sent + u64::from(info.bits));
                mean(&belief)
            })
            .collect();
        let estimator = DymboEstimator { filter, start: start() };
        let (estimates, price) = told(estimator.clone(), &measurements);
        assert_eq!(estimates, alone);
        assert_eq!(price, Price::of(sent, 128 * SLOTS as u64));
        everywhere(&estimator, &measurements, &alone, sent);
    }
}

#[test]
fn several_one_bit_sensors() {
    let measurements = scalar(3, SLOTS, 3);
    let filter = ParallelFilter::new(plant(), 3, CountFusion::Linear).unwrap();
    let mut belief = start();
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let threshold = filter.threshold(&belief);
            let bit = |z: &Vector1<f64>| Observation::Received(Sign::of(z[0], threshold).unwrap());
            belief = filter.step(&belief, &z.iter().map(bit).collect::<Vec<_>>()).unwrap().0;
            mean(&belief)
        })
        .collect();
    let (estimates, price) = told(counted(Link::PERFECT), &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * SLOTS as u64, 64 * SLOTS as u64));
    everywhere(&counted(Link::PERFECT), &measurements, &alone, 3 * SLOTS as u64);
}

#[test]
fn censoring_sensors_and_all_send() {
    let dynamics = constant_velocity_2d(1.0, 0.05).unwrap();
    let (measurements, start) = (plane(SLOTS), plane_start());
    for (threshold, format, with_covariance) in [
        (0.0, NumberFormat::Double, false),
        (0.7, NumberFormat::Double, false),
        (0.7, NumberFormat::Double, true),
        (1.0, NumberFormat::fixed(-100.0, 100.0, 12).unwrap(), false),
        (1.0, NumberFormat::Single, true),
    ] {
        let network = Network::new(plane_sensors(), threshold, Link::PERFECT).unwrap();
        let alone_network = network.clone().with_format(format);
        let mut own = vec![OwnRecursion::new(&start); 4];
        let (mut belief, mut sent, mut rng) = (start, 0, Stream::new(0).rng());
        let alone: Vec<_> = measurements
            .iter()
            .map(|z| {
                let predicted = kalman::predict(&dynamics, &belief);
                let rules: Vec<_> = if with_covariance {
                    alone_network.rules_under(&predicted).unwrap()
                } else {
                    let sensors = plane_sensors();
                    let own = own.iter_mut().zip(&sensors);
                    own.map(|(own, sensor)| {
                        let step = own.advance(&dynamics, sensor, belief.mean()).unwrap();
                        CensoringRule::new(&step.innovation_covariance, threshold).unwrap()
                    })
                    .collect()
                };
                let (observed, reports) = alone_network.transmit(&mut rng, &rules, predicted.mean(), z).unwrap();
                sent += reports as u64 * u64::from(format.bits());
                belief = alone_network
                    .fuse(&predicted, &rules, predicted.mean(), &observed)
                    .unwrap()
                    .0;
                if threshold == 0.0 {
                    // All-send is the Kalman filter.
                    let all = plane_sensors()
                        .into_iter()
                        .zip(z)
                        .fold(predicted, |b, (sensor, z)| kalman::update(&sensor, &b, z).unwrap().0);
                    assert!((all.mean() - belief.mean()).amax() < 1e-9);
                }
                belief.mean().as_slice().to_vec()
            })
            .collect();
        let estimator = if with_covariance {
            CensoringEstimator::told(network, format, dynamics, start)
        } else {
            CensoringEstimator::own(network, format, dynamics, start, SLOTS).unwrap()
        };
        let (estimates, price) = told(estimator.clone(), &measurements);
        assert_eq!(estimates, alone);
        let down = 64 * SLOTS as u64 * if with_covariance { 14 } else { 4 };
        assert_eq!(price, Price { up: sent, down });
        everywhere(&estimator, &measurements, &alone, sent);
    }
}

#[test]
fn words_in_the_plane() {
    let dynamics = constant_velocity_2d(1.0, 0.05).unwrap();
    let (measurements, scheme) = (plane(SLOTS), InnovationWord::new(1.0, 2).unwrap());
    let broadcast = |m: &Gaussian<1>| Prediction {
        mean: m.mean()[0],
        deviation: (m.covariance()[0] + 1.0).sqrt(),
    };
    let mut belief = plane_start();
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let predicted = kalman::predict(&dynamics, &belief);
            belief = predicted;
            for (sensor, z) in plane_sensors().iter().zip(z) {
                let h = sensor.matrix();
                let expected =
                    Gaussian::from_trusted_parts(h * predicted.mean(), h * predicted.covariance() * h.transpose());
                let told = broadcast(&expected);
                let word = scheme.word(z[0], &told).unwrap();
                let factor = scheme
                    .factor(&told, &Observation::Received(word), &Link::PERFECT)
                    .unwrap();
                belief = assumed_density::update(&belief, h, &factor).unwrap().0;
            }
            belief.mean().as_slice().to_vec()
        })
        .collect();
    let estimator = Reporting {
        dynamics,
        sensors: plane_sensors(),
        scheme,
        link: Link::PERFECT,
        filter: MomentFilter,
        broadcast,
        start: plane_start(),
    };
    let (estimates, price) = told(estimator.clone(), &measurements);
    assert_eq!(estimates, alone);
    // The two axes are asked different questions: two words of two numbers, one question a sensor.
    assert_eq!(price, Price::of(4 * 2 * SLOTS as u64, 4 * 128 * SLOTS as u64));
    everywhere(&estimator, &measurements, &alone, 4 * 2 * SLOTS as u64);
}

#[test]
fn a_strangers_scheme_with_an_exact_filter() {
    let (dynamics, grid) = (Ar1::new(0.9, 0.5).unwrap(), Grid::symmetric(12.0, 0.1).unwrap());
    let scheme = TwoSided {
        reach: 1.0,
        noise_variance: 1.0,
    };
    let filter = PointMassFilter::new(&dynamics, grid).unwrap();
    let prior = PointMass::normal(grid, 0.0, 2.6).unwrap();
    let (measurements, sensor) = (scalar(3, SLOTS, 4), LinearSensor::direct(1.0).unwrap());
    let mut belief = prior.clone();
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            belief = filter.predict(&belief).unwrap();
            let told = belief.mean();
            for z in z {
                let sign = Sign::of((z[0] - told).abs(), 1.0).unwrap();
                let factor = scheme
                    .factor(&told, &Observation::Received(sign), &Link::PERFECT)
                    .unwrap();
                belief.update(&Observed::new(sensor, factor)).unwrap();
            }
            vec![belief.mean()]
        })
        .collect();
    let estimator = Reporting {
        dynamics,
        sensors: vec![sensor; 3],
        scheme,
        link: Link::PERFECT,
        filter: PointMasses::new(grid),
        broadcast: |m: &Gaussian<1>| m.mean()[0],
        start: prior,
    };
    let (estimates, price) = told(estimator, &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * SLOTS as u64, 64 * SLOTS as u64));
}

#[test]
fn static_quantizers_with_a_table() {
    let deviation = start().covariance()[0].sqrt();
    let system = System::lloyd_max(Scene::gaussian_with_deviations(deviation, &[1.0; 3]).unwrap(), 4).unwrap();
    let (decoder, measurements) = (MmseDecoder::new(&system, 1000).unwrap(), scalar(3, SLOTS, 5));
    let quantizer = &system.quantizers()[0];
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let symbol = |z: &Vector1<f64>| Observation::Received(Symbol(quantizer.encode(z[0]).unwrap()));
            vec![decoder.decode(&z.iter().map(symbol).collect::<Vec<_>>()).unwrap().mean]
        })
        .collect();
    let estimator = LookUp::new(&system, 1000).unwrap();
    let (estimates, price) = told(estimator.clone(), &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * 2 * SLOTS as u64, 0));
    everywhere(&estimator, &measurements, &alone, 3 * 2 * SLOTS as u64);
}

#[test]
fn binary_patterns_with_a_table() {
    let source = Source::gaussian_with_deviation(start().covariance()[0].sqrt()).unwrap();
    let patterns = [vec![0.0], vec![-1.2, 1.2], vec![-1.8, 0.0, 1.8]];
    let sensors: Vec<_> = patterns
        .map(|edges| PatternSensor::with_deviation(BinaryQuantizer::new(edges).unwrap(), 1.0).unwrap())
        .to_vec();
    let table = Bank::new(source, sensors.clone())
        .unwrap()
        .table(Decoder::Mmse)
        .unwrap();
    let measurements = scalar(3, SLOTS, 6);
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let bits = sensors.iter().zip(z).map(|(s, z)| s.quantizer().encode(z[0]).unwrap());
            vec![table.estimate(&bits.collect::<Vec<_>>()).unwrap()]
        })
        .collect();
    let estimator = Patterns::new(sensors, table, source.variance()).unwrap();
    let (estimates, price) = told(estimator, &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * SLOTS as u64, 0));
}

#[test]
fn a_belief_from_leader_to_leader() {
    let coded = Coded {
        components: 3,
        reduction: Reduction::default(),
        format: WireFormat::new(Vector1::zeros(), 20.0, 1.0, &[0.25]).unwrap(),
        resolution: 0,
    };
    let filter = HandoffFilter::new(200, coded).unwrap();
    let dynamics = Ar1::new(0.9, 0.5).unwrap();
    let sensor = LinearSensor::<1, 1>::direct(1.0).unwrap();
    let readings: Vec<Vec<_>> = scalar(5, 15, 7)
        .into_iter()
        .map(|slot| {
            slot.into_iter()
                .map(|z| Observed::new(sensor, Value::new(z, [[1.0]].into()).unwrap()))
                .collect()
        })
        .collect();
    let leaders: Vec<_> = (0..15).map(|k| SensorId(k * 3 % 5)).collect();
    let prior = Mixture::single(&start()).unwrap();
    let (mut known, mut bits) = (prior.clone(), Vec::new());
    let alone: Vec<_> = (0..15)
        .map(|k| {
            let mut rng = Stream::new(9).named("lead").indexed(k as u64 + 1).rng();
            let reading = &readings[k][leaders[k].index()];
            let (handover, _) = filter.step(&mut rng, &known, &dynamics, reading).unwrap();
            bits.push(handover.bits().unwrap() as u64);
            known = handover.into_mixture();
            vec![known.mean()[0]]
        })
        .collect();
    let walker = Leaders {
        filter,
        dynamics,
        start: prior,
        readings,
        leaders: leaders.clone(),
    };
    let walk = Walk::new(walker, clock(), 15, Stream::new(9));
    // A line of five: leaders are up to four hops apart.
    let line = (0..5).map(|i| Vector2::new(f64::from(i) * 10.0, 0.0)).collect();
    let field = Field::new(&Deployment::given(line).unwrap(), 11.0).unwrap();
    let mut network = walk.simulate(field, leaders[0], setup(4)).unwrap();
    network.run_until(clock().end(15)).unwrap();
    let mut estimates: Vec<_> = network
        .nodes()
        .iter()
        .flat_map(|node| node.estimates().to_vec())
        .collect();
    estimates.sort_by_key(|(slot, _)| *slot);
    assert_eq!(estimates.into_iter().map(|(_, mean)| mean).collect::<Vec<_>>(), alone);
    let hops = |k: usize| leaders[k].0.abs_diff(leaders[k + 1].0);
    let expected: u64 = (0..14).map(|k| bits[k] * u64::from(hops(k))).sum();
    assert_eq!(network.ledger().messages().payload.0, expected);
    assert_eq!(network.log().entries, []);
}

#[test]
fn a_source_found_by_a_chain() {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable)
        .unwrap()
        .with_closest(1e-3)
        .unwrap();
    let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6)
        .unwrap()
        .with_reach(250.0)
        .unwrap();
    let mut rng = Stream::new(3).rng();
    let alarm = Vector2::new(44.396, 52.042);
    let deployed = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300).unwrap();
    let first = deployed.nearest_to(&alarm);
    let graph = Graph::within(deployed.positions(), 15.0).unwrap();
    let source = Vector2::new(62.0, 50.0);
    let samples: Vec<Vec<f64>> = deployed
        .positions()
        .iter()
        .map(|p| sensor.sample(&mut rng, p, &source, 1.0))
        .collect();
    let square = SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    };
    let rate = RateModel::Joint(RateRange::new(0.5, 1.5).unwrap());
    let mut search = Search::new(&alarm, 50.0, square, rate, 1e-5).unwrap();
    search.most_nodes = 4;
    let alone = search
        .run(&sensor, &deployed, &graph, first, |node| samples[node].clone())
        .unwrap();
    assert!(alone.steps.len() > 2 || alone.status == Status::Converged);
    let field = Field::new(&deployed, 15.0).unwrap();
    let chain = SourceChain::new(search, sensor, deployed, graph, samples).unwrap();
    let walk = Walk::new(chain, clock(), 10, Stream::new(1));
    let mut network = walk.simulate(field, SensorId(first as u32), setup(5)).unwrap();
    network.run_until(clock().end(10)).unwrap();
    let mut estimates: Vec<_> = network
        .nodes()
        .iter()
        .enumerate()
        .flat_map(|(i, node)| {
            node.estimates()
                .iter()
                .map(move |(slot, mean)| (*slot, i, mean.clone()))
        })
        .collect();
    estimates.sort_by_key(|(slot, _, _)| *slot);
    let expected: Vec<_> = alone
        .steps
        .iter()
        .zip(1..)
        .map(|(step, slot)| (slot, step.node, step.estimate.mean().as_slice().to_vec()))
        .collect();
    assert_eq!(estimates, expected);
    assert_eq!(network.ledger().messages().payload.0, alone.bits() as u64);
}

#[test]
fn questions_and_reports_have_the_lengths_of_their_codecs() {
    let scheme = InnovationWord::new(1.0, 3).unwrap();
    let told = Prediction {
        mean: 0.5,
        deviation: 1.5,
    };
    let word = scheme.word(1.0, &told).unwrap();
    assert_eq!(word.to_bits(&scheme.report_format()).unwrap().bits(), 3);
    assert_eq!(told.to_bits(&scheme.feedback_format()).unwrap().bits(), 128);
}

#[test]
fn followed_signals() {
    let (measurements, config) = (scalar(3, SLOTS, 8), Config::new(0.7).unwrap());
    let mut sensors = vec![fewbits_adaptive::Sensor::new(config); 3];
    let mut receivers = vec![Receiver::new(config); 3];
    let (dynamics, direct) = (Ar1::new(0.9, 0.5).unwrap(), LinearSensor::<1, 1>::direct(1.0).unwrap());
    let (mut belief, mut sent) = (start(), 0);
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            belief = kalman::predict(&dynamics, &belief);
            for ((sensor, receiver), z) in sensors.iter_mut().zip(&mut receivers).zip(z) {
                let packet = sensor.encode(z[0]).unwrap().map(|report| report.packet);
                sent += packet.as_ref().map_or(0, |packet| packet.bits() as u64);
                let value = receiver.receive(&packet.into()).unwrap().value.unwrap();
                assert!((value - z[0]).abs() <= 0.7);
                let factor = InCell::new(Cell::new(value - 0.7, value + 0.7).unwrap(), 1.0, 0.0, 1.0).unwrap();
                belief = assumed_density::update(&belief, direct.matrix(), &factor).unwrap().0;
            }
            mean(&belief)
        })
        .collect();
    let followers = Followers {
        dynamics,
        sensors: vec![direct; 3],
        noise_variance: 1.0,
        config,
        start: start(),
    };
    let (estimates, price) = told(followers.clone(), &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(sent, 0));
    let known = followers.start();
    assert_eq!(followers.belief_of(&followers.belief_bits(&known).unwrap()).unwrap(), known);
    assert!(followers.belief_of(&BitString::default()).is_err());
    everywhere(&followers, &measurements, &alone, sent);
}

#[test]
fn quantized_ranges_in_the_plane() {
    let noise = RangeNoise::from_snr_db(40.0).unwrap();
    let sensors: Vec<_> = [[4.0, 4.0], [16.0, 4.0], [10.0, 16.0]]
        .map(|place| {
            RangeSensor::new(place.into(), noise)
                .unwrap()
                .on_axes::<4>([0, 1])
                .unwrap()
        })
        .to_vec();
    let scheme = QuantizedRange::new(4, noise).unwrap();
    // As it travels: in single precision.
    let single = |x: f64| f64::from(x as f32);
    let broadcast = move |expected: &Gaussian<1>| {
        let deviation = expected.covariance()[0]
            .sqrt()
            .hypot(noise.deviation(expected.mean()[0]));
        RangeReference {
            centre: single(expected.mean()[0]),
            half_width: single(2.0 * deviation),
        }
    };
    let start = Gaussian::new([9.0, 9.0, 0.0, 0.5].into(), Matrix4::identity() * 0.1).unwrap();
    let mut transition = Matrix4::identity();
    (transition[(0, 2)], transition[(1, 3)]) = (1.0, 1.0);
    let dynamics = LinearGaussian::with_covariance(transition, Matrix4::identity() * 0.01).unwrap();
    let (mut rng, mut state) = (Stream::new(3).rng(), *start.mean());
    let measurements: Vec<Vec<Vector1<f64>>> = (0..SLOTS)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            sensors.iter().map(|sensor| sensor.sample(&mut rng, &state)).collect()
        })
        .collect();
    let mut belief = start;
    let alone: Vec<_> = measurements
        .iter()
        .map(|z| {
            let predicted = kalman::predict(&dynamics, &belief);
            belief = predicted;
            for (sensor, z) in sensors.iter().zip(z) {
                let row: RowVector4<f64> = sensor.jacobian(predicted.mean());
                let expected = Gaussian::from_trusted_parts(
                    sensor.mean(predicted.mean()),
                    row * predicted.covariance() * row.transpose(),
                );
                let told = broadcast(&expected);
                let level = Observation::Received(scheme.level(z[0], &told).unwrap());
                let factor = scheme.factor(&told, &level, &Link::PERFECT).unwrap();
                belief = assumed_density::update_through(&belief, &Observed::new(*sensor, factor))
                    .unwrap()
                    .0;
            }
            belief.mean().as_slice().to_vec()
        })
        .collect();
    let estimator = Reporting {
        dynamics,
        sensors,
        scheme,
        link: Link::PERFECT,
        filter: MomentFilter,
        broadcast,
        start,
    };
    let (estimates, price) = told(estimator.clone(), &measurements);
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * 2 * SLOTS as u64, 3 * 64 * SLOTS as u64));
    everywhere(&estimator, &measurements, &alone, 3 * 2 * SLOTS as u64);
}
