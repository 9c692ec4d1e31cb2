//! The closed forms of bodies, by their own laws and independent values; then the grids by the closed forms.

use crate::cylinder::Cylinder;
use crate::slab::{SlabWall, green as slab_green};
use crate::sphere::Sphere;
use crate::two_media::TwoMedia;
use fewbits_diffusion::{
    Boundary, CellKind, Domain, Flow, FluxRule, Grid, Patch, Snapshot, StepControl, TimedSource, Transient, Transport,
};
use fewbits_models::diffusion::{Air, Ground, Wall};
use fewbits_numerics::quadrature::Rule;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

const WALLS: [SlabWall; 2] = [SlabWall::Impermeable, SlabWall::Absorbing];

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * want.abs(), "{got}, expected {want}");
}

/// Values of an independent program.
#[test]
fn slab_and_two_media_values() {
    use SlabWall::{Absorbing as A, Impermeable as I};
    for (walls, t, want) in [
        ([I, I], 0.3, 0.9186799210981015),
        ([A, A], 0.3, 0.34714660248241697),
        ([I, A], 0.3, 0.529030048375063),
        ([I, I], 0.01, 0.044318484119380205),
    ] {
        close(slab_green(0.7, 0.4, t, 0.5, 1.0, walls), want, 1e-10);
    }
    let media = TwoMedia::new(2.0, 0.5).unwrap();
    close(media.green(0.5, 0.8, 1.0), 0.25106839206526355, 1e-10);
    close(media.green(-0.5, 0.8, 1.0), 0.17739016659916987, 1e-10);
}

#[test]
fn slab_mass() {
    for (walls, kept) in [
        ([WALLS[0], WALLS[0]], true),
        ([WALLS[1], WALLS[1]], false),
        ([WALLS[0], WALLS[1]], false),
    ] {
        let green = |z: f64, t: f64| slab_green(z, 0.6, t, 0.5, 2.0, walls);
        // Before the walls are felt the substance is where it was released, in units of the slab's own.
        let free = (-0.1_f64.powi(2) / 0.04).exp() / (0.04 * PI).sqrt();
        assert!((green(0.7, 0.02) / free - 1.0).abs() < 1e-12);
        let mut before = 1.0;
        for t in [0.02, 0.2, 1.0, 1.7, 4.0] {
            let now = Rule::gauss_legendre(20).composite(0.0, 2.0, 60, |z| green(z, t));
            assert!(if kept {
                (now - 1.0).abs() < 1e-10
            } else {
                now < before + 1e-12
            });
            before = now;
        }
    }
}

#[test]
fn two_media_mass_and_continuity() {
    let media = TwoMedia::new(2.0, 0.5).unwrap();
    for z0 in [0.8, -0.4] {
        let rule = Rule::gauss_legendre(20);
        let total = rule.composite(-12.0, 0.0, 60, |z| media.green(z, z0, 1.0))
            + rule.composite(0.0, 20.0, 60, |z| media.green(z, z0, 1.0));
        assert!((total - 1.0).abs() < 1e-10);
        let h = 1e-5;
        assert!((media.green(h, z0, 1.0) - media.green(-h, z0, 1.0)).abs() < 1e-4);
        let above = (media.green(2.0 * h, z0, 1.0) - media.green(h, z0, 1.0)) / h;
        let below = (media.green(-h, z0, 1.0) - media.green(-2.0 * h, z0, 1.0)) / h;
        assert!((2.0 * above - 0.5 * below).abs() < 1e-4);
    }
}

#[test]
fn cylinder_mass_reciprocity_and_wall() {
    for wall in WALLS {
        let cylinder = Cylinder::new(2.0, 0.5, wall).unwrap();
        let rule = Rule::gauss_legendre(24);
        let mut before = 1.0;
        for t in [0.3, 0.7, 2.0, 8.0] {
            let source = [1.1, 0.4];
            let total = rule.sum(0.0, 2.0, |rho| {
                let spokes = 32;
                let ring: f64 = (0..spokes)
                    .map(|i| cylinder.green([rho, TAU * i as f64 / spokes as f64], source, t))
                    .sum();
                rho * ring * TAU / spokes as f64
            });
            match wall {
                SlabWall::Impermeable => assert!((total - 1.0).abs() < 1e-8, "{total} at {t}"),
                SlabWall::Absorbing => assert!(total < before + 1e-9 && total >= 0.0),
            }
            before = total;
            let (a, b) = ([0.3, -1.0], [1.7, 2.0]);
            let (there, back) = (cylinder.green(a, b, t), cylinder.green(b, a, t));
            assert!((there - back).abs() <= 1e-12 * there.max(1e-6));
        }
        let h = 1e-4;
        let c = |rho: f64| cylinder.green([rho, 0.2], [1.1, 0.4], 0.5);
        match wall {
            SlabWall::Impermeable => {
                assert!(((3.0 * c(2.0) - 4.0 * c(2.0 - h) + c(2.0 - 2.0 * h)) / (2.0 * h)).abs() < 1e-6)
            }
            SlabWall::Absorbing => assert!(c(2.0).abs() < 1e-12),
        }
        // Far from the wall and early, free space.
        let free = (-(0.1_f64 * 0.1) / (4.0 * 0.5 * 0.02)).exp() / (4.0 * PI * 0.5 * 0.02);
        assert!((cylinder.green([0.1, 0.0], [0.0, 0.0], 0.02) / free - 1.0).abs() < 1e-10);
        assert_eq!(cylinder.green([0.1, 0.0], [0.0, 0.0], 0.0), 0.0);
        // Series and flat wall meet.
        let at = |t| cylinder.green([1.9, 0.1], [1.95, 0.1], t);
        assert!((at(0.012_49) / at(0.012_51) - 1.0).abs() < 0.08);
    }
    assert!(Cylinder::new(-1.0, 1.0, WALLS[0]).is_err());
}

#[test]
fn sphere_mass_reciprocity_and_wall() {
    for wall in WALLS {
        let ball = Sphere::new(2.0, 0.5, wall).unwrap();
        let rule = Rule::gauss_legendre(16);
        let source = Vector3::new(0.0, 0.0, 1.1);
        let mut before = 1.0;
        for t in [0.1, 0.6, 3.0] {
            // The source on the z axis leaves the angle about it trivial.
            let total = rule.composite(0.0, 2.0, 2, |r| {
                r * r
                    * TAU
                    * rule.composite(-1.0, 1.0, 2, |c| {
                        ball.green(&Vector3::new(r * (1.0 - c * c).sqrt(), 0.0, r * c), &source, t)
                    })
            });
            match wall {
                SlabWall::Impermeable => assert!((total - 1.0).abs() < 1e-8, "{total} at {t}"),
                SlabWall::Absorbing => assert!(total < before + 1e-9 && total >= 0.0),
            }
            before = total;
            let (a, b) = (Vector3::new(0.3, -1.0, 0.2), Vector3::new(-1.1, 0.2, 0.9));
            let (there, back) = (ball.green(&a, &b, t), ball.green(&b, &a, t));
            assert!((there - back).abs() <= 1e-12 * there.max(1e-6));
        }
        let h = 1e-4;
        let c = |r: f64| ball.green(&Vector3::new(r, 0.0, 0.0), &Vector3::new(1.1, 0.3, 0.0), 0.5);
        match wall {
            SlabWall::Impermeable => {
                assert!(((3.0 * c(2.0) - 4.0 * c(2.0 - h) + c(2.0 - 2.0 * h)) / (2.0 * h)).abs() < 1e-6)
            }
            SlabWall::Absorbing => assert!(c(2.0).abs() < 1e-12),
        }
    }
}

/// The boundary keeps flux and concentration, at every ratio of the two media and in every unit.
#[test]
fn two_media_meet_at_their_boundary() {
    for (above, below, source, t) in [
        (2.1, 0.6, 0.8, 0.7),
        (0.3, 1.9, 0.5, 0.9),
        (2.1, 0.6, -0.4, 1.3),
        (1.7, 1.7, 0.6, 0.5),
    ] {
        let media = TwoMedia::new(above, below).unwrap();
        let h = 1e-4;
        let (up, down) = (|n: f64| media.green(n * h, source, t), |n: f64| media.green(-n * h, source, t));
        close(up(1e-9), down(1e-9), 1e-7);
        let slope = |c: &dyn Fn(f64) -> f64| (-3.0 * c(1e-9) + 4.0 * c(1.0) - c(2.0)) / (2.0 * h);
        close(above * slope(&up), -below * slope(&down), 1e-6);
        let rule = Rule::gauss_legendre(20);
        let total = rule.composite(-20.0, 0.0, 40, |z| media.green(z, source, t))
            + rule.composite(0.0, 20.0, 40, |z| media.green(z, source, t));
        close(total, 1.0, 1e-10);
        // Equal media are one.
        if above == below {
            let distance = 0.9 + source;
            close(
                media.green(-0.9, source, t),
                (-distance * distance / (4.0 * above * t)).exp() / (4.0 * PI * above * t).sqrt(),
                1e-13,
            );
        }
        assert_eq!(media.green(0.3, source, 0.0), 0.0);
    }
    assert!(TwoMedia::new(0.0, 1.0).is_err() && TwoMedia::new(1.0, -1.0).is_err());
}

const CLOSED: [Boundary; 2] = [Boundary::Closed; 2];

fn boundary(wall: SlabWall) -> Boundary {
    match wall {
        SlabWall::Impermeable => Boundary::Closed,
        SlabWall::Absorbing => Boundary::Absorbing,
    }
}

/// The field at `age` of a unit mass spread over a patch at time 0.
fn burst(transport: &Transport, patch: &Patch, age: f64) -> Snapshot {
    // Released within a tenth of a thousandth of the age: the mean delay is taken off.
    let short = 1e-4 * age;
    let release = TimedSource {
        patch: patch.clone(),
        rate: short.recip(),
        start: 0.0,
        stop: short,
    };
    let mut run = Transient::new(transport)
        .with_control(StepControl::Tolerance(1e-5))
        .unwrap();
    let initial = vec![0.0; transport.domain().free().len()];
    run.run(&initial, &[release], &[age + 0.5 * short]).unwrap().remove(0)
}

/// Largest errors on a line of cells of 1 m / n, relative to the largest value.
fn line_error(cells: usize, sides: [Boundary; 2], media: impl Fn(f64) -> f64, exact: impl Fn(f64) -> f64) -> f64 {
    let grid = Grid::uniform(&[cells], 1.0 / cells as f64).unwrap();
    let domain = Domain::new(grid, &vec![CellKind::Free; cells], [sides, CLOSED, CLOSED]).unwrap();
    let diffusivity = domain.sample(|[x, ..]| media(x));
    let transport =
        Transport::new(domain.clone(), diffusivity, &Flow::still(&domain), 0.0, FluxRule::default()).unwrap();
    // The point of release is between two cells.
    let half = 0.75 / cells as f64;
    let patch = domain.block([0.4 - half, 0.0, 0.0], [0.4 + half, 0.0, 0.0]).unwrap();
    let field = burst(&transport, &patch, 0.03).concentration;
    let wanted = domain.sample(|[x, ..]| exact(x));
    let peak = wanted.iter().copied().fold(0.0, f64::max);
    field
        .iter()
        .zip(&wanted)
        .map(|(c, w)| (c - w).abs())
        .fold(0.0, f64::max)
        / peak
}

#[test]
fn grids_of_slabs_converge_to_closed_forms() {
    for walls in [[WALLS[0]; 2], [WALLS[1]; 2], [WALLS[0], WALLS[1]], [WALLS[1], WALLS[0]]] {
        let error =
            |cells| line_error(cells, walls.map(boundary), |_| 0.5, |x| slab_green(x, 0.4, 0.03, 0.5, 1.0, walls));
        let (coarse, fine) = (error(50), error(100));
        let order = (coarse / fine).log2();
        assert!(fine < 2e-3 && (1.8..2.2).contains(&order), "{walls:?}: {fine}, order {order}");
    }
}

#[test]
fn grid_of_two_media_converges_to_closed_form() {
    let media = TwoMedia::new(0.05, 0.02).unwrap();
    let side = |x: f64| if x < 0.5 { 0.02 } else { 0.05 };
    let error = |cells| line_error(cells, CLOSED, side, |x| media.green(x - 0.5, -0.1, 0.03));
    let (coarse, fine) = (error(50), error(100));
    let order = (coarse / fine).log2();
    assert!(fine < 6e-3 && (1.6..2.3).contains(&order), "{fine}, order {order}");
}

/// Largest error of a burst in a body that is cut out of cells, as a share of the largest exact value.
fn staircase_error(
    grid: Grid,
    wall: SlabWall,
    inside: impl Fn([f64; 3]) -> bool,
    [lower, upper]: [[f64; 3]; 2],
    exact: impl Fn([f64; 3]) -> f64,
) -> f64 {
    let kind = |cell: usize| {
        if inside(grid.centre(cell)) {
            CellKind::Free
        } else {
            CellKind::Blocked(boundary(wall))
        }
    };
    let cells: Vec<CellKind> = (0..grid.cells()).map(kind).collect();
    let domain = Domain::new(grid, &cells, [CLOSED; 3]).unwrap();
    let transport = Transport::new(domain.clone(), 0.5, &Flow::still(&domain), 0.0, FluxRule::default()).unwrap();
    let patch = domain.block(lower, upper).unwrap();
    let field = burst(&transport, &patch, 0.1).concentration;
    let exact = domain.sample(exact);
    let peak = exact.iter().copied().fold(0.0, f64::max);
    field.iter().zip(&exact).map(|(c, w)| (c - w).abs()).fold(0.0, f64::max) / peak
}

/// A staircase disc with absorbing or closed wall against the series of Bessel functions, at every cell of the inside.
#[test]
fn staircase_discs_are_near_bessel_series() {
    for wall in [SlabWall::Impermeable, SlabWall::Absorbing] {
        let pipe = Cylinder::new(1.0, 0.5, wall).unwrap();
        for (split, tolerance) in [(40_usize, 0.05), (80, 0.025)] {
            let width = 2.4 / split as f64;
            let grid = Grid::uniform(&[split, split], width).unwrap();
            let polar = |point: [f64; 3]| {
                let [x, y] = [point[0] - 1.2, point[1] - 1.2];
                [x.hypot(y), y.atan2(x)]
            };
            let patch = [[1.5 - width, 1.2 - width, 0.0], [1.5 + width, 1.2 + width, 0.0]];
            let exact = |point| pipe.green(polar(point), [0.3, 0.0], 0.1);
            let error = staircase_error(grid, wall, |point| polar(point)[0] < 1.0, patch, exact);
            assert!(error < tolerance, "{wall:?} {split}: {error}");
        }
    }
}

/// A staircase ball, absorbing or closed.
#[test]
fn staircase_balls_are_near_their_series() {
    for wall in [SlabWall::Impermeable, SlabWall::Absorbing] {
        let ball = Sphere::new(1.0, 0.5, wall).unwrap();
        let grid = Grid::uniform(&[22; 3], 2.2 / 22.0).unwrap();
        let from_centre = |point: [f64; 3]| Vector3::new(point[0] - 1.1, point[1] - 1.1, point[2] - 1.1);
        let exact = |point| ball.green(&from_centre(point), &Vector3::new(0.2, 0.0, 0.0), 0.1);
        let inside = |point| from_centre(point).norm() < 1.0;
        let error = staircase_error(grid, wall, inside, [[1.2, 1.0, 1.0], [1.4, 1.2, 1.2]], exact);
        assert!(error < 0.12, "{wall:?}: {error}");
    }
}

/// The half-space of the estimator, with every ground, in a box too large to matter: means over cubes of .4 m.
#[test]
fn boxes_converge_to_half_spaces() {
    let source = [2.4, 2.4, 0.4];
    let sensors = [[3.2, 2.4, 0.0], [3.2, 2.4, 0.4], [1.6, 3.2, 0.8], [2.4, 1.6, 1.2]];
    // Midpoints of 2 x 2 x 2 parts.
    let part = |corner: [f64; 3], i: usize| {
        let at = |axis: usize| corner[axis] + 0.1 + 0.2 * (i >> axis & 1) as f64;
        Vector3::new(at(0), at(1), at(2))
    };
    for (loss, floor) in [
        (0.0, Boundary::Closed),
        (0.4, Boundary::Leaking(0.4)),
        (f64::INFINITY, Boundary::Absorbing),
    ] {
        let air = Air::new(0.5, Vector3::zeros(), Ground::Wall(Wall::permeable(loss).unwrap())).unwrap();
        let mean = |sensor: [f64; 3]| {
            let pairs = (0..64).map(|i| (part(sensor, i / 8), part(source, i % 8)));
            pairs.map(|(at, from)| air.concentration(&at, &from, 0.5)).sum::<f64>() / 64.0
        };
        let wanted = sensors.map(mean);
        let error = |split: usize| {
            let (counts, width) = ([12 * split, 12 * split, 7 * split], 0.4 / split as f64);
            let grid = Grid::uniform(&counts, width).unwrap();
            let cells = vec![CellKind::Free; grid.cells()];
            let domain = Domain::new(grid, &cells, [CLOSED, CLOSED, [floor, Boundary::Closed]]).unwrap();
            let transport =
                Transport::new(domain.clone(), 0.5, &Flow::still(&domain), 0.0, FluxRule::default()).unwrap();
            let block = |corner: [f64; 3]| domain.block(corner, corner.map(|x| x + 0.4)).unwrap();
            let release = TimedSource {
                patch: block(source),
                rate: 1.0,
                start: 0.0,
                stop: f64::INFINITY,
            };
            let mut run = Transient::new(&transport)
                .with_control(StepControl::Tolerance(1e-5))
                .unwrap();
            let snapshot = run.run(&vec![0.0; cells.len()], &[release], &[0.5]).unwrap().remove(0);
            let errors = sensors.iter().zip(wanted);
            let errors = errors.map(|(sensor, want)| (block(*sensor).mean(&snapshot.concentration) - want).abs());
            errors.fold(0.0, f64::max) / wanted.into_iter().fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(1), error(2));
        let order = (coarse / fine).log2();
        assert!(fine < 0.05 && (1.5..2.7).contains(&order), "{loss}: {fine}, order {order}");
    }
}
