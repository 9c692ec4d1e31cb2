//! Schemes of the comparison over networks: receivers against themselves without a network and under losses, floors, lives of nodes.

use fewbits_adaptive::{Config, Receiver as Following, Sensor};
use fewbits_baselines::over_bits::{Estimator, OverBits};
use fewbits_binary_patterns::{Bank, BinaryQuantizer, PatternSensor, Source};
use fewbits_core::factor::Levels;
use fewbits_core::{Cell, Dynamics, Gaussian, LinearSensing, Observation, Sensing, SensorNode};
use fewbits_experiments::network::receivers::{Followers, LookUp, each};
use fewbits_experiments::network::schemes;
use fewbits_experiments::network::worlds::{self, COEFFICIENT, Entry, floor_at};
use fewbits_filters::{assumed_density, kalman};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::{
    BitStar, Channel, Clock, Fault, FaultKind, Field, Radio, Seconds, SensorId, Setup, Simulator, TWO_AA_CELLS,
};
use fewbits_protocol::{Feedback, ReportLength};
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::{ObservationModel, System};
use fewbits_quantizers::Symbol;
use nalgebra::Vector1;

const SLOTS: usize = 60;
type Measurements = Vec<Vec<Vector1<f64>>>;

fn dynamics() -> Ar1 {
    Ar1::new(0.9, 0.5).unwrap()
}

fn start() -> Gaussian<1> {
    Gaussian::scalar(0.0, dynamics().stationary_variance().unwrap()).unwrap()
}

fn direct() -> LinearSensor<1, 1> {
    LinearSensor::direct(1.0).unwrap()
}

fn measured() -> Measurements {
    let (mut rng, mut state) = (Stream::new(8).rng(), Vector1::new(1.0));
    (0..SLOTS)
        .map(|_| {
            state = dynamics().propagate(&mut rng, &state);
            (0..3).map(|_| direct().sample(&mut rng, &state)).collect()
        })
        .collect()
}

fn clock() -> Clock {
    Clock::new(Seconds::new(1.0).unwrap()).unwrap()
}

fn star<E: Estimator + Clone + Send + Sync + 'static>(
    estimator: E,
    feedback: Feedback,
    report: ReportLength,
    node: impl Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static,
) -> BitStar<OverBits<E>, 1> {
    let centre = move || Ok(OverBits::new(estimator.clone()));
    BitStar::new(centre, feedback, report, node, measured(), clock(), Stream::new(9)).unwrap()
}

/// A snapshot has thousands of bytes; as link frames of 127 bytes it would hardly ever arrive whole.
fn setup(seed: u64) -> Setup {
    let radio = Radio {
        mtu: None,
        ..Radio::cc2420(0.0).unwrap()
    };
    Setup::new(radio, Stream::new(seed))
}

fn means<E: Estimator + Clone + Send + Sync + 'static>(star: BitStar<OverBits<E>, 1>) -> (Vec<f64>, u64) {
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(SLOTS as u32)).unwrap();
    assert_eq!(network.log().entries, []);
    let up = network.ledger().accounts()[1..].iter().map(|account| account.payload.0);
    (network.nodes()[0].means().into_iter().map(|mean| mean[0]).collect(), up.sum())
}

#[test]
fn tables_give_what_they_give_alone() {
    let deviation = start().covariance()[0].sqrt();
    let system =
        System::lloyd_max(ObservationModel::gaussian_with_deviations(deviation, &[1.0; 3]).unwrap(), 4).unwrap();
    let (decoder, quantizer) = (MmseDecoder::new(&system, 1000).unwrap(), &system.quantizers()[0]);
    let alone = measured().into_iter().map(|z| {
        let symbol = |z: &Vector1<f64>| Observation::Received(Symbol(quantizer.encode(z[0]).unwrap()));
        decoder.decode(&z.iter().map(symbol).collect::<Vec<_>>()).unwrap().mean
    });
    let (look_up, schemes) = LookUp::of_system(&system, 1000).unwrap();
    let (over, up) = means(star(look_up, Feedback::Clock, ReportLength::Fixed(2), each(schemes)));
    assert_eq!((over, up), (alone.collect(), 3 * 2 * SLOTS as u64));
}

/// One sign bit of `x ~ N(0, s)` in unit noise: mean `sqrt(2 / pi) s / sqrt(s + 1)`, variance `s - (2 / pi) s^2 / (s + 1)`.
#[test]
fn patterns_have_the_variance_given_the_bits() {
    let variance = 2.0;
    let sensor = PatternSensor::with_deviation(BinaryQuantizer::new(vec![0.0]).unwrap(), 1.0).unwrap();
    let source = Source::gaussian_with_deviation(f64::sqrt(variance)).unwrap();
    let table = Bank::new(source, vec![sensor]).unwrap().table().unwrap();
    let patterns = LookUp::of_patterns(1, table, variance).unwrap();
    let predicted = patterns.predict(1, &patterns.start()).unwrap();
    assert!((predicted.covariance()[0] - variance).abs() < 1e-12);
    let after = patterns
        .update(1, &predicted, &[(0, Observation::Received(true))])
        .unwrap();
    let share = 2.0 / std::f64::consts::PI * variance * variance / (variance + 1.0);
    assert!((after.mean()[0].abs() - share.sqrt()).abs() < 1e-9, "{after:?}");
    assert!((after.covariance()[0] - (variance - share)).abs() < 1e-9, "{after:?}");
    let nothing = patterns.update(1, &predicted, &[(0, Observation::Nothing)]).unwrap();
    assert!((nothing.covariance()[0] - variance).abs() < 1e-9);
}

fn followers(config: Config) -> Followers<Ar1, LinearSensor<1, 1>, 1> {
    Followers {
        dynamics: dynamics(),
        sensors: vec![direct(); 3],
        noise_variance: 1.0,
        config,
        start: start(),
    }
}

fn followed_star(feedback: Feedback, config: Config) -> BitStar<OverBits<Followers<Ar1, LinearSensor<1, 1>, 1>>, 1> {
    let followers = followers(config);
    let node = followers.nodes();
    star(followers, feedback, ReportLength::Varying, node)
}

#[test]
fn followed_signals_give_what_they_give_alone() {
    let config = Config::new(0.7).unwrap();
    let (mut sensors, mut receivers) = (vec![Sensor::new(config); 3], vec![Following::new(config); 3]);
    let (mut belief, mut sent) = (start(), 0);
    let alone = measured().into_iter().map(|z| {
        belief = kalman::predict(&dynamics(), &belief);
        for ((sensor, receiver), z) in sensors.iter_mut().zip(&mut receivers).zip(&z) {
            let packet = sensor.encode(z[0]).unwrap().map(|report| report.packet);
            sent += packet.as_ref().map_or(0, |packet| packet.bits() as u64);
            let value = receiver.receive(&packet.into()).unwrap().value.unwrap();
            assert!((value - z[0]).abs() <= 0.7);
            let factor = Levels::new(Cell::new(value - 0.7, value + 0.7).unwrap(), 1.0, 0.0, 1.0).unwrap();
            belief = assumed_density::update(&belief, direct().matrix(), &factor).unwrap().0;
        }
        belief.mean()[0]
    });
    let alone: Vec<_> = alone.collect();
    for feedback in [Feedback::Clock, Feedback::Echoed] {
        assert_eq!(means(followed_star(feedback, config)), (alone.clone(), sent));
    }
}

#[test]
fn followers_by_echo_come_back_after_losses() {
    let config = Config::new(0.5).and_then(|c| c.resilient(4, Some(4))).unwrap();
    let lossy = Setup {
        channel: Channel::lossy(0.1).unwrap(),
        ..setup(1)
    };
    let mut network = followed_star(Feedback::Echoed, config).simulate(10.0, lossy).unwrap();
    network.run_until(clock().end(SLOTS as u32)).unwrap();
    let faults = network.ledger().faults();
    assert!(faults.resynchronisations > 0 && faults.failures == 0, "{faults:?}");
    // About as many as echoes and snapshots are lost.
    assert!(faults.disagreements < SLOTS as u64, "{faults:?}");
}

/// Twenty runs with losses, restarts and a snapshot in the middle: after quiet slots whoever lives is followed within delta again.
#[test]
fn followed_signals_survive_faults() {
    let config = Config::new(0.5).and_then(|c| c.resilient(4, Some(4))).unwrap();
    let at = |slot: u64| Seconds::new(slot as f64 + 0.4).unwrap();
    let mut followed = 0;
    for seed in 0..20 {
        let restart = Fault {
            at: at(10 + seed),
            node: SensorId((seed % 4) as u32),
            kind: FaultKind::Restart,
        };
        let faulty = Setup {
            channel: Channel::lossy(0.3).unwrap(),
            faults: vec![restart],
            ..setup(seed)
        };
        let star = || followed_star(Feedback::Clock, config);
        let mut network = star().simulate(10.0, faulty).unwrap();
        network.run_until(clock().end(40)).unwrap();
        let mut stored = Vec::new();
        network.snapshot(&mut stored).unwrap();
        let field = Field::star(3, 10.0).unwrap();
        let mut network = Simulator::restore(star(), field, setup(seed), stored.as_slice()).unwrap();
        network.run_until(clock().end(SLOTS as u32)).unwrap();
        let last = &measured()[SLOTS - 1];
        let belief = network.nodes()[0].receiver().unwrap().belief().clone();
        for (receiver, z) in belief.receivers.iter().zip(last) {
            if receiver.tracked().synchronised {
                followed += 1;
                assert!((receiver.tracked().value.unwrap() - z[0]).abs() <= 0.5);
            }
        }
    }
    assert_eq!(followed, 60);
}

#[test]
fn without_bits_the_floor_is_the_stationary_variance_and_with_many_the_kalman_filter() {
    let stationary = worlds::PROCESS / (1.0 - COEFFICIENT * COEFFICIENT);
    let both = worlds::scalar(1).unwrap().everything().unwrap();
    assert!((floor_at(0.0, both).powi(2) / stationary - 1.0).abs() < 1e-9);
    assert!((floor_at(60.0, both).powi(2) / both[1] - 1.0).abs() < 1e-9);
}

/// Days on two AA cells of the busiest sensor (CC2420), whose rest takes `watts`: at a slot a second and 6 mW the scheme hardly matters, at
/// fifty a second and 0.1 mW it decides.
#[test]
fn the_scheme_decides_the_life_of_nodes_that_sleep() {
    let entries = schemes::of_scalar(&worlds::scalar(200).unwrap()).unwrap();
    let asleep = Radio::cc2420(0.0).unwrap().sleep.value();
    let days = |family: &str, setting: &str, period: f64, watts: f64| {
        let same = |e: &&Entry| (e.family, e.setting.as_str()) == (family, setting) && e.feedback != "told";
        let energy = entries.iter().find(same).unwrap().run(Stream::new(1)).unwrap().busiest;
        assert!(energy > 0.0);
        TWO_AA_CELLS.value() / (watts + asleep + energy / period) / 86_400.0
    };
    let slow = days("CFwMD", "n=0.25", 1.0, 6e-3) / days("all-send", "32 bit", 1.0, 6e-3);
    assert!((slow - 1.0).abs() < 0.05, "{slow}");
    let fast = |family, setting| days(family, setting, 0.02, 1e-4);
    // Who must listen before it sends one bit dies before one that sends 32 unasked, who sends one bit unasked after it.
    let (asked, unasked, whole) = (fast("Dymbo", "K=4"), fast("Lloyd-Max-table", "L=2"), fast("all-send", "32 bit"));
    assert!(asked < whole && whole < unasked, "{asked} {whole} {unasked}");
}
