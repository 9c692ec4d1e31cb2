//! What the missing bits cost: the loss over the plane of plants.

use super::common::{bad, log_spaced, nearest, not_empty, plant};
use crate::legacy::claim::{largest, smallest};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_dymbo::{ScalarPlant, chain, steady};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_2_PI, PI};

const ID: &str = "dymbo-fig4";

/// The grid and the contour levels.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
    level: Vec<f64>,
    /// Coefficients at which the exact loss is computed as well.
    exact_a: Vec<f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        let hundredths = |i: i32| f64::from(i) / 100.0;
        Self {
            a: (0..=100).map(hundredths).collect(),
            gamma: log_spaced(-3.0, 1.0, 81),
            level: vec![1.05, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0],
            exact_a: (0..=19).map(|i| hundredths(5 * i)).chain([0.99, 1.0]).collect(),
        }
    }
}

/// Noise ratios in the picture.
const SHOWN: std::ops::RangeInclusive<f64> = 1e-3..=10.0;

pub(super) struct Loss;

fn loss(a: f64, gamma: f64) -> Result<f64, Error> {
    Ok(steady::loss(&plant(ID, a, gamma)?)?)
}

/// Where the exact loss is two, as a noise ratio.
fn exact_double(a: f64) -> Result<Option<f64>, Error> {
    let at = |log: f64| chain::true_loss(&ScalarPlant::with_noise_ratio(a, log.exp())?);
    Ok(steady::crossing(2.0, (-0.7, 1.5), at)?.map(f64::exp))
}

impl Figure for Loss {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Loss against the Kalman filter",
            caption: "Contours of the steady variance of the sign-bit filter over that of the Kalman filter. One bit costs nearly \
                      nothing for slow plants. The paper's `below 2 whenever gamma < 1` fails in the corner near |a| = 1; the \
                      exact loss (dashed) is a little larger than the Riccati prediction.",
            source: "Ribeiro and Giannakis, Fig. 4",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        for (name, list) in [("a", &p.a), ("gamma", &p.gamma), ("level", &p.level)] {
            not_empty(ID, name, list)?;
        }
        for &a in p.a.iter().chain(&p.exact_a) {
            p.gamma.iter().try_for_each(|g| plant(ID, a, *g).map(drop))?;
        }
        match p.level.iter().find(|level| **level <= 1.0) {
            Some(level) => Err(bad(ID, "level", level, "losses above 1")),
            None => Ok(()),
        }
    }

    fn quicken(&self, p: &mut Parameters) {
        p.exact_a = vec![0.0, 0.5, 0.9, 1.0];
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("loss_riccati", "", "steady variance over the Kalman filter's, closed form"),
            column("loss_true", "", "the same with the exact mean squared error"),
        ]);
        let cells: Vec<(f64, f64)> = p.a.iter().flat_map(|a| p.gamma.iter().map(move |g| (*a, *g))).collect();
        let rows: Vec<_> = cells
            .par_iter()
            .map(|&(a, gamma)| {
                let exact = if p.exact_a.contains(&a) {
                    Some(chain::true_loss(&plant(ID, a, gamma)?)?)
                } else {
                    None
                };
                Ok(row![a, gamma, loss(a, gamma)?, exact])
            })
            .collect::<Result<_, Error>>()?;
        rows.into_iter().try_for_each(|row| table.push(row))?;

        let mut contours = Table::new([
            column("kind", "", "riccati or exact"),
            column("level", "", "loss"),
            column("a", "", "plant coefficient"),
            column("gamma", "", "noise ratio at which the loss reaches the level"),
        ]);
        for &level in &p.level {
            for &a in &p.a {
                if let Some(gamma) = steady::noise_ratio_at_loss(level, a)? {
                    contours.push(row!["riccati", level, a, gamma])?;
                }
            }
        }
        let exact: Vec<_> = p
            .exact_a
            .par_iter()
            .map(|a| Ok((*a, exact_double(*a)?)))
            .collect::<Result<_, Error>>()?;
        for (a, gamma) in exact {
            if let Some(gamma) = gamma {
                contours.push(row!["exact", 2.0, a, gamma])?;
            }
        }
        Ok(Tables::from(table).with("contours", contours))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let riccati = tables.main.numbers("loss_riccati")?;
        let mut claims = vec![Claim::at_least(
            "at-least-one",
            "the loss is never below 1",
            smallest(riccati),
            1.0,
        )];
        claims.extend(shape_claims()?);
        claims.extend(limit_claims()?);

        let statement = "largest loss over |a| <= 1, gamma <= 1, at the corner";
        let corner = (PI / 4.0 * (1.0 + (1.0 + 8.0 / PI).sqrt()) - 1.0) / ((5.0_f64.sqrt() - 1.0) / 2.0);
        claims.push(Claim::near("corner", statement, loss(1.0, 1.0)?, corner, 1e-12));
        claims.push(Claim::near("corner-value", statement, corner, 2.045951665822, 1e-11));

        let contours = tables.named("contours")?;
        let double = contours
            .only("kind", "riccati")?
            .only("level", 2.0)?
            .points("a", "gamma")?;
        for (a, gamma, digits) in [
            (0.0, 2.751938393884, 1e-10),
            (0.5, 2.289387185, 1e-8),
            (0.75, 1.717071801, 1e-8),
            (0.9, 1.268577635602, 1e-10),
            (0.95, 1.101845079, 1e-8),
            (0.99, 0.962140128, 1e-8),
            (1.0, 0.926310609465, 1e-10),
        ] {
            let (id, statement) = (format!("double-{a}"), format!("noise ratio at which the loss is 2 for a = {a}"));
            claims.push(Claim::near(id, statement, nearest(&double, a), gamma, digits).at_defaults());
        }
        let root = steady::coefficient_at_loss(2.0, 1.0)?.unwrap_or(f64::NAN);
        let statement = "E4: at gamma = 1 the loss exceeds 2 beyond this |a| (the paper: nowhere)";
        claims.push(Claim::near("e4-riccati", statement, root, 0.979320618683, 1e-10));

        let exact = tables.main.points("loss_riccati", "loss_true")?;
        let below = exact
            .iter()
            .filter(|(riccati, exact)| *exact < riccati * (1.0 - 1e-10))
            .count();
        claims.push(Claim::never("exact-above", "the exact loss is nowhere below the Riccati loss", below));
        let ratio = largest(exact.iter().map(|(riccati, exact)| exact / riccati));
        let statement = "the Riccati loss is right to 6 % on the whole grid";
        claims.push(Claim::at_most("exact-close", statement, ratio, 1.06).at_defaults());
        for (a, gamma, value, digits) in [
            (0.9, 0.5, 1.559659509, 1e-8),
            (0.9, 1.0, 1.859131, 1e-6),
            (1.0, 1.0, 2.069546, 1e-6),
        ] {
            let (id, statement) = (format!("exact-{a}-{gamma}"), format!("exact loss at a = {a}, gamma = {gamma}"));
            claims.push(Claim::near(id, statement, chain::true_loss(&plant(ID, a, gamma)?)?, value, digits));
        }
        let double = contours.only("kind", "exact")?.points("a", "gamma")?;
        let statement = "exact loss 2 at a = 1";
        claims.push(Claim::near("exact-double-1", statement, nearest(&double, 1.0), 0.892584, 1e-6).at_defaults());
        let at = |a: f64| chain::true_loss(&ScalarPlant::with_noise_ratio(a, 1.0)?);
        let root = steady::crossing(2.0, (0.9, 1.0), at)?.unwrap_or(f64::NAN);
        claims.push(Claim::near("exact-double-gamma-1", "exact loss 2 at gamma = 1", root, 0.971111, 1e-6));
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let contours = tables.named("contours")?;
        let riccati = contours.only("kind", "riccati")?;
        let (x, y) = (Axis::log("gamma = process / measurement variance"), Axis::linear("plant coefficient a"));
        let mut panel = Panel::new(
            "Loss: steady variance over the Kalman filter's",
            x.between(*SHOWN.start(), *SHOWN.end()),
            y.between(0.0, 1.0),
        );
        for (i, &level) in p.level.iter().enumerate() {
            // Contours that leave the picture would pile up at its edge.
            let mut curve = riccati.only("level", level)?.points("gamma", "a")?;
            curve.retain(|(gamma, _)| SHOWN.contains(gamma));
            panel = panel.with(Layer::line(format!("{level}"), curve).coloured(i));
        }
        let exact = contours.only("kind", "exact")?.points("gamma", "a")?;
        panel = panel.with(Layer::dashed("2, exact", exact).coloured(p.level.len()));
        Ok(Plot::of(panel.legend(Legend::Outside)))
    }
}

/// Monotone and even, on a grid finer than the table's.
fn shape_claims() -> Result<Vec<Claim>, Error> {
    let gammas = log_spaced(-3.0, 1.0, 400);
    let (mut falls_a, mut falls_gamma, mut uneven, mut doubled) = (0, 0, 0, 0);
    let mut before: Vec<f64> = Vec::new();
    for i in 0..=200 {
        let a = f64::from(i) / 200.0;
        let line = gammas.iter().map(|g| loss(a, *g)).collect::<Result<Vec<_>, _>>()?;
        falls_a += before.iter().zip(&line).filter(|(b, l)| b >= l).count();
        falls_gamma += line.windows(2).filter(|w| w[0] >= w[1]).count();
        for (gamma, value) in gammas.iter().zip(&line) {
            uneven += usize::from(loss(-a, *gamma)? != *value);
            doubled += usize::from((a <= 0.979 && *gamma <= 1.0 || *gamma <= 0.926) && *value >= 2.0);
        }
        before = line;
    }
    Ok(vec![
        Claim::never("rises-with-a", "the loss increases strictly with |a| (201 x 400 plants)", falls_a),
        Claim::never("rises-with-gamma", "the loss increases strictly with gamma (201 x 400 plants)", falls_gamma),
        Claim::never("even", "the loss is even in a", uneven),
        Claim::never(
            "below-two",
            "E4: the loss is below 2 for |a| <= 0.979 and gamma <= 1, or gamma <= 0.926",
            doubled,
        ),
    ])
}

fn limit_claims() -> Result<Vec<Claim>, Error> {
    let mut claims = Vec::new();
    for a in [0.0, 0.5, 0.9] {
        let gamma = 1e-7;
        let slope = (loss(a, gamma)? - 1.0) / gamma * (1.0 - a * a).powi(2);
        let statement = format!("a = {a}, gamma to 0: loss - 1 = (1 - 2/pi) gamma/(1 - a^2)^2");
        claims.push(Claim::near_relative(format!("slow-{a}"), statement, slope, 1.0 - FRAC_2_PI, 1e-4));
    }
    let slow = loss(1.0, 1e-20)?;
    claims.push(Claim::near("slow-1", "a = 1, gamma to 0: sqrt(pi/2), not pi/2 (E5)", slow, (PI / 2.0).sqrt(), 1e-9));
    for a in [0.0, 0.5, 1.0] {
        let gamma = 1e9;
        let slope = loss(a, gamma)? / gamma;
        let expected = (1.0 - FRAC_2_PI) / (1.0 - a * a * (1.0 - FRAC_2_PI));
        let statement = format!("a = {a}, gamma to infinity: loss/gamma = (1 - 2/pi)/(1 - a^2 (1 - 2/pi))");
        claims.push(Claim::near_relative(format!("fast-{a}"), statement, slope, expected, 1e-6));
    }
    let still = ScalarPlant::new(1.0, 0.0, 1.0)?;
    let after = |c: f64| (0..100_000).fold(1.0, |m, _| still.filtered_variance(m, c));
    let statement = "E5: pi/2 is the ratio for a constant parameter, after 100000 samples";
    claims.push(Claim::near("static", statement, after(FRAC_2_PI) / after(1.0), 1.570889, 1e-6));
    Ok(claims)
}
