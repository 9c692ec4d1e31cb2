//! Fusion without feedback.

use crate::Instant;
use fewbits_baselines::cfwmd::{ImputedBelief, fuse_received, imputing};
use fewbits_cfwmd::Error;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{JointBelief, LocalSensor, joint};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, NumberFormat, Observation, Sensing};
use fewbits_filters::kalman;
use fewbits_models::{LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2};

type Sensors<const M: usize> = Network<LinearSensor<2, M>, 2, M>;

fn scalar(loss: f64) -> Sensors<1> {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let threshold = Budget::new(1.0, 2).unwrap().threshold(1).unwrap();
    Network::new(vec![sensor; 2], threshold, Link::lossy(loss).unwrap()).unwrap()
}

fn vector() -> Sensors<2> {
    let sensor = LinearSensor::new(SMatrix::identity(), Matrix2::new(2.0, 0.0, 0.0, 4.0)).unwrap();
    Network::new(vec![sensor; 2], Budget::new(1.0, 2).unwrap().threshold(2).unwrap(), Link::PERFECT).unwrap()
}

fn known() -> Gaussian<2> {
    Gaussian::known(Vector2::new(0.0, 10.0)).unwrap()
}

#[derive(Clone, Copy)]
enum Method {
    Ignore,
    Joint,
    Imputing(usize),
}

/// What arrives from each sensor over a run, and where the truth went.
type Run<const M: usize> = Vec<(Vector2<f64>, Vec<Observation<SVector<f64, M>>>)>;

fn simulate<const M: usize>(
    network: &Sensors<M>,
    dynamics: &LinearGaussian<2, 1>,
    start: &Gaussian<2>,
    seed: u64,
) -> Run<M> {
    let mut rng = Stream::new(seed).rng();
    let mut truth = start.sample(&mut rng);
    let mut sensors: Vec<_> = network
        .sensors()
        .iter()
        .map(|s| LocalSensor::new(*s, network.threshold(), NumberFormat::Double, start).unwrap())
        .collect();
    (0..20)
        .map(|_| {
            truth = dynamics.propagate(&mut rng, &truth);
            let observations = sensors
                .iter_mut()
                .zip(network.sensors())
                .map(|(half, sensor)| {
                    let z = sensor.sample(&mut rng, &truth);
                    let report = half.step(dynamics, &z).unwrap();
                    network
                        .link()
                        .transmit(&mut rng, report.as_ref(), &NumberFormat::Double)
                        .unwrap()
                })
                .collect();
            (truth, observations)
        })
        .collect()
}

/// Runs one method; beliefs and the total log-likelihood.
fn track<const M: usize>(
    network: &Sensors<M>,
    start: &Gaussian<2>,
    method: Method,
    run: &Run<M>,
) -> (Vec<Gaussian<2>>, f64) {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut rng = Stream::new(500).fast_rng();
    let (mut total, mut belief) = (0.0, *start);
    let mut joint = JointBelief::new(start, network.sensors().len()).unwrap();
    let particles = if let Method::Imputing(n) = method { n } else { 1 };
    let mut imputed = ImputedBelief::new(start, network.sensors().len(), particles).unwrap();
    let beliefs = run
        .iter()
        .map(|(_, observations)| {
            let info = match method {
                Method::Ignore => {
                    let predicted = kalman::predict(&dynamics, &belief);
                    let (next, info) = fuse_received(network, &predicted, observations).unwrap();
                    belief = next;
                    info
                }
                Method::Joint => {
                    let (next, info) = joint::step(network, &dynamics, &joint, observations).unwrap();
                    joint = next;
                    belief = joint.state();
                    info
                }
                Method::Imputing(_) => {
                    let (next, info) = imputing::step(&mut rng, network, &dynamics, &imputed, observations).unwrap();
                    imputed = next;
                    belief = imputed.state();
                    info
                }
            };
            total += info.log_likelihood;
            belief
        })
        .collect();
    (beliefs, total)
}

/// How far the assumed-density belief strays from the exact one, in exact standard deviations: largest and root mean square.
fn distance<const M: usize>(network: &Sensors<M>, start: &Gaussian<2>, particles: usize) -> (f64, f64) {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    for seed in 0..6 {
        let run = simulate(network, &dynamics, start, 100 + seed);
        let (assumed, _) = track(network, start, Method::Joint, &run);
        let (exact, _) = track(network, start, Method::Imputing(particles), &run);
        for (a, e) in assumed.iter().zip(&exact) {
            let off = (a.mean() - e.mean()).component_div(&e.standard_deviations()).amax();
            worst = worst.max(off);
            squares += off * off;
            count += 1.0;
        }
    }
    (worst, (squares / count).sqrt())
}

#[test]
fn the_assumed_density_stays_close_to_the_exact_filter() {
    let (worst, typical) = distance(&scalar(0.0), &known(), 800);
    assert!(typical < 0.12 && worst < 0.6, "known start: {typical} {worst}");
    let uncertain = Gaussian::new(Vector2::new(0.0, 10.0), Matrix2::identity() * 5.0).unwrap();
    let (worst, typical) = distance(&scalar(0.0), &uncertain, 800);
    assert!(typical < 0.15 && worst < 0.8, "uncertain start: {typical} {worst}");
    let (worst, typical) = distance(&scalar(0.2), &known(), 800);
    assert!(typical < 0.25 && worst < 1.2, "lossy link: {typical} {worst}");
    let (worst, typical) = distance(&vector(), &known(), 600);
    assert!(typical < 0.2 && worst < 1.0, "vector: {typical} {worst}");
}

#[test]
fn fusing_silence_pays() {
    let network = scalar(0.0);
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut errors = [0.0; 3];
    let methods = [Method::Ignore, Method::Joint, Method::Imputing(60)];
    for seed in 0..120 {
        let run = simulate(&network, &dynamics, &known(), 1000 + seed);
        for (error, method) in errors.iter_mut().zip(methods) {
            let (beliefs, _) = track(&network, &known(), method, &run);
            *error += beliefs
                .iter()
                .zip(&run)
                .map(|(b, (truth, _))| (b.mean()[0] - truth[0]).powi(2))
                .sum::<f64>();
        }
    }
    // 0.99^2 against 1.11^2 in the long run; 150 runs tell them apart.
    assert!(errors[1] < 0.93 * errors[0] && errors[2] < 0.93 * errors[0], "{errors:?}");
    assert!((errors[1] / errors[2] - 1.0).abs() < 0.06, "{errors:?}");
}

/// A report that is known to be lost was sent. From a start that all share, the sensors' predictions are the centre's, so that the
/// posterior is that of feedback: the innovation lies outside the region of silence.
#[test]
fn lost_reports_are_outside_the_region_of_silence() {
    fn check<const M: usize>(network: &Sensors<M>, tolerance: f64) {
        let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
        let start = Gaussian::known(Vector2::new(3.0, -2.0)).unwrap();
        let predicted = kalman::predict(&dynamics, &start);
        let observations = [Observation::Lost; 2];
        let rules = network.rules_under(&predicted).unwrap();
        let (expected, info) = network
            .fuse(&predicted, &rules, predicted.mean(), &observations)
            .unwrap();
        let joint = JointBelief::new(&start, 2).unwrap();
        let (one, seen) = joint::step(network, &dynamics, &joint, &observations).unwrap();
        let belief = ImputedBelief::new(&start, 2, 40_000).unwrap();
        let (many, drawn) =
            imputing::step(&mut Stream::new(11).rng(), network, &dynamics, &belief, &observations).unwrap();
        for (state, evidence, slack) in [
            (one.state(), seen.log_likelihood, tolerance),
            (many.state(), drawn.log_likelihood, 0.05),
        ] {
            let scale = expected.covariance().amax();
            assert!((state.mean() - expected.mean()).amax() < slack * scale.sqrt(), "{state:?} {expected:?}");
            assert!((state.covariance() - expected.covariance()).amax() < slack * scale, "{state:?} {expected:?}");
            assert!((evidence - info.log_likelihood).abs() < slack, "{evidence} {}", info.log_likelihood);
        }
        assert!(expected.covariance()[(0, 0)] > 1.3 * predicted.covariance()[(0, 0)]);
    }
    // The joint Gaussian takes the two sensors one after the other.
    check(&scalar(0.3), 0.1);
    check(&vector(), 0.1);
}

/// What the centre knows of each sensor's own estimate: all of it once every report has come from a common start, and less of
/// that which was silent.
#[test]
fn own_estimates_are_known_as_far_as_reports_came() {
    let (network, dynamics, start) = (scalar(0.0), constant_velocity_1d(1.0, 4.0).unwrap(), known());
    let mut own = LocalSensor::new(network.sensors()[1], network.threshold(), NumberFormat::Double, &start).unwrap();
    let z = Vector1::new(21.0);
    assert!(own.step(&dynamics, &z).unwrap().is_some());
    let belief = JointBelief::new(&start, 2).unwrap();
    let (after, _) =
        joint::step(&network, &dynamics, &belief, &[Observation::Nothing, Observation::Received(z)]).unwrap();
    let [silent, sent] = [0, 1].map(|i| after.estimate(i).unwrap());
    assert!((sent.mean() - own.estimate()).amax() < 1e-9 && sent.covariance().amax() < 1e-9);
    assert!(silent.covariance()[(0, 0)] > 0.01);
    assert!(after.estimate(2).is_none());
}

#[test]
fn a_first_report_that_breaks_the_rule_is_noticed() {
    // From a known start the first prediction of every sensor is known exactly.
    let network = scalar(0.0);
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    let observations = [Observation::Received(Vector1::new(10.1)), Observation::Nothing];
    let refused = joint::step(&network, &dynamics, &JointBelief::new(&known(), 2).unwrap(), &observations);
    assert!(matches!(refused, Err(Error::Impossible)));
    let particles = ImputedBelief::new(&known(), 2, 20).unwrap();
    assert_eq!(particles.violations(), 0);
    let (particles, _) = imputing::step(&mut rng, &network, &dynamics, &particles, &observations).unwrap();
    assert_eq!(particles.violations(), 1);
}

#[test]
fn bad_steps_are_typed_errors() {
    let (network, dynamics) = (scalar(0.0), constant_velocity_1d(1.0, 4.0).unwrap());
    let mut rng = Stream::new(1).fast_rng();
    let joint = JointBelief::new(&known(), 2).unwrap();
    let run = simulate(&network, &dynamics, &known(), 3);
    let mut imputed = ImputedBelief::new(&known(), 2, 50).unwrap();
    for (_, observations) in &run[..6] {
        imputed = imputing::step(&mut rng, &network, &dynamics, &imputed, observations)
            .unwrap()
            .0;
    }
    // A network that always reports, seen by the same filters: silence is impossible.
    let always = Network::new(network.sensors().to_vec(), 0.0, Link::PERFECT).unwrap();
    let far = Observation::Received(Vector1::new(9.0));
    let nan = Observation::Received(Vector1::new(f64::NAN));
    let cases = [
        (&network, vec![Observation::Nothing], "`observations` is 1 entries"),
        (&network, vec![nan, Observation::Nothing], "report"),
        (&always, vec![far, Observation::Nothing], "impossible"),
    ];
    for (network, observations, words) in cases {
        let error = joint::step(network, &dynamics, &joint, &observations).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        let error = imputing::step(&mut rng, network, &dynamics, &imputed, &observations).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
    let erased = [Observation::Nothing, Observation::Lost];
    assert!(joint::step(&network, &dynamics, &joint, &erased).is_ok());
    assert!(imputing::step(&mut rng, &network, &dynamics, &imputed, &erased).is_ok());
    assert!(ImputedBelief::new(&known(), 2, 0).is_err());
    let sensor = network.sensors()[0];
    assert!(LocalSensor::new(sensor, -1.0, NumberFormat::Double, &known()).is_err());
    assert!(LocalSensor::new(sensor, 1.0, NumberFormat::fixed(0.0, 1.0, 4).unwrap(), &known()).is_err());
    let mut half = LocalSensor::new(sensor, 1.0, NumberFormat::Double, &known()).unwrap();
    let fresh = half.clone();
    assert!(half.step(&dynamics, &Vector1::new(f64::NAN)).is_err());
    assert_eq!(half, fresh);
}

/// Issue: known dynamics, continual silence, prior variance 1e8 and 1e16 times the noise's.
#[test]
fn any_ratio_of_variances_keeps_the_joint_belief_definite() {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let network = Network::new(vec![sensor; 3], 0.5, Link::PERFECT).unwrap();
    let still = LinearGaussian::with_covariance(Matrix2::new(1.0, 1.0, 0.0, 1.0), SMatrix::zeros()).unwrap();
    for ratio in [1e8, 1e16] {
        let start = Gaussian::new(Vector2::zeros(), SMatrix::identity() * ratio).unwrap();
        let mut belief = JointBelief::new(&start, 3).unwrap();
        for k in 0..2000 {
            let (next, info) = joint::step(&network, &still, &belief, &[Observation::Nothing; 3]).unwrap();
            belief = next;
            let state = belief.state();
            assert!(info.log_likelihood.is_finite(), "step {k}");
            assert!(Gaussian::new(*state.mean(), *state.covariance()).is_ok(), "step {k}: {state:?}");
        }
        // Each sensor's own filter has long settled: its estimate is nearly the state, within the interval of silence.
        let estimate = belief.estimate(1).unwrap();
        assert!(estimate.covariance()[(0, 0)].is_finite() && belief.estimate(3).is_none());
    }
}

/// Over all that one sensor can cause, messages and silence, the evidence of a step is one.
#[test]
fn the_evidence_of_all_that_can_come_is_one() {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let start = Gaussian::new(Vector2::new(0.0, 1.0), SMatrix::identity()).unwrap();
    for loss in [0.0, 0.3] {
        let network = Network::new(vec![sensor], 0.8, Link::lossy(loss).unwrap()).unwrap();
        let step = |belief: &JointBelief<2>, observation| joint::step(&network, &dynamics, belief, &[observation]);
        // At first the sensor's estimate is known and the density of messages jumps; after a silence it is smooth.
        let mut belief = JointBelief::new(&start, 1).unwrap();
        for observation in [
            Observation::Nothing,
            Observation::Received(Vector1::new(4.0)),
            Observation::Nothing,
        ] {
            belief = step(&belief, observation).unwrap().0;
            let evidence = |observation| step(&belief, observation).unwrap().1.log_likelihood.exp();
            let width = 0.02;
            let heard: f64 = (-2000..2000)
                .map(|i| evidence(Observation::Received(Vector1::new(width * f64::from(i)))) * width)
                .sum();
            let sum = heard + evidence(Observation::Nothing);
            let spoke = 1.0 - (evidence(Observation::Nothing) - loss) / (1.0 - loss);
            assert!((evidence(Observation::Lost) - spoke).abs() < 1e-9);
            assert!((sum - 1.0).abs() < 1e-6, "{sum} with loss {loss}");
        }
    }
}

#[test]
fn beliefs_stay_covariances_from_a_singular_start() {
    // Process noise of rank one and a known start keep the joint covariance singular for several steps.
    fn check<const M: usize>(network: &Sensors<M>, seeds: std::ops::Range<u64>) {
        let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
        for seed in seeds {
            let run = simulate(network, &dynamics, &known(), seed);
            let (beliefs, total) = track(network, &known(), Method::Joint, &run);
            assert!(total.is_finite());
            for belief in beliefs {
                let slack = SMatrix::<f64, 2, 2>::identity() * 1e-10;
                let sound = Gaussian::new(*belief.mean(), belief.covariance() + slack);
                assert!(sound.is_ok() && belief.covariance().amax() < 100.0, "seed {seed}: {belief:?}");
            }
        }
    }
    check(&vector(), 0..120);
    check(&scalar(0.0), 0..300);
}
