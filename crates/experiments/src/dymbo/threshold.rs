//! Where the threshold belongs.

use super::common::{Plant, plants};
use crate::prelude::*;
use fewbits_core::Scheme;
use fewbits_dymbo::{DymboFilter, ScalarFilter, ScalarPlant};
use fewbits_filters::assumed_density;

parameters! {
    pub struct Parameters {
        /// Plants, `a:gamma`; the state starts from its stationary law.
        plants: Vec<Plant> [; 1..] = plants([(0.9, 0.5), (0.9, 0.05), (-0.9, 0.5)]),
        steps: u64 [1..=10_000] = 1000 => "Steps of a run that are measured.",
        burn: u64 [..=10_000] = 100 => "Steps before them.",
        trials: u64 [2..=100_000_000] = 6_000 => quick 200 => "Simulated runs.",
    }
    check |p| {
        let stable = p.plants.iter().all(|plant| plant.a.abs() < 1.0);
        accept("plants", stable, || "a must be above -1 and below 1".to_owned())
    };
}

rows! {
    pub struct Row by "{plant} {rule}" {
        plant: Plant as panel("a = {}, gamma = {}"),
        rule: &'static str as x("") => "Place of the threshold.",
        mse: Measured ["sigma^2"] as points => "Mean squared error.",
        excess: Measured => "Relative excess over the prediction rule, same noise (erratum dymbo-1).",
        nees: Measured => "Squared error over computed variance.",
    }
}

/// The three rules: at the prediction, equation (14) as printed, equation (14) with the exact update.
const RULES: [&str; 3] = ["prediction", "eq14", "eq14_exact"];

/// Time averages of one run: squared error for each rule, plain and normalised.
fn one_run(
    plant: &ScalarPlant,
    start: &Gaussian<1>,
    p: &Parameters,
    stream: Stream,
) -> Result<[[f64; 3]; 2], fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let mut state = start.sample(&mut rng);
    let mut beliefs = [*start; 3];
    let mut sums = [[0.0; 3]; 2];
    for n in 0..p.burn + p.steps {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let ask = |threshold: f64| Ok::<_, fewbits_dymbo::Error>(Observation::Received(Sign::of(sample, threshold)?));
        beliefs[0] = filter.step(&beliefs[0], &ask(filter.threshold(&beliefs[0]))?)?.0;
        // Equation (14) as printed: the threshold is the old estimate, the update that of a bit at the prediction.
        beliefs[1] = filter.step(&beliefs[1], &ask(beliefs[1].mean()[0])?)?.0;
        let old = beliefs[2].mean()[0];
        let factor = filter.scheme().factor(&old, &ask(old)?, filter.link())?;
        beliefs[2] = assumed_density::update(&filter.predict(&beliefs[2]), &Matrix1::identity(), &factor)?.0;
        if n >= p.burn {
            for (i, belief) in beliefs.iter().enumerate() {
                let squared = (belief.mean()[0] - state[0]).powi(2);
                sums[0][i] += squared;
                sums[1][i] += squared / belief.covariance()[0];
            }
        }
    }
    Ok(sums.map(|sums| sums.map(|sum| sum / p.steps as f64)))
}

/// Excess of `b` over `a` relative to `a`, from paired runs.
fn relative(a: &[f64], b: &[f64]) -> Measured {
    let ratio = b.iter().sum::<f64>() / a.iter().sum::<f64>();
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    let residuals: Moments = a.iter().zip(b).map(|(a, b)| (b - ratio * a) / mean).collect();
    Measured::new(ratio - 1.0, Measured::from(residuals).standard_error)
}

pub struct ThresholdPlace;

impl Figure for ThresholdPlace {
    figure!(Parameters => Vec<Row>, "dymbo-threshold", "Where the threshold belongs", "Ribeiro and Giannakis, equation (14)",
        "Steady mean squared error with the threshold at the prediction a theta_hat(n-1), at theta_hat(n-1) as equation \
         (14) prints it with the update unchanged, and the same with the exact update (erratum dymbo-1). For a > 0 the mistake \
         hides within the width of a line; for a < 0 it is a catastrophe."; semilog("mean squared error / sigma^2"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for &plant in &p.plants {
            let (model, start) = (plant.model()?, plant.stationary()?);
            let stream = context.stream(self.about().id).named(&plant.to_string());
            let runs = context.trials(stream, p.trials, |trial| Ok(one_run(&model, &start, p, trial.stream)?))?;
            let of = |what: usize, rule: usize| runs.iter().map(|run| run[what][rule]).collect::<Vec<f64>>();
            rows.extend(RULES.iter().enumerate().map(|(i, rule)| Row {
                plant,
                rule,
                mse: of(0, i).into_iter().collect(),
                excess: relative(&of(0, 0), &of(0, i)),
                nees: of(1, i).into_iter().collect(),
            }));
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let what = "no rule but the prediction's is as good where a is negative";
        let others = select(rows, |r| r.plant.a < 0.0 && r.rule != "prediction");
        claims
            .at_defaults()
            .all("negative", what, others, |r| r.excess.value > 4.0 * r.excess.error());
    }
}
