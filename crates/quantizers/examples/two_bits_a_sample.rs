//! A sensor reports two bits a sample over a link that flips some of them; the receiver tracks the level.

use fewbits_core::factor::Factor;
use fewbits_core::nalgebra::SVector;
use fewbits_core::{Gaussian, Link, Scheme};
use fewbits_monte_carlo::Stream;
use fewbits_quantizers::{Labelling, Quantizer, QuantizingSensor, lloyd_max};
use rand::RngExt;
use rand_distr::StandardNormal;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (prior_variance, noise_variance) = (4.0_f64, 1.0);
    let sample_deviation = (prior_variance + noise_variance).sqrt();
    let table = lloyd_max::gaussian(4)?.affine(0.0, sample_deviation)?;
    let sensor = QuantizingSensor::with_variance(Quantizer::from(&table), Labelling::gray(4)?, noise_variance)?;
    // The design can be stored and flashed to the sensor.
    println!("{}", serde_json::to_string(&sensor)?);

    let (link, mut rng) = (Link::flipping(0.02)?, Stream::new(1).rng());
    let truth = 1.3;
    let mut belief = Gaussian::scalar(0.0, prior_variance)?;
    for _ in 0..20 {
        let sample = truth + noise_variance.sqrt() * rng.sample::<f64, _>(StandardNormal);
        let report = sensor.encode(&mut rng, &mut (), &SVector::from([sample]), &())?;
        let observation = link.transmit(&mut rng, report.as_ref(), sensor.labelling())?;
        let posterior = sensor.factor(&(), &observation, &link)?.tilted(&belief)?;
        belief = Gaussian::new(posterior.mean, posterior.covariance)?;
    }
    println!("{:.3} +- {:.3} after 40 bits, truth {truth}", belief.mean()[0], belief.standard_deviations()[0]);
    Ok(())
}
