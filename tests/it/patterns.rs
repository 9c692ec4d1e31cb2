//! What can be gained beyond the thesis's binary quantizers and assignments ([`docs/binary.md`](../../docs/binary.md)). Errors are
//! exact. References: `binary-beyond/...`.

use crate::references::agree;
use fewbits::binary_patterns::search::{Descent, LinearSearch, free_breakpoints};
use fewbits::binary_patterns::{
    BinaryQuantizer, Mask, Pattern, PatternSensor, Source, gray_basis, linear_pattern, rank, uniform_cells,
};
use fewbits::quantizers::Quantizer;
use fewbits::sensor_assignment::{CodedSensors, Estimator, exchange, pair_costs};
use fewbits_baselines::binary_patterns::{AdaptiveRule, adaptive, printed_gaussian_cells};
use fewbits_baselines::sensor_assignment::all_errors;
use fewbits_experiments::reference;

/// A source, its cells and the noise at one signal-to-noise ratio in dB.
struct Scene {
    source: Source,
    grid: Quantizer,
    noise: f64,
}

impl Scene {
    fn new(source: Source, grid: Quantizer, snr: f64) -> Self {
        let noise = source.noise_deviation(snr).unwrap();
        Self { source, grid, noise }
    }

    fn uniform(bits: usize, snr: f64) -> Self {
        Self::new(Source::uniform(1.0).unwrap(), uniform_cells(1.0, bits).unwrap(), snr)
    }

    fn gaussian(snr: f64) -> Self {
        let sd = 0.1f64.sqrt();
        Self::new(Source::gaussian_with_deviation(sd).unwrap(), printed_gaussian_cells(sd).unwrap(), snr)
    }

    fn search(&self, sensors: usize) -> LinearSearch {
        LinearSearch::with_deviation(self.source, self.grid.clone(), self.noise, sensors).unwrap()
    }

    fn quantizers(&self, masks: impl IntoIterator<Item = Mask>) -> Vec<BinaryQuantizer> {
        let bits = self.grid.cells().trailing_zeros() as usize;
        let quantizer = |m| linear_pattern(m, bits).unwrap().on(&self.grid).unwrap();
        masks.into_iter().map(quantizer).collect()
    }

    fn descent(&self, sensors: usize, candidates: Vec<BinaryQuantizer>) -> Descent {
        Descent::with_deviations(self.source, vec![self.noise; sensors], candidates).unwrap()
    }
}

/// The change of an error in per cent.
fn percent(before: f64, after: f64) -> f64 {
    100.0 * (after / before - 1.0)
}

/// No search may end above the best design that another program found, but for a thousandth.
fn is_as_good_as_known(name: &str, found: f64) {
    let known = reference::value(&format!("binary-beyond/best-known/{name}")).unwrap();
    assert!(found <= 1.001 * known, "{name}: {found}, known {known}");
}

#[test]
fn patterns_of_any_rank_have_less_error() {
    agree("binary-beyond", "change", "", |row| {
        let [_, _, source, sensors, snr] = row.splitn(5, '-').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let snr = snr.parse().unwrap();
        let scene = match source {
            "uniform" => Scene::uniform(3, snr),
            _ => Scene::gaussian(snr),
        };
        let search = scene.search(sensors[1..].parse().unwrap());
        percent(search.best().unwrap().mse, search.any_rank().best().unwrap().mse)
    });
}

#[test]
fn finer_grids_have_less_error() {
    agree("binary-beyond", "after", "18.2", finer);
    agree("binary-beyond", "after", "n10-30", finer);
}

/// The error of the best patterns found on the grid of `bits-4-n8-18.2`: below that of three bits.
fn finer(row: &str) -> f64 {
    let [_, bits, sensors, snr] = row.split('-').collect::<Vec<_>>()[..] else {
        panic!("{row}");
    };
    let (bits, sensors, snr) = (bits.parse().unwrap(), sensors[1..].parse().unwrap(), snr.parse().unwrap());
    let scene = Scene::uniform(bits, snr);
    let gray = gray_basis(bits).unwrap();
    let cycle = |masks: Vec<Mask>| {
        masks
            .into_iter()
            .cycle()
            .take(sensors)
            .map(|m| m as usize - 1)
            .collect()
    };
    // Both the fine and the coarse end of the basis may need the spare sensors.
    let starts: [Vec<usize>; 2] = [cycle(gray.clone()), cycle(gray.into_iter().rev().collect())];
    let full = |choice: &[usize]| rank(&choice.iter().map(|&c| c as Mask + 1).collect::<Vec<_>>()) == bits;
    let descent = scene.descent(sensors, scene.quantizers(1..1 << bits));
    let found = descent.run(&starts, 2, full).unwrap().mse;
    assert!(found < Scene::uniform(3, snr).search(sensors).best().unwrap().mse);
    found
}

/// Any of the 127 patterns of eight cells, by descent from linear ones.
fn any_patterns(scene: &Scene, linear: &[Mask]) -> (Vec<BinaryQuantizer>, f64) {
    let all = Pattern::all(8).unwrap();
    let place = |&m: &Mask| {
        let wanted = linear_pattern(m, 3).unwrap();
        all.iter().position(|p| *p == wanted).unwrap()
    };
    let start = linear.iter().map(place).collect();
    let candidates: Vec<_> = all.iter().map(|p| p.on(&scene.grid).unwrap()).collect();
    let descent = scene.descent(linear.len(), candidates.clone());
    let found = descent.run(&[start], 12, |_| true).unwrap();
    (found.choice.into_iter().map(|c| candidates[c].clone()).collect(), found.mse)
}

#[test]
fn any_pattern_has_less_error() {
    let scene = Scene::uniform(3, 10.0);
    let best = scene.search(8).best().unwrap();
    let found = any_patterns(&scene, &best.masks).1;
    assert!(found < best.mse);
    is_as_good_as_known("any-pattern-10", found);
}

/// Errors of the best linear patterns and of free thresholds, which start from linear patterns, of full or any rank and of a finer
/// grid, and from any patterns.
fn free(scene: &Scene, sensors: usize, jitter: f64) -> [f64; 2] {
    let search = scene.search(sensors);
    let linear = search.best().unwrap();
    let any = search.any_rank().best().unwrap();
    let mut starts = vec![scene.quantizers(linear.masks.clone()), scene.quantizers(any.masks)];
    if sensors > 3 {
        let grid = uniform_cells(1.0, 4).unwrap();
        let fine = Scene { grid, ..*scene };
        starts.push(fine.quantizers(fine.search(sensors).any_rank().best().unwrap().masks));
        starts.push(any_patterns(scene, &linear.masks).0);
    }
    let jitter = jitter / scene.source.scale();
    let error = |start: Vec<BinaryQuantizer>| {
        let sensor = |q| PatternSensor::with_deviation(q, scene.noise).unwrap();
        let sensors: Vec<_> = start.into_iter().map(sensor).collect();
        free_breakpoints(&scene.source, &sensors, jitter, 4).unwrap().mse
    };
    [linear.mse, starts.into_iter().map(error).fold(f64::INFINITY, f64::min)]
}

#[test]
fn free_thresholds_have_less_error() {
    for (name, scene, sensors, jitter) in [
        ("free-n8-18.2", Scene::uniform(3, 18.2), 8, 0.04),
        ("free-n8-10", Scene::uniform(3, 10.0), 8, 0.06),
        ("free-gaussian", Scene::gaussian(5.2), 3, 0.03),
    ] {
        let [before, after] = free(&scene, sensors, jitter);
        assert!(after < before, "{name}");
        is_as_good_as_known(name, after);
    }
}

#[test]
fn free_thresholds_gain_little_with_as_many_sensors_as_bits() {
    let [before, after] = free(&Scene::uniform(3, 25.0), 3, 0.02);
    assert!((-1.0..0.0).contains(&percent(before, after)));
}

/// How the source is estimated at the end.
enum Estimate {
    Likeliest,
    PosteriorMean,
}
use Estimate::{Likeliest, PosteriorMean};

/// The change in per cent from one adaptive rule of ten sensors to another, by the error that each is judged by.
fn rules(snr: f64, before: (AdaptiveRule, Estimate), after: (AdaptiveRule, Estimate)) -> f64 {
    let source = Source::uniform(1.0).unwrap();
    let noise = source.noise_deviation(snr).unwrap();
    let error = |(rule, by): (AdaptiveRule, Estimate)| {
        let errors = adaptive(&source, noise, 10, rule).unwrap();
        match by {
            Likeliest => errors.mle,
            PosteriorMean => errors.mmse,
        }
    };
    percent(error(before), error(after))
}

#[test]
fn thresholds_at_the_posterior_mean_beat_maximum_likelihood() {
    for snr in [5.0, 15.0, 30.0] {
        let mean = (AdaptiveRule::PosteriorMean, PosteriorMean);
        let gain = rules(snr, (AdaptiveRule::MaximumLikelihood, Likeliest), mean);
        assert!(gain <= -12.0, "{snr} dB: {gain} %");
    }
}

#[test]
fn thresholds_of_least_variance_gain_little_more() {
    for snr in [5.0, 20.0] {
        let mean = (AdaptiveRule::PosteriorMean, PosteriorMean);
        let gain = rules(snr, mean, (AdaptiveRule::LeastVariance, PosteriorMean));
        assert!((-1.0..0.0).contains(&gain), "{snr} dB: {gain} %");
    }
}

#[test]
fn smaller_steps_beat_those_of_the_figure() {
    let steps = |step, factor| (AdaptiveRule::VariableStep { step, factor }, Likeliest);
    for snr in [5.0, 10.0, 20.0] {
        let gain = rules(snr, steps(0.5, 1.5), steps(0.2, 1.2));
        assert!(gain <= -6.0, "{snr} dB: {gain} %");
    }
}

/// The sensors of table 6.1.
fn unequal() -> CodedSensors {
    CodedSensors::with_variances(1.0, &[0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001]).unwrap()
}

#[test]
fn posterior_mean_and_exchanges_lower_the_error_of_table_6_1() {
    let sensors = unequal();
    let linear = pair_costs(&sensors).solve();
    let mean = sensors.mse(&linear, Estimator::PosteriorMean).unwrap();
    assert!(mean < sensors.mse(&linear, Estimator::CellCentre).unwrap());
    agree("binary-beyond", "after", "assign-mmse", |_| mean);
    let exchanged = exchange(&sensors, &linear, Estimator::PosteriorMean).unwrap().error;
    assert!(exchanged < mean);
    agree("binary-beyond", "after", "exchange", |_| exchanged);
}

#[test]
fn sensors_that_choose_their_patterns_lower_the_error_of_table_6_1() {
    let sensors = unequal();
    let scene = Scene::uniform(4, 0.0);
    let deviations = sensors.noise_deviations().to_vec();
    let descent = Descent::with_deviations(scene.source, deviations, scene.quantizers(1..16)).unwrap();
    let gray = gray_basis(4).unwrap();
    // The most precise sensors come last, and serve the finest bits well.
    let cycle = gray.iter().cycle().take(8).map(|&m| m as usize - 1).collect();
    let constant = gray.iter().map(|&m| vec![m as usize - 1; 8]);
    let starts: Vec<Vec<usize>> = std::iter::once(cycle).chain(constant).collect();
    let found = descent.run(&starts, 40, |_| true).unwrap().mse;
    assert!(found < all_errors(&sensors, Estimator::PosteriorMean).unwrap().least);
    is_as_good_as_known("joint", found);
}
