//! Wild arguments: every constructor and step returns numbers or an error.

use crate::Instant;
use fewbits_baselines::cfwmd::fuse_received;
use fewbits_baselines::cfwmd::trigger::{StochasticTrigger, Triggered};
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::{JointBelief, joint};
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme};
use fewbits_models::{LinearSensor, constant_velocity_1d};
use nalgebra::{Matrix2, Vector1, Vector2};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(fewbits_core::laws::wild::number)
}

fn kind(which: usize, value: f64) -> Observation<Vector1<f64>> {
    [
        Observation::Received(Vector1::new(value)),
        Observation::Nothing,
        Observation::Lost,
    ][which % 3]
}

fn check<const M: usize>(factor: &impl Factor<M>, m: [f64; M], prior: Option<&Gaussian<M>>) {
    let log = factor.log_likelihood(&m.into());
    if m.iter().all(|x| x.is_finite()) {
        assert!(!log.is_nan() && log < f64::INFINITY, "{log} at {m:?}");
    }
    if let Some(prior) = prior
        && let Ok(tilted) = factor.tilted(prior)
    {
        let finite = tilted
            .mean
            .iter()
            .chain(tilted.covariance.iter())
            .all(|x| x.is_finite());
        assert!(finite && tilted.log_evidence.is_finite(), "{prior:?}: {tilted:?}");
    }
}

proptest! {
    #[test]
    fn scalar_networks_return_numbers_or_errors(x in prop::array::uniform16(wild()), which in 0..9_usize, sensors in 0..4_usize) {
        let _ = (Budget::new(x[0], sensors).and_then(|budget| budget.threshold(1)), Budget::new(x[0], sensors).and_then(|budget| budget.threshold(2)));
        let link = Link::new(x[0], 0.0).and_then(|link| link.with_erasure(x[1])).unwrap_or(Link::PERFECT);
        let Ok(sensor) = LinearSensor::scalar(Vector2::new(x[2], x[3]), x[4]) else { return Ok(()) };
        let Ok(network) = Network::new(vec![sensor; 2], x[5], link) else { return Ok(()) };
        let Ok(belief) = Gaussian::new(Vector2::new(x[6], x[7]), Matrix2::new(x[8], x[9], x[9], x[10])) else { return Ok(()) };
        let seen = [kind(which, x[11]), kind(which / 3, x[12])];
        let Ok(rules) = network.rules_under(&belief) else { return Ok(()) };
        if let Ok((after, info)) = network.fuse(&belief, &rules, &Vector2::new(x[13], x[14]), &seen) {
            prop_assert!(after.is_finite() && info.log_likelihood.is_finite(), "{:?} {:?}: {:?}", network, belief, after);
        }
        if let Ok((after, info)) = fuse_received(&network, &belief, &seen) {
            prop_assert!(after.is_finite() && info.log_likelihood.is_finite());
        }
        let dynamics = constant_velocity_1d(1.0, 1.0).unwrap();
        if let Ok(start) = JointBelief::new(&belief, 2)
            && let Ok((after, info)) = joint::step(&network, &dynamics, &start, &seen)
        {
            prop_assert!(after.state().is_finite() && info.log_likelihood.is_finite(), "{:?} {:?}: {:?}", network, belief, after);
        }
    }

    #[test]
    fn factors_of_wild_numbers_stay_numbers(x in prop::array::uniform12(wild()), nothing in 0..3_usize, lost in 0..3_usize) {
        let link = Link::new(x[0], 0.0).and_then(|link| link.with_erasure(x[1])).unwrap_or(Link::PERFECT);
        let prior = Gaussian::scalar(x[2], x[3]).ok();
        let reports = MissingReports { nothing, lost };
        if let Ok(rule) = CensoringRule::<1>::scalar(x[4], x[5]) {
            if let Ok(factor) = Censored::missing(&rule, &Vector1::new(x[6]), &Vector1::new(x[7]), &link, reports) {
                check(&factor, [x[8]], prior.as_ref());
            }
            let _ = rule.sends(&Vector1::new(x[8]));
        }
        if let Ok(trigger) = StochasticTrigger::new(x[4]).or_else(|_| StochasticTrigger::for_rate(x[4], x[5])) {
            let Ok(sensing) = LinearSensor::<1, 1>::direct(x[7]) else { return Ok(()) };
            let triggered: Triggered<_, 1> = Triggered { sensing, trigger };
            for seen in [Observation::Received(x[8]), Observation::Nothing, Observation::Lost] {
                if let Ok(factor) = triggered.factor(&Vector1::new(x[6]), &seen, &link) {
                    check(&factor, [x[9]], prior.as_ref());
                }
            }
        }
    }
}

proptest! {
    // One case in 8 of `PROPTEST_CASES`: ellipsoids.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]
    #[test]
    fn ellipsoids_of_wild_numbers_stay_numbers(x in prop::array::uniform16(wild()), lost in 0..2_usize) {
        let Ok(rule) = CensoringRule::new(&Matrix2::new(x[0], x[1], x[1], x[2]), x[3]) else { return Ok(()) };
        let noise = Matrix2::new(x[4], x[5], x[5], x[6]);
        let reports = MissingReports { nothing: 1 - lost, lost };
        let Ok(factor) = Censored::missing(&rule, &Vector2::new(x[7], x[8]), &noise, &Link::PERFECT, reports) else { return Ok(()) };
        let prior = Gaussian::new(Vector2::new(x[9], x[10]), Matrix2::new(x[11], x[12], x[12], x[13])).ok();
        check(&factor, [x[14], x[15]], prior.as_ref());
    }
}

#[test]
fn indefinite_noise_near_the_largest_number_is_refused() {
    let rule = CensoringRule::new(&Matrix2::new(0.04, -2.5, -2.5, 1e117), 1.1).unwrap();
    let noise = Matrix2::new(-3.0, f64::MAX, f64::MAX, 0.0);
    let reports = MissingReports { nothing: 1, lost: 0 };
    assert!(Censored::missing(&rule, &Vector2::zeros(), &noise, &Link::PERFECT, reports).is_err());
}
