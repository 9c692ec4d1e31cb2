//! Lost bits.

use super::common::{Plant, each};
use crate::prelude::*;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observation, Sensing, Sign};
use fewbits_dymbo::{DymboFilter, ScalarFilter, ScalarPlant, steady};
use rand::RngExt;

const ID: &str = "dymbo-erasure";

parameters! {
    pub struct Parameters {
        a: f64 [-0.999_999..=0.999_999] = 0.9 => "Plant coefficient; the state starts from its stationary law.",
        gamma: Vec<f64> [1e-6..=1e3; 1..] = vec![0.5, 0.05] => "Process variances over measurement variance.",
        loss: Vec<f64> [0.0..=0.999_999; 1..] = vec![0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7] => "Probabilities that a bit is lost.",
        steps: u64 [1..=10_000] = 1000 => "Steps of a run that are measured.",
        burn: u64 [..=10_000] = 100 => "Steps before them.",
        trials: u64 [2..=100_000_000] = 2_000 => quick 100 => "Simulated runs.",
    }
}

rows! {
    pub struct Row by "{plant} {loss}" {
        plant: Plant,
        loss: f64 => "Probability that a bit is lost.",
        trials: u64 => "Simulated runs.",
        mean_variance: Measured ["sigma^2"] => "Mean of the computed variance.",
        mse: Measured ["sigma^2"] => "Mean squared error.",
        bound: f64 ["sigma^2"] => "Upper bound on the mean variance.",
    }
}

/// Time averages of one run: computed variance and squared error.
fn one_run(
    plant: &ScalarPlant,
    start: &Gaussian<1>,
    loss: f64,
    p: &Parameters,
    stream: Stream,
) -> Result<[f64; 2], fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let mut belief = *start;
    let mut state = belief.sample(&mut rng);
    let mut sums = [0.0; 2];
    for n in 0..p.burn + p.steps {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let bit = Sign::of(sample, filter.threshold(&belief))?;
        let observation = if rng.random_bool(loss) {
            Observation::Lost
        } else {
            Observation::Received(bit)
        };
        belief = filter.step(&belief, &observation)?.0;
        if n >= p.burn {
            sums[0] += belief.covariance()[0];
            sums[1] += (belief.mean()[0] - state[0]).powi(2);
        }
    }
    Ok(sums.map(|sum| sum / p.steps as f64))
}

/// Mean variance and error against the probability of loss.
pub struct LostBits;

impl Figure for LostBits {
    figure!(Parameters => Vec<Row>, ID, "Lost bits", "",
        "Mean computed variance and mean squared error when each bit is lost with a probability that both ends notice \
         (points), below the bound that averages the information, (1 - p) 2/pi, in closed form (line).");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut cases = Vec::new();
        for plant in each(p.a, &p.gamma) {
            let (model, start) = (plant.model()?, plant.stationary()?);
            cases.extend(p.loss.iter().map(|loss| (plant, model, start, *loss)));
        }
        let name = |case: &(Plant, _, _, f64)| format!("{} {}", case.0.gamma, case.3);
        let empty = |_: &_| [Moments::default(); 2];
        let sums = context.sweep(ID, p.trials, &cases, name, empty, |(_, model, start, loss), sums, trial| {
            let run = one_run(model, start, *loss, p, trial.stream)?;
            sums.iter_mut().zip(run).for_each(|(sum, mean)| sum.add(mean));
            Ok::<_, fewbits_dymbo::Error>(())
        })?;
        let row = |((plant, model, _, loss), sums): (&(Plant, ScalarPlant, _, f64), &[Moments; 2])| {
            Ok(Row {
                plant: *plant,
                loss: *loss,
                trials: p.trials,
                mean_variance: Measured::mean(&sums[0]),
                mse: Measured::mean(&sums[1]),
                bound: steady::erasure_bound(model, &Link::lossy(*loss)?)?.filtered_variance,
            })
        };
        cases.iter().zip(&sums).map(row).collect()
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let noise = |m: Measured| 4.5 * m.standard_error.unwrap_or(0.0);
        let what = "the mean variance stays below the bound (Jensen), within 4.5 standard errors";
        claims.all("bounded", what, rows, |r| r.mean_variance.value <= r.bound + noise(r.mean_variance) + 1e-12);
        claims.keyed("mean", "mean variance at a, gamma, loss", rows, |r| r.mean_variance);
        claims.keyed("bound", "the bound at a, gamma, loss", rows, |r| r.bound);
        let printed = || rows.iter().filter(|r| [0.1, 0.3, 0.5].contains(&r.loss));
        let what = "the bound is tight to 0.35 %";
        here.all("tight", what, printed(), |r| r.bound <= 1.0035 * r.mean_variance.value + noise(r.mean_variance));
        let what = "the error is the computed variance within 0.5 %";
        here.all("consistent", what, printed(), |r| {
            (r.mse.value - r.mean_variance.value).abs() <= 0.005 * r.mean_variance.value + noise(r.mse)
        });
        for r in rows.iter().filter(|r| r.loss == 0.0) {
            let what = format!("gamma = {}: without loss it is the steady variance", r.plant.gamma);
            let ratio = r
                .plant
                .sign_bit_variance()
                .ok()
                .map(|steady| r.mean_variance.value / steady);
            claims.near(format!("clean-{}", r.plant.gamma), what, ratio, 1.0, 1e-6);
        }
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let panel = |rows: &[Row]| {
            let (x, y) = (Axis::linear("probability that a bit is lost"), Axis::linear("variance / sigma^2"));
            Panel::new(rows[0].plant.title(), x, y)
                .with(Layer::line("bound on the mean variance", points(rows, |r| (r.loss, r.bound))).coloured(0))
                .with(Layer::measured("mean squared error", rows, |r| (r.loss, r.mse)).coloured(1))
        };
        Plot::grid(2, rows.chunks(p.loss.len()).map(panel).collect())
    }
}
