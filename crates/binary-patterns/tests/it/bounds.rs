//! Orderings that must hold for every bank of one-bit sensors.

use fewbits_baselines::binary_patterns::{Decoder, centralised_bound, network_rate_distortion, printed_crlb};
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;
use fewbits_binary_patterns::search::free_breakpoints;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, PatternSensor, Source, uniform_cells};
use fewbits_quantizers::Quantizer;
use proptest::prelude::*;

fn source() -> impl Strategy<Value = Source> {
    prop_oneof![
        (0.3f64..3.0).prop_map(|v| Source::uniform(v).unwrap()),
        (0.2f64..2.0).prop_map(|s| Source::gaussian_with_deviation(s).unwrap()),
    ]
}

/// Thresholds in units of the source's standard deviation.
fn thresholds() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::btree_set(-17i32..=17, 1..5)
        .prop_map(|set| set.into_iter().map(|t| f64::from(t) / 10.0).collect())
}

fn quantizer(thresholds: &[f64], source: &Source) -> BinaryQuantizer {
    let scale = source.variance().sqrt();
    BinaryQuantizer::new(thresholds.iter().map(|t| t * scale).collect()).unwrap()
}

fn grid(source: &Source) -> Quantizer {
    let scale = source.variance().sqrt();
    Quantizer::new(
        [-1.2, -0.6, -0.25, 0.0, 0.25, 0.6, 1.2]
            .iter()
            .map(|t| t * scale)
            .collect(),
    )
    .unwrap()
}

proptest! {
    // One case in 10 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(10), ..ProptestConfig::default() })]

    #[test]
    fn bounds_are_below_and_decoders_above_the_posterior_mean(
        source in source(),
        sensors in prop::collection::vec((thresholds(), -10.0f64..35.0), 1..5),
    ) {
        let sensors: Vec<PatternSensor> = sensors
            .iter()
            .map(|(t, snr)| PatternSensor::with_deviation(quantizer(t, &source), source.noise_deviation(*snr).unwrap()).unwrap())
            .collect();
        let count = sensors.len();
        let bank = Bank::new(source, sensors).unwrap();
        let mmse = bank.mmse().unwrap();
        prop_assert!(mmse > 0.0 && mmse <= source.variance() * (1.0 + 1e-12));
        prop_assert!(optimal_weight_van_trees(&bank).unwrap() <= mmse * (1.0 + 1e-9));
        let grid = grid(&source);
        for decoder in [
            Decoder::DiscreteMap(&grid),
            Decoder::PrintedDiscreteMap(&grid),
            Decoder::ExactDivisionMap(&grid),
            Decoder::ContinuousMap,
        ] {
            let error = decoder.mse(&bank).unwrap();
            prop_assert!(error.is_finite() && mmse <= error * (1.0 + 1e-10), "{decoder:?}: {error} below {mmse}");
        }
        let table = bank.table().unwrap();
        for bits in words(count) {
            prop_assert!(table.estimate(&bits).unwrap().abs() <= 10.0 * source.variance().sqrt());
        }
    }

    #[test]
    fn no_bank_beats_the_bounds_of_all_schemes(
        source in source(),
        patterns in prop::collection::vec(thresholds(), 1..5),
        snr in -10.0f64..30.0,
    ) {
        let noise = source.noise_deviation(snr).unwrap();
        let quantizers: Vec<_> = patterns.iter().map(|t| quantizer(t, &source)).collect();
        let count = quantizers.len();
        let mmse = Bank::homogeneous_with_deviation(source, quantizers, noise).unwrap().mmse().unwrap();
        let central = centralised_bound(&source, noise, count).unwrap();
        prop_assert!(network_rate_distortion(&source, noise, count).unwrap() <= central * (1.0 + 1e-9));
        prop_assert!(central <= mmse * (1.0 + 1e-9), "{central} above {mmse}");
    }

    #[test]
    fn more_sensors_never_hurt_and_scale_does_not_matter(source in source(), t in thresholds(), snr in 0.0f64..30.0, scale in 0.1f64..10.0) {
        let noise = source.noise_deviation(snr).unwrap();
        let one = quantizer(&t, &source);
        let mut last = source.variance();
        for n in 1..4 {
            let mmse = Bank::homogeneous_with_deviation(source, vec![one.clone(); n], noise).unwrap().mmse().unwrap();
            prop_assert!(mmse <= last * (1.0 + 1e-10));
            last = mmse;
        }
        let (unit, other) = (Source::uniform(1.0).unwrap(), Source::uniform(scale).unwrap());
        let error = |s: Source| Bank::homogeneous_with_deviation(s, vec![quantizer(&t, &s)], s.noise_deviation(snr).unwrap()).unwrap().mmse().unwrap();
        prop_assert!((error(other) - scale * scale * error(unit)).abs() <= 1e-9 * error(other));
    }
}

/// For a Gaussian source the printed formula is a van Trees bound of constant weight, below the optimal one.
#[test]
fn the_printed_bound_is_valid_for_gaussian_sources_only() {
    let gaussian = Source::gaussian_with_deviation(0.6).unwrap();
    let uniform = Source::uniform(1.0).unwrap();
    let grid = uniform_cells(1.0, 3).unwrap();
    let patterns = ["00001111", "00111100", "01100110"].map(|p| p.parse::<fewbits_binary_patterns::Pattern>().unwrap());
    let quantizers: Vec<_> = patterns.iter().map(|p| p.on(&grid).unwrap()).collect();
    for snr in [-10.0, 0.0, 10.0, 20.0] {
        let bank =
            Bank::homogeneous_with_deviation(gaussian, quantizers.clone(), gaussian.noise_deviation(snr).unwrap())
                .unwrap();
        assert!(printed_crlb(&bank).unwrap() <= optimal_weight_van_trees(&bank).unwrap() * (1.0 + 1e-9));
    }
    let bank = Bank::homogeneous_with_deviation(uniform, quantizers, uniform.noise_deviation(-20.0).unwrap()).unwrap();
    let mmse = bank.mmse().unwrap();
    assert!(printed_crlb(&bank).unwrap() > 100.0 * mmse);
    assert!((optimal_weight_van_trees(&bank).unwrap() / mmse - 0.999).abs() < 5e-4);
}

/// Fifty sensors in three groups have 5508 outcomes.
#[test]
fn repeated_sensors_are_counted() {
    let source = Source::uniform(1.0).unwrap();
    let mut quantizers = Vec::new();
    for (thresholds, count) in [
        (vec![0.0], 17),
        (vec![-0.5, 0.5], 16),
        (vec![-0.75, -0.25, 0.25, 0.75], 17),
    ] {
        quantizers.extend(std::iter::repeat_n(BinaryQuantizer::new(thresholds).unwrap(), count));
    }
    let bank = Bank::homogeneous_with_deviation(source, quantizers, source.noise_deviation(10.0).unwrap()).unwrap();
    assert_eq!(bank.outcomes(), 5508);
    let mmse = bank.mmse().unwrap();
    assert!(optimal_weight_van_trees(&bank).unwrap() < mmse && mmse < 0.003);
    let table = bank.table().unwrap();
    assert!(table.estimate(&[true; 49]).is_err());
    // An outcome that never happens still has a finite estimate.
    assert!(table.estimate(&[false; 50]).unwrap().is_finite());
}

/// Distinct sensors have no closed form: a table of 25 of them is refused, not attempted.
#[test]
fn tables_have_limits() {
    let source = Source::uniform(1.0).unwrap();
    let quantizers: Vec<_> = (0..25)
        .map(|i| BinaryQuantizer::new(vec![f64::from(i) / 50.0]).unwrap())
        .collect();
    let bank = Bank::homogeneous_with_deviation(source, quantizers, 0.1).unwrap();
    assert_eq!(bank.outcomes(), 1 << 25);
    let many = (0..30)
        .map(|i| BinaryQuantizer::new(vec![f64::from(i) / 50.0]).unwrap())
        .collect();
    assert!(
        Bank::homogeneous_with_deviation(source, many, 0.1)
            .unwrap()
            .mmse()
            .is_err()
    );
}

/// Estimates at 29 dB, where a discrete MAP without floored logarithms is NaN.
#[test]
fn vanishing_likelihoods_do_not_become_nan() {
    let source = Source::uniform(1.0).unwrap();
    let grid = uniform_cells(1.0, 3).unwrap();
    for snr in [29.0, 45.0, 60.0] {
        let noise = source.noise_deviation(snr).unwrap();
        let quantizers: Vec<_> = ["00001111", "00111100", "00111100", "01100110"]
            .iter()
            .map(|p| {
                p.parse::<fewbits_binary_patterns::Pattern>()
                    .unwrap()
                    .on(&grid)
                    .unwrap()
            })
            .collect();
        let bank = Bank::homogeneous_with_deviation(source, quantizers, noise).unwrap();
        for decoder in [
            Decoder::Mmse,
            Decoder::DiscreteMap(&grid),
            Decoder::ExactDivisionMap(&grid),
            Decoder::ContinuousMap,
        ] {
            let table = decoder.table(&bank).unwrap();
            assert!(words(4).all(|bits| table.estimate(&bits).unwrap().abs() <= 1.0));
            let mse = decoder.mse(&bank).unwrap();
            assert!(mse > 0.002 && mse < 0.02, "{decoder:?} at {snr} dB: {mse}");
        }
    }
}

/// Three sensors gain little from thresholds off the grid, but never lose.
#[test]
fn free_breakpoints_beat_the_grid() {
    let source = Source::uniform(1.0).unwrap();
    let noise = source.noise_deviation(10.0).unwrap();
    let grid = uniform_cells(1.0, 3).unwrap();
    let start: Vec<PatternSensor> = ["00001111", "00111100", "00111100"]
        .iter()
        .map(|p| {
            PatternSensor::with_deviation(
                p.parse::<fewbits_binary_patterns::Pattern>()
                    .unwrap()
                    .on(&grid)
                    .unwrap(),
                noise,
            )
            .unwrap()
        })
        .collect();
    let before = Bank::new(source, start.clone()).unwrap().mmse().unwrap();
    let free = free_breakpoints(&source, &start, 0.05, 3).unwrap();
    assert!(free.mse < before, "{} from {before}", free.mse);
    assert!(optimal_weight_van_trees(&Bank::new(source, free.sensors).unwrap()).unwrap() < free.mse);
}

/// The posterior mean is unbiased on average over the source only: erratum `binary-10`.
#[test]
fn the_posterior_mean_is_biased_at_the_ends() {
    let source = Source::uniform(1.0).unwrap();
    let grid = uniform_cells(1.0, 3).unwrap();
    let bank = gray(source, &grid, 18.2);
    let table = bank.table().unwrap();
    // Bias and variance of the estimate given the value of the source.
    let noise = source.noise_deviation(18.2).unwrap();
    let sensors = gray_quantizers(&grid);
    let given = |x: f64| {
        let p: Vec<[f64; 2]> = sensors.iter().map(|q| q.probabilities(x, noise)).collect();
        let outcomes = words(3).map(|bits| {
            let probability: f64 = bits.iter().zip(&p).map(|(bit, p)| p[usize::from(*bit)]).product();
            (probability, table.estimate(&bits).unwrap() - x)
        });
        let (mean, second) = outcomes.fold((0.0, 0.0), |(m, s), (p, off)| (m + p * off, s + p * off * off));
        (mean, second - mean * mean)
    };
    let (bias, _) = given(1.0);
    assert!((bias + 0.135).abs() < 5e-4, "{bias}");
    let (mut mean, mut error) = (0.0, 0.0);
    for i in 0..4000 {
        let (bias, variance) = given((f64::from(i) + 0.5) / 2000.0 - 1.0);
        mean += bias / 4000.0;
        error += (bias * bias + variance) / 4000.0;
    }
    assert!(mean.abs() < 1e-12);
    assert!((error / bank.mmse().unwrap() - 1.0).abs() < 1e-6);
}

/// As the noise vanishes everything tends to the centroids' error, at no greater cost.
#[test]
fn vanishing_noise_is_resolved() {
    let source = Source::uniform(1.0).unwrap();
    let grid = uniform_cells(1.0, 3).unwrap();
    let floor = 0.25 * 0.25 / 12.0;
    for snr in [80.0, 140.0] {
        let bank = gray(source, &grid, snr);
        let mmse = bank.mmse().unwrap();
        assert!((mmse / floor - 1.0).abs() < 2e-4, "{mmse} at {snr} dB");
        assert!(optimal_weight_van_trees(&bank).unwrap() <= mmse * (1.0 + 1e-9));
        for decoder in [Decoder::DiscreteMap(&grid), Decoder::ExactDivisionMap(&grid)] {
            assert!((decoder.mse(&bank).unwrap() / floor - 1.0).abs() < 2e-4);
        }
    }
}

/// All words of so many bits.
fn words(bits: usize) -> impl Iterator<Item = Vec<bool>> {
    (0..1 << bits).map(move |word| (0..bits).map(|at| word >> at & 1 == 1).collect())
}

fn gray_quantizers(grid: &Quantizer) -> Vec<BinaryQuantizer> {
    let on = |p: &str| p.parse::<fewbits_binary_patterns::Pattern>().unwrap().on(grid).unwrap();
    ["00001111", "00111100", "01100110"].map(on).to_vec()
}

/// Three Gray patterns on a grid.
fn gray(source: Source, grid: &Quantizer, snr: f64) -> Bank {
    Bank::homogeneous_with_deviation(source, gray_quantizers(grid), source.noise_deviation(snr).unwrap()).unwrap()
}
