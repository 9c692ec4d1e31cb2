//! Wild arguments: statistics of numbers are numbers, and a run of any size ends.

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
        let tame = x.iter().chain(&y).all(|x| x.abs() < 1e150);
        let mut all: Moments = x.iter().copied().collect();
        all.merge(&y.iter().copied().collect());
        prop_assert_eq!(all.count() as usize, x.len() + y.len());
        if tame {
            prop_assert!(all.mean().is_finite() && all.variance() >= 0.0, "{:?} {:?}: {:?}", x, y, all);
            prop_assert!(all.standard_error() >= 0.0 && all.root_mean().standard_error >= 0.0, "{:?}: {:?}", all, all.root_mean());
            // Fewer than two values say nothing about the error.
            prop_assert_eq!(all.standard_error().is_infinite(), all.count() < 2, "{:?}", all);
            let z = all.estimate().z_score(0.5);
            prop_assert!(!z.is_nan(), "{:?}: {}", all, z);
        }
    }

    #[test]
    fn runs_of_any_size_end(seed in any::<u64>(), trials in 0..9_u64, failing in 0..12_u64) {
        let run = MonteCarlo::new(Stream::new(seed), trials);
        match run.run(|trial| if trial.index == failing { Err("no") } else { Ok(trial.index) }) {
            Ok(found) => prop_assert!(failing >= trials && found.into_iter().eq(0..trials)),
            Err(_) => prop_assert!(failing < trials || trials == 0),
        }
        prop_assert!(run.single(seed, |trial| Ok::<_, String>(trial.index)).is_ok_and(|index| index == seed));
    }
}
