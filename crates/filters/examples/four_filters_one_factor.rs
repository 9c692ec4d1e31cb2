//! The same sign bits, half of which are lost, through four filters.
//!
//! `cargo run --release -p fewbits-filters --example four_filters_one_factor`

use fewbits_core::factor::{Constant, Levels, Scalar};
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observed, Sensing, Sign};
use fewbits_filters::{
    BootstrapFilter, MomentFilter, PointMassFilter, RaoBlackwellised, ResamplingRule, StateFilter, UniformGrid,
};
use fewbits_models::{Ar1, LinearSensor};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (dynamics, sensor, link) = (Ar1::new(0.95, 0.2)?, LinearSensor::direct(0.5)?, Link::lossy(0.5)?);
    let prior = Gaussian::scalar(0.0, dynamics.stationary_variance()?)?;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut state = prior.sample(&mut rng);
    let mut exact = PointMassFilter::new(UniformGrid::symmetric(10.0, 0.1)?);
    let mut bootstrap = BootstrapFilter::new(ResamplingRule::default(), 2000)?;
    let mut imputing = RaoBlackwellised::new(ResamplingRule::default(), 200)?;
    let (mut gaussian, mut grid) = (prior, exact.start(&mut rng, &prior)?);
    let (mut particles, mut cloud) = (bootstrap.start(&mut rng, &prior)?, imputing.start(&mut rng, &prior)?);
    println!("  truth   exact  assumed  particle  Rao-Blackwellised");
    for _ in 0..15 {
        state = dynamics.propagate(&mut rng, &state);
        let threshold = dynamics.mean(gaussian.mean())[0];
        let bit = Sign::of(sensor.sample(&mut rng, &state)[0], threshold)?;
        let factor: Scalar = match link.transmit(&mut rng, Some(&bit), &())?.received() {
            Some(bit) => Levels::sign(*bit, threshold, sensor.noise_variance(), &link)?.into(),
            None => Constant::new(link.loss())?.into(),
        };
        let observed = Observed::new(sensor, factor);
        gaussian = MomentFilter.step(&mut rng, &dynamics, &gaussian, &[&observed])?.0;
        grid = exact.step(&mut rng, &dynamics, &grid, &[&observed])?.0;
        particles = bootstrap.step(&mut rng, &dynamics, &particles, &[&observed])?.0;
        cloud = imputing.step(&mut rng, &dynamics, &cloud, &[&observed])?.0;
        let means = [
            grid.mean(),
            gaussian.mean()[0],
            particles.mean()[0],
            Belief::mean(&cloud)[0],
        ];
        println!("{:7.3} {:7.3} {:8.3} {:9.3} {:18.3}", state[0], means[0], means[1], means[2], means[3]);
    }
    Ok(())
}
