//! The stationary prediction error: mean squared errors and kurtosis after many slots.

use super::{ErrorChain, MessageLaw};
use crate::{DymboFilter, Error, MultibitFilter, ParallelFilter, ScalarFilter, ScalarPlant, steady};
use fewbits_core::Link;
use std::f64::consts::FRAC_2_PI;

/// Moments of the stationary error.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StationaryError {
    /// Mean squared error before a message, in state units squared.
    pub predicted_mse: f64,
    /// Mean squared error after a message, in state units squared.
    pub filtered_mse: f64,
    /// `E e^4/(E e^2)^2` after a message: 3 for a normal error.
    pub kurtosis: f64,
}

/// The stationary error under one law of messages, e.g. that at the filter's steady predicted variance.
///
/// # Errors
/// If `|a| > 1` (no stationary law exists) or the process noise is zero; [`Error::NotConverged`] if the iteration does not converge.
pub fn stationary(plant: &ScalarPlant, law: &MessageLaw) -> Result<StationaryError, Error> {
    plant.refuse_unstable()?;
    let largest = law.corrections().iter().fold(0.0, |m: f64, d| m.max(d.abs()));
    // A rough normal start; the width follows the density if this guess is too small.
    let mut guess = plant.steady_state(FRAC_2_PI)?.filtered_variance.max(largest * largest);
    loop {
        let mut chain = ErrorChain::from_normal(plant, guess)?;
        chain.settle(law)?;
        if !chain.spills() {
            let filtered_mse = chain.filtered_mse(law);
            return Ok(StationaryError {
                predicted_mse: chain.predicted_mse(),
                filtered_mse,
                kurtosis: chain.filtered_moment(law, 4) / (filtered_mse * filtered_mse),
            });
        }
        guess = 4.0 * guess + plant.process_variance();
    }
}

/// Exact stationary mean squared error of the Dymbo filter over its own link, when every bit arrives.
///
/// # Errors
/// As [`stationary`].
pub fn dymbo_mse(filter: &DymboFilter) -> Result<f64, Error> {
    crossover_mse(filter, filter.link())
}

/// As [`dymbo_mse`] for bits that cross the link `actual`, while the filter assumes its own link.
///
/// # Errors
/// As [`stationary`].
pub fn crossover_mse(filter: &DymboFilter, actual: &Link) -> Result<f64, Error> {
    let p = filter.plant().steady_state(filter.information())?.predicted_variance;
    Ok(stationary(filter.plant(), &MessageLaw::bit(filter, p, actual)?)?.filtered_mse)
}

/// Exact stationary mean squared error of the filter for words of several bits.
///
/// # Errors
/// As [`stationary`].
pub fn multibit_mse(filter: &MultibitFilter) -> Result<f64, Error> {
    let p = filter.plant().steady_state(filter.information())?.predicted_variance;
    Ok(stationary(filter.plant(), &MessageLaw::word(filter, p)?)?.filtered_mse)
}

/// Exact stationary mean squared error of several sensors that answer at once, and the stationary mean of the variance that the
/// filter computes: `(mse, variance)`.
///
/// # Errors
/// As [`stationary`].
pub fn parallel_mse(filter: &ParallelFilter) -> Result<(f64, f64), Error> {
    let settled = steady::settle(filter.plant(), filter.link(), |p| filter.table(p).1)?;
    let law = MessageLaw::count(filter, settled.predicted_variance)?;
    Ok((stationary(filter.plant(), &law)?.filtered_mse, settled.filtered_variance))
}

/// Exact stationary mean squared error of several sensors that answer one after the other.
///
/// # Errors
/// As [`stationary`]; if there are more than 12 sensors.
pub fn sequential_mse(plant: &ScalarPlant, sensors: usize) -> Result<f64, Error> {
    let p = steady::sequential_steady_state(plant, sensors)?.predicted_variance;
    Ok(stationary(plant, &MessageLaw::sequence(plant, p, sensors)?)?.filtered_mse)
}

/// Exact stationary mean squared error of the Dymbo filter divided by the Kalman filter's. [`ScalarPlant::loss`] approximates it.
///
/// # Errors
/// As [`stationary`].
pub fn true_loss(plant: &ScalarPlant) -> Result<f64, Error> {
    Ok(dymbo_mse(&DymboFilter::new(*plant))? / plant.steady_state(1.0)?.filtered_variance)
}

#[cfg(test)]
mod tests {
    use super::{crossover_mse, dymbo_mse, multibit_mse, parallel_mse, sequential_mse, stationary};
    use crate::chain::{ErrorChain, MessageLaw};
    use crate::{CountFusion, DymboFilter, Error, MultibitFilter, ParallelFilter, ScalarFilter, ScalarPlant};
    use fewbits_core::Link;

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    #[test]
    fn all_roads_lead_to_one_bit() {
        let dymbo = dymbo_mse(&DymboFilter::new(plant())).unwrap();
        let one_word = multibit_mse(&MultibitFilter::new(plant(), 1).unwrap()).unwrap();
        let one_count = parallel_mse(&ParallelFilter::new(plant(), 1, CountFusion::Linear).unwrap())
            .unwrap()
            .0;
        let one_string = sequential_mse(&plant(), 1).unwrap();
        for other in [one_word, one_count, one_string] {
            assert!((dymbo - other).abs() < 1e-12);
        }
    }

    #[test]
    fn a_filter_that_ignores_its_bits_has_the_plants_variance_and_scaling_holds() {
        let filter = DymboFilter::new(plant()).with_link(Link::flipping(0.5).unwrap());
        let ignorant = crossover_mse(&filter, &Link::PERFECT).unwrap();
        let alone = plant().dynamics().stationary_variance().unwrap();
        assert!((ignorant - alone).abs() < 1e-10);
        let unit = dymbo_mse(&DymboFilter::new(plant())).unwrap();
        for scale in [1e-8, 9.0, 1e8] {
            let scaled = DymboFilter::new(ScalarPlant::new(-0.9, 0.5 * scale, scale).unwrap());
            assert!((dymbo_mse(&scaled).unwrap() / scale - unit).abs() < 1e-12);
        }
    }

    /// Bits that are pure noise push a trusting filter about: by `d = sqrt(2/pi) P/sqrt(P + r)` each time, so that the error's
    /// variance is `(a^2 d^2 + q)/(1 - a^2) + d^2`, far above what the grid was first made for.
    #[test]
    fn a_filter_that_trusts_noise_walks_wide() {
        for (a, q) in [(0.9, 1.0), (-0.9, 50.0)] {
            let filter = DymboFilter::new(ScalarPlant::new(a, q, 1.0).unwrap());
            let p = filter
                .plant()
                .steady_state(filter.information())
                .unwrap()
                .predicted_variance;
            let step = std::f64::consts::FRAC_2_PI * p * p / (p + 1.0);
            let expected = (a * a * step + q) / (1.0 - a * a) + step;
            let ours = crossover_mse(&filter, &Link::flipping(0.5).unwrap()).unwrap();
            assert!((ours / expected - 1.0).abs() < 1e-9, "{ours} {expected}");
        }
    }

    /// A rounded sample of a state of unknown place errs by noise and rounding: `r + tau^2/12`.
    #[test]
    fn a_chain_starts_from_the_first_message() {
        for (a, q, r, tau) in [(0.9, 0.5, 1.3, 0.7), (-0.6, 0.2, 0.8, 9.0), (1.0, 1.5, 2.0, 30.0)] {
            let chain = ErrorChain::from_first_message(&ScalarPlant::new(a, q, r).unwrap(), tau).unwrap();
            let expected = a * a * (r + tau * tau / 12.0) + q;
            assert!((chain.predicted_mse() / expected - 1.0).abs() < 1e-6, "{} {expected}", chain.predicted_mse());
        }
    }

    #[test]
    fn the_transient_forgets_its_start() {
        let filter = DymboFilter::new(plant());
        let steady = plant().steady_state(filter.information()).unwrap();
        let law = MessageLaw::bit(&filter, steady.predicted_variance, &Link::PERFECT).unwrap();
        let mut chain = ErrorChain::from_first_message(&plant(), 1.0).unwrap();
        for _ in 0..60 {
            chain.advance(&law);
        }
        assert!((chain.filtered_mse(&law) - stationary(&plant(), &law).unwrap().filtered_mse).abs() < 1e-11);
    }

    #[test]
    fn refuses_chains_without_end() {
        let mse = |a: f64, q: f64| dymbo_mse(&DymboFilter::new(ScalarPlant::new_unstable(a, q, 1.0).unwrap()));
        assert!(matches!(mse(0.9, 0.0), Err(Error::Argument(_))));
        assert!(matches!(mse(1.2, 0.5), Err(Error::Argument(e)) if e.name == "coefficient"));
        assert!(matches!(mse(1.0, 1e-16), Err(Error::Argument(_))));
        // Next to no noise, but a short memory: bits bring nothing, the stationary variance is left.
        assert!((mse(0.9, 1e-16).unwrap() / (1e-16 / 0.19) - 1.0).abs() < 1e-6);
    }

    /// Regression: three sensors at a = -3 ran for hours. What has no end is refused, what is slow has one.
    #[test]
    fn work_is_bounded() {
        let wild = ScalarPlant::new_unstable(-3.0, 0.5, 1.0).unwrap();
        for fusion in [CountFusion::Linear, CountFusion::Exact] {
            let filter = ParallelFilter::new(wild, 3, fusion).unwrap();
            assert!(matches!(parallel_mse(&filter), Err(Error::Argument(e)) if e.name == "coefficient"));
        }
        let fine = ScalarPlant::new(1.0, 1e-10, 1.0).unwrap();
        let filter = ParallelFilter::new(fine, 1000, CountFusion::Linear).unwrap();
        assert!(parallel_mse(&filter).unwrap_err().to_string().contains("kernels"));
        let slow = ScalarPlant::new(1.0, 1e-6, 1.0).unwrap();
        let many = ParallelFilter::new(slow, 300, CountFusion::Linear).unwrap();
        let start = std::time::Instant::now();
        assert!(parallel_mse(&many).is_ok() && start.elapsed().as_secs_f64() < 60.0, "{:?}", start.elapsed());
    }
}
