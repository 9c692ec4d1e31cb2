//! Sensors spread at random, who reaches whom, and the way of a message to the corner of the field.
//!
//! `cargo run -p fewbits-topology --example a_route_through_the_field`

use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;
use rand::SeedableRng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let field = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300)?;
    let (start, corner) = (field.nearest_to(&Vector2::zeros()), field.nearest_to(&Vector2::repeat(100.0)));
    for range in [8.0, 10.0, 15.0, 25.0] {
        let graph = Graph::within(field.positions(), range)?;
        let (components, hops) = (graph.components(), graph.hops_from(start)?);
        print!(
            "range {range:2}: {:5.1} neighbours, {:3} pieces, {:3.0} % of the nodes in the largest; ",
            2.0 * graph.edges() as f64 / graph.len() as f64,
            components.sizes.len(),
            100.0 * components.sizes.iter().copied().max().unwrap_or(0) as f64 / graph.len() as f64,
        );
        match hops.route(corner) {
            Some(route) => println!("{} hops from corner to corner", route.len() - 1),
            None => println!("no way from corner to corner"),
        }
    }
    Ok(())
}
