//! Laws that hold for every system of quantizers.

use fewbits_baselines::quantizer_design::{self as baselines, Separation};
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::design;
use fewbits_quantizer_design::system::SensorGroup;
use fewbits_quantizer_design::{
    AtSaddle, Certificate, Channel, Criterion, Error, JointTable, Labelling, Newton, Noise, ObservationModel, Prior,
    Quantizer, System, bounds, lloyd_max,
};
use proptest::prelude::*;

const MI: Criterion = Criterion::MutualInformation;
const MSE: Criterion = Criterion::MeanSquaredError;

fn breakpoints(count: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.15..1.2f64, count + 1).prop_map(|gaps| {
        let middle: f64 = gaps.iter().sum::<f64>() * 0.5;
        let mut at = -middle;
        gaps[..gaps.len() - 1]
            .iter()
            .map(|g| {
                at += g;
                at
            })
            .collect()
    })
}

/// Two sensors, any correlation, any crossover, the second quantizer with a repeated label.
fn pair() -> impl Strategy<Value = System> {
    (breakpoints(3), breakpoints(4), 0.4..2.0f64, 0.4..2.0f64, -0.9..0.9f64, 0.0..0.2f64, any::<bool>()).prop_map(
        |(a, b, s1, s2, rho, eps, equal)| {
            let sds = if equal { [s1, s1] } else { [s1, s2] };
            let rho = if rho.abs() < 0.2 { 0.0 } else { rho };
            let model = ObservationModel::new(
                Prior::normal(0.0, 1.0).unwrap(),
                Noise::equicorrelated_with_deviations(&sds, rho).unwrap(),
            )
            .unwrap();
            let channel = Channel::binary_symmetric(&Labelling::natural(4).unwrap(), eps).unwrap();
            let quantizers = vec![
                Quantizer::new(a).unwrap(),
                Quantizer::with_labels(b, vec![0, 1, 2, 3, 0]).unwrap(),
            ];
            System::distinct(model, quantizers, vec![channel.clone(), channel]).unwrap()
        },
    )
}

/// Three identical sensors and a fourth, with a finite or Gaussian prior.
fn grouped() -> impl Strategy<Value = System> {
    (breakpoints(2), breakpoints(1), 0.5..1.5f64, 0.0..0.2f64, 0..3usize).prop_map(|(a, b, sd, loss, kind)| {
        let prior = if kind == 2 {
            Prior::discrete(vec![-1.0, 0.2, 1.5], vec![0.3, 0.5, 0.2]).unwrap()
        } else {
            Prior::normal(0.0, 1.0).unwrap()
        };
        let noise = if kind == 1 {
            Noise::equicorrelated_with_deviations(&[sd; 4], 0.3)
        } else {
            Noise::independent_with_deviations(&[sd, sd, sd, 0.8])
        };
        let model = ObservationModel::new(prior, noise.unwrap()).unwrap();
        let three = SensorGroup {
            quantizer: Quantizer::new(a).unwrap(),
            channel: Channel::symbol_erasure(3, loss).unwrap(),
            sensors: vec![0, 1, 2],
        };
        let one = SensorGroup {
            quantizer: Quantizer::new(b).unwrap(),
            channel: Channel::ideal(2).unwrap(),
            sensors: vec![3],
        };
        System::new(model, vec![three, one]).unwrap()
    })
}

/// The system with every breakpoint moved by `by` times an entry of `direction`.
fn moved(system: &System, direction: &[f64], by: f64) -> System {
    let mut rest = direction;
    let quantizers = system.quantizers().into_iter().map(|q| {
        let (own, others) = rest.split_at(q.breakpoints().len());
        rest = others;
        q.with_breakpoints(q.breakpoints().iter().zip(own).map(|(b, d)| b + by * d).collect())
    });
    let quantizers = quantizers.collect::<Result<_, _>>().unwrap();
    system.with_quantizers(quantizers).unwrap()
}

/// Fourth-order central difference of `f` along a direction.
fn difference<T>(system: &System, direction: &[f64], f: impl Fn(&System) -> T) -> T
where
    T: std::ops::Sub<T, Output = T> + std::ops::Mul<f64, Output = T>,
{
    let h = 3e-4;
    let at = |steps: f64| f(&moved(system, direction, steps * h));
    (at(1.0) - at(-1.0)) * (2.0 / (3.0 * h)) - (at(2.0) - at(-2.0)) * (1.0 / (12.0 * h))
}

/// Two directions in which the entries' errors do not cancel by chance.
fn directions(count: usize) -> [Vec<f64>; 2] {
    [0.3, 1.7].map(|phase: f64| (0..count).map(|i| (phase + 2.3 * i as f64).cos()).collect())
}

/// Slope and change of the gradient along [`directions`] agree with differences.
fn agree_with_differences(system: &System, criterion: Criterion) {
    let found = system.derivatives(criterion).unwrap();
    assert!((found.value - system.value(criterion).unwrap()).abs() < 1e-13);
    for direction in directions(found.gradient.len()) {
        let slope = difference(system, &direction, |s| s.value(criterion).unwrap());
        let expected: f64 = found.gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        assert!((slope - expected).abs() < 1e-8, "{criterion:?}: {slope} {expected}");
        let column = difference(system, &direction, |s| s.derivatives(criterion).unwrap().gradient);
        for i in 0..column.len() {
            let expected: f64 = (0..column.len()).map(|j| found.hessian[(i, j)] * direction[j]).sum();
            assert!((column[i] - expected).abs() < 1e-7, "{criterion:?} {i}: {} {expected}", column[i]);
        }
    }
}

proptest! {
    // One case in 40 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(40), ..ProptestConfig::default() })]

    #[test]
    fn derivatives_of_pairs_agree_with_central_differences(system in pair()) {
        agree_with_differences(&system, Criterion::MutualInformation);
        agree_with_differences(&system, Criterion::MeanSquaredError);
    }

    #[test]
    fn derivatives_of_groups_agree_with_central_differences(system in grouped()) {
        agree_with_differences(&system, Criterion::MutualInformation);
        agree_with_differences(&system, Criterion::MeanSquaredError);
    }

    #[test]
    fn information_and_error_obey_their_bounds(system in pair()) {
        let mi = system.value(MI).unwrap();
        let mse = system.value(MSE).unwrap();
        prop_assert!(mse >= system.model().prior().deviation().powi(2) * (-2.0 * mi).exp());
        let clear = system.with_channels(vec![Channel::ideal(4).unwrap(), Channel::ideal(4).unwrap()]).unwrap();
        prop_assert!(mi <= clear.value(MI).unwrap() + 1e-13);
        prop_assert!(mse >= clear.value(MSE).unwrap() - 1e-13);
        prop_assert!(mi >= -1e-15 && mse <= system.model().prior().deviation().powi(2) + 1e-12);
    }

    #[test]
    fn mirrors_and_swaps_change_nothing(system in pair()) {
        let mirror = system.quantizers().iter().map(Quantizer::mirrored).collect();
        let mirrored_words = Labelling::new(vec![3, 2, 1, 0]).unwrap();
        let [a, b] = [0, 1].map(|g| system.groups()[g].channel.clone());
        // Natural words in reverse order are their complements: the same binary channel.
        prop_assert!((mirrored_words.word(0), mirrored_words.word(3)) == (Some(3), Some(0)));
        let mirrored = system.with_quantizers(mirror).unwrap();
        let swapped = System::distinct(
            system.model().subset(&[1, 0]).unwrap(),
            system.quantizers().into_iter().rev().collect(),
            vec![b, a],
        ).unwrap();
        for criterion in [MI, MSE] {
            let value = system.value(criterion).unwrap();
            prop_assert!((mirrored.value(criterion).unwrap() - value).abs() < 1e-12);
            prop_assert!((swapped.value(criterion).unwrap() - value).abs() < 1e-12);
        }
    }

    #[test]
    fn counting_agrees_with_telling_apart(system in grouped()) {
        let apart = System::new(
            system.model().clone(),
            system
                .groups()
                .iter()
                .flat_map(|g| g.sensors.iter().map(move |n| SensorGroup { sensors: vec![*n], ..g.clone() }))
                .collect(),
        ).unwrap();
        for criterion in [MI, MSE] {
            prop_assert!((system.value(criterion).unwrap() - apart.value(criterion).unwrap()).abs() < 1e-12);
        }
        let decoders = [&system, &apart].map(|s| MmseDecoder::new(s, 10_000).unwrap());
        let [few, many] = decoders.map(|d| d.decode_symbols(&[2, 0, 1, 1]).unwrap());
        prop_assert!((few.mean - many.mean).abs() < 1e-12 && (few.variance - many.variance).abs() < 1e-12);
    }

    #[test]
    fn erasures_scale_the_information_of_one_sensor(b in breakpoints(3), loss in 0.0..1.0f64, sd in 0.3..2.0f64) {
        let one = |channel: Channel| {
            let model = ObservationModel::gaussian_with_deviations(1.0, &[sd]).unwrap();
            let q = Quantizer::new(b.clone()).unwrap();
            System::distinct(model, vec![q], vec![channel]).unwrap().value(MI).unwrap()
        };
        let clear = one(Channel::ideal(4).unwrap());
        prop_assert!((one(Channel::symbol_erasure(4, loss).unwrap()) - (1.0 - loss) * clear).abs() < 1e-13);
    }

    #[test]
    fn quantized_sensors_respect_van_trees_and_the_ceo(b in breakpoints(3), sd in 0.3..2.0f64, other in 0.3..2.0f64) {
        let q = Quantizer::new(b).unwrap();
        let model = ObservationModel::gaussian_with_deviations(1.0, &[sd, other]).unwrap();
        let ceo = bounds::ceo(model.prior(), model.noise(), &[2.0, 2.0]).unwrap();
        let system = System::ideal(model, vec![q.clone(), q]).unwrap();
        let mse = system.value(MSE).unwrap();
        prop_assert!(mse > baselines::bayesian_cramer_rao(&system).unwrap());
        prop_assert!(mse > ceo.distortion);
    }

    #[test]
    fn derivatives_of_bayes_errors_agree_with_differences(b in breakpoints(3), theta in 0.5..3.0f64, prior in 0.2..0.8f64) {
        let noise = Noise::independent_with_deviations(&[1.0, 1.0, 0.7]).unwrap();
        let model = ObservationModel::new(Prior::binary(theta, prior).unwrap(), noise).unwrap();
        let one = SensorGroup {
            quantizer: Quantizer::new(b).unwrap(),
            channel: Channel::ideal(4).unwrap(),
            sensors: vec![2],
        };
        let pair = SensorGroup { sensors: vec![0, 1], ..one.clone() };
        let system = System::new(model, vec![pair, one]).unwrap();
        let decisions = |s: &System| {
            let table = JointTable::new(s).unwrap();
            (0..table.outcomes()).map(|t| table.decide(t)).collect::<Vec<_>>()
        };
        // Only inside one smooth piece: no decision may change within the reach of the differences.
        let here = decisions(&system);
        let stays = |d: &Vec<f64>| [-6e-4, 6e-4].iter().all(|h| decisions(&moved(&system, d, *h)) == here);
        prop_assume!(directions(6).iter().all(stays));
        agree_with_differences(&system, Criterion::BayesError);
    }

    #[test]
    fn the_dynamic_programme_equals_brute_force(sd in 0.3..1.5f64, rho in -0.8..0.8f64, kind in 0..3usize) {
        let prior = if kind == 2 { Prior::binary(1.5, 0.4) } else { Prior::normal(0.0, 1.0) }.unwrap();
        let model = ObservationModel::new(prior, Noise::equicorrelated_with_deviations(&[sd, sd], rho).unwrap()).unwrap();
        let q = |b: [f64; 2]| Quantizer::new(b.to_vec()).unwrap();
        let system = System::ideal(model, vec![q([-0.7, 0.9]), q([-0.5, 0.4])]).unwrap();
        let criterion = [MI, MSE, Criterion::BayesError][kind];
        let grid: Vec<f64> = (-4..=5).map(|i| f64::from(i) * 0.55).collect();
        let (best, value) = baselines::best_contiguous(&system, 1, criterion, &grid).unwrap();
        let mut brute = f64::NEG_INFINITY;
        for i in 0..grid.len() {
            for j in i + 1..grid.len() {
                let tried = system.with_quantizer(1, q([grid[i], grid[j]])).unwrap().value(criterion).unwrap();
                brute = brute.max(criterion.sense() * tried);
            }
        }
        prop_assert!((criterion.sense() * value - brute).abs() < 1e-12, "{value} {brute}");
        let met = system.with_quantizer(1, best).unwrap().value(criterion).unwrap();
        prop_assert!((met - value).abs() < 1e-12);
    }
}

#[test]
fn a_useless_channel_says_nothing_and_a_clean_one_changes_no_bit() {
    let words = Labelling::natural(4).unwrap();
    let q = Quantizer::symmetric(1.2).unwrap();
    let model = ObservationModel::gaussian_with_deviations(2.0, &[1.0, 1.0]).unwrap();
    let ideal = System::ideal(model, vec![q.clone(), q]).unwrap();
    let over = |eps| {
        ideal
            .with_channels(vec![Channel::binary_symmetric(&words, eps).unwrap(); 2])
            .unwrap()
    };
    assert!(over(0.5).value(MI).unwrap().abs() < 1e-14);
    assert!((over(0.5).value(MSE).unwrap() - 4.0).abs() < 1e-12);
    for criterion in [MI, MSE] {
        assert_eq!(over(0.0).value(criterion).unwrap().to_bits(), ideal.value(criterion).unwrap().to_bits());
        // Above one half the received bits are complements of a channel below it.
        let (low, high) = (over(0.2).value(criterion).unwrap(), over(0.8).value(criterion).unwrap());
        assert!((low - high).abs() < 1e-13);
    }
}

#[test]
fn empty_far_and_useless_cells_are_finite() {
    let far = Quantizer::new(vec![-30.0, 0.0, 30.0, 60.0, 61.0]).unwrap();
    let near = Quantizer::new(vec![-1e-9, 1e-9]).unwrap();
    for rho in [0.0, 0.6] {
        let model = ObservationModel::new(
            Prior::normal(0.0, 1.0).unwrap(),
            Noise::equicorrelated_with_deviations(&[1.0; 2], rho).unwrap(),
        )
        .unwrap();
        let system = System::ideal(model.clone(), vec![far.clone(), near.clone()]).unwrap();
        for criterion in [MI, MSE] {
            let found = system.derivatives(criterion).unwrap();
            assert!(
                found.value.is_finite() && found.gradient.iter().chain(found.hessian.iter()).all(|v| v.is_finite())
            );
        }
        // Cells that are never met change nothing.
        let plain = System::ideal(model, vec![Quantizer::new(vec![0.0]).unwrap(), near.clone()]).unwrap();
        assert!((plain.value(MI).unwrap() - system.value(MI).unwrap()).abs() < 1e-12);
        let decoder = MmseDecoder::new(&system, 18).unwrap();
        assert!(matches!(decoder.decode_symbols(&[4, 0]), Err(Error::ImpossibleOutcome)));
        assert!(decoder.decode_symbols(&[0, 2]).unwrap().mean.is_finite());
    }
}

#[test]
fn a_signal_of_zero_cannot_be_detected() {
    let model =
        ObservationModel::new(Prior::binary(0.0, 0.3).unwrap(), Noise::independent_with_deviations(&[1.0; 4]).unwrap())
            .unwrap();
    let system = System::identical(model, Quantizer::symmetric(1.0).unwrap()).unwrap();
    assert!((system.value(Criterion::BayesError).unwrap() - 0.3).abs() < 1e-15);
    assert!(system.value(MI).unwrap().abs() < 1e-14);
}

#[test]
fn small_equivocations_keep_their_digits() {
    let model =
        ObservationModel::new(Prior::binary(4.0, 0.5).unwrap(), Noise::independent_with_deviations(&[1.0; 5]).unwrap())
            .unwrap();
    let system = System::identical(model, Quantizer::new(vec![0.960_430_8, 2.0, 3.039_569_2]).unwrap()).unwrap();
    let left = JointTable::new(&system).unwrap().equivocation().unwrap();
    // ln 2 - 0.693108122 leaves four digits; the table keeps all of them.
    assert!((left - (std::f64::consts::LN_2 - system.value(MI).unwrap())).abs() < 1e-14);
    assert!((left - 3.9e-5).abs() < 1e-6);
}

#[test]
fn a_step_off_leaves_the_saddle_of_two_signs() {
    let model = ObservationModel::new(
        Prior::normal(0.0, 1.0).unwrap(),
        Noise::equicorrelated_with_deviations(&[1.0; 2], 0.85).unwrap(),
    )
    .unwrap();
    let q = Quantizer::new(vec![0.0]).unwrap();
    let start = System::ideal(model, vec![q.clone(), q]).unwrap();
    let saddle = design::joint(
        &start,
        MSE,
        &Newton {
            at_saddle: AtSaddle::Stay,
            ..Newton::default()
        },
    )
    .unwrap();
    let escaped = design::joint(&start, MSE, &Newton::default()).unwrap();
    assert!(saddle.certificate == Certificate::Saddle && escaped.certificate != Certificate::Saddle);
    assert!((escaped.value - 0.595_035_725_000_632_5).abs() < 1e-9);
}

#[test]
fn joint_newton_is_cheap() {
    let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 1.0]).unwrap();
    let eight = Quantizer::from(&lloyd_max::gaussian(8).unwrap());
    let start = System::ideal(model, vec![eight.clone(), eight]).unwrap();
    for criterion in [MI, MSE] {
        let design = design::joint(&start, criterion, &Newton::default()).unwrap();
        assert!(design.evaluations <= 200 && design.iterations <= 12, "{} {}", design.evaluations, design.iterations);
    }
}

#[test]
fn impossible_requests_are_named() {
    let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 1.0]).unwrap();
    let q = Quantizer::symmetric(1.0).unwrap();
    let ideal = System::ideal(model.clone(), vec![q.clone(), q.clone()]).unwrap();
    let noisy = ideal
        .with_channels(vec![Channel::symbol_erasure(4, 0.1).unwrap(); 2])
        .unwrap();
    let grid = [-1.0, 0.0, 1.0];
    assert!(
        baselines::best_contiguous(&noisy, 0, MI, &grid)
            .unwrap_err()
            .to_string()
            .contains("ideal")
    );
    assert!(baselines::best_contiguous(&ideal, 0, MI, &grid[..2]).is_err());
    assert!(baselines::best_contiguous(&ideal, 2, MI, &grid).is_err());
    let counted = System::identical(model.clone(), q.clone()).unwrap();
    assert!(
        baselines::best_contiguous(&counted, 0, MI, &grid)
            .unwrap_err()
            .to_string()
            .contains("single sensor")
    );
    assert!(baselines::greedy(&counted, &[0], MI, &Newton::default()).is_err());
    assert!(baselines::alternating_step(&counted, 0, MI).is_err());
    let many = System::ideal(ObservationModel::gaussian_with_deviations(1.0, &[1.0; 11]).unwrap(), vec![q.clone(); 11])
        .unwrap();
    assert!(matches!(many.value(MI), Err(Error::TooLarge { .. })));
    let crowd = System::identical(ObservationModel::gaussian_with_deviations(1.0, &vec![1.0; 400]).unwrap(), q.clone())
        .unwrap();
    assert!(matches!(crowd.value(MI), Err(Error::TooLarge { .. })));
    let separate = |signal, sd| {
        baselines::separate(Separation::Matusita, signal, sd, &q, &Channel::ideal(4).unwrap(), &Newton::default())
    };
    assert!(separate(0.0, 1.0).is_err() && separate(1.0, 0.0).is_err() && separate(f64::NAN, 1.0).is_err());
    // Four words over a poor channel: a cell is squeezed out, and the error says so or does not converge.
    let words = Labelling::natural(4).unwrap();
    let poor = ideal
        .with_channels(vec![Channel::binary_symmetric(&words, 0.25).unwrap(); 2])
        .unwrap();
    if let Ok(design) = design::joint(&poor, MSE, &Newton::default()) {
        assert!(design.value.is_finite());
    }
}

/// The probabilities of single reports of so many sensors are below the smallest number; those of their counts are not.
#[test]
fn more_equal_sensors_have_less_error() {
    let error = |sensors: usize| {
        let model = ObservationModel::gaussian_with_deviations(1.0, &vec![1.0; sensors]).unwrap();
        let system = System::identical(model, Quantizer::new(vec![0.0]).unwrap()).unwrap();
        system.value(MSE).unwrap()
    };
    let errors = [10, 60, 61, 500, 1200].map(error);
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
}
