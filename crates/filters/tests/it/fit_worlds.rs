//! Worlds of known parameters for calibration, and how much a fit loses on readings that it has not seen.

use fewbits_filters::calibration::{Instant, Reading};
use fewbits_filters::fit::{LevelModel, Quantity, Request, SensorModel, fit};
use fewbits_monte_carlo::Stream;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::StandardNormal;

pub(crate) const ROWS: usize = 200;

/// Instants of a world, twice as many as are fitted: sensors of `bits` say whether they are above zero. Sensor 0 reads first.
pub(crate) fn record(seed: u64, truth: &LevelModel, bits: &[usize], rows: usize) -> Vec<Instant> {
    let mut rng = Stream::new(seed).named("fit").rng();
    let mut noise = || rng.sample::<f64, _>(StandardNormal);
    // The level in steps of a tenth of a second, so that delays are multiples of a step.
    let steps = 10 * rows + 400;
    let short = 0.1;
    let mut level = vec![truth.mean; steps];
    for k in 1..steps {
        let before = level[k - 1];
        level[k] = match truth.time_constant {
            Some(constant) => {
                let kept = f64::exp(-short / constant);
                let settled = 0.5 * truth.change * truth.change * constant;
                truth.mean + kept * (before - truth.mean) + (settled * (1.0 - kept * kept)).sqrt() * noise()
            }
            None => before + truth.change * short.sqrt() * noise(),
        };
    }
    let mut walks = vec![0.0; truth.sensors.len()];
    (0..rows)
        .map(|row| {
            let values = truth.sensors.iter().enumerate().map(|(sensor, own)| {
                // A walk begins at zero.
                walks[sensor] += own.walk * noise() * f64::from(u8::from(row > 0));
                let late = (own.delay / short).round() as usize;
                let x = level[200 + 10 * row - late];
                let value = own.gain * x + own.bias + own.slope * row as f64 + walks[sensor] + own.noise * noise();
                let reading = match bits.contains(&sensor) {
                    false => Reading::from(value),
                    true if value > 0.0 => Reading::Within {
                        lower: 0.0,
                        upper: f64::INFINITY,
                    },
                    true => Reading::Within {
                        lower: f64::NEG_INFINITY,
                        upper: 0.0,
                    },
                };
                (sensor, reading)
            });
            Instant {
                seconds: row as f64,
                values: values.collect(),
            }
        })
        .collect()
}

pub(crate) fn walk(change: f64, sensors: Vec<SensorModel>) -> LevelModel {
    LevelModel {
        change,
        time_constant: None,
        mean: 20.0,
        sensors,
    }
}

pub(crate) fn exact(noise: f64) -> SensorModel {
    SensorModel::exact(noise)
}

/// The five kinds of worlds: name, truth, sensors of bits, what is looked for.
pub(crate) fn kinds() -> Vec<(&'static str, LevelModel, Vec<usize>, Request)> {
    let biased = |noise: f64, bias: f64| SensorModel { bias, ..exact(noise) };
    let reference = Request {
        reference: Some(0),
        ..Request::default()
    };
    vec![
        (
            "noises and biases",
            walk(0.3, vec![exact(0.5), biased(1.5, 2.0), biased(0.8, -1.0)]),
            vec![],
            Request::default(),
        ),
        (
            "gain against a reference",
            walk(
                1.0,
                vec![
                    exact(0.2),
                    SensorModel {
                        gain: 1.2,
                        ..biased(0.6, -3.0)
                    },
                ],
            ),
            vec![],
            Request {
                gain: true,
                ..reference.clone()
            },
        ),
        (
            "drifts",
            walk(
                0.3,
                vec![
                    exact(0.3),
                    SensorModel {
                        slope: 0.02,
                        ..exact(0.5)
                    },
                    SensorModel {
                        walk: 0.15,
                        ..exact(0.4)
                    },
                ],
            ),
            vec![],
            Request {
                slope: true,
                walk: true,
                ..reference.clone()
            },
        ),
        (
            "a delay",
            walk(
                1.0,
                vec![
                    exact(0.3),
                    SensorModel {
                        delay: 1.5,
                        ..exact(0.5)
                    },
                ],
            ),
            vec![],
            Request {
                delay: true,
                ..reference.clone()
            },
        ),
        (
            "a level that returns, and a threshold",
            LevelModel {
                time_constant: Some(8.0),
                ..walk(1.0, vec![exact(0.4), biased(0.7, -21.0)])
            },
            vec![1],
            Request {
                time_constant: true,
                ..Request::default()
            },
        ),
    ]
}

pub(crate) fn true_value(truth: &LevelModel, quantity: Quantity) -> f64 {
    match quantity {
        Quantity::Change => truth.change,
        Quantity::TimeConstant => truth.time_constant.unwrap(),
        Quantity::Mean => truth.mean,
        Quantity::Noise(sensor) => truth.sensors[sensor].noise,
        Quantity::Bias(sensor) => truth.sensors[sensor].bias,
        Quantity::Gain(sensor) => truth.sensors[sensor].gain,
        Quantity::Slope(sensor) => truth.sensors[sensor].slope,
        Quantity::Walk(sensor) => truth.sensors[sensor].walk,
        Quantity::Delay(sensor) => truth.sensors[sensor].delay,
        other => unreachable!("{other:?}"),
    }
}

/// The parameters that a world has, of those that are looked for.
fn parameters(truth: &LevelModel, request: &Request) -> Vec<Quantity> {
    let mut found = vec![Quantity::Change];
    if truth.time_constant.is_some() {
        found.extend([Quantity::TimeConstant, Quantity::Mean]);
    }
    found.extend((0..truth.sensors.len()).map(Quantity::Noise));
    for sensor in 1..truth.sensors.len() {
        let model = truth.sensors[sensor];
        found.push(Quantity::Bias(sensor));
        for (is_there, quantity) in [
            (request.gain, Quantity::Gain(sensor)),
            (model.slope != 0.0, Quantity::Slope(sensor)),
            (model.walk != 0.0, Quantity::Walk(sensor)),
            (model.delay != 0.0, Quantity::Delay(sensor)),
        ] {
            found.extend(is_there.then_some(quantity));
        }
    }
    found
}

/// The truth with other parameters: sizes by factors, a gain about the mean level.
fn moved(truth: &LevelModel, parameters: &[Quantity], by: &DVector<f64>) -> LevelModel {
    let mut model = truth.clone();
    for (quantity, by) in parameters.iter().zip(by.iter()) {
        let sensors = &mut model.sensors;
        match *quantity {
            Quantity::Change => model.change *= by.exp(),
            Quantity::TimeConstant => model.time_constant = model.time_constant.map(|seconds| seconds * by.exp()),
            Quantity::Mean => model.mean += by,
            Quantity::Noise(sensor) => sensors[sensor].noise *= by.exp(),
            Quantity::Walk(sensor) => sensors[sensor].walk *= by.exp(),
            Quantity::Bias(sensor) => sensors[sensor].bias += by,
            Quantity::Slope(sensor) => sensors[sensor].slope += 0.01 * by,
            Quantity::Delay(sensor) => sensors[sensor].delay += by,
            Quantity::Gain(sensor) => {
                sensors[sensor].gain += 0.1 * by;
                sensors[sensor].bias -= 0.1 * by * truth.mean;
            }
            other => unreachable!("{other:?}"),
        }
    }
    model
}

/// Minus the second derivatives of the likelihood at the truth.
fn information(truth: &LevelModel, parameters: &[Quantity], rows: &[Instant]) -> DMatrix<f64> {
    let count = parameters.len();
    let step = |i: usize| match parameters[i] {
        Quantity::Delay(_) => 0.25,
        _ => 0.03,
    };
    let at = |i: usize, one: f64, j: usize, other: f64| {
        let mut by = DVector::zeros(count);
        by[i] += one * step(i);
        by[j] += other * step(j);
        moved(truth, parameters, &by).log_likelihood(rows).unwrap().0
    };
    let mut found = DMatrix::zeros(count, count);
    for i in 0..count {
        for j in 0..=i {
            let bent = at(i, 1.0, j, 1.0) + at(i, -1.0, j, -1.0) - at(i, 1.0, j, -1.0) - at(i, -1.0, j, 1.0);
            found[(i, j)] = -bent / (4.0 * step(i) * step(j));
            found[(j, i)] = found[(i, j)];
        }
    }
    found
}

/// Losses against the truth in nats, and in how many worlds they are more than one in a hundred of the log-likelihood.
#[derive(Default)]
struct Losses {
    values: Vec<f64>,
    /// Of each world: the share of its forecasts that are poor.
    poor: Vec<f64>,
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|one| (one - mean).powi(2)).sum();
    (mean, squares.sqrt() / count)
}

impl Losses {
    fn add(&mut self, losses: &[f64], limit: f64) {
        self.values.push(mean_and_error(losses).0);
        let poor = losses.iter().filter(|loss| **loss > limit).count();
        self.poor.push(poor as f64 / losses.len() as f64);
    }

    fn told(&self) -> String {
        let (poor, poor_error) = mean_and_error(&self.poor);
        let (loss, error) = mean_and_error(&self.values);
        format!("{:.1} ± {:.1} of a hundred poor, {loss:.2} ± {error:.2} nats", 100.0 * poor, 100.0 * poor_error)
    }
}

/// How many estimates of a parameter there are, and how many of them are within 1.96 standard errors.
#[derive(Default)]
struct Coverage(Vec<(Quantity, usize, usize)>);

impl Coverage {
    fn add(&mut self, quantity: Quantity, is_within: bool) {
        let place = self.0.iter().position(|one| one.0 == quantity).unwrap_or_else(|| {
            self.0.push((quantity, 0, 0));
            self.0.len() - 1
        });
        self.0[place].1 += usize::from(is_within);
        self.0[place].2 += 1;
    }
}

/// The measurement of `docs/fit.md`. The bound is that of Bayes' rule with estimates that have the covariance of the Cramer-Rao bound and are told
/// which faults are there: such an estimate is the truth plus a normal error, and a forecaster averages over as many errors about it.
#[test]
#[ignore = "four minutes"]
fn held_out_readings_of_hundreds_of_worlds() {
    let said = std::thread::scope(|scope| {
        let kinds: Vec<_> = kinds()
            .into_iter()
            .map(|kind| scope.spawn(move || measure(&kind)))
            .collect();
        kinds.into_iter().map(|one| one.join().unwrap()).collect::<String>()
    });
    println!("{said}");
}

fn measure((name, truth, bits, request): &(&'static str, LevelModel, Vec<usize>, Request)) -> String {
    const WORLDS: u64 = 400;
    const FIRST: u64 = 2000;
    const DRAWS: usize = 4;
    const MODELS: usize = 100;
    let parameters = parameters(truth, request);
    let [mut point, mut averaged, mut bound_of_point, mut bound]: [Losses; 4] = Default::default();
    let (mut limits, mut faults, mut coverage) = (Vec::new(), 0, Coverage::default());
    for seed in FIRST..FIRST + WORLDS {
        let rows = record(seed, truth, bits, 2 * ROWS);
        let fitted = &rows[..ROWS];
        // Both know the readings before.
        let held_out =
            |model: &LevelModel| model.log_likelihood(&rows).unwrap().0 - model.log_likelihood(fitted).unwrap().0;
        let best = held_out(truth);
        let limit = 0.01 * best.abs();
        limits.push(limit);
        let found = fit(fitted, truth.sensors.len(), request).unwrap();
        point.add(&[best - held_out(&found.model)], limit);
        averaged.add(&[best - found.log_predictive(&rows, ROWS).unwrap()], limit);
        // A fault that is left out costs as much as says that it is not there.
        let is_found = |one: &Quantity| found.estimates.iter().any(|other| other.quantity == *one);
        let is_likelier = truth.log_likelihood(fitted).unwrap().0 > found.log_likelihood + 0.1;
        faults += usize::from(parameters.iter().all(is_found) && is_likelier);
        for one in &found.estimates {
            let off = (one.value - true_value(truth, one.quantity)) / one.standard_error;
            coverage.add(one.quantity, off.abs() < 1.96);
        }
        let eigen = information(truth, &parameters, fitted).symmetric_eigen();
        let mut rng = Stream::new(seed).named("errors").rng();
        let mut error = || {
            let mut normal = |i: usize| rng.sample::<f64, _>(StandardNormal) / eigen.eigenvalues[i].max(0.25).sqrt();
            &eigen.eigenvectors * DVector::from_fn(parameters.len(), |i, _| normal(i))
        };
        let mut draws = [Vec::new(), Vec::new()];
        for _ in 0..DRAWS {
            let own = error();
            draws[0].push(best - held_out(&moved(truth, &parameters, &own)));
            let logs: Vec<f64> = (0..MODELS)
                .map(|_| held_out(&moved(truth, &parameters, &(&own + error()))))
                .collect();
            let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let mean = logs.iter().map(|log| (log - largest).exp()).sum::<f64>() / MODELS as f64;
            draws[1].push(best - largest - mean.ln());
        }
        bound_of_point.add(&draws[0], limit);
        bound.add(&draws[1], limit);
    }
    let mut said = format!("{name}: {} parameters, one in a hundred is ", parameters.len());
    said +=
        &format!("{:.2} nats; the truth is likelier in the fitted rows: {faults} worlds\n", mean_and_error(&limits).0);
    for (what, losses) in [
        ("best model", &point),
        ("averaged", &averaged),
        ("bound of a model", &bound_of_point),
        ("bound", &bound),
    ] {
        said += &format!("  {what}: {}\n", losses.told());
    }
    let difference: Vec<f64> = averaged
        .poor
        .iter()
        .zip(&bound.poor)
        .map(|(one, other)| one - other)
        .collect();
    let (more, error) = mean_and_error(&difference);
    said += &format!("  averaged less bound: {:.1} ± {:.1} of a hundred poor\n", 100.0 * more, 100.0 * error);
    for (quantity, within, all) in &coverage.0 {
        let share = *within as f64 / *all as f64;
        let error = (share * (1.0 - share) / *all as f64).sqrt();
        said += &format!("  {quantity:?}: {share:.3} ± {error:.3} of {all} within 1.96 standard errors\n");
    }
    assert_eq!(faults, 0, "{name}");
    for (quantity, within, all) in &coverage.0 {
        // 95 in a hundred, less four standard errors of so many.
        let least = 0.95 - 4.0 * (0.95 * 0.05 / *all as f64).sqrt();
        assert!(*within as f64 >= least * *all as f64, "{quantity:?} {said}");
    }
    // What is attainable, and two standard errors.
    assert!(more <= 2.0 * error, "{said}");
    said
}
