//! Nothing depends on the unit: the design of a scaled model is the scaled design.

use fewbits_baselines::quantizer_design::{self as baselines, Alternating, Separation, Words};
use fewbits_core::Link;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::design::{self, Design, Scope};
use fewbits_quantizer_design::{
    AllowedCells, AtSaddle, BitBudget, Certificate, Channel, Criterion, JointTable, Newton, Noise, ObservationModel,
    Prior, Quantizer, Request, System, lloyd_max,
};

const MI: Criterion = Criterion::MutualInformation;
const MSE: Criterion = Criterion::MeanSquaredError;
const SCALES: [f64; 2] = [1e-4, 1e4];

fn pair(rho: f64, scale: f64) -> ObservationModel {
    let noise = Noise::equicorrelated_with_deviations(&[scale, 0.8 * scale], rho).unwrap();
    ObservationModel::new(Prior::normal(0.0, scale).unwrap(), noise).unwrap()
}

fn equal_pair(rho: f64, scale: f64) -> ObservationModel {
    let noise = Noise::equicorrelated_with_deviations(&[scale; 2], rho).unwrap();
    ObservationModel::new(Prior::normal(0.0, scale).unwrap(), noise).unwrap()
}

fn size(criterion: Criterion, scale: f64) -> f64 {
    if criterion == MSE { scale * scale } else { 1.0 }
}

fn agree(one: &Design, other: &Design, scale: f64, criterion: Criterion, tolerance: f64) {
    let relative = other.value / size(criterion, scale);
    assert!((relative - one.value).abs() <= 1e-11 * one.value.abs(), "{scale}: {relative} {}", one.value);
    assert_eq!(one.certificate, other.certificate, "{scale}");
    for (a, b) in one.system.quantizers().iter().zip(other.system.quantizers()) {
        assert_eq!(a.labels(), b.labels());
        for (a, b) in a.breakpoints().iter().zip(b.breakpoints()) {
            assert!((a - b / scale).abs() <= tolerance, "{scale}: {a} {}", b / scale);
        }
    }
}

/// Runs an algorithm at every scale and compares with scale one.
fn law(criterion: Criterion, tolerance: f64, run: impl Fn(f64) -> Design) {
    let one = run(1.0);
    for scale in SCALES {
        agree(&one, &run(scale), scale, criterion, tolerance);
    }
}

#[test]
fn joint_and_greedy_designs_know_no_unit() {
    let newton = Newton::default();
    for criterion in [MI, MSE] {
        for rho in [0.0, 0.6] {
            let start = |scale: f64| System::lloyd_max(pair(rho, scale), 4).unwrap();
            law(criterion, 1e-8, |s| design::joint(&start(s), criterion, &newton).unwrap());
            law(criterion, 1e-8, |s| {
                baselines::greedy(&start(s), &[1, 0], criterion, &newton)
                    .unwrap()
                    .pop()
                    .unwrap()
            });
        }
    }
}

/// At correlation .85 the symmetric start leads to a saddle, which once was taken for an optimum in large units.
#[test]
fn saddles_are_left_in_every_unit() {
    for (rho, levels, best) in [(0.85, 4, Some(0.331_123_01)), (0.7, 3, None)] {
        let run = |s: f64| {
            let start = System::lloyd_max(equal_pair(rho, s), levels).unwrap();
            design::joint(&start, MI, &Newton::default()).unwrap()
        };
        let one = run(1.0);
        assert_eq!(one.certificate, Certificate::LocalOptimum);
        assert!(best.is_none_or(|b: f64| (one.value - b).abs() < 1e-8), "{}", one.value);
        for scale in [1e-4, 1e3, 1e4] {
            let other = run(scale);
            assert!((other.value - one.value).abs() < 1e-11, "{rho} {scale}: {} {}", other.value, one.value);
            assert_eq!(other.certificate, Certificate::LocalOptimum);
        }
    }
    let stay = Newton {
        at_saddle: AtSaddle::Stay,
        ..Newton::default()
    };
    for scale in SCALES {
        let start = System::lloyd_max(equal_pair(0.85, scale), 4).unwrap();
        assert!(design::joint(&start, MSE, &stay).unwrap().certificate == Certificate::Saddle, "{scale}");
    }
}

#[test]
fn searches_know_no_unit() {
    law(MSE, 1e-6, |s| {
        let start = System::lloyd_max(equal_pair(0.0, s), 3).unwrap();
        let best = baselines::multi_start(&start, MSE, 4, 1, &Newton::default()).unwrap();
        Design { iterations: 0, ..best }
    });
    let folded = |s: f64| {
        let request = Request {
            cells: AllowedCells::Any,
            starts: 6,
            ..Request::estimation(equal_pair(0.85, s), BitBudget::Each(1), Link::PERFECT)
        };
        let found = request.run().unwrap();
        found.best().value / (s * s)
    };
    let one = folded(1.0);
    for scale in SCALES {
        assert!((folded(scale) / one - 1.0).abs() < 1e-11, "{scale}");
    }
    let words = |s: f64| baselines::assign_words(&equal_pair(0.0, s), 2, 0.1, 3..=4, MSE, Words::Shared).unwrap();
    let one = words(1.0);
    for scale in SCALES {
        let other = words(scale);
        assert_eq!(one[0].words, other[0].words);
        agree(&one[0].design, &other[0].design, scale, MSE, 1e-8);
    }
}

#[test]
fn alternating_steps_and_programmes_know_no_unit() {
    let rule = Alternating {
        tolerance: 1e-6,
        breakpoint_tolerance: 1e-2,
        cells: AllowedCells::Any,
        ..Alternating::default()
    };
    for criterion in [MI, MSE] {
        let start = |s: f64| System::lloyd_max(pair(0.3, s), 4).unwrap();
        let one = baselines::alternate(&start(1.0), 0, criterion, &rule).unwrap();
        let grid = |s: f64| (-20..=20).map(|i| 0.21 * s * f64::from(i)).collect::<Vec<_>>();
        let (best, _) = baselines::best_contiguous(&start(1.0), 0, criterion, &grid(1.0)).unwrap();
        for scale in SCALES {
            let other = baselines::alternate(&start(scale), 0, criterion, &rule).unwrap();
            assert_eq!(one.iterations, other.iterations);
            assert!((other.value / size(criterion, scale) - one.value).abs() < 1e-11);
            let (scaled, _) = baselines::best_contiguous(&start(scale), 0, criterion, &grid(scale)).unwrap();
            for (a, b) in best.breakpoints().iter().zip(scaled.breakpoints()) {
                assert!((a * scale - b).abs() < 1e-9 * scale);
            }
        }
    }
}

#[test]
fn detection_knows_no_unit() {
    let model = |s: f64| {
        ObservationModel::new(
            Prior::binary(2.0 * s, 0.4).unwrap(),
            Noise::independent_with_deviations(&[s; 3]).unwrap(),
        )
        .unwrap()
    };
    let about = |s: f64| Quantizer::new([0.2, 1.0, 1.8].map(|b| s * b).to_vec()).unwrap();
    for criterion in [MI, Criterion::BayesError] {
        law(criterion, 1e-6, |s| {
            let start = System::identical(model(s), about(s)).unwrap();
            design::joint(&start, criterion, &Newton::default()).unwrap()
        });
    }
    let ideal = Channel::ideal(4).unwrap();
    for distance in [Separation::Matusita, Separation::Bhattacharyya, Separation::JDivergence] {
        let run = |s: f64| baselines::separate(distance, 2.0 * s, s, &about(s), &ideal, &Newton::default()).unwrap();
        let (one, reached) = run(1.0);
        for scale in SCALES {
            let (other, far) = run(scale);
            assert!((far - reached).abs() < 1e-12);
            for (a, b) in one.breakpoints().iter().zip(other.breakpoints()) {
                assert!((a * scale - b).abs() < 1e-8 * scale);
            }
        }
    }
}

/// Decisions that are almost sure: information within 1e-20 of its limit still has an optimum, and Newton finds it.
#[test]
fn strong_signals_have_designs_too() {
    for signal in [10.0, 14.0] {
        let middle = 0.5 * signal;
        let about = Quantizer::new(vec![middle - 1.0, middle, middle + 1.0]).unwrap();
        let model = ObservationModel::new(
            Prior::binary(signal, 0.5).unwrap(),
            Noise::independent_with_deviations(&[1.0; 9]).unwrap(),
        )
        .unwrap();
        let start = System::identical(model, about.clone()).unwrap();
        let informed = design::joint(&start, MI, &Newton::default()).unwrap();
        let decided = design::joint(&start, Criterion::BayesError, &Newton::default()).unwrap();
        let ideal = Channel::ideal(4).unwrap();
        let (q, _) =
            baselines::separate(Separation::Matusita, signal, 1.0, &about, &ideal, &Newton::default()).unwrap();
        let matusita = start.with_quantizer(0, q).unwrap();
        let equivocation = |s: &System| JointTable::new(s).unwrap().equivocation().unwrap();
        assert!(equivocation(&informed.system) <= equivocation(&matusita) * (1.0 + 1e-9));
        assert!(decided.value <= matusita.value(Criterion::BayesError).unwrap() * (1.0 + 1e-9));
        assert!(decided.value > 0.0 && decided.certificate != Certificate::Saddle);
    }
}

#[test]
fn a_design_is_stored_and_restored() {
    let start = System::lloyd_max(pair(0.2, 1.0), 4).unwrap();
    let best = design::joint(&start, MSE, &Newton::default()).unwrap();
    let json = serde_json::to_string(&best.system).unwrap();
    assert_eq!(serde_json::from_str::<System>(&json).unwrap(), best.system);
}

#[test]
fn what_a_user_reaches_for_agrees_with_what_he_built_by_hand() {
    let model = pair(0.4, 1.0);
    let lloyd = System::lloyd_max(model.clone(), 4).unwrap();
    for (n, q) in lloyd.quantizers().iter().enumerate() {
        let by_hand = lloyd_max::gaussian(4)
            .unwrap()
            .affine(0.0, model.sample_deviation(n))
            .unwrap();
        assert_eq!(q, &Quantizer::from(&by_hand));
        // The samples are normal, so the symbols have the table's probabilities.
        let alone = JointTable::new(&lloyd.subset(&[n]).unwrap()).unwrap();
        for (t, mass) in by_hand.probabilities().iter().enumerate() {
            assert!((alone.probability(t) - mass).abs() < 1e-12);
        }
    }
    assert!(lloyd.subset(&[2]).is_err());
    let decoder = MmseDecoder::new(&lloyd, 16).unwrap();
    assert_eq!(decoder.estimates().len(), 16);
}

/// Two equal sensors with correlated noise are best with different quantizers. The Hessian over the breakpoints that they share
/// does not show it.
#[test]
fn identical_sensors_leave_the_saddle_of_equal_quantizers() {
    let shared = |scale: f64| {
        let q = Quantizer::symmetric(1.1 * scale).unwrap();
        System::identical(equal_pair(0.85, scale), q).unwrap()
    };
    for scale in [1e-4, 1.0, 1e4] {
        let found = design::joint(&shared(scale), MI, &Newton::default()).unwrap();
        assert!((found.value - 0.331_123_01).abs() < 1e-8, "{}", found.value);
        assert_eq!((found.certificate, found.scope), (Certificate::LocalOptimum, Scope::EverySensor));
        let stay = design::joint(
            &shared(scale),
            MSE,
            &Newton {
                at_saddle: AtSaddle::Stay,
                ..Newton::default()
            },
        )
        .unwrap();
        assert!(stay.certificate == Certificate::Saddle);
    }
    // Independent noise: equal quantizers are an optimum, also over the breakpoints of every sensor.
    let equal = System::identical(equal_pair(0.0, 1.0), Quantizer::symmetric(1.3).unwrap()).unwrap();
    let found = design::joint(&equal, MI, &Newton::default()).unwrap();
    assert_eq!((found.certificate, found.system.groups().len()), (Certificate::LocalOptimum, 1));
}

/// What is not checked is said: two sensors told apart would take more outcomes than allowed.
#[test]
fn an_unchecked_certificate_names_its_scope() {
    let q = Quantizer::symmetric(1.1).unwrap();
    let shared = System::identical(equal_pair(0.85, 1.0), q).unwrap();
    // 10 counts, 15 with one symbol more; 16 outcomes apart.
    let narrow = design::joint(&shared.with_outcome_limit(15), MI, &Newton::default()).unwrap();
    assert_eq!((narrow.scope, narrow.certificate), (Scope::SharedBreakpoints, Certificate::LocalOptimum));
}

/// The nodes of a density are not hypotheses: the caller says whether to estimate or to decide.
#[test]
fn nodes_of_a_density_are_estimated_not_guessed() {
    let values: Vec<f64> = (0..64).map(|k| (f64::from(k) + 0.5) / 64.0).collect();
    let noise = || Noise::independent_with_deviations(&[0.3, 0.3]).unwrap();
    let nodes = ObservationModel::new(Prior::discrete(values, vec![1.0 / 64.0; 64]).unwrap(), noise()).unwrap();
    let density = ObservationModel::new(Prior::uniform(0.0, 1.0).unwrap(), noise()).unwrap();
    let [estimated, exact] = [&nodes, &density].map(|model| {
        let found = Request::estimation(model.clone(), BitBudget::Each(1), Link::PERFECT)
            .run()
            .unwrap();
        found.best().clone()
    });
    assert!((estimated.value / exact.value - 1.0).abs() < 1e-3, "{} {}", estimated.value, exact.value);
    let mut request = Request::detection(nodes, BitBudget::Each(1), Link::PERFECT).unwrap();
    request.starts = 4;
    let guessed = request.run().unwrap().best().clone();
    assert!(estimated.value < guessed.system().value(MSE).unwrap());
    assert!(guessed.value < estimated.system().value(Criterion::BayesError).unwrap());
    let gaussian = ObservationModel::gaussian_with_deviations(1.0, &[1.0]).unwrap();
    assert!(Request::detection(gaussian, BitBudget::Each(1), Link::PERFECT).is_err());
}
