//! A network without faults gives, to the last bit, the estimates of the estimator alone, and its ledger has the estimator's bits.

use crate::worlds::{clock, counted, each, plane, plane_sensors, plane_start, plant, scalar, setup, star, start};
use fewbits_baselines::cfwmd::centre::CensoringEstimator;
use fewbits_baselines::dymbo::centre::ScalarEstimator;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_core::factor::Value;
use fewbits_core::{Belief, Gaussian, Likelihood, Link, NumberFormat, Observation, Observed, SensorNode, Sign};
use fewbits_densities::Mixture;
use fewbits_diffusive::{RateModel, RateRange, Search, SearchBox, SearchField, SourceChain, SourceSensor, Status};
use fewbits_dymbo::{CountFusion, DymboFilter, MultibitFilter, ParallelFilter, ScalarFilter};
use fewbits_filters::kalman;
use fewbits_handoff::{Coded, HandoffFilter, Leaders};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::wire::WireFormat;
use fewbits_models::diffusion::{Air, Ground};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use fewbits_network::{BitStar, Field, Ledger, SensorId, Walk};
use fewbits_protocol::{Feedback, Receiver, ReportLength};
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector1, Vector2, Vector3};

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

fn run<R: Receiver, const M: usize>(star: BitStar<R, M>) -> (Vec<Vec<f64>>, Price) {
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(SLOTS as u32)).unwrap();
    assert_eq!(network.log().entries, []);
    (network.nodes()[0].means(), price(network.ledger()))
}

/// The same by echo: the same estimates, and every replica has them.
fn everywhere<R: Receiver, const M: usize>(star: BitStar<R, M>, alone: &[Vec<f64>], up: u64) {
    let mut network = star.simulate(10.0, setup(2)).unwrap();
    network.run_until(clock().end(SLOTS as u32)).unwrap();
    assert_eq!(network.nodes()[0].means(), alone);
    assert_eq!((network.log().entries.len(), price(network.ledger()).up), (0, up));
    // Replicas have predicted into the last slot and have not been told what came in it.
    let at = |node: usize| network.nodes()[node].receiver().unwrap().estimate();
    assert!((2..network.nodes().len()).all(|node| at(node) == at(1)));
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
    let estimator = ScalarEstimator { filter, start: start() };
    let of = |feedback| {
        let nodes = each(filter.scheme());
        star(estimator.clone(), feedback, ReportLength::Fixed(1), nodes, measurements.clone())
    };
    let (estimates, price) = run(of(Feedback::Told));
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(bits, 64 * SLOTS as u64));
    everywhere(of(Feedback::Echoed), &alone, bits);
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
        let scheme = filter.scheme();
        let estimator = ScalarEstimator { filter, start: start() };
        let of = |feedback| {
            let (length, nodes) = (ReportLength::Fixed(bits as u32), each(scheme));
            star(estimator.clone(), feedback, length, nodes, measurements.clone())
        };
        let (estimates, price) = run(of(Feedback::Told));
        assert_eq!(estimates, alone);
        assert_eq!(price, Price::of(sent, 128 * SLOTS as u64));
        everywhere(of(Feedback::Echoed), &alone, sent);
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
    let (estimates, price) = run(counted(Link::PERFECT, Feedback::Told, measurements.clone()));
    assert_eq!(estimates, alone);
    assert_eq!(price, Price::of(3 * SLOTS as u64, 64 * SLOTS as u64));
    everywhere(counted(Link::PERFECT, Feedback::Echoed, measurements), &alone, 3 * SLOTS as u64);
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
                let observed: Vec<_> = observed.into_iter().map(Some).collect();
                belief = predicted;
                let all = alone_network.likelihoods(&rules, predicted.mean(), &observed).unwrap();
                all.condition(&mut belief).unwrap();
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
        let estimator = match with_covariance {
            true => CensoringEstimator::told(alone_network, dynamics, start),
            false => CensoringEstimator::own(alone_network, dynamics, start, SLOTS).unwrap(),
        };
        let nodes = estimator.clone();
        let node = move |i| -> Box<dyn SensorNode<1>> { Box::new(nodes.node(i)) };
        let length = ReportLength::Fixed(format.bits());
        let (estimates, price) =
            run(star(estimator.clone(), Feedback::Told, length, node.clone(), measurements.clone()));
        assert_eq!(estimates, alone);
        let down = 64 * SLOTS as u64 * if with_covariance { 14 } else { 4 };
        assert_eq!(price, Price { up: sent, down });
        everywhere(star(estimator, Feedback::Echoed, length, node, measurements.clone()), &alone, sent);
    }
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
    let leaders: Vec<_> = (0..15).map(|k| k * 3 % 5).collect();
    let prior = Mixture::single(&start()).unwrap();
    let (mut known, mut bits) = (prior.clone(), Vec::new());
    let alone: Vec<_> = (0..15)
        .map(|k| {
            let mut rng = Stream::new(9).named("lead").indexed(k as u64 + 1).rng();
            let reading = &readings[k][leaders[k] as usize];
            let (handover, _) = filter.step(&mut rng, &known, &dynamics, reading).unwrap();
            bits.push(handover.message().unwrap().bits() as u64);
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
    let walk = Walk::new(walker, clock(), 15, Stream::new(9)).unwrap();
    // A line of five: leaders are up to four hops apart.
    let line = (0..5).map(|i| Vector2::new(f64::from(i) * 10.0, 0.0)).collect();
    let field = Field::new(&Deployment::given(line).unwrap(), 11.0).unwrap();
    let mut network = walk.simulate(field, SensorId(leaders[0]), setup(4)).unwrap();
    network.run_until(clock().end(15)).unwrap();
    let mut estimates: Vec<_> = network
        .nodes()
        .iter()
        .flat_map(|node| node.estimates().to_vec())
        .collect();
    estimates.sort_by_key(|(slot, _)| *slot);
    assert_eq!(estimates.into_iter().map(|(_, mean)| mean).collect::<Vec<_>>(), alone);
    let hops = |k: usize| leaders[k].abs_diff(leaders[k + 1]);
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
        .map(|p| sensor.sample(&mut rng, p, &source, 1.0).unwrap())
        .collect();
    let square = SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    };
    let rate = RateModel::Joint(RateRange::new(0.5, 1.5).unwrap());
    let mut search = Search::new(&alarm, 50.0, square, rate, 1e-5).unwrap();
    search.max_nodes = 4;
    let nodes = SearchField::new(sensor, deployed.clone(), graph).unwrap();
    let alone = search.run(&nodes, first, |node| Ok(samples[node].clone())).unwrap();
    assert!(alone.steps.len() > 2 || alone.status == Status::Converged);
    let field = Field::new(&deployed, 15.0).unwrap();
    let chain = SourceChain::new(search, nodes, samples).unwrap();
    let walk = Walk::new(chain, clock(), 10, Stream::new(1)).unwrap();
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
        .map(|(step, slot)| (slot, step.node, step.estimate))
        .collect();
    assert_eq!(estimates.len(), expected.len());
    for (walked, alone) in estimates.iter().zip(&expected) {
        assert_eq!((walked.0, walked.1), (alone.0, alone.1));
        // A node that received raw records covers the whole box with its first cells; `run` remembers where the last posterior was. The
        // estimates therefore agree to the accuracy of cells of 0.8 deviations, 1e-7 of a deviation, and not to the bit.
        for ((a, b), deviation) in walked
            .2
            .iter()
            .zip(alone.2.mean().iter())
            .zip(alone.2.standard_deviations().iter())
        {
            println!("{:e}", (a - b).abs() / deviation);
            assert!((a - b).abs() < 1e-7 * deviation, "{a} {b}, deviation {deviation}");
        }
    }
    assert_eq!(network.ledger().messages().payload.0, alone.bits() as u64);
}
