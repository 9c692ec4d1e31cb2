//! Particles against sums written out by hand.

use fewbits_core::Belief;
use fewbits_densities::{Error, Particles};
use proptest::prelude::*;

fn weighted() -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>)> {
    (1..40usize).prop_flat_map(|n| {
        let column = prop::collection::vec(-100.0..100.0f64, n);
        let log_weight = prop_oneof![4 => -30.0..30.0f64, 1 => Just(f64::NEG_INFINITY)];
        (column.clone(), column, prop::collection::vec(log_weight, n))
    })
}

proptest! {
    #[test]
    fn moments_are_the_weighted_sums((x, y, logs) in weighted()) {
        let total: f64 = logs.iter().map(|l| l.exp()).sum();
        let belief = Particles::new([x.clone(), y.clone()], &logs);
        if total == 0.0 {
            prop_assert!(matches!(belief, Err(Error::Impossible)), "{belief:?}");
            return Ok(());
        }
        let mut belief = belief.unwrap();
        let w: Vec<f64> = logs.iter().map(|l| l.exp() / total).collect();
        let mean = |c: &[f64]| w.iter().zip(c).map(|(w, x)| w * x).sum::<f64>();
        let (mx, my) = (mean(&x), mean(&y));
        let cov: f64 = (0..w.len()).map(|i| w[i] * (x[i] - mx) * (y[i] - my)).sum();
        let ess = 1.0 / w.iter().map(|w| w * w).sum::<f64>();
        prop_assert!((belief.mean()[0] - mx).abs() < 1e-9);
        prop_assert!((belief.covariance()[(1, 0)] - cov).abs() < 1e-9);
        prop_assert!((belief.effective_sample_size() - ess).abs() < 1e-9 * ess);
        prop_assert!(belief.weights().iter().zip(&w).all(|(a, b)| (a - b).abs() < 1e-12));
        let log_sum = belief.reweigh(|_, log_weights| log_weights.copy_from_slice(&logs)).unwrap();
        prop_assert!((log_sum - total.ln()).abs() < 1e-9);
        prop_assert!((belief.log_weights().iter().map(|l| l.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn selection_copies_and_equalises((x, y, _) in weighted(), picks in prop::collection::vec(0..40u32, 1..60)) {
        let mut belief = Particles::uniform([x.clone(), y.clone()]).unwrap();
        let picks: Vec<u32> = picks.iter().map(|p| p % x.len() as u32).collect();
        belief.select(&picks).unwrap();
        prop_assert_eq!(belief.len(), picks.len());
        prop_assert!((belief.effective_sample_size() - picks.len() as f64).abs() < 1e-9);
        for (i, p) in picks.iter().enumerate() {
            let point = belief.point(i).unwrap();
            prop_assert_eq!((point[0], point[1]), (x[*p as usize], y[*p as usize]));
        }
        let before = belief.clone();
        prop_assert!(belief.select(&[belief.len() as u32]).is_err());
        prop_assert_eq!(belief, before);
    }
}

#[test]
fn a_failed_reweighing_keeps_the_belief() {
    let mut belief = Particles::new([vec![0.0, 1.0]], &[0.0, 3.0_f64.ln()]).unwrap();
    let before = belief.clone();
    for bad in [[f64::NEG_INFINITY; 2], [f64::NAN, 0.0], [f64::INFINITY, 0.0]] {
        let result = belief.reweigh(|_, log_weights| log_weights.copy_from_slice(&bad));
        let expected = if bad[0] == f64::NEG_INFINITY {
            matches!(result, Err(Error::Impossible))
        } else {
            matches!(result, Err(Error::NotANumber { .. }))
        };
        assert!(expected, "{bad:?}: {result:?}");
        assert_eq!(belief, before);
        assert!((belief.weights()[1] - 0.75).abs() < 1e-15);
        assert!((belief.effective_sample_size() - 1.6).abs() < 1e-14);
    }
}

#[test]
fn log_weights_far_below_underflow_still_count() {
    let belief = Particles::new([vec![0.0, 4.0]], &[-1e6, -1e6]).unwrap();
    assert_eq!(belief.mean()[0], 2.0);
}

#[test]
fn bad_particles_are_refused() {
    let refused = |columns: [Vec<f64>; 1], logs: Vec<f64>| Particles::new(columns, &logs).unwrap_err().to_string();
    assert!(refused([vec![]], vec![]).contains("at least 1"));
    assert!(refused([vec![1.0]], vec![0.0, 0.0]).contains("one per particle"));
    assert!(refused([vec![f64::NAN]], vec![0.0]).contains("columns"));
    assert!(refused([vec![1.0]], vec![f64::NAN]).contains("log_weights"));
    assert!(refused([vec![1.0]], vec![f64::INFINITY]).contains("log_weights"));
    assert!(refused([vec![1.0]], vec![f64::NEG_INFINITY]).contains("impossible"));
}

#[test]
fn storage_round_trips_and_checks() {
    let belief = Particles::uniform([vec![1.0, 2.0], vec![3.0, -1.0]]).unwrap();
    let text = serde_json::to_string(&belief).unwrap();
    assert_eq!(serde_json::from_str::<Particles<2>>(&text).unwrap(), belief);
    assert!(serde_json::from_str::<Particles<3>>(&text).is_err());
    assert!(serde_json::from_str::<Particles<1>>(r#"{"columns":[[1.0]],"weights":[0.5,0.5]}"#).is_err());
}

#[test]
fn particles_and_clouds_give_back_what_they_were_made_of() {
    use fewbits_core::Gaussian;
    use fewbits_densities::GaussianCloud;
    use nalgebra::{Matrix2, Vector2};
    let (x, y, logs) = (vec![1.0, 4.0, -2.0], vec![0.5, -1.5, 3.0], [0.2, -0.7, 1.1]);
    let belief = Particles::new([x.clone(), y.clone()], &logs).unwrap();
    let mut belief = belief.with_auxiliary(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
    assert_eq!((belief.len(), belief.auxiliary_width()), (3, 2));
    assert_eq!(
        (belief.columns(), belief.point(2), belief.point(3)),
        ([&x[..], &y[..]], Some(Vector2::new(-2.0, 3.0)), None)
    );
    let mut same = Particles::uniform([vec![0.0; 5], vec![0.0; 5]]).unwrap();
    same.clone_from(&belief);
    assert_eq!(same, belief);
    assert_eq!((same.weights(), same.effective_sample_size()), (belief.weights(), belief.effective_sample_size()));
    {
        let ([_, y], side) = belief.parts_mut();
        (y[1], side[3]) = (-2.5, 7.0);
    }
    belief.columns_mut()[0][0] = 1.5;
    assert_eq!((belief.columns()[0][0], belief.columns()[1][1], belief.auxiliary()[3]), (1.5, -2.5, 7.0));
    assert_ne!(same, belief);
    // About another point the covariance gains the outer product of the gap.
    let gap = Vector2::new(0.3, -1.1);
    let about = belief.covariance_about(&(belief.mean() + gap)) - belief.covariance();
    assert!((about - gap * gap.transpose()).amax() < 1e-13);
    let shared = Matrix2::new(2.0, 0.5, 0.5, 1.0);
    let mut cloud = GaussianCloud::new(belief.clone(), shared).unwrap();
    assert_eq!((&cloud.means, &cloud.shared_covariance), (&belief, &shared));
    assert_eq!((*cloud.gaussian().mean(), Belief::mean(&cloud)), (belief.mean(), belief.mean()));
    assert!((Belief::covariance(&cloud) - belief.covariance() - shared).amax() < 1e-14);
    cloud.shared_covariance = shared * 3.0;
    cloud.means.select(&[0, 1, 2]).unwrap();
    assert!((Belief::covariance(&cloud) - cloud.means.covariance() - shared * 3.0).amax() < 1e-14);
    assert_eq!((cloud.means.weights(), cloud.means.effective_sample_size()), (&[1.0 / 3.0; 3][..], 3.0));
    assert_eq!(cloud.means.log_weights(), [(1.0_f64 / 3.0).ln(); 3]);
    let agreed = GaussianCloud::agreed(&Gaussian::new(gap, shared).unwrap(), 4).unwrap();
    assert!((Belief::mean(&agreed) - gap).amax() < 1e-15 && (Belief::covariance(&agreed) - shared).amax() < 1e-15);
    assert!(agreed.means.len() == 4 && GaussianCloud::agreed(&Gaussian::new(gap, shared).unwrap(), 0).is_err());
    assert!(Particles::from_belief(&mut fewbits_monte_carlo::Stream::new(1).rng(), &agreed, 0).is_err());
}

/// What is stored with weights that are not theirs is refused, down to the effective number.
#[test]
fn stored_weights_are_checked_against_each_other() {
    let stored = |more: &str| {
        let text = format!(r#"{{"columns":[[1.0,2.0,3.0]],"weights":[0.5,0.25,0.25]{more}}}"#);
        serde_json::from_str::<Particles<1>>(&text)
    };
    let logs = [0.5_f64.ln(), 0.25_f64.ln(), 0.25_f64.ln()]
        .map(|l| l.to_string())
        .join(",");
    let good = stored("").unwrap();
    assert!((good.effective_sample_size() - 8.0 / 3.0).abs() < 1e-14);
    assert_eq!(stored(&format!(r#","log_weights":[{logs}]"#)).unwrap(), good);
    assert!(stored(r#","log_weights":[-0.6931471805599453,-1.3862943611198906]"#).is_err());
    assert!(stored(r#","log_weights":[-0.6931471805599453,null,-1.3862943611198906]"#).is_err());
    let effective = |n: f64| stored(&format!(r#","effective_sample_size":{n}"#));
    assert_eq!(effective(8.0 / 3.0).unwrap().effective_sample_size(), 8.0 / 3.0);
    assert!(effective(2.6667).is_err() && effective(2.6666).is_err() && effective(3.0).is_err());
    let zero = r#"{"columns":[[1.0,2.0,3.0]],"weights":[0.5,0.0,0.5],"log_weights":[-0.6931471805599453,null,-0.6931471805599453]}"#;
    let zero: Particles<1> = serde_json::from_str(zero).unwrap();
    assert_eq!((zero.log_weights()[1], zero.weights()[1], zero.mean()[0]), (f64::NEG_INFINITY, 0.0, 2.0));
    let text = serde_json::to_string(&zero).unwrap();
    assert!(text.contains(r#"-0.6931471805599453,"-inf""#), "{text}");
    assert_eq!(serde_json::from_str::<Particles<1>>(&text).unwrap(), zero);
}
