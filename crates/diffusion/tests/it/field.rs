//! `SensorField` as a model of an estimator: the laws of `SourceModel`.

use fewbits_diffusion::{
    Domain, Flow, FluxRule, Plan, PotentialFlow, SensorField, Source, Steady, StepControl, TimedSource, Transient,
    Transport,
};
use fewbits_models::{Receptor, SourceModel};
use nalgebra::Vector3;

const SENSORS: [[f64; 3]; 2] = [[0.7, 0.7, 0.0], [2.2, 1.6, 0.0]];
const AGES: [f64; 3] = [2.0, 8.0, 32.0];

fn domain() -> Domain {
    Plan::parse("I...#..\n....#..\n....#..\n......O")
        .unwrap()
        .domain(0.5, 2, 0.0)
        .unwrap()
}

fn transport() -> Transport {
    let domain = domain();
    let wind = PotentialFlow::new(&domain, 0.05).unwrap().flow;
    Transport::new(domain, 0.04, &wind, 0.0, FluxRule::default()).unwrap()
}

fn fields() -> [SensorField; 2] {
    let transport = transport();
    let control = StepControl::Tolerance(1e-6);
    [
        SensorField::steady(&transport, &SENSORS).unwrap(),
        SensorField::transient(&transport, &SENSORS, &AGES, control).unwrap(),
    ]
}

fn at(point: [f64; 3]) -> Vector3<f64> {
    Vector3::from(point)
}

fn receptor(field: &SensorField, sensor: usize) -> Receptor {
    field.receptor(&at(SENSORS[sensor])).unwrap()
}

/// Places all over the grid and around it.
fn places() -> impl Iterator<Item = Vector3<f64>> {
    (0..16 * 10).map(|i| Vector3::new(0.237 * (i % 16) as f64 - 0.1, 0.231 * (i / 16) as f64 - 0.1, 0.0))
}

/// At the centre of a cell the field is what the sensor measures of a source there.
#[test]
fn response_at_a_centre_is_the_forward_concentration() {
    let transport = transport();
    let steady = Steady::new(&transport).unwrap();
    let [still, timed] = fields();
    let (centre, rate) = ([1.125, 0.875, 0.0], 3.0);
    let patch = transport.domain().point(centre).unwrap();
    let source = Source {
        patch: patch.clone(),
        rate,
    };
    let forward = steady.concentration(&[source]).unwrap();
    let release = TimedSource {
        patch,
        rate,
        start: 0.0,
        stop: f64::INFINITY,
    };
    let mut run = Transient::new(&transport)
        .with_control(StepControl::Tolerance(1e-7))
        .unwrap();
    let run = run.run(&vec![0.0; forward.len()], &[release], &AGES).unwrap();
    for (k, sensor) in SENSORS.iter().enumerate() {
        let cell = transport.domain().locate(*sensor).unwrap();
        let got = rate * still.concentration(&receptor(&still, k), &at(centre), f64::INFINITY);
        assert!((got / forward[cell] - 1.0).abs() < 1e-12, "{got} {}", forward[cell]);
        for snapshot in &run {
            let got = rate * timed.concentration(&receptor(&timed, k), &at(centre), snapshot.time);
            let largest = snapshot.concentration.iter().copied().fold(0.0, f64::max);
            assert!((got - snapshot.concentration[cell]).abs() < 1e-4 * largest, "{}: {got}", snapshot.time);
        }
    }
}

#[test]
fn concentrations_are_finite_and_zero_where_no_source_can_be() {
    for field in fields() {
        let sensor = receptor(&field, 1);
        for place in places() {
            for age in [f64::NEG_INFINITY, -1.0, 0.0, f64::NAN] {
                assert_eq!(field.concentration(&sensor, &place, age), 0.0);
            }
            let mut before = 0.0;
            for age in [0.5, 2.0, 5.0, 8.0, 30.0, 32.0, 1e9, f64::INFINITY] {
                let c = field.concentration(&sensor, &place, age);
                assert!(c.is_finite() && c >= before - 1e-9, "{place} {age}: {c} after {before}");
                assert!(field.admits(&place, 0.0) || c == 0.0);
                before = c;
            }
        }
    }
}

#[test]
fn gradient_is_the_derivative_of_the_value() {
    for field in fields() {
        let sensor = receptor(&field, 0);
        for place in places().filter(|place| field.admits(place, 0.01)) {
            let gradient = field.source_gradient(&sensor, &place, 8.0);
            assert_eq!(gradient.value, field.concentration(&sensor, &place, 8.0));
            let step = 1e-6;
            for axis in 0..2 {
                let mut moved = [place; 2];
                moved[0][axis] -= step;
                moved[1][axis] += step;
                let [low, high] = moved.map(|place| field.concentration(&sensor, &place, 8.0));
                let slope = (high - low) / (2.0 * step);
                // No place stands within a step of a cell's face or centre.
                let scale = field.variation(&sensor, &place, 0.25, 8.0) / 0.25;
                let rounding = 1e-15 / step * gradient.value;
                let same = (gradient.gradient[axis] - slope).abs() <= 1e-5 * scale + rounding;
                assert!(same || !field.admits(&moved[0], 0.0) || !field.admits(&moved[1], 0.0), "{place} {axis}");
            }
            assert_eq!(gradient.gradient[2], 0.0);
        }
    }
}

/// Interpolation never passes a wall: on its two sides the field differs as the cells do.
#[test]
fn values_stay_on_their_side_of_a_wall() {
    let [field, _] = fields();
    let sensor = receptor(&field, 0);
    let value = |x: f64| field.concentration(&sensor, &at([x, 0.4, 0.0]), f64::INFINITY);
    let (near, far) = (value(1.99), value(2.51));
    assert!(near > 2.0 * far && value(2.2) == 0.0, "{near} {far}");
    // Towards the wall nothing changes beyond the last centre.
    assert!((value(1.9) / value(1.99) - 1.0).abs() < 1e-14);
}

#[test]
fn variation_bounds_changes_within_the_square() {
    for field in fields() {
        let sensor = receptor(&field, 1);
        for place in places().step_by(3).filter(|place| field.admits(place, 0.0)) {
            let centre = field.concentration(&sensor, &place, 32.0);
            let mut before = 0.0;
            for half_width in [0.0, 0.03, 0.1, 0.4, 1.0, 10.0] {
                let bound = field.variation(&sensor, &place, half_width, 32.0);
                assert!(bound >= before);
                before = bound;
                for other in places().filter(|other| (other - place).amax() <= half_width && field.admits(other, 0.0)) {
                    let change = (field.concentration(&sensor, &other, 32.0) - centre).abs();
                    assert!(change <= 2.0 * bound + 1e-12, "{place} {other} {half_width}: {change} {bound}");
                }
            }
        }
    }
}

#[test]
fn squares_that_hold_air_are_admitted() {
    let [field, _] = fields();
    for place in places().filter(|place| field.admits(place, 0.0)) {
        for (dx, dy, half_width) in [(0.3, 0.1, 0.3), (-2.0, 1.0, 2.0), (0.0, 0.0, 0.0)] {
            assert!(field.admits(&(place + Vector3::new(dx, dy, 0.0)), half_width));
        }
    }
    assert!(!field.admits(&at([2.2, 0.4, 0.0]), 0.1) && !field.admits(&at([-1.0, 0.4, 0.0]), 0.9));
}

#[test]
fn receptors_are_sensors_only() {
    let [field, _] = fields();
    assert_eq!(receptor(&field, 1).index, 1);
    assert!(field.receptor(&at([1.2, 0.2, 0.0])).is_err() && field.receptor(&at([2.2, 0.2, 0.0])).is_err());
    let transport = transport();
    assert!(SensorField::steady(&transport, &[[2.2, 0.4, 0.0]]).is_err());
    assert!(SensorField::transient(&transport, &SENSORS, &[2.0, 1.0], StepControl::default()).is_err());
    let closed = Plan::parse("...").unwrap().domain(1.0, 1, 0.0).unwrap();
    let closed = Transport::new(closed.clone(), 1.0, &Flow::still(&closed), 0.0, FluxRule::default()).unwrap();
    assert!(SensorField::steady(&closed, &[[0.5, 0.5, 0.0]]).is_err());
}
