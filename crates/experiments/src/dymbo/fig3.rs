//! How much of the measurement noise the filters remove, against the noise ratio.

use super::common::{dymbo_steady, kalman_variance, log_spaced, nearest, not_empty, plant};
use crate::legacy::claim::{not_increasing, smallest};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-fig3";

/// Coefficients and noise ratios.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: vec![0.5, 0.9, 0.99],
            gamma: log_spaced(-3.0, 1.0, 81),
        }
    }
}

pub(super) struct KalmanVariance;

impl Figure for KalmanVariance {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Steady variance against the noise ratio",
            caption: "Steady filtered variance over the measurement variance, of the Kalman filter (solid) and of the sign-bit filter \
                      (dashed). A slow plant (small gamma) is averaged over many samples; a fast one leaves the last sample \
                      alone, and then one bit falls behind.",
            source: "Ribeiro and Giannakis, Fig. 3",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "a", &p.a)?;
        not_empty(ID, "gamma", &p.gamma)?;
        p.a.iter()
            .try_for_each(|a| p.gamma.iter().try_for_each(|g| plant(ID, *a, *g).map(drop)))
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("kf_reduction", "sigma^2", "steady filtered variance of the Kalman filter"),
            column("dymbo_reduction", "sigma^2", "steady filtered variance of the sign-bit filter"),
        ]);
        for &a in &p.a {
            for &gamma in &p.gamma {
                let plant = plant(ID, a, gamma)?;
                table.push(row![
                    a,
                    gamma,
                    kalman_variance(&plant)?,
                    dymbo_steady(&plant)?.filtered_variance
                ])?;
            }
        }
        Ok(table.into())
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        for scheme in ["kf", "dymbo"] {
            let name = format!("{scheme}_reduction");
            let mut falls = 0;
            for &a in &p.a {
                falls += not_increasing(&tables.main.only("a", a)?.numbers(&name)?);
            }
            let statement = format!("the {scheme} variance increases strictly with gamma");
            claims.push(Claim::never(format!("{scheme}-rises-with-gamma"), statement, falls).at_defaults());
            let mut falls = 0;
            for &gamma in &p.gamma {
                falls += not_increasing(&tables.main.only("gamma", gamma)?.numbers(&name)?);
            }
            let statement = format!("the {scheme} variance increases strictly with |a|");
            claims.push(Claim::never(format!("{scheme}-rises-with-a"), statement, falls).at_defaults());
        }
        let kalman = tables.main.numbers("kf_reduction")?;
        let statement = "the Kalman variance stays below that of one measurement";
        claims.push(Claim::never("kf-below-one", statement, kalman.iter().filter(|m| **m >= 1.0).count()));
        let excess = kalman
            .iter()
            .zip(tables.main.numbers("dymbo_reduction")?)
            .map(|(kf, dymbo)| dymbo - kf);
        claims.push(Claim::at_least("dymbo-above-kf", "the sign-bit filter is nowhere better", smallest(excess), 0.0));
        for &a in &p.a {
            let large = kalman_variance(&plant(ID, a, 1e8)?)?;
            let statement = format!("a = {a}: a fast plant leaves one measurement");
            claims.push(Claim::near(format!("limit-fast-{a}"), statement, large, 1.0, 1e-7));
            if a.abs() < 1.0 {
                let gamma = 1e-9;
                let small = kalman_variance(&plant(ID, a, gamma)?)? * (1.0 - a * a) / gamma;
                let statement = format!("a = {a}: a slow plant keeps its own variance gamma/(1 - a^2)");
                claims.push(Claim::near(format!("limit-slow-{a}"), statement, small, 1.0, 1e-4));
            }
        }
        let expected = [
            (0.5, [0.013101431739, 0.531128874149, 0.910934831]),
            (0.9, [0.042637333914, 0.597407287258, 0.914828459]),
            (0.99, [0.086901783027, 0.615926716308, 0.915950303]),
        ];
        for (a, values) in expected {
            let curve = tables.main.only("a", a)?.points("gamma", "kf_reduction")?;
            for ((gamma, value), digits) in [0.01, 1.0, 10.0].into_iter().zip(values).zip([1e-10, 1e-10, 1e-9]) {
                let (id, statement) =
                    (format!("kf-{a}-{gamma}"), format!("Kalman variance at a = {a}, gamma = {gamma}"));
                claims.push(Claim::near_relative(id, statement, nearest(&curve, gamma), value, digits).at_defaults());
            }
        }
        let statement = "E6: at gamma = 2 the Kalman variance is no longer about half the measurement's (a = 0.9)";
        claims.push(Claim::near("e6", statement, kalman_variance(&plant(ID, 0.9, 2.0)?)?, 0.721, 5e-4));
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let x = Axis::log("gamma = process / measurement variance");
        let mut panel =
            Panel::new("Steady variance", x, Axis::log("filtered variance / sigma^2")).legend(Legend::BottomRight);
        for (i, &a) in p.a.iter().enumerate() {
            let rows = tables.main.only("a", a)?;
            panel = panel
                .with(Layer::line(format!("Kalman, a = {a}"), rows.points("gamma", "kf_reduction")?).coloured(i))
                .with(
                    Layer::dashed(format!("sign bit, a = {a}"), rows.points("gamma", "dymbo_reduction")?).coloured(i),
                );
        }
        Ok(Plot::of(panel))
    }
}
