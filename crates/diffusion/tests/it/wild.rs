//! Wild arguments: grids, flows, transports and fields are numbers, or refused.

use fewbits_diffusion::{
    Boundary, CellKind, Divergence, Domain, Flow, FluxRule, Grid, Plan, PotentialFlow, SensorField, Source, Steady,
    StepControl, TimedSource, Transient, Transport,
};
use fewbits_models::SourceModel;
use fewbits_models::nalgebra::Vector3;
use fewbits_numerics::wild;
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn boundary(which: u8, leak: f64) -> Boundary {
    [
        Boundary::Closed,
        Boundary::Absorbing,
        Boundary::Leaking(leak),
        Boundary::Inflow,
        Boundary::Outflow,
    ][usize::from(which % 5)]
}

fn finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

/// A grid of wild edges, or of nine squares.
fn domain(x: &[f64], which: [u8; 6]) -> Option<Domain> {
    let mut edges = [x[..3].to_vec(), vec![0.0, x[3], x[4]]];
    if which[0].is_multiple_of(2) {
        edges.iter_mut().for_each(|axis| axis.sort_by(f64::total_cmp));
    }
    let grid = [
        Grid::new(&edges),
        Grid::uniform(&[3, 3], x[0]),
        Grid::uniform(&[3, 3], 0.5),
    ]
    .into_iter()
    .flatten()
    .next()?;
    let cells: Vec<CellKind> = (0..grid.cells())
        .map(|i| match which[i % 6] % 4 {
            0 => CellKind::Blocked(boundary(which[i % 6] / 4, x[5])),
            1 => CellKind::Open(boundary(which[i % 6] / 4, x[5])),
            _ => CellKind::Free,
        })
        .collect();
    Domain::new(grid, &cells, [0, 1, 2].map(|i| [boundary(which[i], x[6]), boundary(which[i + 3], x[7])])).ok()
}

proptest! {
    // Each case factors matrices: one case in 8.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]
    #[test]
    fn fields_are_numbers_or_refused(x in prop::array::uniform20(wild()), which in prop::array::uniform6(any::<u8>())) {
        let Some(domain) = domain(&x, which) else { return Ok(()) };
        let velocity = |_: [f64; 3]| [x[8], x[9], 0.0];
        let flows = [
            Ok(Flow::still(&domain)),
            Flow::from_velocity(&domain, velocity, Divergence::Refuse),
            Flow::from_velocity(&domain, velocity, Divergence::Project),
            PotentialFlow::new(&domain, x[10]).map(|potential| potential.flow),
        ];
        for flow in flows.into_iter().flatten() {
            for scheme in [FluxRule::ExponentialFitting, FluxRule::Upwind] {
                let Ok(transport) = Transport::new(domain.clone(), x[11], &flow, x[12], scheme) else { continue };
                let point = domain.grid().centre(domain.free()[0]);
                let Ok(patch) = domain.point(point) else { continue };
                if let Ok(steady) = Steady::new(&transport)
                    && let Ok(field) = steady.concentration(&[Source { patch: patch.clone(), rate: x[13] }])
                {
                    prop_assert!(finite(&field) && (x[13] < 0.0 || field.iter().all(|c| *c >= 0.0)), "{:?} {:?}: {:?}", domain, x, field);
                    if let Ok(balance) = transport.balance(&field) {
                        prop_assert!(!balance.mass.is_nan() && !balance.removed().is_nan(), "{:?}", balance);
                    }
                }
                if let Ok(field) = SensorField::steady(&transport, &[point]) {
                    let place = Vector3::from(point);
                    let sensor = field.receptor(&place).unwrap();
                    for source in [place, Vector3::new(x[14], x[15], x[16])] {
                        let gradient = field.source_gradient(&sensor, &source, x[17]);
                        prop_assert!(gradient.value >= 0.0 && finite(gradient.gradient.as_slice()), "{:?} {:?}: {:?}", domain, x, gradient);
                        prop_assert!(!field.variation(&sensor, &source, x[18], x[17]).is_nan());
                        let _ = field.admits(&source, x[18]);
                    }
                }
            }
        }
        let _ = (domain.point([x[14], x[15], x[16]]), domain.block([x[14], x[15], 0.0], [x[16], x[17], 0.0]));
    }

    #[test]
    fn transients_are_numbers_or_refused(x in prop::array::uniform8(wild()), steps in 0..4_usize) {
        let domain = Plan::parse("I.#\n..O").unwrap().domain(0.5, 1, 0.0).unwrap();
        let Ok(wind) = PotentialFlow::new(&domain, x[0]) else { return Ok(()) };
        let patch = domain.point([0.2, 0.2, 0.0]).unwrap();
        let Ok(transport) = Transport::new(domain, x[1], &wind.flow, x[2], FluxRule::default()) else { return Ok(()) };
        for control in [StepControl::Equal(steps), StepControl::Tolerance(x[3].max(1e-3))] {
            let Ok(mut transient) = Transient::new(&transport).with_control(control) else { continue };
            let release = TimedSource { patch: patch.clone(), rate: x[4], start: x[5], stop: x[6] };
            if let Ok(snapshots) = transient.run(&[0.0; 5], &[release], &[x[7]]) {
                prop_assert!(snapshots.iter().all(|s| finite(&s.concentration) && finite(&s.dose)), "{:?} {:?}", x, snapshots);
            }
            if let Ok(responses) = transient.step_responses(std::slice::from_ref(&patch), &[x[7]]) {
                prop_assert!(responses.iter().flatten().all(|field| finite(field)), "{:?} {:?}", x, responses);
            }
        }
    }

    #[test]
    fn any_text_is_a_plan_or_refused(text in "[.#LAIO \nx]{0,40}", width in wild(), split in 0..4_usize, leak in wild()) {
        if let Ok(plan) = Plan::parse(&text) && let Ok(domain) = plan.domain(width, split, leak) {
            let [squares, cells] = [plan.domain(1.0, 1, 0.0).unwrap(), domain.clone()].map(|domain| domain.grid().cells());
            prop_assert_eq!(cells, squares * split * split);
            prop_assert!(finite(domain.grid().edges(0)));
        }
    }
}

#[test]
fn release_just_before_a_reading_ends() {
    let domain = Plan::parse("I.#\n..O").unwrap().domain(0.5, 1, 0.0).unwrap();
    let flow = PotentialFlow::new(&domain, 1.0).unwrap().flow;
    let patch = domain.point([0.2, 0.2, 0.0]).unwrap();
    let transport = Transport::new(domain, 1.0, &flow, 0.0, FluxRule::default()).unwrap();
    let release = |start| TimedSource {
        patch: patch.clone(),
        rate: 1.0,
        start,
        stop: 2.0,
    };
    let dose = |start| {
        let snapshots = Transient::new(&transport)
            .run(&[0.0; 5], &[release(start)], &[1.0, 3.0])
            .unwrap();
        snapshots[1].dose[0]
    };
    let (late, at) = (dose(1.0 - 1e-12), dose(1.0));
    assert!((late / at - 1.0).abs() < 1e-6, "{late} {at}");
}
