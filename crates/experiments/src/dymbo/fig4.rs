//! What the missing bits cost: the loss over the plane of plants.

use super::common::{Plant, each, log_spaced};
use crate::prelude::*;
use fewbits_baselines::dymbo::contours;
use fewbits_dymbo::chain;

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

    struct Contour by "{kind} {level} {a}" {
        kind: &'static str => "Riccati or exact.",
        level: f64 => "Loss.",
        a: f64 => "Plant coefficient.",
        gamma: f64 => "Noise ratio at which the loss reaches the level.",
    }
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
                loss_riccati: model.loss()?,
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
                push("riccati", level, a, contours::noise_ratio_at_loss(level, a)?);
            }
        }
        let exact = |a: &f64| Ok::<_, Error>((*a, contours::noise_ratio_at_true_loss(2.0, *a)?));
        for (a, gamma) in parallel::try_map(&p.exact_a, exact)? {
            push("exact", 2.0, a, gamma);
        }
        Ok(Rows { plane, contours })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "the loss is never below 1 (erratum dymbo-3)";
        claims.all("at-least-one", what, &rows.plane, |r| r.loss_riccati >= 1.0);
        let exact = || rows.plane.iter().filter_map(|r| Some(r.loss_true? / r.loss_riccati));
        let what = "the exact loss is nowhere below the Riccati loss";
        here.all("exact-above", what, exact(), |ratio| ratio >= 1.0 - 1e-10);
        here.all("exact-close", "the Riccati loss is right to 6 % on the whole grid", exact(), |ratio| ratio <= 1.06);
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
            line.extend(near_one.filter_map(|a| Some((contours::noise_ratio_at_loss(level, a).ok()??, a))));
            panel = panel.with(Layer::line(level.to_string(), line).coloured(i).inline());
        }
        panel = panel.with(Layer::dashed("2, by the exact error", curve("exact", 2.0)).coloured(p.level.len()));
        Plot::of(panel)
    }
}
