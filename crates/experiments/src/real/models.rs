//! Which models the bank believed, over time.

use super::recordings::{Recording, Source};
use super::tracking::best_for;
use crate::prelude::*;
use fewbits_adaptive::{Replay, SCALES, Sensor};

fn shown() -> Source {
    Source {
        columns: vec!["bursts".into(), "drift".into(), "gusts".into()],
        samples: 1500,
        ..Source::default()
    }
}

parameters! {
    pub struct Parameters {
        #[serde(flatten)]
        source: Source = shown() => quick Source { samples: 1000, ..shown() },
        rate: f64 [0.02..=12.0] = 0.5 => "Bits per sample, at most.",
        every: usize [1..=10_000] = 10 => "Slots from one row to the next.",
    }
}

rows! {
    pub struct Row {
        column: String => "Signal.",
        slot: usize => "Slot.",
        sample: f64 => "Sample.",
        value: f64 => "Reconstruction.",
        walk: f64 => "Weight of the random walks.",
        damped: f64 => "Weight of the velocities that decay by 0.6.",
        smooth: f64 => "Weight of the velocities that decay by 0.95.",
        scale: f64 => "Mean logarithm to base 2 of the driving noise, in steps of two delta.",
    }
}

/// Models over time.
pub struct Models;

fn follow(recording: &Recording, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
    let (config, _) = best_for(recording, p.rate, context, Replay::rate)?;
    let mut sensor = Sensor::new(config);
    let mut rows = Vec::new();
    for (slot, sample) in recording.samples.iter().enumerate() {
        sensor.encode(*sample)?;
        if slot % p.every != 0 {
            continue;
        }
        let weights = sensor.model_weights();
        let family = |f: usize| weights.iter().skip(f * SCALES).take(SCALES).sum();
        rows.push(Row {
            column: recording.name.clone(),
            slot,
            sample: *sample,
            value: sensor.reconstruction().unwrap_or(*sample),
            walk: family(0),
            damped: family(1),
            smooth: family(2),
            scale: weights
                .iter()
                .enumerate()
                .map(|(m, w)| w * (2.0 * (m % SCALES) as f64 - 6.0))
                .sum(),
        });
    }
    Ok(rows)
}

fn mean<'a>(rows: impl Iterator<Item = &'a Row>, of: impl Fn(&Row) -> f64) -> Option<f64> {
    let values: Vec<f64> = rows.map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

impl Figure for Models {
    figure!(Parameters => Vec<Row>, "real-models", "Real signals: what the bank believed", "our own comparison",
        "Weights of the three families of models, and the mean scale of their noise, over time: a plume raises the scale \
         within a few reports, a smooth drift is given to the velocities, a calm to the narrowest walks.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let recordings = p.source.load("real-models", context)?;
        let mut rows = Vec::new();
        for recording in &recordings {
            rows.extend(follow(recording, p, context)?);
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        // Twenty-four weights in single precision.
        let sums = |r: &Row| (r.walk + r.damped + r.smooth - 1.0).abs() < 2e-6;
        claims.all("weights", "weights sum to one", rows, sums);
        let of = |column: &'static str| rows.iter().filter(move |r| r.column == column && r.slot > 300);
        let velocity = |r: &Row| r.damped + r.smooth;
        here.above("drift", "a smooth drift is given to the velocities", mean(of("drift"), velocity), 0.5);
        let moving = mean(of("gusts").filter(|r| r.sample > 0.3), |r| r.scale);
        let calm = mean(of("gusts").filter(|r| r.sample == 0.0), |r| r.scale);
        let what = "gusts raise the scale by a factor of at least four over a calm";
        let gap = minus(moving, calm);
        here.above("gusts", what, gap, 2.0);
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        let columns = distinct(rows, |r| r.column.clone());
        let panels = columns.iter().flat_map(|column| {
            let of = |y: fn(&Row) -> f64| {
                let chosen = rows.iter().filter(|r| r.column == *column);
                points(chosen, move |r| (r.slot as f64, y(r)))
            };
            let slots = || Axis::linear("slot");
            [
                Panel::new(format!("{column}: signal"), slots(), Axis::linear("signal"))
                    .with(Layer::line("sample", of(|r| r.sample)))
                    .with(Layer::dashed("reconstruction", of(|r| r.value))),
                Panel::new(format!("{column}: models"), slots(), Axis::linear("weight").between(0.0, 1.0))
                    .with(Layer::line("walk", of(|r| r.walk)))
                    .with(Layer::line("velocity 0.6", of(|r| r.damped)))
                    .with(Layer::line("velocity 0.95", of(|r| r.smooth))),
            ]
        });
        let scale = |column: &String| {
            let chosen = rows.iter().filter(|r| r.column == *column);
            Layer::line(column, points(chosen, |r| (r.slot as f64, r.scale)))
        };
        let scales =
            Panel::linear("scale of the models", "slot", "log_2(noise / step)").with_all(columns.iter().map(scale));
        Plot::grid(2, panels.chain([scales]).collect())
    }
}
