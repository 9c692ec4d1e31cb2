//! What is refused, and with which words.

use fewbits_diffusion::{
    Boundary, CellKind, Divergence, Domain, Error, Flow, FluxRule, Grid, Plan, PotentialFlow, Source, Steady,
    StepControl, TimedSource, Transient, Transport,
};

const CLOSED: [[Boundary; 2]; 3] = [[Boundary::Closed; 2]; 3];

fn room() -> Domain {
    Plan::parse("#####\n#.#.#\nI...O\n#####")
        .unwrap()
        .domain(0.5, 1, 0.0)
        .unwrap()
}

#[test]
fn grids_are_checked() {
    assert!(Grid::new(&[]).is_err() && Grid::new(&[vec![0.0, 1.0, 1.0]]).is_err() && Grid::new(&[vec![0.0]]).is_err());
    assert!(
        Grid::uniform(&[3, 0], 1.0).is_err()
            && Grid::uniform(&[3], -1.0).is_err()
            && Grid::uniform(&[2, 2, 2, 2], 1.0).is_err()
    );
    assert!(Grid::new(&[vec![0.0, f64::NAN]]).is_err());
    let grid = Grid::new(&[vec![0.0, 0.1, 0.4], vec![-1.0, 2.0]]).unwrap();
    let domain = Domain::new(grid, &[CellKind::Free; 2], [[Boundary::Closed; 2]; 3]).unwrap();
    assert_eq!(domain.locate([0.1, 0.0, 99.0]), Ok(1));
    assert_eq!(domain.locate([0.4, 2.0, 0.0]), Ok(1));
    assert!(domain.locate([0.41, 0.0, 0.0]).is_err());
}

#[test]
fn domains_are_checked() {
    let grid = || Grid::uniform(&[2, 1], 1.0).unwrap();
    assert!(Domain::new(grid(), &[CellKind::Free], CLOSED).is_err());
    assert_eq!(
        Domain::new(grid(), &[CellKind::Blocked(Boundary::Closed); 2], CLOSED).unwrap_err(),
        Error::NoFreeCell
    );
    for leak in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(Domain::new(grid(), &[CellKind::Free, CellKind::Blocked(Boundary::Leaking(leak))], CLOSED).is_err());
    }
    let leaking = Domain::new(grid(), &[CellKind::Free, CellKind::Blocked(Boundary::Leaking(0.1))], CLOSED).unwrap();
    assert!(leaking.with_wall_normals(|_| [2.0, 0.0, 0.0]).is_err());
}

#[test]
fn source_in_a_wall_names_the_nearest_free_cell() {
    let room = room();
    let refused = room.point([1.2, 0.6, 0.0]).unwrap_err();
    assert_eq!(
        refused,
        Error::Blocked {
            point: [1.2, 0.6, 0.0],
            nearest: [0.75, 0.75, 0.5]
        }
    );
    assert!(refused.to_string().contains("nearest free cell is [0.75, 0.75, 0.5]"), "{refused}");
    assert!(matches!(room.point([9.0, 0.6, 0.0]), Err(Error::Outside { .. })));
    assert!(matches!(room.point([f64::NAN, 0.6, 0.0]), Err(Error::Outside { .. })));
    assert!(room.block([0.0, 0.0, 0.0], [0.1, 0.1, 0.0]).is_err() && room.block([0.0; 3], [2.0, 2.0, 0.0]).is_err());
}

#[test]
fn plans_name_line_and_column() {
    let refused = Plan::parse("...\n.x.").unwrap_err().to_string();
    assert!(refused.contains("'x' in line 1, column 1: expected one of . # L A I O"), "{refused}");
    let refused = Plan::parse("...\n..").unwrap_err().to_string();
    assert!(refused.contains("2 squares in line 1: expected 3, as in line 0"), "{refused}");
    assert_eq!(Plan::parse(" \n").unwrap_err(), Error::NoFreeCell);
    assert!(Plan::parse("###").unwrap().domain(1.0, 1, 0.0).is_err());
    assert!(Plan::parse("...").unwrap().domain(1.0, 0, 0.0).is_err());
}

#[test]
fn squares_of_a_plan_are_replaced() {
    let plan = Plan::parse("#..#\n####").unwrap();
    assert_eq!(plan.clone().with('I', [[1, 0]]).unwrap(), Plan::parse("#I.#\n####").unwrap());
    assert!(plan.clone().with('x', [[1, 0]]).is_err() && plan.with('I', [[4, 0]]).is_err());
}

#[test]
fn winds_are_checked() {
    let room = room();
    let across = Flow::from_velocity(&room, |[x, ..]| [x, 0.0, 0.0], Divergence::Refuse).unwrap_err();
    assert!(matches!(across, Error::Divergence { .. }) && across.to_string().contains("Project"), "{across}");
    assert!(Flow::from_velocity(&room, |_| [f64::NAN; 3], Divergence::Project).is_err());
    assert!(Flow::from_cells(&room, &[[0.0; 3]], Divergence::Project).is_err());
    assert!(PotentialFlow::new(&room, 0.0).is_err());
    let apart = Plan::parse("I#O").unwrap().domain(1.0, 1, 0.0).unwrap();
    assert_eq!(PotentialFlow::new(&apart, 1.0).unwrap_err(), Error::NoPassage);
    // A wind against the openings.
    let duct = Plan::parse("I..O").unwrap().domain(1.0, 1, 0.0).unwrap();
    let against = Flow::from_velocity(&duct, |_| [-1.0, 0.0, 0.0], Divergence::Refuse).unwrap();
    let refused = Transport::new(duct.clone(), 0.1, &against, 0.0, FluxRule::default()).err();
    assert!(matches!(refused, Some(Error::Backflow { cell: [3, 0, 0], .. })), "{refused:?}");
    // A flow of another domain.
    assert!(Transport::new(room, 0.1, &against, 0.0, FluxRule::default()).is_err());
}

#[test]
fn media_are_checked() {
    let room = room();
    let still = Flow::still(&room);
    let count = room.free().len();
    let transport = |diffusivity: Vec<f64>, decay: Vec<f64>| {
        Transport::new(room.clone(), diffusivity, &still, decay, FluxRule::default())
    };
    assert!(transport(vec![0.1; count], vec![0.0; count]).is_ok());
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(transport(vec![bad; count], vec![0.0; count]).is_err());
        assert!(bad == 0.0 || transport(vec![0.1; count], vec![bad; count]).is_err());
    }
    assert!(transport(vec![0.1; 2], vec![0.0; count]).is_err() && transport(vec![0.1; count], vec![0.0; 2]).is_err());
}

#[test]
fn part_without_sink_is_named() {
    let domain = Plan::parse("I.O##\n###.#").unwrap().domain(1.0, 1, 0.0).unwrap();
    let transport =
        |decay: f64| Transport::new(domain.clone(), 0.1, &Flow::still(&domain), decay, FluxRule::default()).unwrap();
    assert_eq!(Steady::new(&transport(0.0)).err(), Some(Error::NoSink { cell: [3, 1, 0] }));
    assert!(Steady::new(&transport(1e-3)).is_ok());
    // In time it is well posed.
    let release = TimedSource {
        patch: domain.point([3.5, 1.5, 0.0]).unwrap(),
        rate: 1.0,
        start: 0.0,
        stop: 2.0,
    };
    let run = Transient::new(&transport(0.0))
        .run(&[0.0; 4], &[release], &[3.0])
        .unwrap();
    assert!((run[0].concentration[3] - 2.0).abs() < 1e-12);
}

#[test]
fn runs_are_checked() {
    let room = room();
    let transport = Transport::new(room.clone(), 0.1, &Flow::still(&room), 0.0, FluxRule::default()).unwrap();
    let count = room.free().len();
    let release = |rate, start, stop| TimedSource {
        patch: room.point([0.7, 0.7, 0.0]).unwrap(),
        rate,
        start,
        stop,
    };
    let mut solver = Transient::new(&transport);
    for times in [vec![], vec![0.0], vec![2.0, 1.0], vec![f64::NAN]] {
        assert!(solver.run(&vec![0.0; count], &[], &times).is_err(), "{times:?}");
        assert!(solver.step_responses(&[], &times).is_err(), "{times:?}");
    }
    assert!(solver.run(&[0.0], &[], &[1.0]).is_err() && solver.run(&vec![f64::NAN; count], &[], &[1.0]).is_err());
    for bad in [
        release(f64::NAN, 0.0, 1.0),
        release(1.0, 2.0, 1.0),
        release(1.0, -1.0, 1.0),
        release(1.0, f64::NAN, 1.0),
    ] {
        assert!(
            solver
                .run(&vec![0.0; count], std::slice::from_ref(&bad), &[1.0])
                .is_err(),
            "{bad:?}"
        );
    }
    assert!(
        Transient::new(&transport)
            .with_control(StepControl::Tolerance(0.0))
            .is_err()
    );
    assert!(Transient::new(&transport).with_control(StepControl::Equal(0)).is_err());
    let other = Domain::new(Grid::uniform(&[40], 1.0).unwrap(), &[CellKind::Free; 40], CLOSED).unwrap();
    let foreign = other.point([39.5, 0.0, 0.0]).unwrap();
    assert!(Steady::new(&transport).unwrap().adjoint(&[foreign]).is_err());
    assert!(Steady::new(&transport).unwrap().from_amounts(&[1.0]).is_err());
}

/// Defect: diffusivities and winds near the ends of the range of numbers gave fields that were no numbers.
#[test]
fn numbers_beyond_the_range_are_refused() {
    assert!(Grid::uniform(&[2], 1e31).is_err() && Grid::new(&[vec![0.0, 1e-31]]).is_err());
    assert!(Grid::uniform(&[2], 1e29).is_ok() && Grid::new(&[vec![0.0, 1e-29]]).is_ok());
    let room = room();
    let still = Flow::still(&room);
    for (diffusivity, decay) in [(1e31, 0.0), (1e-31, 0.0), (1.0, 1e31)] {
        assert!(Transport::new(room.clone(), diffusivity, &still, decay, FluxRule::default()).is_err());
    }
    assert!(PotentialFlow::new(&room, 1e91).is_err());
    assert!(Flow::from_velocity(&room, |_| [1e300, 0.0, 0.0], Divergence::Project).is_err());
    let transport = Transport::new(room.clone(), 1e-30, &still, 0.0, FluxRule::default()).unwrap();
    let patch = room.point([0.7, 0.7, 0.0]).unwrap();
    let strongest = Source {
        patch: patch.clone(),
        rate: f64::MAX,
    };
    assert!(Steady::new(&transport).unwrap().concentration(&[strongest]).is_err());
    let mut transient = Transient::new(&transport).with_control(StepControl::Equal(2)).unwrap();
    let release = TimedSource {
        patch,
        rate: f64::MAX,
        start: 0.0,
        stop: f64::MAX,
    };
    assert!(
        transient
            .run(&vec![0.0; room.free().len()], &[release], &[1e300])
            .is_err()
    );
}
