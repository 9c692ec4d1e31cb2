//! Wild arguments: ranges, references, associations and trackers answer numbers or errors, and a failed step keeps the belief.

use fewbits_baselines::pf_mpa::association::{AssociationRule, separation, update};
use fewbits_baselines::pf_mpa::leader::elect;
use fewbits_baselines::pf_mpa::{
    AccelerationChain, Encoder, GuidedGaussian, IntervalRule, Linearised, Network, POSITION, RangeFactor,
    RaoBlackwellGuided, Reports, Target, Tracker,
};
use fewbits_baselines::pf_mpa::{MessagePassing, RingBias, kernel_error};
use fewbits_core::factor::Scalar;
use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::wild;
use fewbits_pf_mpa::{
    GridFilter, QuantizedRange, RangeNoise, RangeReference, RangeSensor, level_information, range_information,
};
use nalgebra::{Matrix4, Vector2, Vector4};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn noise(x: [f64; 2]) -> RangeNoise {
    [
        RangeNoise::new(x[0], x[1]),
        RangeNoise::constant(x[0]),
        RangeNoise::from_snr_db(x[1]),
    ]
    .into_iter()
    .flatten()
    .next()
    .unwrap_or_else(|| RangeNoise::constant(0.1).unwrap())
}

fn check<F: Factor<1> + std::fmt::Debug>(factor: &F, at: f64, prior: Option<&Gaussian<1>>) {
    let log = factor.log_likelihood(&[at].into());
    assert!(!at.is_finite() || at < 0.0 || !log.is_nan() && log < f64::INFINITY, "{factor:?} at {at}: {log}");
    if let Some(prior) = prior
        && let Ok(tilted) = factor.tilted(prior)
    {
        assert!(
            tilted.mean[0].is_finite() && tilted.covariance[0] >= 0.0 && tilted.log_evidence.is_finite(),
            "{factor:?} {prior:?}: {tilted:?}"
        );
    }
}

proptest! {
    #[test]
    fn ranges_and_levels_answer_numbers(x in prop::array::uniform12(wild()), levels in 0..9_usize, level in 0..10_usize) {
        let noise = noise([x[0], x[1]]);
        prop_assert!(!noise.deviation(x[2]).is_nan() || x[2].is_nan() || x[2] < 0.0, "{:?} {}", noise, x[2]);
        let prior = Gaussian::scalar(x[3], x[4]).ok();
        let reference = RangeReference { centre: x[5], half_width: x[6] };
        let link = Link::new(x[7], x[8]).and_then(|link| link.with_erasure(x[9])).unwrap_or(Link::PERFECT);
        let mut factors: Vec<Scalar> = Vec::new();
        let mut reports: Vec<RangeFactor> = RangeFactor::value(x[10], noise).into_iter().collect();
        if let Ok(scheme) = QuantizedRange::new(levels, noise) {
            let told = scheme.level(x[10], &reference);
            prop_assert!(told.is_ok_and(|level| level.0 < levels) || scheme.level(x[10], &reference).is_err());
            for rule in [IntervalRule::Correct, IntervalRule::Printed] {
                reports.extend(RangeFactor::level(&scheme, fewbits_quantizers::Symbol(level), &reference, rule));
            }
            for seen in [Observation::Received(fewbits_quantizers::Symbol(level)), Observation::Nothing, Observation::Lost] {
                factors.extend(scheme.factor(&reference, &seen, &link));
            }
        }
        for factor in &factors {
            check(factor, x[11], prior.as_ref());
            check(factor, 5.0, prior.as_ref());
        }
        for report in &reports {
            check(report, x[11], prior.as_ref());
            check(report, 5.0, prior.as_ref());
            let reconstructed = report.reconstruction();
            prop_assert!(reconstructed.is_none_or(|(m, v)| m.is_finite() && !v.is_nan()), "{:?}", report);
        }
        if let Ok(sensor) = RangeSensor::new(Vector2::new(x[0], x[1]), noise) && x[2].is_finite() && x[3].is_finite() {
            prop_assert!(sensor.distance(x[2], x[3]) >= 0.0 && sensor.direction(x[2], x[3]).iter().all(|u| !u.is_nan()), "{:?} {:?}", sensor, x);
        }
        for information in [range_information(&noise, x[2]), level_information(&reference, levels, &noise, x[2])].into_iter().flatten() {
            prop_assert!(information >= 0.0, "{:?} {:?} {} {}: {}", noise, reference, levels, x[2], information);
        }
        if let Ok(bias) = RingBias::new(x[2], x[3], x[4]) {
            prop_assert!(bias.printed.is_finite() && bias.exact.is_finite() && !bias.total_variation.is_nan(), "{:?} {:?}", &x[2..5], bias);
        }
        let _ = (kernel_error(x[0], 2, x[1]), AccelerationChain::printed(x[0]), Encoder::published(x[0]), Encoder::adaptive(levels));
    }

    #[test]
    fn associations_are_probabilities_or_errors(x in prop::array::uniform8(wild()), gain in wild()) {
        let (Ok(one), Ok(two)) = (Gaussian::scalar(x[0], x[1]), Gaussian::scalar(x[2], x[3])) else { return Ok(()) };
        let targets = [one, two];
        for rule in [AssociationRule::PRINTED, AssociationRule::Tanh { gain }, AssociationRule::Logistic, AssociationRule::Exact] {
            if let Ok(p) = rule.probability(&targets, [x[4], x[5]], x[6]) {
                prop_assert!(!p.is_nan(), "{:?} {:?}", rule, x);
                prop_assert!((0.0..=1.0).contains(&p) || matches!(rule, AssociationRule::Tanh { gain } if gain < 0.0), "{:?} {:?}: {}", rule, x, p);
            }
        }
        let _ = separation([x[0], x[2]], [x[4], x[5]]);
        if let Ok(pair) = update(&targets, [x[4], x[5]], x[6], x[7]) {
            prop_assert!(!pair.straight.is_nan() && pair.targets.iter().all(Gaussian::is_finite), "{:?}: {:?}", x, pair);
        }
    }
}

/// One step of a tracker from the belief that it starts with.
fn step<T: Tracker>(
    tracker: &T,
    target: &Target,
    prior: &Gaussian<4>,
    observed: &[fewbits_baselines::pf_mpa::Ranged],
) -> Result<(), TestCaseError>
where
    T::Belief: Clone + PartialEq + std::fmt::Debug,
    T::Workspace: Default,
{
    let mut rng = Stream::new(3).rng();
    let Ok(before) = tracker.start(&mut rng, target, prior) else {
        return Ok(());
    };
    let mut belief = before.clone();
    match tracker.step_in_place(&mut rng, target, 1, &mut belief, observed, &mut T::Workspace::default()) {
        Ok(info) => prop_assert!(
            tracker.estimate(&belief).is_finite() && info.log_likelihood.is_none_or(|log| !log.is_nan()),
            "{:?} {:?} {:?}",
            prior,
            observed,
            info
        ),
        Err(_) => prop_assert_eq!(belief, before),
    }
    Ok(())
}

proptest! {
    // Each case runs six trackers: one case in 16.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(16), ..ProptestConfig::default() })]
    #[test]
    fn trackers_return_numbers_or_keep_their_belief(x in prop::array::uniform16(wild()), levels in 2..9_usize, values in any::<bool>()) {
        let scheme = QuantizedRange::new(levels, noise([x[0], x[1]])).unwrap();
        let encoder = Encoder::published(x[2]).unwrap_or(Encoder::adaptive(levels).unwrap());
        let places = [[0.0, 0.0], [x[3], 4.0], [5.0, x[4]]].map(Vector2::from);
        let Ok(network) = Network::new(&places, scheme, encoder) else { return Ok(()) };
        let chain = AccelerationChain::printed(x[5]).unwrap_or(AccelerationChain::printed(0.1).unwrap());
        let target = Target::new(x[6], x[7], chain).unwrap_or(Target::printed().unwrap());
        let spread = Matrix4::from_diagonal(&Vector4::new(x[8].abs(), x[9].abs(), 0.1, 0.2));
        let Ok(prior) = Gaussian::new(Vector4::new(x[10], x[11], 0.1, -0.2), spread) else { return Ok(()) };
        let reports = if values { Reports::Ranges } else { Reports::Levels };
        let Ok(observed) = network.observe(&target, 1, &prior, &x[12..15], reports) else { return Ok(()) };
        step(&Linearised::EKF, &target, &prior, &observed)?;
        step(&Linearised::MESSAGE_PASSING_TRANSFER, &target, &prior, &observed)?;
        step(&GridFilter::new(POSITION).unwrap(), &target, &prior, &observed)?;
        step(&GuidedGaussian::new(20).unwrap(), &target, &prior, &observed)?;
        step(&MessagePassing::improved(20).unwrap(), &target, &prior, &observed)?;
        step(&RaoBlackwellGuided::new(20).unwrap(), &target, &prior, &observed)?;
        let format = fewbits_core::NumberFormat::Single;
        if let Ok(handover) = fewbits_core::RoundedGaussian::new(&prior, &format) {
            prop_assert!(handover.belief().is_finite(), "{:?}", handover);
        }
        let _ = elect(&places, &[places[1], places[2]]);
    }
}
