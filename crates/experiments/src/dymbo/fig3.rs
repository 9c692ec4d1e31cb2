//! How much of the measurement noise the filters remove, against the noise ratio.

use super::common::{Plant, log_spaced};
use crate::prelude::*;

parameters! {
    pub struct Parameters {
        a: Vec<f64> [-1.0..=1.0; 1..] = vec![0.5, 0.9, 0.99] => "Plant coefficients.",
        gamma: Vec<f64> [1e-12..=1e12; 1..] = log_spaced(-3.0, 1.0, 81) => "Process variances over measurement variance.",
    }
}

rows! {
    pub struct Row {
        plant: Plant,
        kf_reduction: f64 ["sigma^2"] => "Steady filtered variance of the Kalman filter.",
        dymbo_reduction: f64 ["sigma^2"] => "Steady filtered variance of the sign-bit filter.",
    }
}

pub struct KalmanVariance;

impl Figure for KalmanVariance {
    figure!(Parameters => Vec<Row>, "dymbo-fig3", "Steady variance against the noise ratio", "Ribeiro and Giannakis, Fig. 3",
        "Steady filtered variance over the measurement variance, of the Kalman filter (solid) and of the sign-bit filter \
         (dashed). A slow plant (small gamma) is averaged over many samples; a fast one leaves the last sample \
         alone, and then one bit falls behind.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        let plants = p.a.iter().flat_map(|a| super::common::each(*a, &p.gamma));
        let row = |plant: Plant| {
            Ok(Row {
                kf_reduction: plant.kalman_variance()?,
                dymbo_reduction: plant.sign_bit_variance()?,
                plant,
            })
        };
        plants.map(row).collect()
    }

    fn claims(&self, p: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        type Of = fn(&Row) -> f64;
        let schemes: [(&str, Of); 2] = [("kf", |r| r.kf_reduction), ("dymbo", |r| r.dymbo_reduction)];
        for (scheme, of) in schemes {
            let neighbours = rows.windows(2).filter(|w| w[0].plant.a == w[1].plant.a);
            let what = format!("the {scheme} variance increases strictly with gamma");
            here.all(format!("{scheme}-rises-with-gamma"), what, neighbours, |w| of(&w[0]) < of(&w[1]));
            let neighbours = rows.iter().zip(rows.iter().skip(p.gamma.len()));
            let what = format!("the {scheme} variance increases strictly with |a|");
            here.all(format!("{scheme}-rises-with-a"), what, neighbours, |(low, high)| of(low) < of(high));
        }
        let what = "the Kalman variance stays below that of one measurement";
        claims.all("kf-below-one", what, rows, |r| r.kf_reduction < 1.0);
        let what = "the sign-bit filter is nowhere better (erratum dymbo-2)";
        claims.all("dymbo-above-kf", what, rows, |r| r.dymbo_reduction >= r.kf_reduction);
        let kalman = |a: f64, gamma: f64| Plant { a, gamma }.kalman_variance().ok();
        for &a in &p.a {
            let what = format!("a = {a}: a fast plant leaves one measurement");
            claims.near(format!("limit-fast-{a}"), what, kalman(a, 1e8), 1.0, 1e-7);
            if a.abs() < 1.0 {
                let share = kalman(a, 1e-9).map(|m| m * (1.0 - a * a) / 1e-9);
                let what = format!("a = {a}: a slow plant keeps its own variance gamma/(1 - a^2)");
                claims.near(format!("limit-slow-{a}"), what, share, 1.0, 1e-4 / (1.0 - a * a).powi(2));
            }
        }
        claims.references("kf", "Kalman variance at a, gamma", rows, |r| {
            // Powers of ten without their last place.
            let gamma = (r.plant.gamma * 1e12).round() / 1e12;
            (format!("{} {gamma}", r.plant.a), r.kf_reduction)
        });
        let what =
            "at gamma = 2 the Kalman variance is no longer about half the measurement's (a = 0.9) (erratum dymbo-6)";
        claims.near("kf-at-2", what, kalman(0.9, 2.0), 0.721, 5e-4);
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let mut panel =
            Panel::loglog("Steady variance", "gamma = process / measurement variance", "filtered variance / sigma^2");
        for (i, (a, curve)) in p.a.iter().zip(rows.chunks(p.gamma.len())).enumerate() {
            let kalman = points(curve, |r| (r.plant.gamma, r.kf_reduction));
            let sign_bit = points(curve, |r| (r.plant.gamma, r.dymbo_reduction));
            panel = panel
                .with(Layer::unbroken(format!("Kalman, a = {a}"), kalman).coloured(i))
                .with(Layer::dashed(format!("sign bit, a = {a}"), sign_bit).coloured(i));
        }
        Plot::of(panel)
    }
}
