//! Neighbour graphs of up to a million nodes at equal density: time for each node and peak memory.
//!
//! `cargo run --release -p fewbits-topology --example a_million_nodes`

use fewbits_topology::{Deployment, Graph};
use rand::SeedableRng;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for nodes in [10_000, 100_000, 1_000_000] {
        let side = (nodes as f64).sqrt();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let field = Deployment::uniform(&mut rng, [0.0; 2], [side; 2], nodes)?;
        let before = Instant::now();
        let graph = Graph::within(field.positions(), 2.0)?;
        let seconds = before.elapsed().as_secs_f64();
        println!(
            "{nodes:8} nodes, {:5.2} neighbours each: {:6.3} s, {:4.0} ns for each node, peak memory {}",
            2.0 * graph.edges() as f64 / nodes as f64,
            seconds,
            seconds / nodes as f64 * 1e9,
            peak().unwrap_or_else(|| "unknown".to_owned()),
        );
    }
    Ok(())
}

/// The largest resident size of this process so far, where the system tells.
fn peak() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(format!("{:.0} MiB", kibibytes / 1024.0))
}
