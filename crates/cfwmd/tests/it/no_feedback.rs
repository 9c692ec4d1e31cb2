//! Fusion without feedback.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::message::Format;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{LocalSensor, NoFeedback, NoFeedbackCentre};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Gaussian, Observation};
use fewbits_models::{LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2};

fn scalar(loss: f64) -> Network<2, 1> {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    Network::new(vec![sensor; 2], Budget::new(1.0, 2).unwrap().threshold(1).unwrap(), loss).unwrap()
}

fn vector() -> Network<2, 2> {
    let sensor = LinearSensor::new(SMatrix::identity(), Matrix2::new(2.0, 0.0, 0.0, 4.0)).unwrap();
    Network::new(vec![sensor; 2], Budget::new(1.0, 2).unwrap().threshold(2).unwrap(), 0.0).unwrap()
}

fn known() -> Gaussian<2> {
    Gaussian::known(Vector2::new(0.0, 10.0)).unwrap()
}

/// What each sensor says over a run, and where the truth went.
type Run<const M: usize> = Vec<(Vector2<f64>, Vec<Observation<SVector<f64, M>>>)>;

fn simulate<const M: usize>(
    network: &Network<2, M>,
    dynamics: &LinearGaussian<2, 1>,
    start: &Gaussian<2>,
    seed: u64,
) -> Run<M> {
    use rand::RngExt;
    let mut rng = Stream::new(seed).rng();
    let mut truth = start.sample(&mut rng).unwrap();
    let mut sensors: Vec<_> = network
        .sensors()
        .iter()
        .map(|s| LocalSensor::new(*s, network.threshold(), Format::Double, start).unwrap())
        .collect();
    (0..20)
        .map(|_| {
            truth = fewbits_core::Dynamics::propagate(dynamics, &mut rng, &truth);
            let heard = sensors
                .iter_mut()
                .zip(network.sensors())
                .map(|(half, sensor)| {
                    let z = fewbits_core::Sensing::sample(sensor, &mut rng, &truth);
                    let report = half.step(dynamics, &z).unwrap().heard();
                    if rng.random::<f64>() < network.loss() {
                        Observation::Silent
                    } else {
                        report
                    }
                })
                .collect();
            (truth, heard)
        })
        .collect()
}

/// Runs one method; beliefs and the total log-likelihood.
fn track<const M: usize>(
    network: &Network<2, M>,
    start: &Gaussian<2>,
    method: NoFeedback,
    run: &Run<M>,
) -> (Vec<Gaussian<2>>, f64) {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut centre = NoFeedbackCentre::new(network.clone(), start, method, 0.5).unwrap();
    let mut rng = Stream::new(500).fast_rng();
    let mut total = 0.0;
    let beliefs = run
        .iter()
        .map(|(_, heard)| {
            total += centre.step(&mut rng, &dynamics, heard).unwrap().log_likelihood;
            centre.belief()
        })
        .collect();
    (beliefs, total)
}

#[test]
fn the_printed_likelihood_is_the_filter_that_ignores_silence() {
    let network = scalar(0.0);
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    for seed in 0..20 {
        let run = simulate(&network, &dynamics, &known(), seed);
        let (ignore, _) = track(&network, &known(), NoFeedback::Ignore, &run);
        let (literal, _) = track(&network, &known(), NoFeedback::Literal, &run);
        assert_eq!(ignore, literal);
    }
}

/// How far the assumed-density belief strays from the exact one, in exact standard deviations: largest and root mean square.
fn distance<const M: usize>(network: &Network<2, M>, start: &Gaussian<2>, particles: usize) -> (f64, f64) {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    for seed in 0..6 {
        let run = simulate(network, &dynamics, start, 100 + seed);
        let (assumed, _) = track(network, start, NoFeedback::AssumedDensity, &run);
        let (exact, _) = track(network, start, NoFeedback::RaoBlackwell(particles), &run);
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
fn hearing_silence_pays() {
    let network = scalar(0.0);
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut errors = [0.0; 3];
    let methods = [
        NoFeedback::Ignore,
        NoFeedback::AssumedDensity,
        NoFeedback::RaoBlackwell(60),
    ];
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

#[test]
fn a_first_message_that_breaks_the_rule_is_noticed() {
    // From a known start the first prediction of every sensor is known exactly.
    let network = scalar(0.0);
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    let heard = [Observation::Received(Vector1::new(10.1)), Observation::Silent];
    let mut centre = NoFeedbackCentre::new(network.clone(), &known(), NoFeedback::AssumedDensity, 0.5).unwrap();
    let refused = centre.step(&mut rng, &dynamics, &heard);
    assert!(matches!(refused, Err(Error::ProtocolViolation { sensor: 0, .. })), "{refused:?}");
    assert_eq!(centre.belief(), known());
    let mut particles = NoFeedbackCentre::new(network, &known(), NoFeedback::RaoBlackwell(20), 0.5).unwrap();
    particles.step(&mut rng, &dynamics, &heard).unwrap();
    assert_eq!(particles.violations(), 1);
}

#[test]
fn bad_steps_are_typed_errors() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let mut rng = Stream::new(1).fast_rng();
    for method in [
        NoFeedback::Ignore,
        NoFeedback::AssumedDensity,
        NoFeedback::RaoBlackwell(5),
        NoFeedback::Literal,
    ] {
        let mut centre = NoFeedbackCentre::new(scalar(0.0), &known(), method, 0.5).unwrap();
        let short = centre.step(&mut rng, &dynamics, &[Observation::Silent]);
        assert_eq!(short.unwrap_err(), Error::ObservationCount { heard: 1, sensors: 2 });
        let nan = [Observation::Received(Vector1::new(f64::NAN)), Observation::Silent];
        assert!(matches!(centre.step(&mut rng, &dynamics, &nan), Err(Error::Argument(_))));
        assert_eq!(centre.belief(), known());
        assert!(
            centre
                .step(&mut rng, &dynamics, &[Observation::Silent, Observation::Lost])
                .is_ok()
        );
    }
    let always = Network::new(scalar(0.0).sensors().to_vec(), 0.0, 0.0).unwrap();
    let mut centre = NoFeedbackCentre::new(always, &known(), NoFeedback::AssumedDensity, 1.0).unwrap();
    let silent = centre.step(&mut rng, &dynamics, &[Observation::Received(Vector1::new(9.0)), Observation::Silent]);
    assert_eq!(silent.unwrap_err(), Error::ImpossibleSilence { sensor: 1 });
    assert!(NoFeedbackCentre::new(scalar(0.0), &known(), NoFeedback::RaoBlackwell(0), 0.5).is_err());
    assert!(NoFeedbackCentre::new(scalar(0.0), &known(), NoFeedback::Ignore, 0.0).is_err());
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    assert!(LocalSensor::new(sensor, -1.0, Format::Double, &known()).is_err());
    let mut half = LocalSensor::new(sensor, 1.0, Format::Double, &known()).unwrap();
    assert!(half.step(&dynamics, &Vector1::new(f64::NAN)).is_err());
}

#[test]
fn beliefs_stay_covariances_from_a_singular_start() {
    // Process noise of rank one and a known start keep the joint covariance singular for several steps.
    fn check<const M: usize>(network: &Network<2, M>, seeds: std::ops::Range<u64>) {
        let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
        for seed in seeds {
            let run = simulate(network, &dynamics, &known(), seed);
            let (beliefs, total) = track(network, &known(), NoFeedback::AssumedDensity, &run);
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
