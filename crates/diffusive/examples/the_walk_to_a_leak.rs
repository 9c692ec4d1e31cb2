//! A gas leak found by a belief that walks from sensor to sensor.
//!
//! `cargo run -p fewbits-diffusive --example the_walk_to_a_leak`

use fewbits_diffusive::{RateModel, RateRange, Search, SearchBox, SearchField, SourceSensor};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Still air; five samples in 25 seconds; metres, seconds, kilograms.
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable)?;
    let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6)?;
    let (source, rate) = (Vector2::new(62.0, 50.0), 1.0);

    let mut rng = Stream::new(3).rng();
    let nodes = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300)?;
    let graph = Graph::within(nodes.positions(), 15.0)?;
    let alarm = Vector2::new(44.0, 52.0); // who noticed something
    let area = SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    };
    let search = Search::new(&alarm, 50.0, area, RateModel::Joint(RateRange::new(0.5, 1.5)?), 1e-5)?;
    let start = nodes.nearest_to(&alarm);
    let field = SearchField::new(sensor.clone(), nodes, graph)?;
    let outcome = search
        .run(&field, start, |node| sensor.sample(&mut rng, &field.deployment().positions()[node], &source, rate))?;

    for step in &outcome.steps {
        println!(
            "node {:3}: estimate ({:5.1}, {:5.1}), deviations ({:4.1}, {:4.1}) m, {} bits sent",
            step.node,
            step.estimate.mean()[0],
            step.estimate.mean()[1],
            step.estimate.standard_deviations()[0],
            step.estimate.standard_deviations()[1],
            step.bits
        );
    }
    println!("{:?} after {} bits; the leak is at ({}, {})", outcome.status, outcome.bits(), source[0], source[1]);
    Ok(())
}
