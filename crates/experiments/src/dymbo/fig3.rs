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
    pub struct Row by place {
        a: f64 as key("a = {}") => "Plant coefficient; one bit cannot hold an unstable plant.",
        gamma: f64 as x("gamma = process / measurement variance") => "Process variance over measurement variance.",
        kf_reduction: f64 ["sigma^2"] as line("Kalman") => "Steady filtered variance of the Kalman filter.",
        dymbo_reduction: f64 ["sigma^2"] as dashed("sign bit") => "Steady filtered variance of the sign-bit filter.",
    }
}

/// The plant, its noise ratio without the last place of a power of ten.
fn place(row: &Row) -> String {
    format!("{} {}", row.a, (row.gamma * 1e12).round() / 1e12)
}

pub struct KalmanVariance;

impl Figure for KalmanVariance {
    figure!(Parameters => Vec<Row>, "dymbo-fig3", "Steady variance against the noise ratio", "Ribeiro and Giannakis, Fig. 3",
        "Steady filtered variance over the measurement variance, of the Kalman filter (solid) and of the sign-bit filter \
         (dashed). A slow plant (small gamma) is averaged over many samples; a fast one leaves the last sample \
         alone, and then one bit falls behind."; loglog("filtered variance / sigma^2"));

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        let row = |plant: Plant| {
            Ok(Row {
                a: plant.a,
                gamma: plant.gamma,
                kf_reduction: plant.kalman_variance()?,
                dymbo_reduction: plant.sign_bit_variance()?,
            })
        };
        p.a.iter()
            .flat_map(|a| super::common::each(*a, &p.gamma))
            .map(row)
            .collect()
    }

    fn claims(&self, p: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        type Of = fn(&Row) -> f64;
        let schemes: [(&str, Of); 2] = [("kf", |r| r.kf_reduction), ("dymbo", |r| r.dymbo_reduction)];
        for (scheme, of) in schemes {
            let neighbours = rows.windows(2).filter(|w| w[0].a == w[1].a);
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
    }
}
