//! Envelopes and Fisher information over the sensors' own ground and heights.

use super::posterior_of;
use fewbits_core::Gaussian;
use fewbits_diffusive::information::{Unknown, fisher_information};
use fewbits_diffusive::{Envelope, Prior, RateModel, SourceLikelihood, SourceSensor};
use fewbits_models::diffusion::{Air, Ground, Wall};
use nalgebra::{Matrix2, Vector2, Vector3};

const SOURCE: [f64; 2] = [62.0, 50.0];

fn grounds() -> [Ground; 4] {
    [
        Ground::None,
        Ground::Impermeable,
        Ground::Wall(Wall::ABSORBING),
        Ground::Wall(Wall::permeable(2.0).unwrap()),
    ]
}

fn sensor(ground: Ground, heights: (f64, f64)) -> SourceSensor {
    let air = Air::new(40.0, Vector3::zeros(), ground).unwrap();
    SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 1e-7)
        .unwrap()
        .with_heights(heights.0, heights.1)
        .unwrap()
}

/// A posterior of noise-free samples of twelve nodes, a few centimetres wide.
fn sharp(sensor: &SourceSensor, rate: RateModel) -> Envelope {
    let source = Vector2::from(SOURCE);
    let records = (0..12).map(|i| {
        let angle = f64::from(i);
        let node = source + Vector2::new(angle.cos(), angle.sin()) * (6.0 + f64::from(i));
        sensor
            .record(&node, &sensor.responses(&node, &source).unwrap())
            .unwrap()
    });
    let likelihood = SourceLikelihood::new(records.collect(), rate).unwrap();
    let prior = Prior::Exact(Gaussian::new(source, Matrix2::identity() * 100.0).unwrap());
    let posterior = posterior_of(&prior, &likelihood).unwrap();
    Envelope::new(&posterior, &likelihood).unwrap()
}

/// The concentration is exceeded at 0.98 of the truth and not at 1.02 of it, over every ground and at every height.
#[test]
fn exceedance_is_of_the_sensors_own_medium() {
    let place = Vector2::new(70.0, 44.0);
    for ground in grounds() {
        for heights in [(2.0, 1.0), (20.0, 20.0), (30.0, 2.0)] {
            // An integral for every cell: once is enough.
            if matches!(ground, Ground::Wall(wall) if wall != Wall::ABSORBING) && heights.0 != 20.0 {
                continue;
            }
            let sensor = sensor(ground, heights);
            let area = sharp(&sensor, RateModel::Known(1.0));
            let field = sensor.receptor(&place).unwrap();
            let truth = sensor
                .model()
                .concentration(&field, &Vector3::new(SOURCE[0], SOURCE[1], heights.0), 40.0);
            let above = |share: f64| area.exceedance(&place, 40.0, share * truth).unwrap();
            assert!(
                above(0.98) > 0.99 && above(1.02) < 0.01,
                "{ground:?} {heights:?}: {} {}",
                above(0.98),
                above(1.02)
            );
        }
    }
}

/// The largest distance at which the truth exceeds the threshold, found by walking along the ray.
#[test]
fn reach_is_where_the_plume_falls_below_the_threshold() {
    for (wind, heights) in [(0.0, (0.0, 0.0)), (3.0, (20.0, 1.0)), (0.0, (12.0, 3.0))] {
        let air = Air::new(40.0, Vector3::new(wind, 0.0, 0.0), Ground::Impermeable).unwrap();
        let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 1e-7).unwrap();
        let sensor = sensor.with_heights(heights.0, heights.1).unwrap();
        let area = sharp(&sensor, RateModel::Known(1.0));
        let at = |r: f64| air.concentration(&Vector3::new(r, 0.0, heights.1), &Vector3::new(0.0, 0.0, heights.0), 60.0);
        let walked = |threshold: f64| (0..40_000).map(|i| 0.01 * f64::from(i)).rfind(|r| at(*r) > threshold);
        for threshold in [1e-4, 1e-3] {
            let reach = area.reach(&Vector2::from(SOURCE), 0.0, 60.0, threshold, 0.5).unwrap();
            match (reach, walked(threshold)) {
                (Some(reach), Some(truth)) => {
                    assert!((reach - truth).abs() < 0.1, "{wind} {heights:?} {reach} {truth}")
                }
                (None, None) => {}
                other => panic!("{wind} {heights:?} {threshold}: {other:?}"),
            }
        }
    }
}

/// The information on the diffusivity, by differences of the sensor's own responses in other air.
#[test]
fn information_on_the_diffusivity_keeps_ground_and_heights() {
    let source = Vector2::from(SOURCE);
    let nodes = [Vector2::new(50.0, 54.0), Vector2::new(70.0, 45.0)];
    for ground in grounds() {
        for heights in [(0.0, 0.0), (20.0, 20.0), (5.0, 1.0)] {
            let sensor = sensor(ground, heights);
            let all = [Unknown::Diffusivity, Unknown::Rate];
            let got = fisher_information(&all, &sensor, &nodes, &source, 1.3).unwrap();
            let responses = |k: f64, node: &Vector2<f64>| {
                let air = Air::new(k, Vector3::zeros(), ground).unwrap();
                let ages = sensor.instants().iter();
                let field = Vector3::new(node.x, node.y, heights.1);
                ages.map(|t| air.concentration(&field, &Vector3::new(source.x, source.y, heights.0), *t))
                    .collect::<Vec<f64>>()
            };
            let mut expected = 0.0;
            for node in &nodes {
                let (slow, fast) = (responses(39.99, node), responses(40.01, node));
                for (s, f) in slow.iter().zip(&fast) {
                    expected += (1.3 * (f - s) / 0.02 / sensor.noise()).powi(2);
                }
            }
            assert!(
                (got[(0, 0)] - expected).abs() <= 1e-5 * expected,
                "{ground:?} {heights:?}: {} {expected}",
                got[(0, 0)]
            );
        }
    }
}

#[test]
fn envelope_refuses_what_is_no_number() {
    let area = sharp(&sensor(Ground::Impermeable, (0.0, 0.0)), RateModel::Known(1.0));
    let place = Vector2::new(70.0, 44.0);
    assert!(area.exceedance(&place, f64::NAN, 1e-4).is_err() && area.exceedance(&place, 1.0, 0.0).is_err());
    assert!(area.exceedance(&Vector2::new(f64::NAN, 0.0), 1.0, 1e-4).is_err());
    assert!(area.reach(&place, f64::NAN, 1.0, 1e-4, 0.5).is_err() && area.reach(&place, 0.0, 1.0, 1e-4, 1.5).is_err());
    assert_eq!(area.exceedance(&place, -1.0, 1e-4).unwrap(), 0.0);
}
