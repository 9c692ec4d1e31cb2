//! The closed form against the general filter.

use fewbits_adaptive::{Config, MODELS, SCALES, Sensor};
use fewbits_core::factor::Levels;
use fewbits_core::{Cell, Gaussian, Observed};
use fewbits_filters::{Imm, MomentFilter, StateFilter, Switching};
use fewbits_models::{LinearGaussian, LinearSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector1, Vector2};

/// The bank finds the same model as exact truncated-normal updates of the same models on the same cells.
#[test]
fn the_bank_believes_what_the_general_filter_believes() {
    let mut models = Vec::new();
    for decay in [0.0, 0.6, 0.95] {
        for scale in 0..SCALES {
            let q = 4.0_f64.powi(scale as i32 - 3);
            let (f, g) = (Matrix2::new(1.0, decay, 0.0, decay), Vector2::new(1.0, f64::from(decay > 0.0)));
            models.push(LinearGaussian::new(f, g, Vector1::new(q * q)).unwrap());
        }
    }
    assert_eq!(models.len(), MODELS);
    let models = Switching::new(models).unwrap();
    let mut filter = Imm::new(MomentFilter, vec![1.0; MODELS], 0.005).unwrap();
    let mut rng = Stream::new(1).rng();
    let signals: [fn(f64) -> f64; 3] = [
        |n| 30.0 * (0.07 * n).sin(),
        |n| 3.0 * (n * 12.9898).sin() + 2.0 * (n * 78.233).sin(),
        |n| 200.0 * (0.2 * n).cos(),
    ];
    for signal in signals {
        let mut sensor = Sensor::new(Config::new(0.5).unwrap());
        let start = Gaussian::new(Vector2::zeros(), Matrix2::new(0.1, 0.0, 0.0, 0.0)).unwrap();
        let mut belief = filter.start(&mut rng, &start).unwrap();
        let matrix = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.15 * 0.15).unwrap();
        let first = signal(0.0);
        sensor.encode(first).unwrap();
        for n in 1..400 {
            sensor.encode(signal(f64::from(n))).unwrap();
            let j = (sensor.reconstruction().unwrap() - first).round();
            let factor = Levels::certain(Cell::new(j - 0.5, j + 0.5).unwrap(), 0.15 * 0.15).unwrap();
            filter.predict(&mut rng, &models, &mut belief).unwrap();
            let observed = Observed::new(matrix, factor);
            filter.update(&mut rng, &mut belief, &[&observed]).unwrap();
        }
        let ours = sensor.model_weights();
        let family = |weights: &[f64], f: usize| weights[f * SCALES..(f + 1) * SCALES].iter().sum::<f64>();
        let scale = |weights: &[f64]| -> f64 { weights.iter().enumerate().map(|(m, w)| w * (m % SCALES) as f64).sum() };
        // Within a fifth of probability for each family, and half a step of the scales.
        for f in 0..3 {
            let (a, b) = (family(&ours, f), family(belief.probabilities(), f));
            assert!((a - b).abs() < 0.4, "family {f}: {a} {b}");
        }
        let (a, b) = (scale(&ours), scale(belief.probabilities()));
        assert!((a - b).abs() < 1.0, "scale: {a} {b}");
    }
}
