//! Convergence from the first message: simulated, exact and predicted.

use super::common::{Plant, each};
use crate::prelude::*;
use fewbits_dymbo::chain::first_message_transient;
use fewbits_dymbo::{DymboFilter, RoundedSample, ScalarFilter, ScalarPlant, filtered_variance};
use fewbits_filters::kalman;

parameters! {
    pub struct Parameters {
        a: f64 [-0.999_999..=0.999_999] = 0.9 => "Plant coefficient; the state starts from its stationary law.",
        gamma: Vec<f64> [1e-4..=1e3; 1..] = vec![0.5, 0.05] => "Process variances over measurement variance.",
        tau: f64 [1e-3..=100.0] = 1.0 => "Resolution of the first message in noise deviations.",
        steps: usize [1..=10_000] = 50 => "Steps after the first message.",
        trials: u64 [2..=100_000_000] = 100_000 => quick 5_000 => "Simulated runs.",
    }
}

rows! {
    pub struct Rows {
        errors: Vec<Row> => "Errors and variances.",
        path: Vec<Point> => "One run.",
    }

    struct Row by "{plant} {n}" {
        plant: Plant as panel("a = {}, gamma = {}"),
        n: usize as x("step n") => "Step.",
        kf_pred: f64 ["sigma^2"] as line("Kalman, exact") in errors => "Variance computed by the Kalman filter, which is exact.",
        kf_mse: Measured ["sigma^2"] as points("Kalman, simulated") in errors => "Mean squared error of the Kalman filter.",
        dymbo_pred: f64 ["sigma^2"] => "Variance computed by the sign-bit filter.",
        dymbo_mse: Measured ["sigma^2"] as points("sign bit, simulated") in errors => "Mean squared error of the sign-bit filter.",
        dymbo_exact: f64 ["sigma^2"] as line("sign bit, exact") in errors => "Exact mean squared error, by the error chain.",
        dymbo_minf: f64 ["sigma^2"] as dashed("steady, sign bit") in errors => "Steady variance of the sign-bit filter.",
        kf_minf: f64 ["sigma^2"] => "Steady variance of the Kalman filter.",
        nees: Measured => "Squared error over computed variance, sign-bit filter.",
        /// Mean squared error when the stationary prior is used at n = 0.
        informed_mse: Measured ["sigma^2"] as points("with prior, simulated") in errors,
        informed_nees: Measured => "Its squared error over computed variance.",
    }

    struct Point {
        plant: Plant as panel("a = {}, gamma = {}"),
        n: usize as x("step n") => "Step.",
        theta: f64 ["sigma"] as line("state") in path => "State.",
        kf: f64 ["sigma"] as dashed("Kalman") in path => "Estimate of the Kalman filter.",
        dymbo: f64 ["sigma"] as line("sign bit") in path => "Estimate of the sign-bit filter.",
        bit: Option<f64> => "Bit received; none at the first message.",
    }
}

/// Truth, the beliefs of the three filters, and the bit at one step.
struct Step {
    truth: f64,
    /// Of the Kalman filter, of the sign-bit filter, and of the latter with the stationary prior.
    beliefs: [Gaussian<1>; 3],
    bit: Option<f64>,
}

/// One run: the Kalman filter and the sign-bit filter from the same first sample without prior, and the sign-bit filter that
/// uses the stationary prior.
fn simulate(
    plant: &ScalarPlant,
    prior: &Gaussian<1>,
    p: &Parameters,
    stream: Stream,
) -> Result<Vec<Step>, fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let scheme = RoundedSample::new(plant.measurement_variance(), p.tau)?;
    let mut state = prior.sample(&mut rng);
    let sample = plant.sensor().sample(&mut rng, &state)[0];
    let message = scheme.round(sample)?;
    let mut run = vec![Step {
        truth: state[0],
        beliefs: [
            Gaussian::scalar(sample, plant.measurement_variance())?,
            scheme.belief(message)?,
            scheme.belief_with_prior(message, prior)?,
        ],
        bit: None,
    }];
    for n in 0..p.steps {
        let [kalman, dymbo, informed] = run[n].beliefs;
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let ask = |belief: &Gaussian<1>| Sign::of(sample, filter.threshold(belief));
        let bit = ask(&dymbo)?;
        run.push(Step {
            truth: state[0],
            beliefs: [
                kalman::step(plant.dynamics(), plant.sensor(), &kalman, &Vector1::new(sample))?.0,
                filter.step(&dymbo, &Observation::Received(bit))?.0,
                filter.step(&informed, &Observation::Received(ask(&informed)?))?.0,
            ],
            bit: Some(bit.value()),
        });
    }
    Ok(run)
}

pub struct Convergence;

impl Figure for Convergence {
    figure!(Parameters => Rows, "dymbo-fig5", "Convergence after a fine first message", "Ribeiro and Giannakis, Fig. 5",
        "Mean squared error of the Kalman filter and of the sign-bit filter, simulated (points, one standard error) and \
         exact (lines); the third curve starts from first message and stationary prior together. The level differs \
         by the loss, the convergence by a step or two (erratum dymbo-12); for the slow plant the first message without the \
         prior is worse than the prior alone.";
        { errors: semilog("mean squared error / sigma^2"), path: linear("state / sigma", "One run") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let (mut errors, mut path) = (Vec::new(), Vec::new());
        for plant in each(p.a, &p.gamma) {
            let (model, prior) = (plant.model()?, plant.stationary()?);
            let stream = context.stream(self.about().id).named(&plant.gamma.to_string());
            let sums = context.moments(stream, p.trials, |trial| {
                let numbers = simulate(&model, &prior, p, trial.stream)?.into_iter().flat_map(|step| {
                    let squared = |belief: &Gaussian<1>| (belief.mean()[0] - step.truth).powi(2);
                    let [kalman, dymbo, informed] = step.beliefs.each_ref().map(squared);
                    [kalman, dymbo, informed, informed / step.beliefs[2].covariance()[0]]
                });
                Ok(numbers.collect::<Vec<_>>())
            })?;
            let transient = first_message_transient(&model, p.tau, 1.0 + p.tau * p.tau / 12.0, p.steps)?;
            let mut kf_pred = 1.0;
            for (n, (exact, sums)) in transient.iter().zip(sums.chunks(4)).enumerate() {
                if n > 0 {
                    kf_pred = filtered_variance(model.dynamics().predict_variance(kf_pred), 1.0, 1.0);
                }
                let dymbo_mse = Measured::from(sums[1]);
                errors.push(Row {
                    plant,
                    n,
                    kf_pred,
                    kf_mse: sums[0].into(),
                    dymbo_pred: exact.filtered_variance,
                    dymbo_mse,
                    dymbo_exact: exact.mse,
                    dymbo_minf: plant.sign_bit_variance()?,
                    kf_minf: plant.kalman_variance()?,
                    nees: Measured::new(
                        dymbo_mse.value / exact.filtered_variance,
                        dymbo_mse.standard_error.map(|se| se / exact.filtered_variance),
                    ),
                    informed_mse: sums[2].into(),
                    informed_nees: sums[3].into(),
                });
            }
            let steps = simulate(&model, &prior, p, stream.indexed(0))?;
            path.extend(steps.into_iter().enumerate().map(|(n, step)| Point {
                plant,
                n,
                theta: step.truth,
                kf: step.beliefs[0].mean()[0],
                dymbo: step.beliefs[1].mean()[0],
                bit: step.bit,
            }));
        }
        Ok(Rows { errors, path })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let rows = &rows.errors;
        let what = "simulated sign-bit error against the error chain, worst step";
        claims.all_within("dymbo-exact", what, rows, |r| (r.dymbo_mse, r.dymbo_exact), 4.5);
        let what = "simulated Kalman error against its variance, worst step";
        claims.all_within("kf-exact", what, rows, |r| (r.kf_mse, r.kf_pred), 4.5);
        let steady = |nees: f64| (0.9995..=1.0030).contains(&nees);
        let what = "exact normalised error within [0.9995, 1.0030] at every step";
        here.all("consistent", what, rows, |r| steady(r.dymbo_exact / r.dymbo_pred));
        let what = "normalised error of the prior-aware start within 4.5 standard errors of the same interval";
        here.all("informed-consistent", what, rows, |r| {
            let slack = 4.5 * r.informed_nees.error();
            (0.9995 - slack..=1.0030 + slack).contains(&r.informed_nees.value)
        });
        for curve in rows.chunks(p.steps + 1) {
            let gamma = curve[0].plant.gamma;
            let late: Moments = curve
                .iter()
                .skip(30)
                .map(|r| r.dymbo_mse.value / r.dymbo_minf)
                .collect();
            let what =
                format!("gamma = {gamma}: simulated error over n >= 30 is the predicted steady variance within 2 %");
            here.near(format!("steady-{gamma}"), what, late.mean(), 1.0, 0.02);
        }

        let curves = || rows.chunks(p.steps + 1);
        // The Kalman filter settles on its own variance, the sign-bit filter on its own exact error.
        type Of = fn(&Row) -> f64;
        let settling: [(&str, &str, Of, Of); 2] = [
            ("dymbo", "sign-bit", |r| r.dymbo_exact, |r| r.dymbo_exact),
            ("kf", "Kalman", |r| r.kf_pred, |r| r.kf_minf),
        ];
        for (id, who, value, level) in settling {
            let what = format!("steps of the {who} filter to within 5 % of its level, a, gamma (erratum dymbo-12)");
            claims.references(&format!("steps-{id}"), &what, curves(), |c| {
                let level = c.last().map_or(f64::NAN, level);
                (c[0].plant.to_string(), c.iter().position(|r| value(r) <= 1.05 * level).map(|n| n as f64))
            });
        }
        let ratios: [(&str, &str, Of); 2] = [
            ("exact", "exact errors", |r| r.dymbo_exact / r.kf_pred),
            ("computed", "computed variances", |r| r.dymbo_pred / r.kf_pred),
        ];
        for (id, of, ratio) in ratios {
            let peak = |c: &[Row]| c.iter().map(ratio).fold(0.0, f64::max);
            let what = format!("the ratio of {of} peaks at n = 2");
            here.all(format!("peak-at-{id}"), what, curves(), |c| c.get(2).is_some_and(|r| ratio(r) == peak(c)));
            let what = format!("the ratio of {of} at its peak, a, gamma");
            claims.references(&format!("peak-{id}"), &what, curves(), |c| (c[0].plant.to_string(), peak(c)));
        }
    }
}
