//! The front door: requests and solutions.

use super::models;
use fewbits_core::Link;
use fewbits_monte_carlo::Stream;
use fewbits_quantizer_design::design::Scope;
use fewbits_quantizer_design::solve::{Adc, BitBudget, Progress, Request, Solution, minimax};
use fewbits_quantizer_design::{AllowedCells, Criterion, WordedCells};
use fewbits_quantizer_design::{Certificate, Noise, ObservationModel, Prior};
use rand::RngExt;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

fn pair(scale: f64) -> ObservationModel {
    let noise = Noise::equicorrelated_with_deviations(&[scale; 2], 0.5).unwrap();
    ObservationModel::new(Prior::normal(20.0 * scale, 4.0 * scale).unwrap(), noise).unwrap()
}

fn unit_pair(rho: f64) -> ObservationModel {
    let noise = Noise::equicorrelated_with_deviations(&[1.0; 2], rho).unwrap();
    ObservationModel::new(Prior::normal(0.0, 1.0).unwrap(), noise).unwrap()
}

fn best(model: ObservationModel, bits: BitBudget, link: Link) -> Solution {
    let request = Request {
        starts: 8,
        ..Request::estimation(model, bits, link)
    };
    request.run().unwrap().best().clone()
}

/// Squared error of encoder, link and decoder on simulated samples, with its standard error.
fn simulated(solution: &Solution, deviations: &[f64], rho: f64, draws: u64) -> (f64, f64) {
    let mut rng = Stream::new(5).named("simulated").rng();
    let decoder = solution.decoder(10_000).unwrap();
    let (prior, mean) = (solution.system().model().prior().deviation(), solution.system().model().prior().mean());
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..draws {
        let mut normal = || fewbits_numerics::normal::quantile(rng.random_range(1e-12..1.0));
        let (x, shared) = (mean + prior * normal(), normal());
        let samples: Vec<f64> = deviations
            .iter()
            .map(|s| x + s * (rho.sqrt() * shared + (1.0 - rho).sqrt() * normal()))
            .collect();
        let mut symbols = solution.encode(&samples).unwrap();
        for (symbol, sensor) in symbols.iter_mut().zip(solution.sensors()) {
            for bit in 0..sensor.bits {
                if rng.random_range(0.0..1.0) < sensor.link.crossover() {
                    *symbol ^= 1 << bit;
                }
            }
            if rng.random_range(0.0..1.0) < sensor.link.loss() {
                *symbol = 1 << sensor.bits;
            }
        }
        let error = (decoder.decode_symbols(&symbols).unwrap().mean - x).powi(2);
        sum += error;
        squares += error * error;
    }
    let n = draws as f64;
    (sum / n, ((squares / n - (sum / n).powi(2)) / n).sqrt())
}

/// The job of the guide, in ten lines: two correlated sensors of three bits over a link that flips 2 % of the bits.
#[test]
fn two_correlated_sensors_over_a_flipping_link() {
    let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.0], 0.5).unwrap();
    let model = ObservationModel::new(Prior::normal(20.0, 4.0).unwrap(), noise).unwrap();
    let link = Link::flipping(0.02).unwrap();
    let solutions = Request::estimation(model, BitBudget::Each(3), link).run().unwrap();
    let solution = solutions.best();
    let adc = Adc::new(12, 0.0..=40.0).unwrap();
    let header = solution
        .rounded(&[adc, adc])
        .unwrap()
        .export("plant", 4096)
        .unwrap()
        .to_c_header();
    assert!(header.contains("plant_thresholds_0") && header.contains("plant_decode"));
    // A step takes some 5 ms, so these are far below 10 s on any machine.
    assert!(solutions.steps < 1000, "{} steps", solutions.steps);
    // The best of 20,000 random starts.
    assert!(solution.value < 1.354_01, "{} after {}", solution.value, solutions.steps);
    assert_eq!((solution.certificate, solution.scope), (Certificate::LocalOptimum, Scope::EverySensor));
    assert!(solution.gap().unwrap() > 0.0);
    let (error, standard_error) = simulated(solution, &[1.0, 1.0], 0.5, 100_000);
    assert!((error - solution.value).abs() < 4.0 * standard_error, "{error} {standard_error} {}", solution.value);
}

/// The same job where a word may stand for several intervals: below the 1.365 that is asked of it.
#[test]
fn two_correlated_sensors_with_folded_cells() {
    let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.0], 0.5).unwrap();
    let model = ObservationModel::new(Prior::normal(20.0, 4.0).unwrap(), noise).unwrap();
    let request = Request {
        cells: AllowedCells::Any,
        ..Request::estimation(model, BitBudget::Each(3), Link::flipping(0.02).unwrap())
    };
    let solutions = request.run().unwrap();
    assert!(solutions.best().value < 1.354_45, "{}", solutions.best().value);
    assert_eq!(solutions.best().certificate, Certificate::LocalOptimum);
    assert!(solutions.steps < 1000, "{} steps", solutions.steps);
}

/// One bit, correlation .85: from intervals, improvements lead to .595036 and not to this optimum.
#[test]
fn folded_cells_of_one_bit_are_found() {
    let folded = |scale: f64| {
        let noise = Noise::equicorrelated_with_deviations(&[scale; 2], 0.85).unwrap();
        let model = ObservationModel::new(Prior::normal(0.0, scale).unwrap(), noise).unwrap();
        let request = Request {
            cells: AllowedCells::Any,
            starts: 1,
            ..Request::estimation(model, BitBudget::Each(1), Link::PERFECT)
        };
        request.run().unwrap().best().clone()
    };
    let one = folded(1.0);
    assert!((one.value - 0.559_245_993_323_162_8).abs() < 1e-11, "{}", one.value);
    assert!(one.sensors().iter().any(|s| s.words.len() > 2));
    assert_eq!(one.certificate, Certificate::LocalOptimum);
    for scale in [1e-4, 1e4] {
        assert!((folded(scale).value / (scale * scale) / one.value - 1.0).abs() < 1e-11, "{scale}");
    }
}

#[test]
fn folded_cells_beat_intervals_where_noise_is_small() {
    let intervals = best(pair(1.0), BitBudget::Each(2), Link::PERFECT);
    let folded = Request {
        cells: AllowedCells::Any,
        starts: 8,
        ..Request::estimation(pair(1.0), BitBudget::Each(2), Link::PERFECT)
    };
    let folded = folded.run().unwrap().best().clone();
    assert!(folded.value < 0.95 * intervals.value, "{} {}", folded.value, intervals.value);
}

/// `E[X | Y]` is linear, so one sensor's optimum is the Lloyd-Max quantizer of its sample.
#[test]
fn one_sensor_over_a_clear_link_is_lloyd_max() {
    for (bits, distortion) in [(2, 0.117_481_847_829), (3, 0.034_547_760_778)] {
        let model = ObservationModel::gaussian_with_deviations(2.0, &[1.0]).unwrap();
        let found = best(model, BitBudget::Each(bits), Link::PERFECT).value;
        let exact = 4.0 - 16.0 / 5.0 * (1.0 - distortion);
        assert!((found - exact).abs() < 1e-7, "{found} {exact}");
    }
}

#[test]
fn printed_optima_are_found() {
    for (rho, value) in [(0.0, 0.388_403_07), (0.85, 0.516_272_61)] {
        let found = best(unit_pair(rho), BitBudget::Each(2), Link::PERFECT).value;
        assert!((found - value).abs() < 1e-7, "{rho}: {found}");
    }
    let informed = Request {
        criterion: Criterion::MutualInformation,
        ..Request::estimation(unit_pair(0.85), BitBudget::Each(2), Link::PERFECT)
    };
    let informed = informed.run().unwrap();
    assert!((informed.best().value - 0.331_123_01).abs() < 1e-7);
}

#[test]
fn detection_reaches_the_printed_error_probability() {
    let noise = Noise::independent_with_deviations(&[1.0; 5]).unwrap();
    let model = ObservationModel::new(Prior::binary(2.0, 0.5).unwrap(), noise).unwrap();
    let mut request = Request::detection(model, BitBudget::Each(2), Link::PERFECT).unwrap();
    request.starts = 2;
    let found = request.run().unwrap();
    assert!(found.best().value < 1.660_803_1e-2, "{}", found.best().value);
    assert!(Request::detection(unit_pair(0.0), BitBudget::Each(2), Link::PERFECT).is_err());
}

#[test]
fn designs_scale_with_the_unit() {
    let link = Link::new(0.05, 0.03).unwrap();
    let one = best(pair(1.0), BitBudget::PerSensor(vec![2, 1]), link);
    for scale in [1e-4, 1e4] {
        let other = best(pair(scale), BitBudget::PerSensor(vec![2, 1]), link);
        assert!((other.value / (scale * scale) / one.value - 1.0).abs() < 1e-9, "{scale}");
        // Rounding decides between a design and its mirror image about the mean.
        let distance = |mirror: bool| {
            let pairs = one.sensors().iter().zip(other.sensors()).flat_map(|(a, b)| {
                assert_eq!(a.words.len(), b.words.len());
                let mut own: Vec<f64> = b.breakpoints.iter().map(|b| b / scale).collect();
                if mirror {
                    own = own.iter().rev().map(|b| 40.0 - b).collect();
                }
                a.breakpoints.clone().into_iter().zip(own)
            });
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(distance(false).min(distance(true)) < 1e-6, "{scale}: {} {}", distance(false), distance(true));
    }
}

/// A symbol that is lost and known to be leaves the prior.
#[test]
fn losses_of_one_sensor_mix_prior_and_posterior() {
    let model = || ObservationModel::gaussian_with_deviations(1.0, &[0.5]).unwrap();
    let clear = best(model(), BitBudget::Each(2), Link::PERFECT).value;
    // Whether the loss is noticed makes no difference.
    for link in [
        Link::lossy(0.3).unwrap(),
        Link::PERFECT.with_erasure(0.3).unwrap(),
        Link::lossy(0.1).unwrap().with_erasure(0.2).unwrap(),
    ] {
        let lossy = best(model(), BitBudget::Each(2), link);
        assert!((lossy.value - (0.3 + 0.7 * clear)).abs() < 1e-9, "{link:?}");
        assert_eq!(lossy.sensors()[0].symbols(), 5);
        assert!((lossy.decoder(5).unwrap().decode_symbols(&[4]).unwrap().variance - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_useless_link_leaves_the_prior() {
    let found = best(unit_pair(0.3), BitBudget::Each(3), Link::flipping(0.5).unwrap());
    assert!((found.value - 1.0).abs() < 1e-9);
}

#[test]
fn shared_out_bits_are_the_best_of_all_shares() {
    let model = || ObservationModel::gaussian_with_deviations(1.0, &[0.2, 1.5]).unwrap();
    let link = Link::flipping(0.01).unwrap();
    let shared = best(model(), BitBudget::Total(3), link);
    let all = (0..=3).map(|first| best(model(), BitBudget::PerSensor(vec![first, 3 - first]), link).value);
    let least = all.fold(f64::INFINITY, f64::min);
    assert!((shared.value / least - 1.0).abs() < 1e-6, "{} {least}", shared.value);
    assert!(Request::estimation(model(), BitBudget::Total(0), link).run().is_err());
    assert!(Request::estimation(model(), BitBudget::Each(7), link).run().is_err());
    assert!(
        Request::estimation(model(), BitBudget::PerSensor(vec![1]), link)
            .run()
            .is_err()
    );
}

/// Defect: thresholds a thousandth apart at a thousand million were all printed as 1.00000000e9.
#[test]
fn a_table_tells_thresholds_apart() {
    for mean in [20.0, -1e9] {
        let noise = Noise::independent_with_deviations(&[1e-4]).unwrap();
        let model = ObservationModel::new(Prior::normal(mean, 1e-3).unwrap(), noise).unwrap();
        let found = best(model, BitBudget::Each(2), Link::PERFECT);
        let table = found.table();
        let edges = table
            .lines()
            .filter_map(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
        let edges: Vec<f64> = edges.filter(|edge| (edge - mean).abs() < 0.1).collect();
        let exact = &found.sensors()[0].breakpoints;
        assert!(edges.len() >= 3 && exact.iter().all(|b| edges.iter().any(|e| (e - b).abs() < 1e-7)), "{table}");
    }
}

/// For each model the evaluations of Nelder-Mead that take as much time on the processor as the design (measured once). Both are sums over the
/// same nodes.
const EQUAL_TIME: [usize; 5] = [360, 110, 290, 66, 32];

/// One model of each prior, and the units in turn. The reference has a number of evaluations, not a time, so that the speed of the machine does
/// not matter. The example `random_models` compares by processor time.
#[test]
fn random_models_are_no_worse_than_nelder_mead() {
    for (i, most) in (0_u64..).zip(EQUAL_TIME) {
        let task = models::task(i, [1e-4, 1.0, 1e4][i as usize % 3], 3, 2).unwrap();
        let found = task.request().unwrap().run().unwrap();
        let error = task.exact(found.best()).unwrap();
        let reference = task.nelder_mead(&|evaluations| evaluations >= most).unwrap();
        assert!(error <= reference * (1.0 + 1e-9), "{}: {error} {reference}", task.what);
    }
}

#[test]
fn a_time_limit_still_gives_a_design() {
    let mut calls = 0;
    let mut count = |_| {
        calls += 1;
        ControlFlow::Continue(())
    };
    let request = Request {
        time_limit: Some(Duration::ZERO),
        progress: Some(&mut count),
        ..Request::estimation(pair(1.0), BitBudget::Each(3), Link::PERFECT)
    };
    let found = request.run().unwrap();
    assert!(found.is_cut_short && found.best().value < 16.0);
    assert!(calls > 0);
}

/// Told to stop at any call, the search ends at once with a design that it may use, and calls no more.
#[test]
fn a_search_that_is_stopped_gives_its_best_so_far() {
    let alone = best(pair(1.0).subset(&[0]).unwrap(), BitBudget::Each(1), Link::PERFECT).value;
    let whole = best(pair(1.0), BitBudget::Each(3), Link::PERFECT).value;
    let mut all = 0;
    for last in [1, 2, 7, 40, usize::MAX] {
        let mut calls = 0;
        let mut stop = |_| {
            calls += 1;
            if calls >= last {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let request = Request {
            progress: Some(&mut stop),
            ..Request::estimation(pair(1.0), BitBudget::Each(3), Link::PERFECT)
        };
        let found = request.run().unwrap();
        let value = found.best().value;
        assert_eq!((found.is_cut_short, calls), (last < usize::MAX, last.min(calls)), "{last}");
        assert!(value >= whole * (1.0 - 1e-12) && value < alone, "{last}: {value}, {whole}, {alone}");
        all = calls;
    }
    assert!(all > 40, "{all}");
}

/// Each reading of this clock is a second later, so that seven of them are a limit of 7 s, however fast the machine is.
#[test]
fn times_are_read_from_the_clock_that_is_handed_in() {
    static READINGS: AtomicU64 = AtomicU64::new(0);
    fn clock() -> Duration {
        Duration::from_secs(READINGS.fetch_add(1, Ordering::Relaxed))
    }
    let mut elapsed = Vec::new();
    let mut keep = |progress: Progress| {
        elapsed.push(progress.elapsed);
        ControlFlow::Continue(())
    };
    let limited = Request {
        clock,
        time_limit: Some(Duration::from_secs(7)),
        ..Request::estimation(pair(1.0), BitBudget::Each(2), Link::PERFECT)
    };
    let limited = limited.run().unwrap();
    assert!(limited.is_cut_short);
    let found = Request {
        clock,
        progress: Some(&mut keep),
        ..Request::estimation(pair(1.0), BitBudget::Each(2), Link::PERFECT)
    };
    let found = found.run().unwrap();
    assert!(!found.is_cut_short && found.best().value <= limited.best().value);
    assert!(
        !elapsed.is_empty()
            && elapsed
                .iter()
                .all(|time| time.subsec_nanos() == 0 && time.as_secs() > 0)
    );
    assert!(elapsed.windows(2).all(|pair| pair[0] < pair[1]));
}

/// A million joint symbols with correlated unequal noise, once with bits to share out: without a limit these take minutes. The clock goes on
/// by a millisecond at each reading, of which there is one per hundred thousand multiplications, so the speed of the machine does not matter.
#[test]
fn large_designs_end_soon_after_their_time_limit() {
    static READINGS: AtomicU64 = AtomicU64::new(0);
    fn clock() -> Duration {
        Duration::from_millis(READINGS.fetch_add(1, Ordering::Relaxed))
    }
    let deviations = [0.5, 0.6, 0.7, 0.8, 0.9];
    let noise = Noise::equicorrelated_with_deviations(&deviations, 0.5).unwrap();
    let model = ObservationModel::new(Prior::normal(0.0, 1.0).unwrap(), noise).unwrap();
    let alone = best(model.subset(&[0]).unwrap(), BitBudget::Each(4), Link::flipping(0.05).unwrap()).value;
    for bits in [BitBudget::Each(4), BitBudget::Total(18)] {
        let request = Request {
            clock,
            time_limit: Some(Duration::from_millis(500)),
            ..Request::estimation(model.clone(), bits.clone(), Link::flipping(0.05).unwrap())
        };
        let start = clock();
        let found = request.run().unwrap();
        let elapsed = clock() - start;
        assert!(elapsed < Duration::from_millis(700), "{bits:?}: {elapsed:?}");
        assert!(found.is_cut_short);
        let best = found.best();
        assert!(best.value < alone, "{bits:?}: {} {alone}", best.value);
        // What comes after the limit is the value of the design, on fewer nodes.
        assert!(2 * best.system().model().values().len() < model.values().len(), "{bits:?}");
        assert!(best.sensors().iter().all(|s| s.words.len() <= 1 << s.bits));
    }
}

#[test]
fn codes_of_a_converter_are_the_cells() {
    let solution = best(pair(1.0), BitBudget::Each(2), Link::flipping(0.02).unwrap());
    let adc = Adc::new(10, 4.0..=36.0).unwrap();
    let rounded = solution.rounded(&[adc, adc]).unwrap();
    for i in 0..4000 {
        let y = -1.0 + 42.0 * f64::from(i) / 4000.0;
        let words = rounded.solution.encode(&[y, y]).unwrap();
        assert_eq!([0, 1].map(|n| rounded.encode(n, adc.code(y)).unwrap()).to_vec(), words, "{y}");
    }
    // At an optimum the loss is of second order in the step.
    assert!(rounded.solution.value >= solution.value * (1.0 - 1e-12));
    assert!(rounded.solution.value < solution.value * 1.0001);
    let coarse = solution.rounded(&[Adc::new(2, 4.0..=36.0).unwrap(); 2]).unwrap();
    assert!(coarse.thresholds.iter().all(|t| t.windows(2).all(|w| w[0] < w[1])));
    assert!(coarse.solution.value > solution.value);
}

#[test]
fn additive_decoders_have_their_stated_error() {
    let solution = best(pair(1.0), BitBudget::Each(2), Link::flipping(0.02).unwrap());
    let export = solution.export("small", 64).unwrap();
    let stated = export.mean_squared_error().unwrap();
    assert!(stated >= solution.value);
    assert!(solution.export("small", 63).is_err() && solution.export("1", 4096).is_err());
    // E (X - estimate)^2 over the joint symbols, from the exact posterior.
    let decoder = solution.decoder(100).unwrap();
    let table = fewbits_quantizer_design::JointTable::new(solution.system()).unwrap();
    let mut error = 0.0;
    for a in 0..4 {
        for b in 0..4 {
            let posterior = decoder.decode_symbols(&[a, b]).unwrap();
            let off = export.decode(&[a, b]).unwrap() - posterior.mean;
            error += table.probability(4 * a + b) * (posterior.variance + off * off);
        }
    }
    assert!((error - stated).abs() < 1e-9, "{error}");
}

#[test]
fn json_follows_its_schema() {
    let solution = best(pair(1.0), BitBudget::PerSensor(vec![2, 1]), Link::new(0.1, 0.02).unwrap());
    let export = solution.export("plant", 4096).unwrap();
    let json: serde_json::Value = serde_json::from_str(&export.to_json().unwrap()).unwrap();
    let schema: serde_json::Value = serde_json::from_str(fewbits_quantizer_design::solve::JSON_SCHEMA).unwrap();
    let keys = |v: &serde_json::Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let required: Vec<String> = serde_json::from_value(schema["required"].clone()).unwrap();
    assert_eq!(keys(&json), required);
    let of_sensors = &schema["properties"]["sensors"]["items"]["required"];
    assert_eq!(keys(&json["sensors"][0]), serde_json::from_value::<Vec<String>>(of_sensors.clone()).unwrap());
    // The table holds every joint symbol, missing words included: 5 by 3.
    assert_eq!(json["decoder"]["shape"], serde_json::json!([5, 3]));
    let means: Vec<f64> = serde_json::from_value(json["decoder"]["means"].clone()).unwrap();
    for a in 0..5 {
        for b in 0..3 {
            assert_eq!(means[3 * a + b], export.decode(&[a, b]).unwrap());
        }
    }
}

#[test]
fn sensitivity_is_zero_without_a_change() {
    let solution = best(unit_pair(0.3), BitBudget::Each(2), Link::flipping(0.02).unwrap());
    for row in solution.sensitivity(0.0).unwrap() {
        assert!((row.mismatch.mean_squared_error - solution.value).abs() < 1e-12, "{row:?}");
    }
    for row in solution.sensitivity(0.2).unwrap() {
        let mismatch = row.mismatch;
        assert!(mismatch.mean_squared_error >= mismatch.with_best_decoder - 1e-12, "{row:?}");
    }
    assert!(solution.sensitivity(1.0).is_err());
}

#[test]
fn minimax_lowers_the_worst_case() {
    let request = Request {
        starts: 4,
        ..Request::estimation(unit_pair(0.0), BitBudget::Each(2), Link::PERFECT)
    };
    let found = minimax(request, 0.5, 0.3, 0.3).unwrap();
    assert!(found.worst_case < found.nominal_worst_case, "{found:?}");
    assert!(found.bound <= found.worst_case && found.bound > 0.9 * found.worst_case, "{found:?}");
    assert_eq!(found.weights.len(), 9);
}

/// A prior by a function of all nodes at once is the prior by a function of one, and an error of the caller's comes through.
#[test]
fn a_prior_by_a_function_that_may_fail() {
    #[derive(Debug, PartialEq)]
    enum Failed {
        Mine,
        Library(fewbits_quantizer_design::Error),
    }
    impl From<fewbits_quantizer_design::Error> for Failed {
        fn from(error: fewbits_quantizer_design::Error) -> Self {
            Self::Library(error)
        }
    }
    let bump = |x: f64| (-0.5 * (x - 1.0) * (x - 1.0)).exp() * (1.0 + 0.3 * x.sin());
    let one = Prior::density(bump, -5.0..=7.0).unwrap();
    let all = Prior::density_by(|nodes| Ok::<_, Failed>(nodes.iter().map(|x| bump(*x)).collect()), -5.0..=7.0);
    assert_eq!(all.unwrap(), one);
    let rule = |density: fn(&[f64]) -> Result<Vec<f64>, Failed>| Prior::density_by(density, 0.0..=1.0).unwrap_err();
    assert_eq!(rule(|_| Err(Failed::Mine)), Failed::Mine);
    for refused in [
        rule(|nodes| Ok(vec![1.0; nodes.len() - 1])),
        rule(|nodes| Ok(vec![f64::NAN; nodes.len()])),
        rule(|nodes| Ok(nodes.iter().map(|x| f64::from(u8::from(*x > 0.37))).collect())),
    ] {
        let Failed::Library(error) = refused else {
            panic!("{refused:?}")
        };
        assert!(matches!(error, fewbits_quantizer_design::Error::Argument(_)), "{error}");
    }
}

#[test]
fn requests_that_do_not_fit_are_refused() {
    let cells = |breakpoints: &[f64], words: &[usize]| WordedCells {
        breakpoints: breakpoints.to_vec(),
        words: words.to_vec(),
    };
    let request = || Request::estimation(unit_pair(0.3), BitBudget::Each(1), Link::PERFECT);
    let one = Request {
        links: vec![Link::PERFECT],
        ..request()
    };
    assert!(one.run().unwrap_err().to_string().contains("links"));
    for (other, what) in [
        (vec![cells(&[0.0], &[0, 1])], "start"),
        (vec![cells(&[0.0], &[0, 1]), cells(&[0.0], &[0])], "words"),
        (vec![cells(&[0.0], &[0, 1]), cells(&[1.0, 0.0], &[0, 1, 0])], "increas"),
        (vec![cells(&[0.0], &[0, 1]), cells(&[0.0], &[0, 2])], "word"),
    ] {
        let request = Request {
            start: Some(other),
            ..request()
        };
        let error = request.run().unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

/// Without noise, sensors of several intervals divide the axis at all their breakpoints together: the best are those of one Lloyd-Max
/// quantizer. Max (1960) has the distortions of 3, 4 and 7 levels.
#[test]
fn precise_sensors_share_the_breakpoints_of_one_quantizer() {
    for (bits, distortion) in [(vec![1, 1], 0.1902), (vec![2], 0.11748), (vec![2, 2], 0.0440)] {
        for (unit, noise) in [(1.0, 1e-3), (1e6, 2e-4)] {
            let noise = Noise::independent_with_deviations(&vec![unit * noise; bits.len()]).unwrap();
            let model = ObservationModel::new(Prior::normal(3.0 * unit, unit).unwrap(), noise).unwrap();
            let value = best(model, BitBudget::PerSensor(bits.clone()), Link::PERFECT).value / (unit * unit);
            assert!((value - distortion).abs() < 1e-4, "{bits:?}: {value}");
        }
    }
}
