//! Quantizer designs beyond the publication ([`docs/quantizers.md`](../../docs/quantizers.md)): folded cells, broken symmetry, words,
//! channels, bounds, effort. References: `mi-beyond/...`.

use crate::references::{agree, numbers};
use fewbits::core::Link;
use fewbits::quantizer_design::design::{self, Design};
use fewbits::quantizer_design::{
    AllowedCells, BitBudget, Channel, Criterion, Labelling, Newton, ObservationModel, Quantizer, Request, SensorGroup,
    System, bounds, lloyd_max,
};
use fewbits_baselines::quantizer_design as baselines;

const MI: Criterion = Criterion::MutualInformation;
const MSE: Criterion = Criterion::MeanSquaredError;

/// Two sensors with a common noise deviation and correlation.
fn pair(sd: f64, rho: f64) -> ObservationModel {
    use fewbits::quantizer_design::{Noise, Prior};
    let noise = Noise::equicorrelated_with_deviations(&[sd; 2], rho).unwrap();
    ObservationModel::new(Prior::normal(0.0, 1.0).unwrap(), noise).unwrap()
}

fn sensors(count: usize) -> ObservationModel {
    ObservationModel::gaussian_with_deviations(1.0, &vec![1.0; count]).unwrap()
}

fn lloyd(levels: usize, sd: f64) -> Quantizer {
    Quantizer::from(&lloyd_max::gaussian(levels).unwrap().affine(0.0, sd).unwrap())
}

fn joint(start: &System, criterion: Criterion) -> Design {
    design::joint(start, criterion, &Newton::default()).unwrap()
}

fn outer(system: &System) -> f64 {
    *system.quantizers()[0].breakpoints().last().unwrap()
}

/// Largest difference between two lists of breakpoints.
fn apart(a: &Quantizer, b: &Quantizer) -> f64 {
    let pairs = a.breakpoints().iter().zip(b.breakpoints());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn criterion(name: &str) -> Criterion {
    if name == "mi" { MI } else { MSE }
}

/// The best design of `noise0.5-L4 mse any`: a local optimum, above the bound for any codes where noise is independent.
fn best(row: &str) -> f64 {
    let [case, name, cells] = row.split(' ').collect::<Vec<_>>()[..] else {
        panic!("{row}");
    };
    let (noise, levels) = case.split_once("-L").unwrap();
    let levels: usize = levels.parse().unwrap();
    let sd = noise.strip_prefix("noise").map(|sd| sd.parse().unwrap());
    let (criterion, model) = (criterion(name), pair(sd.unwrap_or(1.0), if sd.is_none() { 0.85 } else { 0.0 }));
    let design = if cells == "contiguous" {
        let start = System::ideal(model.clone(), vec![lloyd(levels, model.sample_deviation(0)); 2]).unwrap();
        baselines::multi_start(&start, criterion, 20, 1, &Newton::default()).unwrap()
    } else {
        let request = Request {
            criterion,
            cells: AllowedCells::Any,
            ..Request::estimation(model.clone(), BitBudget::Each(levels.ilog2()), Link::PERFECT)
        };
        // Newton's method stays where it is, and has the curvature.
        joint(request.run().unwrap().best().system(), criterion)
    };
    assert!(design.largest_curvature < 1e-8, "{row}: {}", design.largest_curvature);
    if sd.is_some() {
        let bound = bounds::ceo(model.prior(), model.noise(), &[(levels as f64).log2(); 2]).unwrap();
        assert!(design.system.value(MSE).unwrap() > bound.distortion, "{row}");
    }
    design.value
}

#[test]
fn best_contiguous_cells() {
    agree("mi-beyond", "value", "contiguous", best);
}

/// Erratum `mi-13`.
#[test]
fn folded_cells_win_with_shared_or_small_noise() {
    agree("mi-beyond", "value", "any", best);
}

#[test]
fn identical_sign_quantizers_lose_their_optimality() {
    agree("mi-beyond", "symmetry", "", |row| {
        let (varied, name) = row.split_once(' ').unwrap();
        let signs = |model| System::ideal(model, vec![Quantizer::new(vec![0.0]).unwrap(); 2]);
        let found = match varied {
            "rho" => baselines::symmetry_breaking(0.1, 0.9, criterion(name), |rho| signs(pair(1.0, rho))),
            _ => baselines::symmetry_breaking(0.2, 2.0, criterion(name), |sd| signs(pair(sd, 0.0))),
        };
        found.unwrap()
    });
}

#[test]
fn gray_natural_and_three_words_by_crossover() {
    let model = sensors(2);
    let best = |crossover, criterion, words| {
        baselines::assign_words(&model, 2, crossover, 2..=4, criterion, words)
            .unwrap()
            .remove(0)
    };
    for crossover in [0.001, 0.01, 0.05, 0.1, 0.2] {
        for criterion in [MI, MSE] {
            let expected = match criterion {
                _ if crossover > 0.06 => vec![0, 1, 3],
                MSE if crossover == 0.05 => vec![0, 1, 2, 3],
                _ => vec![0, 1, 3, 2],
            };
            let found = best(crossover, criterion, baselines::Words::Shared);
            assert_eq!(found.words, vec![expected; 2], "{crossover} {criterion:?}");
            if crossover == 0.05 {
                let mixed = best(crossover, criterion, baselines::Words::PerSensor);
                let gain = criterion.sense() * (mixed.design.value - found.design.value);
                assert!(gain <= 1e-10, "different words at the two sensors gain {gain}");
            }
        }
    }
    agree("mi-beyond", "three-words", "", |row| {
        best(numbers(row)[0], MSE, baselines::Words::Shared).design.value
    });
}

#[test]
fn designs_for_other_channels() {
    let design = |row: &str| {
        let channel = match row {
            "erasure 0.1" => Channel::symbol_erasure(4, 0.1),
            _ => Channel::pulse_amplitude(4, 10.0),
        };
        let start = System::ideal(sensors(2), vec![lloyd(4, 1.4); 2]).unwrap();
        joint(&start.with_channels(vec![channel.unwrap(); 2]).unwrap(), MI).system
    };
    agree("mi-beyond", "outer", "", |row| outer(&design(row)));
    agree("mi-beyond", "mse", "", |row| design(row).value(MSE).unwrap());
}

#[test]
fn no_design_beats_a_bound() {
    agree("mi-beyond", "bound", "", |row| {
        let [count, levels, crossover] = numbers(row)[..] else {
            panic!("{row}");
        };
        let (model, levels) = (sensors(count as usize), levels as usize);
        let flips = if crossover > 0.0 {
            -(crossover * crossover.log2() + (1.0 - crossover) * (-crossover).ln_1p() / std::f64::consts::LN_2)
        } else {
            0.0
        };
        let bits = (levels as f64).log2() * (1.0 - flips);
        let bound = bounds::ceo(model.prior(), model.noise(), &vec![bits; model.sensors()]).unwrap();
        let words = Labelling::natural(levels).unwrap();
        let channel = Channel::binary_symmetric(&words, crossover).unwrap();
        let start = lloyd(levels, model.sample_deviation(0));
        let group = SensorGroup {
            quantizer: start,
            channel,
            sensors: (0..model.sensors()).collect(),
        };
        let design = joint(&System::new(model, vec![group]).unwrap(), MSE);
        assert!(design.value > bound.distortion, "{row}");
        if crossover == 0.0 {
            assert!(design.value > baselines::bayesian_cramer_rao(&design.system).unwrap(), "{row}");
        }
        bound.distortion
    });
}

#[test]
fn iterations_of_newton_and_of_alternating_maximisation() {
    let start = |row: &str| System::ideal(sensors(1), vec![lloyd(row.parse().unwrap(), 1.0)]).unwrap();
    let newton = |row: &str| {
        let strict = Newton {
            tolerance: 1e-12,
            ..Newton::default()
        };
        design::joint(&start(row), MI, &strict).unwrap()
    };
    // The last iteration only confirms that the step vanished.
    agree("mi-beyond", "newton", "", |row| newton(row).iterations as f64 - 1.0);
    agree("mi-beyond", "alternating", "", |row| {
        let limit = newton(row).system.quantizers();
        let (mut current, mut steps) = (start(row), 0);
        while apart(&current.quantizers()[0], &limit[0]) > 1e-8 && steps < 1000 {
            let quantizer = baselines::alternating_step(&current, 0, MI).unwrap();
            current = current.with_quantizer(0, quantizer).unwrap();
            steps += 1;
        }
        f64::from(steps)
    });
}

#[test]
fn nine_sensors_in_different_groups_return_to_one_quantizer() {
    for (levels, sizes) in [(4, &[3, 3, 3][..]), (4, &[5, 4]), (2, &[3, 3, 3]), (2, &[1; 9])] {
        for criterion in [MI, MSE] {
            let mut first = 0;
            let group = |(g, size): (usize, &usize)| {
                // Pushed apart at the start: groups shifted and stretched differently.
                let shift = 0.5 * (g as f64 / (sizes.len() - 1) as f64 - 0.5);
                let quantizer = lloyd(levels, 1.4).affine(shift, 1.0 + 0.4 * shift).unwrap();
                let own = (first..first + size).collect();
                first += size;
                SensorGroup {
                    quantizer,
                    channel: Channel::ideal(levels).unwrap(),
                    sensors: own,
                }
            };
            let groups = sizes.iter().enumerate().map(group).collect();
            let end = joint(&System::new(sensors(9), groups).unwrap(), criterion)
                .system
                .quantizers();
            assert!(end.iter().all(|q| apart(q, &end[0]) <= 1e-6), "{levels} levels, {sizes:?}, {criterion:?}");
        }
    }
}
