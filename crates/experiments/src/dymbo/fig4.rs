//! What the missing bits cost: the loss over the plane of plants.

use super::common::{Plant, each, log_spaced};
use crate::prelude::*;
use fewbits_dymbo::{chain, filtered_variance, steady};
use std::f64::consts::{FRAC_2_PI, PI};

fn hundredths(i: i32) -> f64 {
    f64::from(i) / 100.0
}

parameters! {
    pub struct Parameters {
        a: Vec<f64> [-1.0..=1.0; 1..] = (0..=100).map(hundredths).collect() => "Plant coefficients.",
        gamma: Vec<f64> [1e-6..=1e3; 1..] = log_spaced(-3.0, 1.0, 81) => "Process variances over measurement variance.",
        level: Vec<f64> [1.000_001..=1e6; 1..] = vec![1.05, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0] => "Losses of the contours.",
        /// Coefficients at which the exact loss is computed as well.
        exact_a: Vec<f64> [-1.0..=1.0] = (0..=19).map(|i| hundredths(5 * i)).chain([0.99, 1.0]).collect() => quick vec![0.0, 0.5, 0.9, 1.0],
    }
}

rows! {
    pub struct Rows {
        plane: Vec<Row> => "The plane of plants.",
        contours: Vec<Contour> => "Where the loss reaches each level.",
    }

    struct Row {
        plant: Plant,
        loss_riccati: f64 => "Steady variance over the Kalman filter's, closed form.",
        loss_true: Option<f64> => "The same with the exact mean squared error.",
    }

    struct Contour by "{a}" {
        kind: &'static str => "Riccati or exact.",
        level: f64 => "Loss.",
        a: f64 => "Plant coefficient.",
        gamma: f64 => "Noise ratio at which the loss reaches the level.",
    }
}

fn loss(a: f64, gamma: f64) -> Option<f64> {
    steady::loss(&Plant { a, gamma }.model().ok()?).ok()
}

pub struct Loss;

impl Figure for Loss {
    figure!(Parameters => Rows, "dymbo-fig4", "Loss against the Kalman filter", "Ribeiro and Giannakis, Fig. 4",
        "Contours of the steady variance of the sign-bit filter over that of the Kalman filter. One bit costs nearly \
         nothing for slow plants. The paper's `below 2 whenever gamma < 1` fails in the corner near |a| = 1; the \
         exact loss (dashed) is a little larger than the Riccati prediction.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let plants: Vec<Plant> = p.a.iter().flat_map(|a| each(*a, &p.gamma)).collect();
        let row = |plant: &Plant| {
            let model = plant.model()?;
            let exact = p.exact_a.contains(&plant.a).then(|| chain::true_loss(&model));
            Ok::<_, Error>(Row {
                plant: *plant,
                loss_riccati: steady::loss(&model)?,
                loss_true: exact.transpose()?,
            })
        };
        let plane = parallel::try_map(&plants, row)?;
        let mut contours = Vec::new();
        let mut push = |kind, level, a, gamma: Option<f64>| {
            contours.extend(gamma.map(|gamma| Contour { kind, level, a, gamma }));
        };
        for &level in &p.level {
            for &a in &p.a {
                push("riccati", level, a, steady::noise_ratio_at_loss(level, a)?);
            }
        }
        let exact = |a: &f64| Ok::<_, Error>((*a, chain::noise_ratio_at_loss(2.0, *a)?));
        for (a, gamma) in parallel::try_map(&p.exact_a, exact)? {
            push("exact", 2.0, a, gamma);
        }
        Ok(Rows { plane, contours })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "the loss is never below 1 (erratum dymbo-3)";
        claims.all("at-least-one", what, &rows.plane, |r| r.loss_riccati >= 1.0);
        shapes(claims);
        limits(claims);
        let what = "largest loss over |a| <= 1, gamma <= 1, at the corner";
        let corner = (PI / 4.0 * (1.0 + (1.0 + 8.0 / PI).sqrt()) - 1.0) / ((5.0_f64.sqrt() - 1.0) / 2.0);
        claims.near("corner", what, loss(1.0, 1.0), corner, 1e-12);
        let double = |kind: &'static str| select(&rows.contours, move |c| c.kind == kind && c.level == 2.0);
        claims.keyed("double-riccati", "noise ratio of loss 2 at a", double("riccati"), |c| c.gamma);
        claims.keyed("double-exact", "noise ratio of exact loss 2 at a", double("exact"), |c| c.gamma);
        let root = steady::coefficient_at_loss(2.0, 1.0).ok().flatten();
        let what = "at gamma = 1 the loss exceeds 2 beyond this |a| (the paper: nowhere) (erratum dymbo-4)";
        claims.near("double-gamma-1", what, root, 0.979320618683, 1e-10);
        let root = chain::coefficient_at_loss(2.0, 1.0).ok().flatten();
        claims.near("exact-double-gamma-1", "exact loss 2 at gamma = 1", root, 0.971111, 1e-6);
        let exact = || rows.plane.iter().filter_map(|r| Some(r.loss_true? / r.loss_riccati));
        let what = "the exact loss is nowhere below the Riccati loss";
        here.all("exact-above", what, exact(), |ratio| ratio >= 1.0 - 1e-10);
        here.all("exact-close", "the Riccati loss is right to 6 % on the whole grid", exact(), |ratio| ratio <= 1.06);
        let named = super::common::plants([(0.9, 0.5), (0.9, 1.0), (1.0, 1.0)]);
        let exact = |plant: Plant| plant.model().ok().and_then(|model| chain::true_loss(&model).ok());
        claims.references("exact", "exact loss at a, gamma", named, |plant| (plant.to_string(), exact(plant)));
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let (x, y) = (Axis::log("gamma = process / measurement variance"), Axis::linear("plant coefficient a"));
        let mut panel =
            Panel::new("Loss: steady variance over the Kalman filter's", x.between(1e-3, 10.0), y.between(0.0, 1.0));
        let curve = |kind: &str, level: f64| {
            let shown = |c: &&Contour| c.kind == kind && c.level == level;
            points(rows.contours.iter().filter(shown), |c| (c.gamma, c.a))
        };
        for (i, &level) in p.level.iter().enumerate() {
            let mut line = curve("riccati", level);
            // The table is too coarse for a contour that comes near a = 1 without reaching it.
            let last = line.last().map_or(1.0, |(_, a)| *a);
            let near_one = (1..12).map(|k| 1.0 - 0.01 * 0.5_f64.powi(k)).filter(|a| *a > last);
            line.extend(near_one.filter_map(|a| Some((steady::noise_ratio_at_loss(level, a).ok()??, a))));
            panel = panel.with(Layer::line(level.to_string(), line).coloured(i).inline());
        }
        panel = panel.with(Layer::dashed("2, by the exact error", curve("exact", 2.0)).coloured(p.level.len()));
        Plot::of(panel)
    }
}

/// Monotone and even, on a grid finer than the table's.
fn shapes(claims: &mut Claims) {
    let gammas = log_spaced(-3.0, 1.0, 400);
    let line = |a: f64| -> Vec<f64> { gammas.iter().map(|g| loss(a, *g).unwrap_or(f64::NAN)).collect() };
    let a = |i: usize| i as f64 / 200.0;
    let (plane, mirrored): (Vec<_>, Vec<_>) = (0..=200).map(|i| (line(a(i)), line(-a(i)))).unzip();
    let pairs = plane.windows(2).flat_map(|w| w[0].iter().zip(&w[1]));
    claims.all("rises-with-a", "the loss increases strictly with |a| (201 x 400 plants)", pairs, |(b, l)| b < l);
    let pairs = plane.iter().flat_map(|line| line.windows(2));
    let what = "the loss increases strictly with gamma (201 x 400 plants)";
    claims.all("rises-with-gamma", what, pairs, |w| w[0] < w[1]);
    claims.all("even", "the loss is even in a", plane.iter().zip(&mirrored), |(l, m)| l == m);
    let cells = plane.iter().enumerate();
    let cells = cells.flat_map(|(i, line)| gammas.iter().zip(line).map(move |(g, l)| (a(i), *g, *l)));
    let low = cells.filter(|(a, gamma, _)| *a <= 0.979 && *gamma <= 1.0 || *gamma <= 0.926);
    let what = "the loss is below 2 for |a| <= 0.979 and gamma <= 1, or gamma <= 0.926 (erratum dymbo-4)";
    claims.all("below-two", what, low, |(.., loss)| loss < 2.0);
}

fn limits(claims: &mut Claims) {
    for a in [0.0_f64, 0.5, 0.9] {
        let slope = loss(a, 1e-7).map(|loss| (loss - 1.0) / 1e-7 * (1.0 - a * a).powi(2) / (1.0 - FRAC_2_PI));
        let what = format!("a = {a}, gamma to 0: loss - 1 over (1 - 2/pi) gamma/(1 - a^2)^2");
        claims.near(format!("slow-{a}"), what, slope, 1.0, 1e-4);
    }
    let what = "a = 1, gamma to 0: sqrt(pi/2), not pi/2 (erratum dymbo-5)";
    claims.near("slow-1", what, loss(1.0, 1e-20), (PI / 2.0).sqrt(), 1e-9);
    for a in [0.0, 0.5, 1.0] {
        let expected = (1.0 - FRAC_2_PI) / (1.0 - a * a * (1.0 - FRAC_2_PI));
        let slope = loss(a, 1e9).map(|loss| loss / 1e9 / expected);
        let what = format!("a = {a}, gamma to infinity: loss/gamma over (1 - 2/pi)/(1 - a^2 (1 - 2/pi))");
        claims.near(format!("fast-{a}"), what, slope, 1.0, 1e-6);
    }
    let after = |c: f64| (0..100_000).fold(1.0, |m, _| filtered_variance(m, 1.0, c));
    let what = "pi/2 is the ratio for a constant parameter, after 100000 samples (erratum dymbo-5)";
    claims.near("static", what, after(FRAC_2_PI) / after(1.0), 1.570889, 1e-6);
}
