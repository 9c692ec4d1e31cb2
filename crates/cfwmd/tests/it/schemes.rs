//! Every scheme obeys the laws of `Scheme`.

use crate::Instant;
use fewbits_baselines::cfwmd::trigger::{StochasticTrigger, Triggered};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::LocalSensor;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::scheme::{Censoring, CovarianceFeedback};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::laws::factor::tilted_is_quadrature;
use fewbits_core::laws::message::{decoding_is_total, round_trip};
use fewbits_core::laws::scheme::{deterministic, honesty, total_probability, total_probability_with};
use fewbits_core::number::EvenLevels;
use fewbits_core::{
    BitString, Deterministic, Factor, Gaussian, LinearDynamics, LinearSensing, Link, NumberFormat, Observation, Scheme,
    Sensing,
};
use fewbits_models::{LinearSensor, ReceivedPower, ScalarSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{Matrix2, Matrix4, SVector, Vector1, Vector2, Vector4};
use proptest::prelude::{any, prop, prop_assert, prop_assert_eq, proptest};
use rand::{Rng, RngExt};

fn position() -> ScalarSensor<2> {
    LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.3).unwrap()
}

fn field() -> ReceivedPower<4> {
    ReceivedPower::new(Vector2::new(3.0, -1.0), [0, 2], 100.0, 1.0, 2.0, 0.8).unwrap()
}

fn links() -> [Link; 3] {
    let lossy = Link::lossy(0.3).unwrap();
    [Link::PERFECT, lossy, lossy.with_erasure(0.2).unwrap()]
}

/// Laws 1 and 2 of a scalar scheme whose report is a real number, without memory.
fn scalar_laws<S: Scheme<1, State = ()>>(
    scheme: &S,
    feedback: &S::Feedback,
    r: f64,
    report: impl Fn(f64) -> S::Report,
) {
    let measurements = [-3.0, -0.4, 0.2, 1.7, 6.0].map(Vector1::new);
    for link in links() {
        // Densities jump where the rule begins to send: panels no wider than a thousandth of the noise.
        let received = |m: &SVector<f64, 1>| {
            let density = |z: f64| match scheme.factor(feedback, &Observation::Received(report(z)), &link) {
                Ok(factor) => factor.log_likelihood(m).exp(),
                Err(_) => 0.0,
            };
            let reach = 9.0 * r.sqrt();
            gauss_legendre::<16>().composite(m[0] - reach, m[0] + reach, 4000, density)
        };
        total_probability_with(scheme, feedback, &link, received, &measurements, 1e-3).unwrap();
        let nothing = scheme.factor(feedback, &Observation::Nothing, &link).unwrap();
        let lost = scheme.factor(feedback, &Observation::Lost, &link).unwrap();
        let mut rng = Stream::new(8).rng();
        for m in measurements {
            let [nothing, lost] = [&nothing, &lost].map(|factor| factor.log_likelihood(&m).exp());
            let measure = |rng: &mut _| m + Vector1::new(draw(rng) * r.sqrt());
            honesty(scheme, feedback, &link, &mut rng, 20_000, measure, |o| matches!(o, Observation::Nothing), nothing)
                .unwrap();
            if link.erasure() > 0.0 {
                honesty(scheme, feedback, &link, &mut rng, 20_000, measure, |o| matches!(o, Observation::Lost), lost)
                    .unwrap();
            }
        }
        for missing in [nothing, lost] {
            tilted_is_quadrature(&missing, &Gaussian::scalar(0.7, 2.0).unwrap(), 16.0, 4001, 1e-9).unwrap();
        }
    }
}

/// The law of deterministic schemes, at measurements about `near`.
fn draws_nothing<const M: usize, S: Deterministic<M>>(scheme: &S, feedback: &S::Feedback, near: SVector<f64, M>)
where
    S::Report: PartialEq,
{
    let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
    let measurements = [-9.0, -0.4, 0.0, 0.2, 1.7, 40.0].map(|z| near.add_scalar(z));
    deterministic(scheme, feedback, &sources, &measurements).unwrap();
}

fn draw<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    rng.sample(rand_distr::StandardNormal)
}

#[test]
fn censoring_with_state_feedback_is_lawful() {
    let rule = CensoringRule::scalar(2.4, 0.45).unwrap();
    let scheme = Censoring::new(position(), rule, NumberFormat::Double).unwrap();
    scalar_laws(&scheme, &Vector2::new(0.5, 2.0), 1.3, Vector1::new);
    draws_nothing(&scheme, &Vector2::new(0.5, 2.0), Vector1::new(0.5));
    // A nonlinear sensor.
    let rule = CensoringRule::scalar(2.0, 0.7).unwrap();
    let scheme = Censoring::new(field(), rule, NumberFormat::Double).unwrap();
    scalar_laws(&scheme, &Vector4::new(8.0, 1.0, 12.0, 0.0), 0.8, Vector1::new);
}

#[test]
fn covariance_feedback_and_the_random_trigger_are_lawful() {
    let scheme = CovarianceFeedback::new(position(), 0.45, NumberFormat::Double).unwrap();
    let told = Gaussian::new(Vector2::new(0.5, 2.0), Matrix2::new(2.0, 0.4, 0.4, 1.0)).unwrap();
    scalar_laws(&scheme, &told, 1.3, Vector1::new);
    draws_nothing(&scheme, &told, Vector1::new(0.5));
    assert_eq!(round_trip(&told, &NumberFormat::Double).unwrap(), 5 * 64);
    assert!(CovarianceFeedback::new(position(), -1.0, NumberFormat::Double).is_err());

    let trigger = StochasticTrigger::for_rate(0.4, 2.4).unwrap();
    scalar_laws(
        &Triggered {
            sensing: position(),
            trigger,
        },
        &Vector2::new(0.5, 2.0),
        1.3,
        |z| z,
    );
}

#[test]
fn levels_are_cells_outside_the_interval_of_silence() {
    let levels = EvenLevels::new(-4.0, 5.0, 4).unwrap();
    let measurements: Vec<_> = (-24..=24).map(|i| Vector1::new(f64::from(i) * 0.5)).collect();
    let broadcast = Vector2::new(0.5, 2.0);
    for threshold in [0.0, 0.02, 0.45, 6.0] {
        let rule = CensoringRule::scalar(2.4, threshold).unwrap();
        let scheme = Censoring::new(position(), rule, NumberFormat::Fixed(levels)).unwrap();
        let values =
            (0..16).map(|i| Vector1::new(NumberFormat::Fixed(levels).rounded(-4.0 + 0.6 * f64::from(i)).unwrap()));
        for link in links() {
            let possible = values
                .clone()
                .filter(|v| scheme.factor(&broadcast, &Observation::Received(*v), &link).is_ok());
            total_probability(&scheme, &broadcast, &link, possible, &measurements).unwrap();
        }
    }
    // Issue: a measurement beyond the levels against a prediction within the threshold of the last one.
    let rule = CensoringRule::scalar(2.4, 9.0).unwrap();
    let scheme = Censoring::new(position(), rule, NumberFormat::fixed(-1.0, 1.0, 8).unwrap()).unwrap();
    let mut rng = Stream::new(1).rng();
    let report = scheme
        .encode(&mut rng, &mut (), &Vector1::new(100.0), &broadcast)
        .unwrap()
        .unwrap();
    assert_eq!(report[0], 1.0);
    let factor = scheme
        .factor(&broadcast, &Observation::Received(report), &Link::PERFECT)
        .unwrap();
    // All that is known: the measurement is beyond the interval of silence, on this side.
    assert!(factor.log_likelihood(&Vector1::new(100.0)) > -1e-12 && factor.log_likelihood(&Vector1::new(0.0)) < -5.0);
    assert!(
        scheme
            .encode(&mut rng, &mut (), &Vector1::new(f64::NAN), &broadcast)
            .is_err()
    );
}

#[test]
fn vectors_are_lawful() {
    let sensor = LinearSensor::new(Matrix2::identity(), Matrix2::new(2.0, 0.3, 0.3, 4.0)).unwrap();
    let rule = CensoringRule::new(&Matrix2::new(5.0, 1.0, 1.0, 6.0), 1.386).unwrap();
    let scheme = Censoring::new(sensor, rule, NumberFormat::Double).unwrap();
    let broadcast = Vector2::new(0.5, 2.0);
    draws_nothing(&scheme, &broadcast, broadcast);
    let deviations = sensor.noise_covariance().cholesky().unwrap().l();
    for link in links() {
        let nothing = scheme.factor(&broadcast, &Observation::Nothing, &link).unwrap();
        let lost = scheme.factor(&broadcast, &Observation::Lost, &link).unwrap();
        let mut rng = Stream::new(9).rng();
        for m in [Vector2::new(0.0, 2.5), Vector2::new(3.0, -1.0)] {
            let [p, known] = [&nothing, &lost].map(|factor| factor.log_likelihood(&m).exp());
            let measure = |rng: &mut _| m + deviations * Vector2::new(draw(rng), draw(rng));
            honesty(&scheme, &broadcast, &link, &mut rng, 40_000, measure, |o| matches!(o, Observation::Nothing), p)
                .unwrap();
            if link.erasure() > 0.0 {
                honesty(
                    &scheme,
                    &broadcast,
                    &link,
                    &mut rng,
                    40_000,
                    measure,
                    |o| matches!(o, Observation::Lost),
                    known,
                )
                .unwrap();
            }
            // Sent or silent.
            let silent = (p - link.loss()) / (1.0 - link.loss());
            assert!((known / link.lost_given_sent() + silent - 1.0).abs() < 1e-7);
            // What is sent arrives with its density: the share of reports in a half plane.
            let half = |o: &Observation<Vector2<f64>>| o.received().is_some_and(|z| z[0] > 4.0);
            let reach = gauss_legendre::<24>();
            let share = reach.composite(4.0, 14.0, 40, |a| {
                reach.composite(m[1] - 16.0, m[1] + 16.0, 40, |b| {
                    scheme
                        .factor(&broadcast, &Observation::Received(Vector2::new(a, b)), &link)
                        .map_or(0.0, |f| f.log_likelihood(&m).exp())
                })
            });
            honesty(&scheme, &broadcast, &link, &mut rng, 40_000, measure, half, share).unwrap();
        }
    }
    let rule = CensoringRule::new(&Matrix2::identity(), 1.0).unwrap();
    assert!(Censoring::new(sensor, rule.clone(), NumberFormat::fixed(0.0, 1.0, 8).unwrap()).is_err());
    let json = serde_json::to_string(&rule).unwrap();
    assert_eq!(serde_json::from_str::<CensoringRule<2>>(&json).unwrap(), rule);
    assert!(
        serde_json::from_str::<CensoringRule<2>>(&json.replace("\"threshold\":1.0", "\"threshold\":-1.0")).is_err()
    );
}

/// Without feedback, given the sensor's memory; a fresh memory for every draw.
#[test]
fn a_sensor_with_its_own_filter_is_lawful_given_its_memory() {
    let start = Gaussian::new(Vector2::new(0.0, 10.0), Matrix2::identity()).unwrap();
    let dynamics = constant_velocity_1d(1.0, 0.5).unwrap();
    let mut sensor = LocalSensor::new(position(), 0.45, NumberFormat::Double, &start).unwrap();
    let mut rng = Stream::new(2).rng();
    sensor.step(&dynamics, &Vector1::new(11.0)).unwrap();
    // The scheme of its second slot, told what only the sensor knows.
    let mut own = OwnRecursion::new(&start);
    let [_, second] = [(); 2].map(|()| own.advance(&dynamics, &position(), start.mean()).unwrap());
    let rule = CensoringRule::new(&second.innovation_covariance, 0.45).unwrap();
    let slot = Censoring::new(position(), rule, NumberFormat::Double).unwrap();
    let told = dynamics.transition() * sensor.estimate();
    for link in links() {
        let nothing = slot.factor(&told, &Observation::Nothing, &link).unwrap();
        for m in [18.0, 20.5, 23.0] {
            let p = nothing.log_likelihood(&Vector1::new(m)).exp();
            let silent = (0..20_000).filter(|_| {
                let z = Vector1::new(m + draw(&mut rng) * 1.3_f64.sqrt());
                let report = sensor.clone().step(&dynamics, &z).unwrap();
                link.transmit(&mut rng, report.as_ref(), &NumberFormat::Double).unwrap() == Observation::Nothing
            });
            let share = silent.count() as f64 / 20_000.0;
            assert!((share - p).abs() < 4.0 * (p * (1.0 - p) / 20_000.0).sqrt(), "{share} {p}");
        }
    }
}

proptest! {
    #[test]
    fn broadcasts_decode_totally(bytes in prop::collection::vec(any::<u8>(), 0..48), cut in 0..8usize) {
        let bits = BitString::from_bytes(bytes.clone(), (bytes.len() * 8).saturating_sub(cut)).unwrap();
        for format in [NumberFormat::Double, NumberFormat::Single, NumberFormat::fixed(-5.0, 5.0, 12).unwrap()] {
            let _ = decoding_is_total::<Gaussian<2>>(&bits, &format);
        }
    }

    #[test]
    fn what_was_sent_is_received(z in -30.0..30.0f64, prediction in -30.0..30.0f64, s in 0.1..50.0f64) {
        let (broadcast, link) = (Vector2::new(prediction, 0.0), Link::PERFECT);
        for format in [NumberFormat::Double, NumberFormat::Single, NumberFormat::fixed(-50.0, 50.0, 12).unwrap()] {
            let scheme = Censoring::new(position(), CensoringRule::scalar(s, 0.45).unwrap(), format).unwrap();
            let report = scheme.encode(&mut Stream::new(1).rng(), &mut (), &Vector1::new(z), &broadcast).unwrap();
            let silent = (z - prediction).abs() < scheme.rule().half_width();
            prop_assert_eq!(report.is_none(), silent);
            if let Some(report) = report {
                prop_assert_eq!(report[0], format.rounded(z).unwrap());
                prop_assert_eq!(round_trip(&report, &format).unwrap(), format.bits() as usize);
            }
            let factor = scheme.factor(&broadcast, &report.into(), &link).unwrap();
            prop_assert!(factor.log_likelihood(&Vector1::new(z)).is_finite());
        }
    }
}

#[test]
fn ties_are_sent_and_breaches_refused() {
    let rule = CensoringRule::scalar(4.0, 1.0).unwrap();
    assert!(rule.sends(&Vector1::new(2.0)) && !rule.sends(&Vector1::new(1.999)));
    assert!(CensoringRule::scalar(4.0, 0.0).unwrap().sends(&Vector1::new(0.0)));
    // Rounding of 1e-9 of the statistic is forgiven, and what the format moved.
    let none = Vector1::zeros();
    assert!(rule.check(&Vector1::new(2.0), &none).is_ok() && rule.check(&Vector1::new(2.0 - 1e-10), &none).is_ok());
    assert!(rule.check(&Vector1::new(2.0 - 1e-8), &none).is_err());
    assert!(rule.check(&Vector1::new(1.9), &Vector1::new(0.11)).is_ok());
    assert!(rule.check(&Vector1::new(1.9), &Vector1::new(0.09)).is_err());
    let vector = CensoringRule::new(&Matrix2::new(4.0, 0.0, 0.0, 1.0), 1.0).unwrap();
    assert!(vector.sends(&Vector2::new(2.0, 0.0)) && !vector.sends(&Vector2::new(1.9, 0.1)));
    let scheme = Censoring::new(position(), rule, NumberFormat::Double).unwrap();
    let breach = Observation::Received(Vector1::new(1.0));
    assert!(scheme.factor(&Vector2::zeros(), &breach, &Link::PERFECT).is_err());
    let far = Observation::Received(Vector1::new(5.0));
    assert!(
        scheme
            .factor(&Vector2::zeros(), &far, &Link::flipping(0.1).unwrap())
            .is_err()
    );
    assert!(
        scheme
            .factor(&Vector2::new(f64::NAN, 0.0), &far, &Link::PERFECT)
            .is_err()
    );
    let network =
        Network::new(vec![position(); 2], Budget::new(1.0, 2).unwrap().threshold(1).unwrap(), Link::PERFECT).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    let rules = network.rules_under(&belief).unwrap();
    let error = network
        .likelihood(&rules, belief.mean(), &[far, Observation::Received(Vector1::new(0.1))])
        .unwrap_err();
    assert_eq!(error, fewbits_cfwmd::Error::Impossible);
    let power = Network::new(vec![field(); 2], 1.0, Link::PERFECT).unwrap();
    let plane = Gaussian::new(Vector4::new(8.0, 1.0, 2.0, 0.0), Matrix4::identity()).unwrap();
    let rule = power.rule_under(0, &plane).unwrap();
    let h = field().jacobian(plane.mean());
    assert!((rule.region().innovation_covariance() - h * h.transpose() - Vector1::new(0.8)).amax() < 1e-12);
}
