//! Error against packets: where a packet costs the same whatever is in it, prediction alone counts.

use super::baselines::{Played, searched};
use super::bits::{NEGLIGIBLE, geometric_mean, largest};
use super::recordings::{Recording, Source, each};
use super::tracking::best_for;
use crate::prelude::*;
use fewbits_adaptive::Replay;

parameters! {
    pub struct Parameters {
        #[serde(flatten)]
        source: Source = Source::default() => quick Source { samples: 800, ..Source::default() },
        packets: Vec<f64> [0.005..=1.0; 1..=20] = vec![0.03, 0.1, 0.3] => quick vec![0.1] => "Packets per sample, at most.",
    }
}

rows! {
    pub struct Row {
        column: String as panel => "Signal.",
        target: f64 as x("packets per sample") => "Packets per sample, at most.",
        /// adaptive; send-on-delta, which is also DPCM of order 0 without a lattice; dpcm-0, dpcm-1.
        scheme: &'static str as key,
        delta: f64 => "Half-width of the region of silence.",
        rmse: f64 as curve => "Root mean square error.",
        packets: f64 => "Packets per sample.",
        /// Error over that of the better of both orders of DPCM, whose packets hold a lattice point too; smaller errors than the
        /// negligible one count as that.
        ratio: Option<f64>,
        negligible: f64 => "A millionth of the signal's range.",
    }
}

pub struct Packets;

fn compare(recording: &Recording, target: f64, context: &Context<'_>) -> Result<Vec<Row>, Error> {
    let negligible = NEGLIGIBLE * recording.range();
    let row = |scheme, delta, played: &Played| Row {
        column: recording.name.clone(),
        target,
        scheme,
        delta,
        rmse: recording.rmse(&played.values),
        packets: played.packets as f64 / recording.samples.len() as f64,
        ratio: None,
        negligible,
    };
    let rivals = searched(recording, target, |played| played.packets as f64);
    let mut rows: Vec<Row> = rivals
        .iter()
        .map(|(scheme, delta, played)| row(scheme, *delta, played))
        .collect();
    let rivals = rows.iter().filter(|r| r.scheme.starts_with("dpcm"));
    let best = rivals.map(|r| r.rmse).min_by(f64::total_cmp);
    let price = |replay: &Replay| replay.packets as f64 / recording.samples.len() as f64;
    let (config, ours) = best_for(recording, target, context, price)?;
    let mut ours = row("adaptive", config.delta(), &ours.into());
    ours.ratio = best.map(|best| ours.rmse.max(negligible) / best.max(negligible));
    rows.push(ours);
    Ok(rows)
}

impl Figure for Packets {
    figure!(Parameters => Vec<Row>, "real-packets", "Real signals: error against packets", "our own comparison",
        "Root mean square error against packets per sample. Where a packet costs the same whatever it holds, codes gain \
         nothing: only the prediction counts, and what a packet holds. Send-on-delta sends the sample itself, and is \
         ahead where signals jump and rest; the bank is ahead where they have a velocity. An error of zero is not \
         drawn."; loglog("rms error"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let recordings = p.source.load("real-packets", context)?;
        let found = each(&recordings, &p.packets, |recording, target| compare(recording, target, context))?;
        Ok(found.into_iter().flatten().collect())
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let ratios = || rows.iter().filter_map(|r| r.ratio);
        let what = "at equal packets the error is at most that of the better DPCM, in the geometric mean";
        claims.at_most("mean", what, geometric_mean(ratios()), 1.0);
        here.at_most("worst", "and nowhere above 1.35 of it", largest(ratios()), 1.35);
        claims.all("rate", "the rate is kept", rows.iter().filter(|r| r.ratio.is_some()), |r| r.packets <= r.target);
    }
}
