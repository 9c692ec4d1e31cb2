//! Every entry of the reference values, computed by an independent program.

use crate::Silence;
use fewbits_baselines::cfwmd::cross_covariance_step;
use fewbits_baselines::cfwmd::information::{Direction, divergence};
use fewbits_baselines::cfwmd::trigger::StochasticTrigger;
use fewbits_cfwmd::ellipsoid::Ellipsoid;
use fewbits_cfwmd::rule::{OwnRecursion, OwnStep};
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Factor, Gaussian, LinearSensing, Sensing};
use fewbits_filters::kalman;
use fewbits_models::{LinearSensor, ReceivedPower, constant_velocity_1d};
use fewbits_numerics::normal;
use nalgebra::{Matrix2, SVector, Vector1, Vector2};
use serde_json::Value;

/// Monte-Carlo entries are met by the figures of the experiments crate, claim by claim, at the papers' trial counts.
const BY_FIGURES: [(&str, &str); 13] = [
    ("fig1/", "cfwmd-fig1"),
    ("fig2/", "cfwmd-fig2"),
    ("fig3/", "cfwmd-nofeedback"),
    ("fig4/", "cfwmd-fig4"),
    ("fig6/", "cfwmd-fig6"),
    ("fig8/", "cfwmd-fig8"),
    ("fig9/", "cfwmd-fig9"),
    ("tab2/", "cfwmd-table2"),
    ("tab3/", "cfwmd-fig10"),
    ("tab3_1e4/", "cfwmd-table3"),
    ("cal/", "cfwmd-scheduled"),
    ("cost/", "tests of fewbits-experiments"),
    ("loss/", "cfwmd-lossy"),
];

fn entries() -> Vec<Value> {
    serde_json::from_str(include_str!("../fixtures/cfwmd.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

struct Scene {
    dynamics: fewbits_models::LinearGaussian<2, 1>,
    sensor: LinearSensor<2, 1>,
    steps: Vec<OwnStep<2, 1>>,
    recursion: OwnRecursion<2>,
}

/// The system of the `local_*` entries, checked against their inputs.
fn scene(inputs: &Value) -> Scene {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    assert_eq!(numbers(&inputs["F"]), [1.0, 1.0, 0.0, 1.0]);
    assert_eq!(numbers(&inputs["Q"]), [1.0, 2.0, 2.0, 4.0]);
    assert!(numbers(&inputs["P0"]).iter().all(|p| *p == 0.0));
    let sensor = LinearSensor::scalar(Vector2::from_vec(numbers(&inputs["h"])), inputs["r"].as_f64().unwrap()).unwrap();
    let start = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
    let mut recursion = OwnRecursion::new(&start);
    let steps = (0..inputs["T"].as_u64().unwrap())
        .map(|_| recursion.advance(&dynamics, &sensor, start.mean()).unwrap())
        .collect();
    Scene {
        dynamics,
        sensor,
        steps,
        recursion,
    }
}

fn compute(name: &str, inputs: &Value) -> Option<Vec<f64>> {
    let number = |key: &str| inputs[key].as_f64().unwrap();
    let kind = name.split(['_', '(', '[']).next().unwrap();
    Some(match kind {
        "eta" => {
            let budget = Budget::new(number("l"), inputs["N"].as_u64().unwrap() as usize).unwrap();
            vec![budget.threshold(inputs["n_nu"].as_u64().unwrap() as usize).unwrap()]
        }
        "local" if name == "local_s" => scene(inputs).steps.iter().map(|s| s.innovation_covariance[0]).collect(),
        "local" if name == "local_gain" => scene(inputs)
            .steps
            .iter()
            .flat_map(|s| [s.gain[0], s.gain[1]])
            .collect(),
        "local" if name == "local_Pfilt_last" => scene(inputs).recursion.covariance().transpose().as_slice().to_vec(),
        "cross" => {
            let scene = scene(inputs);
            let matrix = *scene.sensor.matrix();
            let mut cross = scene.steps[0].predicted;
            let mut out = Vec::new();
            for (k, step) in scene.steps.iter().enumerate() {
                if [1, 2, 5, 20].contains(&(k + 1)) {
                    out.extend_from_slice(cross.transpose().as_slice());
                }
                cross = cross_covariance_step(&scene.dynamics, &cross, (step, &matrix), (step, &matrix));
            }
            out
        }
        "allsend" => {
            let scene = scene(inputs);
            let mut belief = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
            let mut out = Vec::new();
            for _ in 0..inputs["T"].as_u64().unwrap() {
                belief = kalman::predict(&scene.dynamics, &belief);
                for _ in 0..inputs["N"].as_u64().unwrap() {
                    belief = kalman::update(&scene.sensor, &belief, &SVector::from([0.0])).unwrap().0;
                }
                out.extend_from_slice(belief.standard_deviations().as_slice());
            }
            out
        }
        "logcens" => vec![
            Silence {
                centre: 0.0,
                half_width: number("c"),
                noise_variance: number("r"),
                loss: 0.0,
                count: 1,
            }
            .factor()
            .log_likelihood(&Vector1::new(number("mu"))),
        ],
        "trunc" => {
            let (mu, sd) = (number("mu"), number("v").sqrt());
            let (low, high) = ((number("a") - mu) / sd, (number("b") - mu) / sd);
            let cell = normal::truncated_moments(low, high).unwrap();
            vec![
                normal::log_interval(low, high),
                mu + sd * cell.mean,
                sd * sd * cell.variance,
            ]
        }
        "quadprob" => {
            let (l1, l2) = (number("l1"), number("l2"));
            let region = Ellipsoid::new(&Matrix2::identity(), number("eta")).unwrap();
            let under = region.under(&Matrix2::new(l1, 0.0, 0.0, l2)).unwrap();
            vec![
                under
                    .log_probability(&Vector2::new(number("b1") * l1.sqrt(), number("b2") * l2.sqrt()))
                    .exp(),
            ]
        }
        "region" => {
            let matrix = |key: &str| Matrix2::from_row_slice(&numbers(&inputs[key]));
            let region = Ellipsoid::new(&matrix("S"), number("eta")).unwrap();
            let moments = region
                .under(&matrix("V"))
                .unwrap()
                .moments(&Vector2::from_vec(numbers(&inputs["mu"])))
                .unwrap();
            let c = moments.covariance;
            vec![
                moments.log_mass.exp(),
                moments.mean[0],
                moments.mean[1],
                c[(0, 0)],
                c[(0, 1)],
                c[(1, 1)],
            ]
        }
        "kl" => [
            Direction::PriorToPosterior,
            Direction::PosteriorToPrior,
            Direction::Symmetric,
        ]
        .map(|direction| divergence(direction, number("nu"), number("s"), number("r")).unwrap())
        .to_vec(),
        "field" => {
            let position = Vector2::new(number("sx"), number("sy"));
            let sensor =
                ReceivedPower::<2>::new(position, [0, 1], number("P0"), number("alpha"), number("n"), 1.0).unwrap();
            let place = Vector2::new(number("x"), number("y"));
            let slope = sensor.jacobian(&place);
            vec![sensor.mean(&place)[0], slope[0], slope[1]]
        }
        "censpost" => {
            let silence = Silence {
                centre: number("yhat"),
                half_width: number("c"),
                noise_variance: number("r"),
                loss: number("loss"),
                count: inputs["n_mis"].as_u64().unwrap() as usize,
            };
            let after = silence.moments(number("m"), number("p")).unwrap();
            vec![after.mean[0], after.covariance[0]]
        }
        "hanY" => vec![
            StochasticTrigger::for_rate(number("rate"), number("s"))
                .unwrap()
                .precision(),
        ],
        _ => return None,
    })
}

/// Erratum `cfwmd-5`.
#[test]
fn every_reference_value_is_met_or_belongs_to_a_figure() {
    let (mut met, mut figures) = (0, 0);
    for entry in entries() {
        let id = entry["id"].as_str().unwrap();
        let name = id.strip_prefix("paper/").unwrap();
        if entry["source"] == "mc" {
            assert!(BY_FIGURES.iter().any(|(prefix, _)| name.starts_with(prefix)), "nobody computes {id}");
            figures += 1;
            continue;
        }
        let ours = compute(name, &entry["inputs"]).unwrap_or_else(|| panic!("nobody computes {id}"));
        let reference = numbers(&entry["value"]);
        let tolerance: f64 = match &entry["tolerance"] {
            Value::String(text) => text.parse().unwrap(),
            other => other.as_f64().unwrap(),
        };
        assert_eq!(ours.len(), reference.len(), "{id}");
        for (a, b) in ours.iter().zip(&reference) {
            assert!((a - b).abs() <= tolerance * b.abs().max(1.0), "{id}: {a} against {b}");
        }
        met += 1;
    }
    assert_eq!((met, figures), (42, 200));
}
