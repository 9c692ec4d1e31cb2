//! Wild arguments: statistics of numbers are numbers, and a run of any size ends.

use fewbits_monte_carlo::statistics::paired_difference;
use fewbits_monte_carlo::{Moments, MonteCarlo, Stream};
use fewbits_numerics::wild;
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn statistics_of_numbers_are_numbers(x in prop::collection::vec(wild(), 0..6), y in prop::collection::vec(wild(), 0..6)) {
        // The square of a spread must be a number, too.
        let tame = |x: &[f64]| x.iter().all(|x| x.abs() < 1e150);
        let of = |x: &[f64]| {
            let mut moments = Moments::default();
            x.iter().for_each(|x| moments.add(*x));
            moments
        };
        let mut all = of(&x);
        all.merge(&of(&y));
        if tame(&x) && tame(&y) {
            prop_assert!(all.mean().is_finite() && all.variance() >= 0.0, "{:?} {:?}: {:?}", x, y, all);
            prop_assert!(!all.standard_error().is_nan() && !all.estimate().value.is_nan(), "{:?}", all);
            prop_assert!(all.mean() < 0.0 || !all.root_mean().standard_error.is_nan(), "{:?}: {:?}", all, all.root_mean());
        }
        if let Ok(difference) = paired_difference(&x, &y) {
            prop_assert!(!tame(&x) || !tame(&y) || difference.mean().is_finite(), "{:?} {:?}", x, y);
        } else {
            prop_assert_ne!(x.len(), y.len());
        }
    }

    #[test]
    fn runs_of_any_size_end(seed in any::<u64>(), trials in 0..9_u64, failing in 0..12_u64) {
        let run = MonteCarlo::new(Stream::new(seed), trials);
        let results = run.run(|trial| if trial.index == failing { Err("no") } else { Ok(trial.index) });
        prop_assert_eq!(results.is_err(), failing < trials || trials == 0 && results.is_err());
        prop_assert!(run.single(seed, |trial| Ok::<_, String>(trial.index)).is_ok_and(|index| index == seed));
    }
}
