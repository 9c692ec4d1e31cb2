//! A room with a wind that was measured: velocities in cells are projected onto winds without divergence, then a puff is followed.

use fewbits_diffusion::{Divergence, Error, Flow, FluxRule, Plan, TimedSource, Transient, Transport};

fn main() -> Result<(), Error> {
    let plan = Plan::parse(
        "
        ##############
        #............#
        I............#
        I.....##.....O
        #.....##.....O
        ##############",
    )?;
    let domain = plan.domain(0.5, 4, 0.0)?;
    // Some anemometers say that it blows to the right, faster in the middle. Air would vanish at the pillar.
    let measured: Vec<[f64; 3]> = domain
        .sample(|[_, y, _]| 0.04 * y * (3.0 - y))
        .into_iter()
        .map(|v| [v, 0.0, 0.0])
        .collect();
    if let Err(error) = Flow::from_cells(&domain, &measured, Divergence::Refuse) {
        println!("{error}");
    }
    let wind = Flow::from_cells(&domain, &measured, Divergence::Project)?;
    let release = TimedSource {
        patch: domain.point([1.2, 1.4, 0.0])?,
        rate: 1e-6,
        start: 0.0,
        stop: 30.0,
    };
    let transport = Transport::new(domain, 0.01, &wind, 0.0, FluxRule::default())?;
    let nothing = vec![0.0; transport.domain().free().len()];
    for snapshot in Transient::new(&transport).run(&nothing, &[release], &[30.0, 60.0, 120.0])? {
        let (here, left) =
            (transport.balance(&snapshot.concentration)?.mass, transport.balance(&snapshot.dose)?.removed());
        println!(
            "{:>5} s: {:.2} mg in the room, {:.2} mg have left ({} steps)",
            snapshot.time,
            1e6 * here,
            1e6 * left,
            snapshot.steps
        );
    }
    Ok(())
}
