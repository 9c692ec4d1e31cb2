//! One belief in four shapes: drawn, weighted, put on a grid, stored and restored.
//!
//! `cargo run -p fewbits-densities --example beliefs_as_values`

use fewbits_core::{Belief, Gaussian};
use fewbits_densities::{GaussianCloud, Particles, PointMass, UniformGrid};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn show(name: &str, belief: &impl Belief<1>) {
    println!("{name:>12}: mean {:7.4}, variance {:7.4}", belief.mean()[0], belief.covariance()[0]);
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let prior = Gaussian::scalar(0.0, 1.0)?;
    // What is observed is twice as likely for every unit further to the right.
    let log_likelihood = |x: f64| x * 2.0_f64.ln();
    show("prior", &prior);

    let mut grid = PointMass::normal(UniformGrid::symmetric(8.0, 0.25)?, 0.0, 1.0)?;
    println!("ln p(observed) = {:.4}", grid.update_with(log_likelihood)?);
    show("grid", &grid);

    let mut particles = Particles::from_belief(&mut rng, &prior, 10_000)?;
    particles.reweigh(|columns, logs| {
        logs.iter_mut()
            .zip(columns[0])
            .for_each(|(l, x)| *l += log_likelihood(*x))
    })?;
    println!("effective sample size {:.0}", particles.effective_sample_size());
    show("particles", &particles);

    let cloud = GaussianCloud::new(Particles::from_belief(&mut rng, &grid, 50)?, [[0.1]].into())?;
    show("cloud", &cloud);
    let restored: GaussianCloud<1> = serde_json::from_str(&serde_json::to_string(&cloud)?)?;
    println!("restored equal: {}", restored == cloud);
    Ok(())
}
