//! Closed forms against finite volumes.

use fewbits_models::diffusion::{Air, Axis, Flux, Ground, ImpulseResponse, Layered, SlabWall, Space, TwoMedia, Wall};
use nalgebra::Vector3;

const CLOSED: Wall = Wall::IMPERMEABLE;

fn close(got: f64, want: f64, scale: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * scale, "{got}, expected {want}");
}

/// Errors fall fourfold when cells and steps are halved.
#[test]
fn half_spaces() {
    for (loss, wind, flux) in [
        (0.0, 0.0, Flux::Total),
        (0.8, 0.0, Flux::Total),
        (f64::INFINITY, 0.0, Flux::Total),
        (0.2, 1.5, Flux::Total),
        (0.2, 1.5, Flux::Diffusive),
        (0.8, -0.9, Flux::Total),
    ] {
        let wall = Wall::permeable(loss).unwrap();
        let exact = Axis::half_space(1.3, wall).unwrap().with_wind(wind, flux).unwrap();
        let peak = exact.green(1.0 + wind, 1.0, 1.0).max(exact.green(1.0, 1.0, 1.0));
        let mut before = f64::INFINITY;
        for cells in [300, 600, 1200] {
            let numeric = Layered::new(&[(18.0, 1.3)], [wall, CLOSED], cells)
                .unwrap()
                .with_wind(wind, flux)
                .unwrap();
            let error = [0.3, 1.0, 2.2, 4.0]
                .map(|z| (numeric.green(z, 1.0, 1.0, cells / 4).unwrap() - exact.green(z, 1.0, 1.0)).abs());
            let error = error.into_iter().fold(0.0, f64::max) / peak;
            assert!(error < 0.35 * before, "{loss} {wind} {flux:?} {cells}: {error} after {before}");
            before = error;
        }
        assert!(before < 4e-4, "{loss} {wind} {flux:?}: {before}");
    }
}

#[test]
fn slabs_and_two_media() {
    let walls = |w| match w {
        SlabWall::Impermeable => CLOSED,
        SlabWall::Absorbing => Wall::ABSORBING,
    };
    for pair in [
        [SlabWall::Impermeable; 2],
        [SlabWall::Absorbing; 2],
        [SlabWall::Impermeable, SlabWall::Absorbing],
        [SlabWall::Absorbing, SlabWall::Impermeable],
    ] {
        let exact = Axis::slab(0.5, 1.0, pair).unwrap();
        let numeric = Layered::new(&[(1.0, 0.5)], pair.map(walls), 1000).unwrap();
        for t in [0.05, 0.6] {
            close(numeric.green(0.7, 0.4, t, 400).unwrap(), exact.green(0.7, 0.4, t), 1.0, 2e-5);
        }
    }
    let exact = TwoMedia::new(2.0, 0.5).unwrap();
    let numeric = Layered::new(&[(12.0, 0.5), (12.0, 2.0)], [CLOSED; 2], 3000).unwrap();
    for z in [0.5, -0.5, 2.0] {
        close(numeric.green(12.0 + z, 12.8, 1.0, 600).unwrap(), exact.green(z, 0.8, 1.0), 0.3, 1e-4);
    }
}

#[test]
fn three_dimensions() {
    let air = Air::new(4.0, Vector3::zeros(), Ground::Wall(Wall::permeable(0.7).unwrap())).unwrap();
    let numeric = Layered::new(&[(30.0, 4.0)], [Wall::permeable(0.7).unwrap(), CLOSED], 750).unwrap();
    for distance in [0.0, 1.5, 4.0] {
        let exact = air.green(&Vector3::new(distance, 0.0, 0.5), &Vector3::new(0.0, 0.0, 1.0), 1.0);
        close(numeric.green_3d(distance, (0.5, 1.0), 1.0, (100, 32)).unwrap(), exact, exact, 8e-4);
    }
    let open = Space::new([Axis::open(4.0).unwrap(); 3]).unwrap();
    let deep = Layered::new(&[(40.0, 4.0)], [CLOSED; 2], 500).unwrap();
    let exact = open.green(&Vector3::new(1.0, 0.0, 20.4), &Vector3::new(0.0, 0.0, 20.0), 1.0);
    close(deep.green_3d(1.0, (20.4, 20.0), 1.0, (50, 32)).unwrap(), exact, exact, 4e-3);
}

#[test]
fn bad_layers_are_refused() {
    assert!(Layered::new(&[], [CLOSED; 2], 10).is_err() && Layered::new(&[(1.0, 0.0)], [CLOSED; 2], 10).is_err());
    assert!(
        Layered::new(&[(1.0, 1.0)], [CLOSED; 2], 1).is_err() && Layered::new(&[(-1.0, 1.0)], [CLOSED; 2], 10).is_err()
    );
    let layered = Layered::new(&[(1.0, 1.0)], [CLOSED; 2], 10).unwrap();
    assert!(layered.green(0.5, 0.5, 1.0, 0).is_err() && layered.green(f64::NAN, 0.5, 1.0, 5).is_err());
    assert_eq!(layered.green(0.5, 0.5, -1.0, 5).unwrap(), 0.0);
    assert_eq!(layered.green(0.5, 2.0, 1.0, 5).unwrap(), 0.0);
}

/// Seen from the other end everything is the same: walls, wind and layers change places.
#[test]
fn layers_turned_over_are_the_same() {
    let (lossy, tight) = (Wall::permeable(0.8).unwrap(), Wall::permeable(0.1).unwrap());
    for flux in [Flux::Total, Flux::Diffusive] {
        for wind in [0.0, 0.7] {
            let layers = |pair: [(f64, f64); 2], walls, wind| {
                Layered::new(&pair, walls, 90).unwrap().with_wind(wind, flux).unwrap()
            };
            let up = layers([(1.2, 0.4), (1.8, 1.9)], [lossy, tight], wind);
            let down = layers([(1.8, 1.9), (1.2, 0.4)], [tight, lossy], -wind);
            for (field, source) in [(0.03, 0.5), (0.9, 1.4), (2.95, 2.2)] {
                let one = up.green(field, source, 0.6, 20).unwrap();
                let other = down.green(3.0 - field, 3.0 - source, 0.6, 20).unwrap();
                assert!((one / other - 1.0).abs() < 1e-10, "{flux:?} {wind}: {one} {other}");
            }
        }
    }
}

/// A coarse grid is good to a per cent: against half-spaces with every wall and wind, and free space in three dimensions.
#[test]
fn coarse_layers_are_close_already() {
    for loss in [0.0, 0.8, f64::INFINITY] {
        for wind in [-0.9, 0.0, 1.2] {
            for flux in [Flux::Total, Flux::Diffusive] {
                let wall = Wall::permeable(loss).unwrap();
                let exact = Axis::half_space(1.3, wall).unwrap().with_wind(wind, flux).unwrap();
                let numeric = Layered::new(&[(14.0, 1.3)], [wall, CLOSED], 350)
                    .unwrap()
                    .with_wind(wind, flux)
                    .unwrap();
                for z in [0.01, 0.5, 1.3, 2.9] {
                    close(numeric.green(z, 0.9, 0.8, 60).unwrap(), exact.green(z, 0.9, 0.8), 1.0, 1e-2);
                }
            }
        }
    }
    let open = Space::new([Axis::open(1.3).unwrap(); 3]).unwrap();
    let deep = Layered::new(&[(16.0, 1.3)], [CLOSED; 2], 240).unwrap();
    for (distance, z) in [(0.0, 8.1), (1.1, 7.3), (2.3, 9.4)] {
        let exact = open.green(&Vector3::new(distance, 0.0, z), &Vector3::new(0.0, 0.0, 8.2), 0.9);
        close(deep.green_3d(distance, (z, 8.2), 0.9, (40, 24)).unwrap(), exact, exact, 2e-2);
    }
    assert_eq!(deep.green_3d(1.0, (8.1, 8.2), 0.0, (40, 24)).unwrap(), 0.0);
    assert!(deep.green_3d(-1.0, (8.1, 8.2), 0.9, (40, 24)).is_err());
    assert!(deep.green_3d(1.0, (8.1, 8.2), 0.9, (40, 0)).is_err());
}
