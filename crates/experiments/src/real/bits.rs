//! Error against bits, for every signal and scheme.

use super::baselines::{Played, delta_modulation, jayant, searched};
use super::recordings::{Recording, Source, each};
use super::tracking::{best_for, stream_bits, words};
use crate::prelude::*;
use fewbits_adaptive::{Replay, Silence};

parameters! {
    pub struct Parameters {
        #[serde(flatten)]
        source: Source = Source::default() => quick Source { samples: 800, ..Source::default() },
        rate: Vec<f64> [0.02..=12.0; 1..=20] = vec![0.25, 0.5, 1.0, 2.0] => quick vec![0.5, 2.0] => "Bits per sample, at most.",
    }
    cost |p| Cost::new(2e-4 * (p.source.samples * p.rate.len()) as f64, 1e4 * p.source.samples as f64);
}

rows! {
    pub struct Rows {
        schemes: Vec<Row> => "Every scheme at every rate that it can keep to.",
        comparison: Vec<Pair> => "Ours beside the best of the baselines.",
    }

    struct Row {
        column: String as panel => "Signal.",
        rate: f64 as x("bits per sample") => "Bits per sample, at most.",
        /// adaptive and words are ours; the others: send-on-delta (12-bit words), modulation (adaptive delta modulation), jayant,
        /// dpcm-0 and dpcm-1 (deadband, order 0 and 1).
        scheme: &'static str as key,
        delta: Option<f64> => "Half-width of the region of silence.",
        rmse: f64 as curve => "Root mean square error.",
        bits: f64 ["bit"] => "Bits per sample: ideal code lengths where a code is adaptive.",
        packets: f64 => "Packets per sample.",
    }

    struct Pair {
        column: String => "Signal.",
        rate: f64 => "Bits per sample, at most.",
        best: &'static str => "The best baseline, its order chosen in hindsight.",
        ratio: f64 => "Error of ours over that of the best; smaller errors than the negligible one count as that.",
        negligible: f64 => "A millionth of the signal's range.",
        worst: f64 => "Largest error of ours over its delta.",
        ideal: f64 ["bit"] => "Ideal bits per sample.",
        stream: f64 ["bit"] => "The same reports as one range-coded stream, whole 32-bit words.",
        packed: f64 ["bit"] => "As packets of whole bits.",
        with_silence: f64 ["bit"] => "As one stream that also tells which slots are silent.",
    }
}

/// Errors below this share of the range count as that.
pub(super) const NEGLIGIBLE: f64 = 1e-6;

pub struct Bits;

fn row(recording: &Recording, rate: f64, scheme: &'static str, delta: Option<f64>, played: &Played) -> Row {
    let n = recording.samples.len() as f64;
    Row {
        column: recording.name.clone(),
        rate,
        scheme,
        delta,
        rmse: recording.rmse(&played.values),
        bits: played.bits / n,
        packets: played.packets as f64 / n,
    }
}

/// The baselines at `rate` bits per sample.
fn baselines(recording: &Recording, rate: f64) -> Vec<Row> {
    let samples = &recording.samples;
    let of = |(scheme, delta, played): &(&'static str, f64, Played)| row(recording, rate, scheme, Some(*delta), played);
    let mut rows: Vec<Row> = searched(recording, rate, |played| played.bits).iter().map(of).collect();
    if rate >= 1.0 {
        rows.push(row(recording, rate, "modulation", None, &delta_modulation(samples)));
    }
    if rate >= 2.0 {
        let bits = if rate >= 3.0 { 3 } else { 2 };
        rows.push(row(recording, rate, "jayant", None, &jayant(samples, bits)));
    }
    // A range of zero: nothing to choose, nothing to send.
    rows.retain(|r| r.rmse.is_finite());
    rows
}

fn compare(recording: &Recording, rate: f64, context: &Context<'_>) -> Result<(Vec<Row>, Pair), Error> {
    let n = recording.samples.len() as f64;
    let mut rows = baselines(recording, rate);
    let kept = rows.iter().filter(|r| r.bits <= rate);
    let best = kept.min_by(|a, b| a.rmse.total_cmp(&b.rmse)).or(rows.first());
    let (best, best_rmse) = best.map_or(("none", f64::INFINITY), |r| (r.scheme, r.rmse));
    let (config, ours) = best_for(recording, rate, context, Replay::rate)?;
    let ours_row = row(recording, rate, "adaptive", Some(config.delta()), &ours.clone().into());
    let negligible = NEGLIGIBLE * recording.range();
    let pair = Pair {
        column: recording.name.clone(),
        rate,
        best,
        ratio: ours_row.rmse.max(negligible) / best_rmse.max(negligible),
        negligible,
        worst: ours.worst_error() / config.delta(),
        ideal: ours.rate(),
        stream: stream_bits(recording, config, Silence::Timed)? / n,
        packed: ours.packet_bits as f64 / n,
        with_silence: stream_bits(recording, config, Silence::Coded)? / n,
    };
    rows.push(ours_row);
    if [1.0, 2.0, 3.0].contains(&rate) {
        let played = words(recording, rate as u32)?;
        rows.push(row(recording, rate, "words", None, &played));
    }
    Ok((rows, pair))
}

/// `exp` of the mean logarithm.
pub(super) fn geometric_mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = values.into_iter().map(f64::ln).collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}

pub(super) fn largest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    values.into_iter().max_by(f64::total_cmp)
}

impl Figure for Bits {
    figure!(Parameters => Rows, "real-bits", "Real signals: error against bits", "our own comparison",
        "Root mean square error against bits per sample on signals with the traits of recordings, or on the columns of \
         a file. The adaptive scheme needs no fit and bounds every error; the baselines are what an engineer would \
         try first, and deadband DPCM with an adaptive code, whose order is chosen in hindsight. An error of zero is \
         not drawn."; loglog("rms error"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let recordings = p.source.load("real-bits", context)?;
        let found = each(&recordings, &p.rate, |recording, rate| compare(recording, rate, context))?;
        let (schemes, comparison): (Vec<Vec<Row>>, Vec<Pair>) = found.into_iter().unzip();
        Ok(Rows {
            schemes: schemes.into_iter().flatten().collect(),
            comparison,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let pairs = &rows.comparison;
        claims.at_most("bounded", "no error exceeds delta", largest(pairs.iter().map(|p| p.worst)), 1.0);
        let what = "at equal bits the error is 0.85 of that of the best baseline, in the geometric mean";
        claims.at_most("mean", what, geometric_mean(pairs.iter().map(|p| p.ratio)), 0.85);
        claims.at_most("worst", "and nowhere above 1.1 of it", largest(pairs.iter().map(|p| p.ratio)), 1.1);
        let ours = || rows.schemes.iter().filter(|r| r.scheme == "adaptive");
        claims.all("rate", "the rate is kept", ours(), |r| r.bits <= r.rate);
        let what = "whole packets cost at most a bit each beyond the ideal length";
        let packets = || pairs.iter().zip(ours());
        claims.all("packets", what, packets(), |(p, r)| p.packed <= p.ideal + r.packets);
        let what = "the stream costs at most one percent and 0.03 bits per sample beyond the ideal length";
        here.all("stream", what, pairs, |p| p.stream <= 1.01 * p.ideal + 0.03);
        let what = "telling the silences costs at most one bit per sample";
        claims.all("silence", what, pairs, |p| p.with_silence <= p.stream + 1.0 + 0.03);
    }
}
