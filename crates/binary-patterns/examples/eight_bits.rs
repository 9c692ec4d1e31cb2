//! Eight one-bit sensors about a uniform unknown: the best linear patterns, then breakpoints off the grid.

use fewbits_binary_patterns::search::{LinearSearch, free_breakpoints};
use fewbits_binary_patterns::{Source, bounds, linear_pattern, uniform_cells};
use fewbits_core::Observation;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let source = Source::uniform(1.0)?;
    let (grid, noise) = (uniform_cells(1.0, 3)?, source.noise_deviation(18.2)?);
    let search = LinearSearch::with_deviation(source, grid, noise, 8)?;
    let best = search.best()?;
    println!("masks {:?}, squared error {:.7}", best.masks, best.mse);
    for mask in &best.masks {
        println!("  {mask}: {}", linear_pattern(*mask, 3)?);
    }
    let bank = search.bank(&best.masks)?;
    println!("no estimator is below {:.7}", bounds::optimal_weight_van_trees(&bank)?);

    let free = free_breakpoints(&source, &search.sensors(&best.masks)?, 0.02, 2)?;
    println!("free breakpoints: {:.7}", free.mse);
    for sensor in &free.sensors {
        println!("  {:.4?}", sensor.quantizer().breakpoints());
    }

    let table = bank.table()?;
    let mut seen = [true, false, true, true, false, true, true, false].map(Observation::Received);
    println!("estimate {:.4}", table.decode(&seen)?);
    seen[3] = Observation::Lost;
    println!("estimate without sensor 4: {:.4}", table.decode(&seen)?);
    Ok(())
}
