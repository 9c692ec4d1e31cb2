//! Wild arguments: a hand-off passes on numbers, or fails.

use fewbits_core::factor::Value;
use fewbits_core::laws::wild;
use fewbits_core::{Belief, Gaussian, Observed};
use fewbits_densities::{Mixture, Particles};
use fewbits_handoff::{Components, HandoffFilter, Whole, trimmed};
use fewbits_mixture_codec::plug_in::plug_in;
use fewbits_mixture_codec::{Criterion, Reduction};
use fewbits_models::{Ar1, ScalarSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::Vector1;
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn handovers_are_numbers_or_refused(x in prop::array::uniform8(wild()), particles in 0..30_usize, components in 0..4_usize) {
        let Ok(known) = Gaussian::scalar(x[0], x[1]).map_err(|_| ()).and_then(|g| Mixture::single(&g).map_err(|_| ())) else { return Ok(()) };
        let Ok(walk) = Ar1::new(x[2], x[3]) else { return Ok(()) };
        let (Ok(sensor), Ok(value)) = (ScalarSensor::scalar(Vector1::new(x[4]), x[5]), Value::scalar(x[6], x[5])) else { return Ok(()) };
        let seen = Observed::new(sensor, value);
        let mut rng = Stream::new(1).rng();
        if let Ok(filter) = HandoffFilter::new(particles, Whole)
            && let Ok((handover, info)) = filter.step(&mut rng, &known, &walk, &seen)
        {
            prop_assert!(info.log_likelihood.is_finite() && handover.mixture().mean()[0].is_finite(), "{:?} {:?}", x, info);
            let error = plug_in(&info.estimate, handover.mixture());
            prop_assert!(!error.kl_plugin.is_nan() && !error.ml_plugin.is_nan(), "{:?}", error);
        }
        let few = Components { reduction: Reduction::paper(Criterion::Kl), components };
        if let Ok(filter) = HandoffFilter::new(particles, few).map(|filter| HandoffFilter { shrink: false, ..filter })
            && let Ok((handover, info)) = filter.step(&mut rng, &known, &walk, &seen)
        {
            prop_assert!(info.log_likelihood.is_finite() && handover.mixture().mean()[0].is_finite(), "{:?} {:?}", x, info);
        }
        if let Ok(cloud) = Particles::new([x[..3].to_vec()], &x[3..6])
            && let Ok(kept) = trimmed(&cloud, x[7])
        {
            prop_assert!(kept.mean()[0].is_finite() || x[..3].iter().any(|x| x.abs() > 1e150), "{:?}", kept);
        }
    }
}
