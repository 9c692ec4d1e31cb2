//! How many bits a sample are worth sending.

use super::common::{bad, kalman_variance, not_empty, pairs, plant};
use crate::legacy::claim::not_decreasing;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_dymbo::{MultibitFilter, chain, iterated};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

const ID: &str = "dymbo-bits";

/// Plants as pairs, and word lengths.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
    bits: Vec<usize>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: vec![0.9],
            gamma: vec![0.5, 0.05],
            bits: (1..=8).collect(),
        }
    }
}

pub(super) struct WordLength;

impl Figure for WordLength {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Bits a sample",
            caption: "Loss against the Kalman filter when each sample sends a word of the innovation's Lloyd-Max quantizer: predicted \
                      (lines) and exact (points). Two bits leave 15 % and three 4 %. Right: what is lost of one sample, 1 - c, by \
                      batch words and by successive bits; the usual formula for the latter promises too much.",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "bits", &p.bits)?;
        if let Some(bits) = p.bits.iter().find(|bits| !(1..=8).contains(*bits)) {
            return Err(bad(ID, "bits", bits, "word lengths from 1 to 8"));
        }
        pairs(ID, &p.a, &p.gamma)?
            .into_iter()
            .try_for_each(|(a, g)| plant(ID, a, g).map(drop))
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("bits", "", "word length"),
            column("c", "", "information of a word against the sample"),
            column("riccati", "sigma^2", "predicted steady variance"),
            column("exact_mse", "sigma^2", "exact steady mean squared error"),
            column("loss", "", "exact error over the Kalman filter's"),
            column("riccati_loss", "", "predicted variance over the Kalman filter's"),
        ]);
        let plants = pairs(ID, &p.a, &p.gamma)?;
        let cases: Vec<_> = plants
            .iter()
            .flat_map(|at| p.bits.iter().map(move |bits| (*at, *bits)))
            .collect();
        let rows: Vec<_> = cases
            .par_iter()
            .map(|&((a, gamma), bits)| {
                let plant = plant(ID, a, gamma)?;
                let filter = MultibitFilter::new(plant, bits)?;
                let kalman = kalman_variance(&plant)?;
                let c = filter.information();
                let riccati = plant.steady_state(c)?.filtered_variance;
                let exact = chain::multibit_mse(&filter)?;
                Ok(row![a, gamma, bits, c, riccati, exact, exact / kalman, riccati / kalman])
            })
            .collect::<Result<_, Error>>()?;
        rows.into_iter().try_for_each(|row| table.push(row))?;

        let mut successive = Table::new([
            column("bits", "", "bits about the same sample"),
            column("batch", "", "1 - c of the Lloyd-Max word"),
            column("exact_tree", "", "1 - c with thresholds at exact means"),
            column("claimed", "", "1 - c promised by assuming normal densities, (1 - 2/pi)^m"),
            column("own_levels", "", "1 - c true of its levels"),
            column("centroids", "", "1 - c true of its cells"),
            column("empty_words", "", "words that no sample causes"),
        ]);
        let any = plant(ID, 0.9, 0.5)?;
        for bits in 1..=5 {
            let assumed = iterated::normal_assumption_information(bits)?;
            let batch = MultibitFilter::new(any, bits)?.information();
            successive.push(row![
                bits,
                1.0 - batch,
                1.0 - iterated::exact_tree_information(bits)?,
                1.0 - assumed.claimed,
                1.0 - assumed.with_own_levels,
                1.0 - assumed.with_centroids,
                assumed.empty_words,
            ])?;
        }
        Ok(Tables::from(table).with("successive", successive))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        for (a, gamma) in pairs(ID, &p.a, &p.gamma)? {
            let losses = tables.main.only("a", a)?.only("gamma", gamma)?.numbers("loss")?;
            let statement = format!("a = {a}, gamma = {gamma}: every bit helps");
            claims.push(Claim::never(format!("falls-{a}-{gamma}"), statement, not_decreasing(&losses)).at_defaults());
        }
        let information = [
            FRAC_2_PI,
            0.882518152171,
            0.965452239211,
            0.990498991992,
            0.997495331644,
            0.999355760335,
        ];
        let first = tables.main.only("gamma", 0.5)?;
        let coefficients = first.points("bits", "c")?;
        for ((bits, c), expected) in coefficients.iter().zip(information) {
            let statement = format!("information of {bits} bits");
            claims.push(Claim::near(format!("c-{bits}"), statement, *c, expected, 1e-11).at_defaults());
        }
        let eight = coefficients.iter().find(|p| p.0 == 8.0).map_or(f64::NAN, |p| p.1);
        claims.push(Claim::near("c-8", "information of 8 bits", eight, 0.999958814917, 1e-11).at_defaults());
        for (gamma, losses, digits) in [
            (0.5, [1.5597, 1.1461, 1.0404, 1.0109], 5e-5),
            (0.05, [1.1800, 1.0508, 1.0143, 1.0039], 5e-5),
        ] {
            let rows = tables.main.only("gamma", gamma)?;
            for ((bits, loss), expected) in rows.points("bits", "loss")?.into_iter().zip(losses) {
                let statement = format!("gamma = {gamma}: loss with {bits} bits");
                claims
                    .push(Claim::near(format!("loss-{gamma}-{bits}"), statement, loss, expected, digits).at_defaults());
            }
            let gaps = rows.points("riccati", "exact_mse")?.into_iter().skip(1);
            let off = gaps
                .filter(|(riccati, exact)| (exact / riccati - 1.0).abs() > 3e-4)
                .count();
            let statement = format!("gamma = {gamma}: from two bits on the prediction is exact to 0.03 %");
            claims.push(Claim::never(format!("riccati-{gamma}"), statement, off).at_defaults());
        }
        for ((bits, exact), expected) in first
            .points("bits", "exact_mse")?
            .into_iter()
            .zip([0.729566, 0.536116, 0.486661, 0.472875])
        {
            let statement = format!("gamma = 0.5: exact error with {bits} bits");
            claims.push(Claim::near(format!("mse-{bits}"), statement, exact, expected, 5e-7).at_defaults());
        }
        claims.extend(successive_claims(tables.named("successive")?)?);
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let (x, y) = (
            Axis::linear("bits a sample").between(0.7, 8.3),
            Axis::log("error over the Kalman filter's, minus 1"),
        );
        let mut left = Panel::new("Loss against word length", x, y);
        for (i, (a, gamma)) in pairs(ID, &p.a, &p.gamma)?.into_iter().enumerate() {
            let rows = tables.main.only("a", a)?.only("gamma", gamma)?;
            let over = |name: &str| -> Result<Vec<(f64, f64)>, Error> {
                Ok(rows
                    .points("bits", name)?
                    .into_iter()
                    .map(|(b, loss)| (b, loss - 1.0))
                    .collect())
            };
            left = left
                .with(Layer::line(format!("predicted, a = {a}, gamma = {gamma}"), over("riccati_loss")?).coloured(i))
                .with(Layer::points(format!("exact, a = {a}, gamma = {gamma}"), over("loss")?).coloured(i));
        }
        let rows = tables.named("successive")?;
        let right = Panel::new(
            "Bits about one sample",
            Axis::linear("bits").between(0.7, 5.3),
            Axis::log("fraction of the information lost, 1 - c"),
        )
        .with(Layer::line("Lloyd-Max word", rows.points("bits", "batch")?).coloured(2))
        .with(Layer::points("successive, exact means", rows.points("bits", "exact_tree")?).coloured(3))
        .with(Layer::dashed("successive, as claimed", rows.points("bits", "claimed")?).coloured(4))
        .with(
            Layer::points("successive, its own levels", rows.points("bits", "own_levels")?)
                .coloured(4)
                .marked(Marker::Cross),
        )
        .with(
            Layer::points("successive, centroids", rows.points("bits", "centroids")?)
                .coloured(5)
                .marked(Marker::Triangle),
        )
        .legend(Legend::BottomLeft);
        Ok(Plot::grid(2, vec![left, right]))
    }
}

fn successive_claims(rows: &Table) -> Result<Vec<Claim>, Error> {
    let mut claims = Vec::new();
    let columns: [(&str, [f64; 3]); 4] = [
        ("claimed", [0.86795, 0.95202, 0.98256]),
        ("own_levels", [0.86954, 0.94104, 0.96803]),
        ("centroids", [0.87492, 0.95343, 0.97806]),
        ("exact_tree", [0.87492, 0.95809, 0.98613]),
    ];
    for (name, expected) in columns {
        for ((bits, lost), c) in rows.points("bits", name)?.into_iter().skip(1).zip(expected) {
            let statement = format!("successive bits, {name}: information of {bits}");
            claims.push(Claim::near(format!("{name}-{bits}"), statement, 1.0 - lost, c, 6e-6));
        }
    }
    let (batch, tree) = (rows.numbers("batch")?, rows.numbers("exact_tree")?);
    let worse = batch.iter().zip(&tree).skip(1).filter(|(b, t)| b >= t).count();
    claims.push(Claim::never("batch-wins", "the Lloyd-Max word loses less at every length from two bits", worse));
    let empty = rows.points("bits", "empty_words")?.last().map_or(f64::NAN, |p| p.1);
    claims.push(Claim::above("empty", "at five bits some successive words never occur", empty, 0.0));
    Ok(claims)
}
