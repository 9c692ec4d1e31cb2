//! Wild arguments: every constructor and step of this crate returns numbers or an error.

use fewbits_core::factor::{Constant, Factor, Levels, Product, Repeated, Scalar, Tilted, Value};
use fewbits_core::number;
use fewbits_core::{BitString, Cell, Gaussian, Link, NumberFormat, Observation, Sign};
use nalgebra::{Matrix2, SMatrix, Vector1, Vector2};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(fewbits_core::laws::wild::number)
}

/// What a factor says at any measurement and under any belief; sweeps are compared where the factor is `resolved` there.
fn check<const M: usize>(factor: &impl Factor<M>, m: [f64; M], prior: Option<&Gaussian<M>>, resolved: bool) {
    let log = factor.log_likelihood(&m.into());
    if m.iter().all(|x| x.is_finite()) {
        assert!(log < f64::INFINITY, "{log} at {m:?}");
    }
    let (columns, mut logs) = (m.map(|x| vec![x; 3]), [0.0; 3]);
    factor.add_log_likelihoods(&columns.each_ref().map(Vec::as_slice), &mut logs);
    for swept in logs {
        let same = swept == log || (swept.is_nan() && log.is_nan());
        assert!(same || !resolved || (swept - log).abs() <= 1e-9 * log.abs().max(1.0), "{swept} {log} at {m:?}");
    }
    if let Some(prior) = prior
        && let Ok(Tilted {
            log_evidence,
            mean,
            covariance,
        }) = factor.tilted(prior)
    {
        let finite = log_evidence.is_finite() && mean.iter().chain(covariance.iter()).all(|x| x.is_finite());
        assert!(finite && covariance.diagonal().min() >= 0.0, "{log_evidence} {mean} {covariance}");
    }
}

proptest! {
    #[test]
    fn factors_of_wild_numbers_stay_numbers(x in prop::array::uniform8(wild()), above in any::<bool>(), count in 0..4_usize) {
        let prior = Gaussian::scalar(x[0], x[1]).ok();
        let link = Link::new(x[2], x[3]).and_then(|link| link.with_erasure(x[4])).unwrap_or(Link::PERFECT);
        // Whether the two edges less a measurement keep six digits of their distance; else the order of operations decides.
        let resolved = |m: f64| (x[7] - x[5]).abs() > 1e-6 * (m.abs() + x[5].abs() + x[7].abs());
        let sign = if above { Sign::Above } else { Sign::Below };
        let mut all: Vec<Scalar> = Vec::new();
        all.extend(Levels::sign(sign, x[5], x[6], &link).map(Scalar::from));
        all.extend(Value::scalar(x[5], x[6]).map(Scalar::from));
        all.extend(Constant::new(x[2]).map(Scalar::from));
        all.push(Constant::of_delivery(&Observation::<Sign>::Lost, &link).into());
        if let Ok(cell) = Cell::new(x[5], x[7]) {
            all.extend(Levels::silence(cell, x[6], &link).map(Scalar::from));
            all.extend(Levels::new(cell, x[6], x[2], x[4]).map(Scalar::from));
            all.extend(Levels::outside(&cell, x[6], link.lost_given_sent()).map(Scalar::from));
            prop_assert!(!cell.log_probability(x[0], x[6].abs()).eq(&f64::INFINITY));
        }
        all.extend(Levels::partition(&[x[5], x[7]], &[x[2], 0.5, x[4]], x[6]).map(Scalar::from));
        for factor in &all {
            check(factor, [x[3]], prior.as_ref(), resolved(x[3]));
            check(factor, [x[7]], prior.as_ref(), resolved(x[7]));
            if let Ok(repeated) = Repeated::new(factor.clone(), count) {
                check(&repeated, [x[3]], prior.as_ref(), resolved(x[3]));
            }
            if let Scalar::Levels(levels) = factor {
                let _ = levels.pieces();
            }
        }
        check(&all.into_iter().collect::<Product>(), [x[3]], prior.as_ref(), resolved(x[3]));
    }

    #[test]
    fn plane_beliefs_of_wild_numbers_stay_numbers(x in prop::array::uniform12(wild())) {
        let covariance = Matrix2::new(x[2], x[3], x[3], x[4]);
        let belief = Gaussian::new(Vector2::new(x[0], x[1]), covariance);
        let other = Gaussian::new(Vector2::new(x[5], x[6]), Matrix2::new(x[7], 0.0, 0.0, x[8])).ok();
        if let Ok(belief) = &belief {
            prop_assert!(belief.is_finite());
            if let Ok(factored) = belief.factored() {
                let log = factored.log_pdf(&Vector2::new(x[9], x[10]));
                prop_assert_eq!(log.is_nan(), x[9].is_nan() || x[10].is_nan());
                prop_assert!(!(x[9].is_finite() && x[10].is_finite() && log == f64::INFINITY));
                let mut logs = [0.0; 2];
                fewbits_core::Density::add_log_densities(&factored, &[&[x[9]; 2], &[x[10]; 2]], &mut logs);
                prop_assert!(logs.iter().all(|swept| swept.to_bits() == log.to_bits() || (swept - log).abs() <= 1e-9 * log.abs() || (swept.is_nan() && log.is_nan())), "{} {:?}", log, logs);
            }
            if let Some(Ok(divergence)) = other.as_ref().map(|other| belief.kl_divergence(other)) {
                prop_assert!(!divergence.is_nan());
            }
        }
        if let Ok(value) = Value::new(Vector2::new(x[5], x[6]), covariance) {
            check(&value, [x[9], x[10]], other.as_ref(), true);
        }
        let _: Option<Gaussian<2>> = Gaussian::known(Vector2::new(x[0], x[11])).ok();
        let _ = SMatrix::<f64, 1, 1>::new(x[11]);
    }

    #[test]
    fn formats_of_wild_numbers_are_refused_or_hold_numbers(x in prop::array::uniform3(wild()), bits in 0..70_u32, bytes in prop::collection::vec(any::<u8>(), 0..20), length in any::<usize>()) {
        if let Ok(levels) = number::EvenLevels::new(x[0], x[1], bits) {
            if let Ok(rounded) = NumberFormat::Fixed(levels).rounded(x[2]) {
                prop_assert!(rounded.is_finite() && rounded >= x[0] && rounded <= x[1]);
            }
            let _ = levels.cell(x[2]);
        }
        prop_assert!(Sign::of(x[0], x[1]).is_err() || (x[0].is_finite() && x[1].is_finite()));
        if let Ok(single) = NumberFormat::Single.rounded(x[2]) {
            prop_assert!(single.is_finite());
        }
        let _ = BitString::from_bytes(bytes.clone(), length);
        let _ = BitString::from_bytes(bytes, length % 200);
        let _ = Vector1::new(x[0]);
    }
}
