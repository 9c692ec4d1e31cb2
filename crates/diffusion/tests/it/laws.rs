//! Laws that hold on any grid, to rounding.

use crate::cases::{Model, fixture, plan};
use fewbits_diffusion::{
    Boundary, CellKind, Divergence, Domain, Error, Flow, FluxRule, Grid, Method, Plan, PotentialFlow, Source, Steady,
    StepControl, TimedSource, Transient, Transport,
};
use serde_json::json;

const SCHEMES: [FluxRule; 2] = [FluxRule::ExponentialFitting, FluxRule::Upwind];

fn plan1(split: usize) -> Domain {
    plan(&fixture(), "plan1").domain(0.25, split, 0.0).unwrap()
}

fn one(count: usize, at: usize) -> Vec<f64> {
    let mut field = vec![0.0; count];
    field[at] = 1.0;
    field
}

/// A wind of any strength along the plan: the potential flow times a factor is one too.
fn windy(domain: &Domain, total: f64, diffusivity: f64, scheme: FluxRule) -> Transport {
    let wind = PotentialFlow::new(domain, total).unwrap().flow;
    Transport::new(domain.clone(), diffusivity, &wind, 0.0, scheme).unwrap()
}

/// Columns of the matrix sum to what leaves; off-diagonals are not positive.
#[test]
fn columns_sum_to_what_leaves() {
    let domain = Plan::parse("####\nI..O\n#L.O\n####")
        .unwrap()
        .domain(0.25, 1, 0.3)
        .unwrap();
    for scheme in SCHEMES {
        for total in [1e-3, 1.0, 1e3] {
            let transport = windy(&domain, total, 0.05, scheme);
            let count = domain.free().len();
            for k in 0..count {
                let column = transport.net_outflow(&one(count, k)).unwrap();
                let leaves = transport.balance(&one(count, k)).unwrap().removed();
                assert!((column.iter().sum::<f64>() - leaves).abs() <= 1e-13 * column[k], "{scheme:?} {total} {k}");
                assert!(column.iter().enumerate().all(|(i, a)| i == k || *a <= 0.0) && leaves >= 0.0);
            }
        }
    }
}

#[test]
fn steady_budget_closes_at_any_peclet_number() {
    let domain = plan1(1);
    let source = Source {
        patch: domain.point([1.6, 1.6, 0.0]).unwrap(),
        rate: 1.0,
    };
    for scheme in SCHEMES {
        for total in [1e-2, 0.15, 3.0, 300.0] {
            let transport = windy(&domain, total, 0.05, scheme);
            let field = Steady::new(&transport)
                .unwrap()
                .concentration(std::slice::from_ref(&source))
                .unwrap();
            let balance = transport.balance(&field).unwrap();
            assert!((balance.removed() - 1.0).abs() < 1e-10, "{scheme:?} {total}: {balance:?}");
            assert!(field.iter().all(|c| *c >= 0.0), "{scheme:?} {total}: negative");
        }
    }
}

#[test]
fn inverse_is_not_negative() {
    let domain = Plan::parse("######\n#..#.#\nI....O\n#.#..#\n######")
        .unwrap()
        .domain(0.25, 1, 0.0)
        .unwrap();
    for scheme in SCHEMES {
        for total in [0.01, 1.0, 100.0, 1e5] {
            let transport = windy(&domain, total, 0.02, scheme);
            let steady = Steady::new(&transport).unwrap();
            let count = domain.free().len();
            for k in 0..count {
                assert!(steady.from_amounts(&one(count, k)).unwrap().iter().all(|c| *c >= 0.0), "{scheme:?} {total}");
            }
        }
    }
}

#[test]
fn still_air_is_reciprocal() {
    let domain = plan(&fixture(), "room_window").domain(0.25, 2, 0.0).unwrap();
    let diffusivity = domain.sample(|[x, y, _]| 0.02 + 0.01 * x + 0.005 * y * y);
    let transport =
        Transport::new(domain.clone(), diffusivity, &Flow::still(&domain), 1e-4, FluxRule::default()).unwrap();
    assert!(transport.is_symmetric().unwrap());
    let steady = Steady::new(&transport).unwrap();
    let (a, b) = (domain.locate([1.1, 1.3, 0.0]).unwrap(), domain.locate([5.0, 4.4, 0.0]).unwrap());
    let count = domain.free().len();
    let [there, back] = [(a, b), (b, a)].map(|(from, to)| steady.from_amounts(&one(count, from)).unwrap()[to]);
    assert!((there / back - 1.0).abs() < 1e-10, "{there} {back}");
}

/// `G(x, s) exp(phi(x) / D)` is symmetric in potential flow with one diffusivity.
#[test]
fn potential_flow_has_a_symmetric_green_function() {
    let domain = plan1(1);
    let wind = PotentialFlow::new(&domain, 0.15).unwrap();
    let transport = Transport::new(domain.clone(), 0.05, &wind.flow, 0.0, FluxRule::default()).unwrap();
    assert!(transport.is_symmetric().unwrap());
    let steady = Steady::new(&transport).unwrap();
    let count = domain.free().len();
    let cells =
        [[1.6, 1.6, 0.0], [10.0, 2.0, 0.0], [5.0, 5.0, 0.0], [9.0, 9.0, 0.0]].map(|x| domain.locate(x).unwrap());
    let fields = cells.map(|cell| steady.from_amounts(&one(count, cell)).unwrap());
    for i in 0..4 {
        for j in 0..i {
            let weighted = |from: usize, to: usize| fields[from][cells[to]].ln() + wind.potential[cells[to]] / 0.05;
            let (there, back) = (weighted(i, j), weighted(j, i));
            assert!((there - back).abs() < 1e-10, "{i} {j}: {there} {back}");
        }
    }
}

/// Cholesky after scaling and LU are the same solution, as rows and as columns.
#[test]
fn steady_adjoint_equals_forward() {
    let domain = plan1(1);
    for (scheme, symmetric) in [(FluxRule::ExponentialFitting, true), (FluxRule::Upwind, false)] {
        let transport = windy(&domain, 0.3, 0.02, scheme);
        assert_eq!(transport.is_symmetric().unwrap(), symmetric);
        let steady = Steady::new(&transport).unwrap();
        let sensors = [[6.6, 5.3, 0.0], [12.0, 1.0, 0.0], [2.0, 9.0, 0.0]].map(|x| domain.point(x).unwrap());
        let rows = steady.adjoint(&sensors).unwrap();
        for source in [[1.6, 1.6, 0.0], [3.1, 4.6, 0.0], [11.0, 8.0, 0.0]] {
            let patch = domain.point(source).unwrap();
            let field = steady
                .concentration(&[Source {
                    patch: patch.clone(),
                    rate: 1.0,
                }])
                .unwrap();
            for (sensor, row) in sensors.iter().zip(&rows) {
                let (forward, adjoint) = (sensor.mean(&field), patch.mean(row));
                assert!((forward / adjoint - 1.0).abs() < 1e-12, "{scheme:?} {source:?}: {forward} {adjoint}");
            }
        }
    }
}

#[test]
fn adjoint_in_time_equals_forward() {
    let domain = plan1(1);
    for method in [Method::TrBdf2, Method::ImplicitEuler] {
        let transport = windy(&domain, 0.15, 0.05, FluxRule::Upwind);
        let solver = || {
            Transient::new(&transport)
                .with_method(method)
                .with_control(StepControl::Equal(8))
                .unwrap()
        };
        let (source, sensor) = (domain.point([1.6, 1.6, 0.0]).unwrap(), domain.point([4.1, 2.8, 0.0]).unwrap());
        let release = TimedSource {
            patch: source.clone(),
            rate: 2.0,
            start: 0.0,
            stop: 40.0,
        };
        let forward = solver()
            .run(&vec![0.0; domain.free().len()], &[release], &[20.0, 40.0, 60.0, 100.0])
            .unwrap();
        let rows = solver()
            .step_responses(std::slice::from_ref(&sensor), &[20.0, 40.0, 60.0, 100.0])
            .unwrap();
        let step: Vec<f64> = rows.iter().map(|row| 2.0 * source.mean(&row[0])).collect();
        // At 100 s the release has stopped for 60 s, after steps of 20, 20, 20 and 40 s.
        let pairs = [
            (&forward[0], step[0]),
            (&forward[1], step[1]),
            (&forward[2], step[2] - step[0]),
        ];
        for (snapshot, adjoint) in pairs {
            let direct = sensor.mean(&snapshot.concentration);
            assert!((direct - adjoint).abs() <= 1e-12 * step[3], "{method:?} {}: {direct} {adjoint}", snapshot.time);
        }
    }
}

/// One run of a step response serves every start and stop.
#[test]
fn adaptive_step_response_agrees_with_release() {
    let domain = plan1(1);
    let transport = windy(&domain, 0.15, 0.05, FluxRule::default());
    let (source, sensor) = (domain.point([1.6, 1.6, 0.0]).unwrap(), domain.point([4.1, 2.8, 0.0]).unwrap());
    let release = TimedSource {
        patch: source.clone(),
        rate: 2.0,
        start: 15.0,
        stop: 45.0,
    };
    let forward = Transient::new(&transport)
        .run(&vec![0.0; domain.free().len()], &[release], &[90.0])
        .unwrap();
    let rows = Transient::new(&transport)
        .step_responses(std::slice::from_ref(&sensor), &[45.0, 75.0])
        .unwrap();
    let adjoint = 2.0 * (source.mean(&rows[1][0]) - source.mean(&rows[0][0]));
    let direct = sensor.mean(&forward[0].concentration);
    assert!((direct / adjoint - 1.0).abs() < 1e-4, "{direct} {adjoint}");
}

#[test]
fn mass_in_time_is_released_less_left() {
    let domain = plan1(1);
    for method in [Method::TrBdf2, Method::ImplicitEuler] {
        let transport = windy(&domain, 0.3, 0.05, FluxRule::default());
        let tolerance = if method == Method::TrBdf2 { 1e-5 } else { 1e-2 };
        let mut solver = Transient::new(&transport)
            .with_method(method)
            .with_control(StepControl::Tolerance(tolerance))
            .unwrap();
        let release = TimedSource {
            patch: domain.point([1.6, 1.6, 0.0]).unwrap(),
            rate: 1.0,
            start: 7.0,
            stop: 60.0,
        };
        for snapshot in solver
            .run(&vec![0.0; domain.free().len()], &[release], &[5.0, 40.0, 300.0])
            .unwrap()
        {
            let mass = transport.balance(&snapshot.concentration).unwrap().mass;
            let left = transport.balance(&snapshot.dose).unwrap().removed();
            let released = (snapshot.time.min(60.0) - 7.0).max(0.0);
            assert!((mass + left - released).abs() < 1e-10 * 53.0, "{method:?} {}: {mass} {left}", snapshot.time);
        }
    }
}

#[test]
fn closed_room_holds_rate_over_decay() {
    let domain = plan(&fixture(), "room").domain(0.25, 1, 0.0).unwrap();
    let transport = Transport::new(domain.clone(), 0.05, &Flow::still(&domain), 1e-3, FluxRule::default()).unwrap();
    let source = Source {
        patch: domain.point([1.1, 3.1, 0.0]).unwrap(),
        rate: 0.7,
    };
    let field = Steady::new(&transport).unwrap().concentration(&[source]).unwrap();
    assert!((transport.balance(&field).unwrap().mass / 700.0 - 1.0).abs() < 1e-10);
}

/// Diffusivity, wind and decay times `a` divide time, and steady concentrations, by `a`; a length times `a` is only another unit.
#[test]
fn nothing_depends_on_the_unit() {
    let steady = |length: f64, time: f64| {
        let domain = plan(&fixture(), "plan1").domain(0.25 * length, 1, 0.0).unwrap();
        let area = length * length / time;
        let wind = PotentialFlow::new(&domain, 0.15 * area).unwrap().flow;
        let transport = Transport::new(domain.clone(), 0.05 * area, &wind, 1e-4 / time, FluxRule::default()).unwrap();
        let patch = domain.point([1.6 * length, 1.6 * length, 0.0]).unwrap();
        let at = domain.point([4.1 * length, 2.8 * length, 0.0]).unwrap();
        let field = Steady::new(&transport)
            .unwrap()
            .concentration(&[Source {
                patch: patch.clone(),
                rate: 1.0,
            }])
            .unwrap();
        let release = TimedSource {
            patch,
            rate: 1.0,
            start: 0.0,
            stop: f64::INFINITY,
        };
        let run = Transient::new(&transport)
            .run(&vec![0.0; domain.free().len()], &[release], &[20.0 * time])
            .unwrap();
        [at.mean(&field) * area, at.mean(&run[0].concentration) * area]
    };
    let plain = steady(1.0, 1.0);
    for (length, time) in [(1e-4, 1.0), (1e4, 1.0), (1.0, 1e-4), (1.0, 1e4)] {
        for (scaled, plain) in steady(length, time).iter().zip(plain) {
            assert!((scaled / plain - 1.0).abs() < 1e-9, "{length} {time}: {scaled} {plain}");
        }
    }
}

#[test]
fn uniform_inflow_stays_uniform() {
    let domain = plan1(1);
    for scheme in SCHEMES {
        let transport = windy(&domain, 0.3, 0.02, scheme);
        let field = Steady::new(&transport)
            .unwrap()
            .from_amounts(&transport.inflow(0.4))
            .unwrap();
        assert!(field.iter().all(|c| (c / 0.4 - 1.0).abs() < 1e-9), "{scheme:?}");
    }
}

/// A measured wind that is not free of divergence is refused, or projected; then uniform stays uniform.
#[test]
fn projected_wind_keeps_uniform() {
    let domain = plan1(1);
    let truth = PotentialFlow::new(&domain, 0.15).unwrap().flow;
    let mut measured = truth.velocities(&domain);
    measured
        .iter_mut()
        .enumerate()
        .for_each(|(i, v)| v[0] *= 1.0 + 0.05 * (i as f64).sin());
    assert!(matches!(Flow::from_cells(&domain, &measured, Divergence::Refuse), Err(Error::Divergence { .. })));
    let projected = Flow::from_cells(&domain, &measured, Divergence::Project).unwrap();
    let transport = Transport::new(domain.clone(), 0.05, &projected, 0.0, FluxRule::default()).unwrap();
    assert!(!transport.is_symmetric().unwrap());
    let field = Steady::new(&transport)
        .unwrap()
        .from_amounts(&transport.inflow(1.0))
        .unwrap();
    assert!(field.iter().all(|c| (c - 1.0).abs() < 1e-9));
}

/// What went wrong in the one-dimensional program that this crate replaces: a column 10 m high in ten cells, wind down at 2.2 m/s (Peclet
/// number 2.2) onto a leaking floor; its mass rose to 3e8.
#[test]
fn falling_wind_never_makes_mass() {
    let grid = Grid::uniform(&[10], 1.0).unwrap();
    let ends = [
        [Boundary::Outflow, Boundary::Inflow],
        [Boundary::Closed; 2],
        [Boundary::Closed; 2],
    ];
    let domain = Domain::new(grid, &[CellKind::Free; 10], ends).unwrap();
    for speed in [-2.2, -2.0, -40.0] {
        let wind = Flow::from_velocity(&domain, |_| [speed, 0.0, 0.0], Divergence::Refuse).unwrap();
        for scheme in SCHEMES {
            let transport = Transport::new(domain.clone(), 1.0, &wind, 0.0, scheme).unwrap();
            let mut initial = vec![0.0; 10];
            initial[5] = 1.0;
            let mut solver = Transient::new(&transport).with_method(Method::ImplicitEuler);
            solver = solver.with_control(StepControl::Tolerance(1e-2)).unwrap();
            let mut before = 1.0;
            for snapshot in solver.run(&initial, &[], &[1.0, 3.0, 10.0]).unwrap() {
                let mass = transport.balance(&snapshot.concentration).unwrap().mass;
                assert!(
                    snapshot.lowest == 0.0 && mass <= before + 1e-12,
                    "{speed} {scheme:?} {}: {mass}",
                    snapshot.time
                );
                before = mass;
            }
        }
    }
    // The floor that leaks (.1 m/s) and the wall that closes: no wind passes them, so such a wind is refused.
    for floor in [Boundary::Leaking(0.1), Boundary::Closed] {
        let sides = [[floor, Boundary::Closed], [Boundary::Closed; 2], [Boundary::Closed; 2]];
        let column = Domain::new(Grid::uniform(&[10], 1.0).unwrap(), &[CellKind::Free; 10], sides).unwrap();
        let refused = Flow::from_velocity(&column, |_| [-2.2, 0.0, 0.0], Divergence::Refuse);
        assert!(matches!(refused, Err(Error::Divergence { .. })), "{refused:?}");
        // Projected, nothing blows.
        let still = Flow::from_velocity(&column, |_| [-2.2, 0.0, 0.0], Divergence::Project).unwrap();
        assert!(still.velocities(&column).iter().all(|v| v[0].abs() < 1e-12));
    }
}

/// Widths that differ: three layers of different diffusivity in series carry the flux of their resistances.
#[test]
fn layers_in_series_are_exact() {
    let edges = vec![0.0, 0.1, 0.4, 0.5, 1.3, 1.4, 2.0];
    let grid = Grid::new(&[edges]).unwrap();
    let sides = [
        [Boundary::Absorbing, Boundary::Closed],
        [Boundary::Closed; 2],
        [Boundary::Closed; 2],
    ];
    let domain = Domain::new(grid, &[CellKind::Free; 6], sides).unwrap();
    let diffusivity = domain.sample(|[x, ..]| {
        if x < 0.4 {
            0.3
        } else if x < 1.3 {
            2.0
        } else {
            0.05
        }
    });
    let transport =
        Transport::new(domain.clone(), diffusivity, &Flow::still(&domain), 0.0, FluxRule::default()).unwrap();
    let field = Steady::new(&transport)
        .unwrap()
        .from_amounts(&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        .unwrap();
    let resistance = [
        0.05 / 0.3,
        0.25 / 0.3,
        0.4 / 0.3 + 0.05 / 2.0,
        0.4 / 0.3 + 0.5 / 2.0,
        0.4 / 0.3 + 0.45 + 1.0,
        0.4 / 0.3 + 0.45 + 8.0,
    ];
    for (c, want) in field.iter().zip(resistance) {
        assert!((c / want - 1.0).abs() < 1e-12, "{c}, expected {want}");
    }
}

/// Cells that touch at a corner only do not exchange anything: the second part sees nothing, and its mass stays.
#[test]
fn diagonal_contact_is_no_passage() {
    let domain = Plan::parse("..#\n..#\n##.").unwrap().domain(0.5, 1, 0.0).unwrap();
    let transport = Transport::new(domain.clone(), 0.05, &Flow::still(&domain), 0.0, FluxRule::default()).unwrap();
    let release = TimedSource {
        patch: domain.point([0.2, 0.2, 0.0]).unwrap(),
        rate: 1.0,
        start: 0.0,
        stop: 5.0,
    };
    let run = Transient::new(&transport).run(&[0.0; 5], &[release], &[20.0]).unwrap();
    assert_eq!(run[0].concentration[4], 0.0);
    assert!((transport.balance(&run[0].concentration).unwrap().mass - 5.0).abs() < 1e-12);
    // Without any exit there is no steady state.
    assert!(matches!(Steady::new(&transport).err(), Some(Error::NoSink { cell: [0, 0, 0] })));
}

/// A part that wind does not reach has no potential: nothing blows there, and the rest is as without it.
#[test]
fn part_without_opening_has_no_wind() {
    let domain = Plan::parse("######\nI....O\n######\n#.#..#\n######")
        .unwrap()
        .domain(0.25, 2, 0.0)
        .unwrap();
    let wind = PotentialFlow::new(&domain, 0.2).unwrap();
    let still = domain.locate([0.9, 0.8, 0.0]).unwrap();
    assert_eq!(wind.flow.velocities(&domain)[still], [0.0; 3]);
    let passing = domain.locate([0.7, 0.3, 0.0]).unwrap();
    assert!((wind.flow.velocities(&domain)[passing][0] - 0.2 / 0.25).abs() < 1e-10);
}

/// Means over a patch, as sources and as sensors, come from the same shares.
#[test]
fn square_of_the_fixture_has_mean_one() {
    let model = Model::new(&fixture(), "room-decay", 2, FluxRule::default());
    let ones = vec![1.0; model.transport.domain().free().len()];
    assert!((model.square(&json!([4, 12])).mean(&ones) - 1.0).abs() < 1e-14);
}
