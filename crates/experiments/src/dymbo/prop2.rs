//! The fine first message: what it brings, and the variance to start from.

use super::common::{bad, not_empty};
use crate::legacy::claim::smallest;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_core::Gaussian;
use fewbits_dymbo::chain::first_message_transient;
use fewbits_dymbo::{FineSensor, ScalarPlant, first_message_mse};
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-prop2";

/// Noise deviation and resolutions; the plant of the start-up comparison.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    sigma: f64,
    tau: Vec<f64>,
    a: f64,
    gamma: Vec<f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            sigma: 1.0,
            tau: vec![0.25, 0.5, 1.0, 2.0, 4.0],
            a: 0.9,
            gamma: vec![0.5, 0.05],
        }
    }
}

pub(super) struct FirstMessage;

impl Parameters {
    fn plant(&self, gamma: f64) -> Result<ScalarPlant, Error> {
        let noise = self.sigma * self.sigma;
        Ok(ScalarPlant::new(self.a, gamma * noise, noise)?)
    }
}

impl Figure for FirstMessage {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "The fine first message",
            caption: "Mean squared error of the first sample rounded to a multiple of tau, at the worst place of the state: exact, \
                      sigma^2 + tau^2/12, and the paper's bound (sigma + tau/2)^2. The bound is valid but loose; a filter that \
                      starts from it (right) is over-cautious for several steps (E7).",
            source: "Ribeiro and Giannakis, Proposition 2",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "tau", &p.tau)?;
        not_empty(ID, "gamma", &p.gamma)?;
        for (name, value) in p.tau.iter().map(|t| ("tau", *t)).chain([("sigma", p.sigma)]) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(ID, name, value, "a finite number above 0"));
            }
        }
        p.gamma
            .iter()
            .try_for_each(|gamma| super::common::plant(ID, p.a, *gamma).map(drop))
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("tau", "unit", "resolution of the first message"),
            column("exact_sup", "unit^2", "mean squared error at the worst state"),
            column("tight", "unit^2", "sigma^2 + tau^2/12"),
            column("printed_bound", "unit^2", "(sigma + tau/2)^2"),
        ]);
        let plant = p.plant(1.0)?;
        for &tau in &p.tau {
            let sensor = FineSensor::new(tau)?;
            let worst = first_message_mse(&plant, &sensor, &Gaussian::scalar(0.5 * tau, 0.0)?);
            let noise = p.sigma * p.sigma;
            table.push(row![tau, worst, noise + tau * tau / 12.0, (p.sigma + 0.5 * tau).powi(2)])?;
        }
        let mut starts = Table::new([
            column("gamma", "", "process variance over measurement variance"),
            column("n", "", "step"),
            column("start", "", "initial variance: tight or printed"),
            column("mse", "unit^2", "exact mean squared error"),
            column("nees", "", "exact error over computed variance"),
        ]);
        // Where the paper starts: a resolution of one noise deviation.
        let tau = p.sigma;
        for &gamma in &p.gamma {
            let plant = p.plant(gamma)?;
            for (name, variance) in [("tight", tau * tau * 13.0 / 12.0), ("printed", 2.25 * tau * tau)] {
                for (n, step) in first_message_transient(&plant, tau, variance, 12)?
                    .into_iter()
                    .enumerate()
                {
                    starts.push(row![gamma, n, name, step.mse, step.mse / step.filtered_variance])?;
                }
            }
        }
        Ok(Tables::from(table).with("starts", starts))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (exact, bound) = (tables.main.numbers("exact_sup")?, tables.main.numbers("printed_bound")?);
        let slack = smallest(exact.iter().zip(&bound).map(|(e, b)| b - e));
        let mut claims = vec![Claim::at_least(
            "valid",
            "the printed bound is valid (Minkowski)",
            slack,
            0.0,
        )];
        let expected = [1.005208333, 1.020833333, 1.083333344306, 1.365015638, 4.002026959];
        for ((tau, value), expected) in p.tau.iter().zip(&exact).zip(expected) {
            let statement = format!("worst mean squared error at tau = {tau}");
            claims.push(Claim::near(format!("exact-{tau}"), statement, *value, expected, 1e-9).at_defaults());
        }
        if let Some(i) = p.tau.iter().position(|t| *t == p.sigma) {
            let statement = "E7: at tau = sigma the printed bound is 2.08 times the truth";
            claims.push(Claim::near_relative("loose", statement, bound[i] / exact[i], 2.0769, 1e-4));
            let statement = "E8: tau = sigma already costs only 8.3 %";
            claims.push(Claim::near("cheap", statement, exact[i] / (p.sigma * p.sigma), 1.0833, 1e-4));
        }
        let starts = tables.named("starts")?;
        for (gamma, printed, tight) in [(0.5, 0.9615, 0.8692), (0.05, 0.7645, 0.6432)] {
            for (start, value) in [("printed", printed), ("tight", tight)] {
                let rows = starts.only("gamma", gamma)?.only("start", start)?.only("n", 1.0)?;
                let mse = rows.numbers("mse")?.first().copied().unwrap_or(f64::NAN);
                let statement = format!("E7: error after one bit from the {start} variance, gamma = {gamma}");
                claims.push(Claim::near(format!("{start}-{gamma}"), statement, mse, value, 5e-5).at_defaults());
            }
        }
        let cautious = starts.only("gamma", 0.5)?.only("start", "printed")?.numbers("nees")?;
        for ((n, value), expected) in cautious.iter().enumerate().zip([0.48, 0.75, 0.87]) {
            let statement = format!("E7: normalised error after {n} bits from the printed bound, gamma = 0.5");
            claims.push(Claim::near(format!("nees-{n}"), statement, *value, expected, 0.006).at_defaults());
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let y = Axis::log("mean squared error");
        let left = Panel::new("First message", Axis::log("resolution tau"), y.clone())
            .with(Layer::points("exact, worst state", tables.main.points("tau", "exact_sup")?).coloured(0))
            .with(Layer::line("sigma^2 + tau^2/12", tables.main.points("tau", "tight")?).coloured(0))
            .with(Layer::dashed("printed bound", tables.main.points("tau", "printed_bound")?).coloured(1))
            .legend(Legend::TopLeft);
        let starts = tables.named("starts")?;
        let mut right = Panel::new(
            "Consistency after the start",
            Axis::linear("step n"),
            Axis::linear("exact error / computed variance"),
        )
        .legend(Legend::BottomRight);
        for (i, &gamma) in p.gamma.iter().enumerate() {
            let of = |start: &str| starts.only("gamma", gamma)?.only("start", start)?.points("n", "nees");
            right = right
                .with(Layer::line(format!("tight start, gamma = {gamma}"), of("tight")?).coloured(2 * i))
                .with(Layer::dashed(format!("printed start, gamma = {gamma}"), of("printed")?).coloured(2 * i + 1));
        }
        Ok(Plot::grid(2, vec![left, right]))
    }
}
