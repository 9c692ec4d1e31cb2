//! `problems-bussgang`: one bit from each of three sensors of the Lorenz system.

use super::models::Lorenz;
use crate::prelude::*;
use fewbits_baselines::bussgang;
use fewbits_core::factor::{Levels, Value};
use fewbits_core::{GaussianDynamics, OnAxes, assumed_density};
use fewbits_models::{AutoDynamics, Flow, LinearSensor};
use nalgebra::Matrix3;

/// Steps of a run.
const STEPS: usize = 200;
/// Length of a step.
const STEP: f64 = 0.02;

parameters! {
    pub struct Parameters {
        deviation: Vec<f64> [0.01..=100.0; 1..] = vec![0.1, 0.3, 1.0, 3.0] => "Deviations of the measurement noise.",
        process: f64 [0.0001..=10.0] = 0.1 => "Deviation of the process noise in a step.",
        trials: u64 [2..=10_000] = 200 => quick 10 => "Runs at each point.",
    }
    cost |p| Cost::new(2e-3 * (p.trials * p.deviation.len() as u64) as f64, 1e8);
}

rows! {
    pub struct Row {
        deviation: f64 as x("deviation of the noise") => "Deviation of the measurement noise of each coordinate.",
        bussgang: Measured as points("signs, linear estimator (Bussgang)") => "Root mean squared error of the state: the linear estimator of all signs.",
        signs: Measured as points("signs, moments of each") => "The same signs, their exact moments one after the other.",
        gain: Measured => "Mean over the runs of the mean squared error of the former less that of the latter.",
        full: Measured as dashed("full values") => "The extended Kalman filter of the measurements themselves.",
    }
}

pub struct Bussgang;

/// Mean squared errors of the three filters in a run.
fn run(dynamics: &dyn GaussianDynamics<3>, variance: f64, stream: Stream) -> Result<[f64; 3], Error> {
    let mut rng = stream.named("truth").rng();
    let prior = Gaussian::new(Vector3::new(3.0, 5.0, 20.0), Matrix3::identity())?;
    let noise = Matrix3::identity() * variance;
    let all = LinearSensor::new(Matrix3::identity(), noise)?;
    let (mut state, mut beliefs, mut sums) = (prior.sample(&mut rng), [prior; 3], [0.0; 3]);
    for _ in 0..STEPS {
        state = dynamics.propagate(&mut rng, &state);
        let z = all.sample(&mut rng, &state);
        let [linear, moments, full] = &mut beliefs;
        for belief in [&mut *linear, &mut *moments, &mut *full] {
            *belief = dynamics.predict(belief, 1.0);
        }
        let signs = (z - linear.mean()).map(f64::signum);
        *linear = bussgang::update(linear, &Matrix3::identity(), &noise, &signs)?;
        // Each sensor asks about the prediction, before any bit of this instant.
        let asked = *moments.mean();
        for axis in 0..3 {
            let sensor = OnAxes::new(LinearSensor::direct(variance)?, [axis])?;
            let bit = Levels::sign(Sign::of(z[axis], asked[axis])?, asked[axis], variance, &Link::default())?;
            *moments = assumed_density::update_through(moments, &Observed::new(sensor, bit))?.0;
        }
        *full = assumed_density::update_through(full, &Observed::new(all, Value::new(z, noise)?))?.0;
        for (sum, belief) in sums.iter_mut().zip(&beliefs) {
            *sum += (belief.mean() - state).norm_squared() / STEPS as f64;
        }
    }
    Ok(sums)
}

impl Figure for Bussgang {
    figure!(Parameters => Vec<Row>, "problems-bussgang", "Three signs of the Lorenz system", "our own comparison",
        "One bit from each of three sensors, one per coordinate, with the prediction as threshold (steps of 0.02, 200 of them). The linear \
         estimator of all signs together (Bussgang's decomposition) and the exact moments of one sign after the other \
         are the same for a single sensor."; loglog("root mean squared error"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let dynamics = AutoDynamics::new(Flow::new(Lorenz, STEP, 1)?, Matrix3::identity() * (p.process * p.process))?;
        let row = |deviation: &f64| {
            let stream = context.stream("problems-bussgang").named(&deviation.to_string());
            let all = context.moments(stream, p.trials, |trial| {
                let [linear, moments, full] = run(&dynamics, deviation * deviation, trial.stream)?;
                Ok([linear, moments, linear - moments, full])
            })?;
            Ok(Row {
                deviation: *deviation,
                bussgang: Measured::root_mean(&all[0]),
                signs: Measured::root_mean(&all[1]),
                gain: all[2].into(),
                full: Measured::root_mean(&all[3]),
            })
        };
        p.deviation.iter().map(row).collect()
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_defaults().at_full_trials();
        for row in rows {
            let ratio = row.signs.value / row.bussgang.value;
            let what = "the moments of one sign after the other are within two per cent of the linear estimator of all, or better";
            full.at_most(format!("same-{}", row.deviation), what, ratio, 1.02);
        }
        claims.all("full", "full values have less error than signs", rows, |r| r.full.value < r.signs.value);
    }
}
