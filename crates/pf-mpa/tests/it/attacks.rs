//! Bad input is a typed error, extreme input an answer.

use fewbits_baselines::pf_mpa::{
    AccelerationChain, Encoder, GuidedGaussian, Linearised, Network, POSITION, RaoBlackwellGuided, Reports, Target,
    Tracker, WithManoeuvre,
};
use fewbits_baselines::pf_mpa::{MessagePassing, ProductSampler};
use fewbits_core::{Error, Gaussian, Observed};
use fewbits_densities::Particles;
use fewbits_filters::{BootstrapFilter, ResamplingRule, StateFilter};
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise, RangeReference, RangeSensor};
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix4, Vector2, Vector4};

fn network(scale: f64, levels: usize, snr: f64, encoder: Encoder) -> Network {
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]];
    let places = places.map(|p| Vector2::from(p) * scale);
    Network::new(&places, QuantizedRange::new(levels, RangeNoise::from_snr_db(snr).unwrap()).unwrap(), encoder).unwrap()
}

fn prior(scale: f64) -> Gaussian<4> {
    let covariance = Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01)) * (scale * scale);
    Gaussian::new(Vector4::new(13.0, 17.0, 0.0, -0.6) * scale, covariance).unwrap()
}

fn target(scale: f64) -> Target {
    Target::new(1.0, 0.02 * scale * scale, AccelerationChain::printed(0.1 * scale).unwrap()).unwrap()
}

/// Ten steps; the estimates in units of the scale.
fn track<T: Tracker>(tracker: &T, scale: f64, reports: Reports) -> Vec<Vector4<f64>> {
    let (network, target) = (network(scale, 4, 40.0, Encoder::published(3.0 * scale).unwrap()), target(scale));
    let mut rng = Stream::new(7).rng();
    let mut world = Stream::new(8).rng();
    let truth = target.simulate(&mut world, prior(scale).mean(), 10);
    let mut belief = tracker.start(&mut rng, &target, &prior(scale)).unwrap();
    let mut workspace = T::Workspace::default();
    let mut estimates = Vec::new();
    for (k, state) in truth.iter().enumerate() {
        let ranges = network.measure(&mut world, state[0], state[1]);
        let observed = network
            .observe(&target, k, &tracker.estimate(&belief), &ranges, reports)
            .unwrap();
        tracker
            .step_in_place(&mut rng, &target, k, &mut belief, &observed, &mut workspace)
            .unwrap();
        estimates.push(tracker.estimate(&belief).mean() / scale);
    }
    estimates
}

fn unit_free<T: Tracker>(tracker: &T, tolerance: f64) {
    for reports in [Reports::Levels, Reports::Ranges] {
        let own = track(tracker, 1.0, reports);
        // Powers of two: rounding is then the same, and no draw falls to the other side of a rounded edge.
        for scale in [-14, 14].map(|e| 2.0_f64.powi(e)) {
            for (a, b) in own.iter().zip(track(tracker, scale, reports)) {
                assert!((a - b).amax() < tolerance, "{}: {a} against {b} at {scale}", std::any::type_name::<T>());
            }
        }
    }
}

#[test]
fn no_tracker_depends_on_the_unit() {
    unit_free(&Linearised::EKF, 1e-9);
    unit_free(&Linearised::MESSAGE_PASSING_TRANSFER, 1e-9);
    unit_free(&GridFilter::new(POSITION).unwrap(), 1e-9);
    unit_free(&GuidedGaussian::new(20).unwrap(), 1e-6);
    unit_free(&RaoBlackwellGuided::new(100).unwrap(), 1e-6);
    unit_free(&MessagePassing::improved(20).unwrap(), 1e-6);
    unit_free(&MessagePassing::published(20).unwrap(), 1e-6);
}

#[test]
fn a_failed_step_leaves_the_belief_as_it_was() {
    let target = target(1.0);
    let network = network(1.0, 4, 40.0, Encoder::published(3.0).unwrap());
    assert!(
        network
            .observe(&target, 0, &prior(1.0), &[1.0; 4], Reports::Levels)
            .is_err()
    );
    assert!(
        network
            .observe(&target, 0, &prior(1.0), &[f64::NAN; 5], Reports::Levels)
            .is_err()
    );
    assert!(
        network
            .observe(&target, 0, &prior(1.0), &[f64::INFINITY; 5], Reports::Ranges)
            .is_err()
    );
    // A particle that cannot have seen the level.
    let observed = network
        .observe(&target, 0, &prior(1.0), &[0.001; 5], Reports::Levels)
        .unwrap();
    let far = Gaussian::known(Vector4::new(1e160, 0.0, 0.0, 0.0)).unwrap();
    let mut rng = Stream::new(3).rng();
    let mut belief = WithManoeuvre::cloud(&mut rng, &far, 5).unwrap();
    let before = belief.clone();
    let sensed: Vec<_> = observed
        .iter()
        .map(|one| Observed::new(one.sensing.on_axes::<6>(POSITION).unwrap(), one.factor.clone()))
        .collect();
    let motion = WithManoeuvre::at(target, 0);
    let mut filter = BootstrapFilter::new(ResamplingRule::default(), 5).unwrap();
    let failed = filter.step_in_place(&mut rng, &motion, &mut belief, &[&sensed]);
    assert!(matches!(failed, Err(Error::Impossible)) || failed.is_ok());
    if failed.is_err() {
        assert_eq!(belief, before);
    }
    // A known position has no grid.
    let known = Gaussian::known(Vector2::zeros()).unwrap();
    let mut filter = GridFilter::<2, 2>::new(POSITION).unwrap();
    let grid = filter.update(&mut rng, &mut known.clone(), &[&observed]);
    assert!(matches!(grid, Err(Error::Argument(_))));
}

#[test]
fn what_contradicts_everything_falls_back_and_says_so() {
    let target = target(1.0);
    let network = network(1.0, 16, 80.0, Encoder::published(30.0).unwrap());
    // Ranges that no point in the plane has.
    let observed = network
        .observe(&target, 0, &prior(1.0), &[0.1, 60.0, 0.1, 60.0, 0.1], Reports::Levels)
        .unwrap();
    let mut rng = Stream::new(3).rng();
    let (belief, info) =
        Tracker::step(&GridFilter::new(POSITION).unwrap(), &mut rng, &target, 0, &prior(1.0), &observed).unwrap();
    assert_eq!(info.fallbacks, 1);
    assert!(belief.mean().iter().all(|x| x.is_finite()));
    let (_, info) = GuidedGaussian::new(5)
        .unwrap()
        .step(&mut rng, &target, 0, &prior(1.0), &observed)
        .unwrap();
    assert!(info.fallbacks <= 1);
    for tracker in [
        MessagePassing::improved(3).unwrap(),
        MessagePassing::published(3).unwrap(),
    ] {
        let stepped = tracker.step(&mut rng, &target, 0, &prior(1.0), &observed);
        assert!(stepped.is_err() || stepped.unwrap().0.mean().iter().all(|x| x.is_finite()));
    }
}

#[test]
fn settings_are_checked() {
    let noise = RangeNoise::from_snr_db(40.0).unwrap();
    let scheme = QuantizedRange::new(4, noise).unwrap();
    let encoder = Encoder::published(3.0).unwrap();
    assert!(Network::new(&[], scheme.clone(), encoder).is_err());
    let twice = [Vector2::zeros(), Vector2::zeros()];
    let error = Network::new(&twice, scheme, encoder).unwrap_err().to_string();
    assert!(error.contains("different places"), "{error}");
    assert!(GridFilter::<4, 2>::new(POSITION).unwrap().with_nodes(2).is_err() && GuidedGaussian::new(1).is_err());
    assert!(RaoBlackwellGuided::new(0).is_err());
    let mut broken = MessagePassing::improved(2).unwrap();
    broken.particles = 1;
    let mut rng = Stream::new(1).rng();
    assert!(broken.start(&mut rng, &target(1.0), &prior(1.0)).is_err());
}

#[test]
fn every_kind_of_bad_input_is_a_typed_error() {
    let (noise, nan) = (RangeNoise::from_snr_db(40.0).unwrap(), f64::NAN);
    let sensor = RangeSensor::new(Vector2::zeros(), noise).unwrap();
    let printed = AccelerationChain::printed(0.1).unwrap();
    let (initial, transition) = ([0.7, 0.15, 0.15], [[0.6, 0.2, 0.2], [0.4, 0.5, 0.1], [0.4, 0.1, 0.5]]);
    let scheme = QuantizedRange::new(4, noise).unwrap();
    let reference = |half_width: f64| RangeReference {
        centre: 5.0,
        half_width,
    };
    let mut crooked = Matrix4::identity();
    crooked[(0, 1)] = 0.5;
    let mut indefinite = Matrix4::identity();
    indefinite[(0, 0)] = -1e-3;
    let refused = [
        ("one particle", MessagePassing::improved(1).is_err() && MessagePassing::published(1).is_err()),
        ("no particle", RaoBlackwellGuided::new(0).is_err()),
        ("one draw", GuidedGaussian::new(1).is_err()),
        ("two nodes", GridFilter::<4, 2>::new(POSITION).unwrap().with_nodes(2).is_err()),
        ("one level", QuantizedRange::new(1, noise).is_err() && QuantizedRange::new(0, noise).is_err()),
        (
            "speed",
            [0.0, -1.0, nan]
                .iter()
                .all(|v| Encoder::published(*v).is_err() && Encoder::predicted(*v).is_err()),
        ),
        ("interval", [0.0, -1.0, nan].iter().all(|t| Target::new(*t, 0.02, printed).is_err())),
        ("process noise", Target::new(1.0, -0.1, printed).is_err()),
        ("acceleration", AccelerationChain::new(nan, initial, transition).is_err()),
        ("no noise", RangeNoise::new(0.0, 0.0).is_err() && RangeNoise::new(-1.0, 1.0).is_err()),
        ("no stored noise", serde_json::from_str::<RangeNoise>(r#"{"constant":0,"relative":0}"#).is_err()),
        ("place", RangeSensor::new(Vector2::new(nan, 0.0), noise).is_err()),
        ("axes", [[0, 0], [0, 4]].iter().all(|axes| sensor.on_axes::<4>(*axes).is_err())),
        (
            "signal-to-noise ratio",
            [nan, f64::INFINITY, 1e9, -1e9]
                .iter()
                .all(|r| RangeNoise::from_snr_db(*r).is_err()),
        ),
        ("deviation", [0.0, -1.0, nan].iter().all(|s| RangeNoise::constant(*s).is_err())),
        (
            "range",
            [nan, f64::INFINITY]
                .iter()
                .all(|z| scheme.level(*z, &reference(1.0)).is_err()),
        ),
        (
            "half width",
            [0.0, -1.0, nan]
                .iter()
                .all(|w| scheme.level(5.0, &reference(*w)).is_err()),
        ),
        ("level", scheme.received(Symbol(4), &reference(1.0)).is_err()),
        ("initial law", AccelerationChain::new(0.1, [0.7, 0.2, 0.2], transition).is_err()),
        ("transition", AccelerationChain::new(0.1, initial, [initial, initial, [0.5, 0.6, -0.1]]).is_err()),
        ("no sensor", Network::new(&[], scheme.clone(), Encoder::adaptive(4).unwrap()).is_err()),
        ("asymmetric", Gaussian::new(Vector4::zeros(), crooked).is_err()),
        ("indefinite", Gaussian::new(Vector4::zeros(), indefinite).is_err()),
        (
            "weights",
            [f64::NEG_INFINITY, f64::INFINITY, nan]
                .iter()
                .all(|w| weighted(*w).is_err()),
        ),
    ];
    let missed: Vec<&str> = refused
        .iter()
        .filter(|(_, refused)| !refused)
        .map(|(what, _)| *what)
        .collect();
    assert!(missed.is_empty(), "{missed:?}");
    // Forty points to the power of six: beyond enumeration, and the belief stays.
    let exhaustive = MessagePassing {
        sampler: ProductSampler::Exact,
        ..MessagePassing::improved(40).unwrap()
    };
    let (target, network) = (target(1.0), network(1.0, 4, 40.0, Encoder::published(3.0).unwrap()));
    let observed = network
        .observe(&target, 0, &prior(1.0), &[9.0; 5], Reports::Levels)
        .unwrap();
    let mut belief = prior(1.0);
    let mut rng = Stream::new(4).rng();
    let failed = exhaustive.step_in_place(&mut rng, &target, 0, &mut belief, &observed, &mut Default::default());
    assert!(failed.is_err());
    assert_eq!(belief, prior(1.0));
    // Points without spread have no kernel.
    let still = Target::new(1.0, 0.0, AccelerationChain::printed(0.0).unwrap()).unwrap();
    let known = Gaussian::known(*prior(1.0).mean()).unwrap();
    assert!(exhaustive.step(&mut rng, &still, 0, &known, &observed).is_err());
    assert!(still.simulate(&mut rng, known.mean(), 0).is_empty());
}

#[test]
fn a_stored_target_is_the_same() {
    let json = serde_json::to_string(&Target::printed().unwrap()).unwrap();
    assert_eq!(serde_json::from_str::<Target>(&json).unwrap(), Target::printed().unwrap());
}

fn weighted(log_weight: f64) -> Result<Particles<1>, Error> {
    Particles::new([vec![0.0, 1.0]], &[log_weight; 2])
}
