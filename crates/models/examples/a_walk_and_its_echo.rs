//! A target in the plane and the amplitude that a sensor receives of it, as CSV.
//!
//! `cargo run -p fewbits-models --example a_walk_and_its_echo`

use fewbits_core::{Dynamics, Sensing};
use fewbits_models::{Ar1, ReceivedPower, constant_velocity_2d};
use nalgebra::{Vector2, Vector4};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn main() -> Result<(), fewbits_models::Error> {
    let target = constant_velocity_2d(1.0, 0.01)?; // [x, x velocity, y, y velocity]
    let sensor = ReceivedPower::<4>::new(Vector2::new(10.0, 0.0), [0, 2], 100.0, 1.0, 2.0, 0.01)?;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut state = Vector4::new(0.0, 1.0, 3.0, -0.2);
    println!("step,x,y,received,noise_free");
    for step in 0..20 {
        state = target.propagate(&mut rng, &state);
        let (received, noise_free) = (sensor.sample(&mut rng, &state)[0], sensor.mean(&state)[0]);
        println!("{step},{:.3},{:.3},{received:.3},{noise_free:.3}", state[0], state[2]);
    }
    // An unstable plant is an error unless asked for by name.
    println!(
        "{}",
        Ar1::new(1.2, 0.5)
            .err()
            .map_or(String::new(), |error| error.to_string())
    );
    Ok(())
}
