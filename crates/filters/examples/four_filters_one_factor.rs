//! The same sign bits, half of which are lost, through four filters.
//!
//! `cargo run --release -p fewbits-filters --example four_filters_one_factor`

use fewbits_core::factor::InCell;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observed, Sensing, Sign};
use fewbits_filters::{
    GaussianCloud, Grid, ParticleFilter, Particles, PointMass, PointMassFilter, RaoBlackwellised, assumed_density,
};
use fewbits_models::{Ar1, LinearSensor};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (dynamics, sensor, link) = (Ar1::new(0.95, 0.2)?, LinearSensor::direct(0.5)?, Link::lossy(0.5)?);
    let prior = Gaussian::scalar(0.0, dynamics.stationary_variance()?)?;
    let exact = PointMassFilter::new(&dynamics, Grid::symmetric(10.0, 0.1)?)?;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut state = prior.sample(&mut rng);
    let mut gaussian = prior;
    let mut grid = PointMass::normal(*exact.grid(), 0.0, prior.covariance()[0])?;
    let mut particles = Particles::from_belief(&mut rng, &prior, 2000)?;
    let mut cloud = GaussianCloud::agreed(&prior, 200)?;
    println!("  truth   exact  assumed  particle  Rao-Blackwellised");
    for _ in 0..15 {
        state = dynamics.propagate(&mut rng, &state);
        let threshold = dynamics.mean(gaussian.mean())[0];
        let bit = Sign::of(sensor.sample(&mut rng, &state)[0], threshold)?;
        let Some(bit) = link.transmit(&mut rng, Some(&bit), &())?.received().copied() else {
            (gaussian, grid) = (fewbits_filters::kalman::predict(&dynamics, &gaussian), exact.predict(&grid)?);
            dynamics.propagate_columns(&mut rng, particles.columns_mut());
            RaoBlackwellised::default().predict(&mut rng, &dynamics, &mut cloud, &mut Default::default())?;
            continue;
        };
        let observed = Observed::new(sensor, InCell::sign(bit, threshold, sensor.noise_variance(), &link)?);
        gaussian = assumed_density::step(&dynamics, &gaussian, &observed)?.0;
        grid = exact.step(&grid, &observed)?.0;
        particles = ParticleFilter::default()
            .step(&mut rng, &dynamics, &particles, &observed)?
            .0;
        cloud = RaoBlackwellised::default()
            .step(&mut rng, &dynamics, &cloud, &observed)?
            .0;
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
