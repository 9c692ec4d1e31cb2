//! Reads a floor plan from a text file, blows wind from its inflow to its outflow, and says which cells explain three sensors.
//!
//! `cargo run --example a_leak_in_a_house [PLAN]`: the plan is `examples/house.txt` unless another is named.

use fewbits_diffusion::{FluxRule, Plan, PotentialFlow, Source, Steady, Transport};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/examples/house.txt").into());
    let plan = Plan::parse(&std::fs::read_to_string(&path)?)?;
    // Squares of 25 cm; 0.15 m^2/s of air per metre of height; turbulent diffusivity 0.05 m^2/s.
    let domain = plan.domain(0.25, 1, 0.0)?;
    let wind = PotentialFlow::new(&domain, 0.15)?;
    println!("{} cells of air; potential difference {:.3} m^2/s", domain.free().len(), wind.difference);
    let sensors = [[1.0, 3.1, 0.0], [6.6, 3.3, 0.0], [9.6, 5.0, 0.0]];
    let sensors = sensors
        .into_iter()
        .map(|at| domain.point(at))
        .collect::<Result<Vec<_>, _>>()?;
    let leak = domain.point([1.6, 1.6, 0.0])?;
    let transport = Transport::new(domain, 0.05, &wind.flow, 0.0, FluxRule::default())?;
    let steady = Steady::new(&transport)?;

    // What the sensors read of a leak of 2 mg/s, and how much of it leaves where.
    let field = steady.concentration(&[Source {
        patch: leak,
        rate: 2e-6,
    }])?;
    let readings: Vec<f64> = sensors.iter().map(|sensor| sensor.mean(&field)).collect();
    let balance = transport.balance(&field)?;
    let shown: Vec<f64> = readings.iter().map(|c| 1e6 * c).collect();
    println!("readings {shown:.2?} mg/m^3; out {:.1} %, in {:.1} %", 5e7 * balance.outflow, 5e7 * balance.inflow);

    // For every cell the rate that fits best and what is left unexplained: adjoint solutions, one per sensor.
    let rows = steady.adjoint(&sensors)?;
    let unexplained = |cell: usize| {
        let (mut aa, mut ay, mut yy) = (0.0, 0.0, 0.0);
        for (row, y) in rows.iter().zip(&readings) {
            (aa, ay, yy) = (aa + row[cell] * row[cell], ay + row[cell] * y, yy + y * y);
        }
        1.0 - ay * ay / (aa * yy)
    };
    let cells = 0..transport.domain().free().len();
    let best = cells
        .min_by(|a, b| unexplained(*a).total_cmp(&unexplained(*b)))
        .unwrap_or(0);
    let centre = transport.domain().grid().centre(transport.domain().free()[best]);
    println!("best cell at ({:.2}, {:.2}), the leak is at (1.6, 1.6)", centre[0], centre[1]);
    Ok(())
}
