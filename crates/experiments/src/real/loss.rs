//! Loss and recovery.

use super::recordings::{Recording, Source};
use super::tracking::best_for;
use crate::prelude::*;
use fewbits_adaptive::{Config, Receiver, Replay, Sensor};

fn shown() -> Source {
    Source {
        columns: vec!["bursts".into()],
        ..Source::default()
    }
}

parameters! {
    pub struct Parameters {
        #[serde(flatten)]
        source: Source = shown() => quick Source { samples: 1000, ..shown() },
        rate: f64 [0.02..=12.0] = 0.5 => "Bits per sample over a perfect link, which choose delta.",
        loss: Vec<f64> [0.0..=0.5; 1..=9] = vec![0.0, 0.01, 0.1] => "Probabilities that a packet is lost.",
        refresh: Vec<u64> [2..=100_000; 1..=9] = vec![25, 100, 400] => "Slots from one refresh to the next.",
        sequence_bits: u32 [1..=16] = 4 => "Bits of the packets' counter.",
        trials: u64 [2..=100_000] = 20 => quick 4 => "Sequences of losses.",
    }
}

rows! {
    pub struct Row {
        column: String => "Signal.",
        loss: f64 as key("loss {}") => "Probability that a packet is lost.",
        refresh: u64 as x("slots from refresh to refresh") => "Slots from one refresh to the next.",
        bits: Measured ["bit"] as points in bits => "Whole bits per sample, counters and refreshes included.",
        rmse: Measured as points in errors => "Root mean square error over delta.",
        beyond: Measured as points in beyond => "Share of the slots whose error exceeds delta.",
        /// Share of the slots whose error exceeds delta although the receiver believes to be in step.
        unnoticed: Measured as points in unnoticed,
        /// Slots from the first packet lost to the next refresh received, at the longest, over the interval of refreshes.
        longest: f64,
        violations: u64 => "Errors beyond delta while no packet was lost since the last refresh that arrived: never.",
    }
}

pub struct Loss;

/// What one sequence of losses did: means over the slots, and slots.
#[derive(Default)]
struct Outcome {
    bits: f64,
    squares: f64,
    beyond: f64,
    unnoticed: f64,
    longest: u64,
    violations: u64,
}

struct Point<'a> {
    recording: &'a Recording,
    config: Config,
    loss: f64,
    refresh: u64,
    sequence_bits: u32,
}

fn one(point: &Point<'_>, trial: Trial) -> Result<Outcome, Error> {
    let recording = point.recording;
    let config = point.config.resilient(point.sequence_bits, Some(point.refresh))?;
    let delta = config.delta();
    let link = Link::lossy(point.loss)?;
    let mut rng = trial.stream.rng();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let n = recording.samples.len() as f64;
    let mut all = Outcome::default();
    let mut lost: Option<u64> = None;
    for (slot, x) in (0_u64..).zip(&recording.samples) {
        let report = sensor.encode(*x)?;
        all.bits += report.map_or(0.0, |r| r.packet.bits() as f64);
        let observation = link.transmit(&mut rng, report.map(|r| r.packet).as_ref(), &())?;
        let arrived = observation.received().is_some();
        if report.is_some() && !arrived {
            lost.get_or_insert(slot);
        } else if report.is_some_and(|r| r.refresh) {
            lost = None;
        }
        let tracked = receiver.receive(&observation)?;
        // Before anything arrived, the receiver knows nothing: an error of the sample's own size.
        let straight = (x - tracked.value.unwrap_or(0.0)).abs();
        let error = recording
            .period
            .map_or(straight, |p| straight.min((p - straight).abs()));
        all.squares += (error / delta).powi(2) / n;
        if error > delta {
            all.beyond += 1.0 / n;
            all.unnoticed += if tracked.synchronised { 1.0 / n } else { 0.0 };
            all.violations += u64::from(lost.is_none());
        }
        all.longest = all.longest.max(lost.map_or(0, |since| slot - since + 1));
    }
    all.bits /= n;
    Ok(all)
}

impl Figure for Loss {
    figure!(Parameters => Vec<Row>, "real-loss", "Real signals: loss and recovery", "our own comparison",
        "A lost packet leaves the receiver out of step until the next refresh that arrives. Frequent refreshes cost bits \
         and shorten that time; the counter of the packets tells the receiver in which slots it must not trust itself.";
        { bits: semilogx("bits per sample"), errors: loglog("rms error / delta"),
          beyond: semilogx("share of slots beyond delta"), unnoticed: semilogx("share beyond delta, unnoticed") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let recordings = p.source.load("real-loss", context)?;
        let mut points = Vec::new();
        for recording in &recordings {
            let (config, _) = best_for(recording, p.rate, context, Replay::rate)?;
            for loss in &p.loss {
                for refresh in &p.refresh {
                    points.push(Point {
                        recording,
                        config,
                        loss: *loss,
                        refresh: *refresh,
                        sequence_bits: p.sequence_bits,
                    });
                }
            }
        }
        let row = |point: &Point<'_>| {
            let column = point.recording.name.clone();
            let stream = context
                .stream("real-loss")
                .named(&format!("{column} {} {}", point.loss, point.refresh));
            let all = context.trials(stream, p.trials, |trial| one(point, trial))?;
            Ok(Row {
                column,
                loss: point.loss,
                refresh: point.refresh,
                bits: all.iter().map(|o| o.bits).collect(),
                rmse: Measured::root_mean(&all.iter().map(|o| o.squares).collect()),
                beyond: all.iter().map(|o| o.beyond).collect(),
                unnoticed: all.iter().map(|o| o.unnoticed).collect(),
                longest: all.iter().map(|o| o.longest).max().unwrap_or(0) as f64 / point.refresh as f64,
                violations: all.iter().map(|o| o.violations).sum(),
            })
        };
        points.iter().map(row).collect()
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "no error exceeds delta but between a loss and the next refresh that arrives";
        claims.all("bounded", what, rows, |r| r.violations == 0);
        let what = "without loss no error exceeds delta";
        here.all("perfect", what, rows.iter().filter(|r| r.loss == 0.0), |r| r.beyond.value == 0.0);
        let what = "with frequent refreshes fewer slots are wrong";
        let worst = || rows.iter().filter(|r| r.loss == 0.1);
        here.increasing("refresh", what, worst().map(|r| r.beyond));
        here.decreasing("price", "and more bits are spent", worst().map(|r| r.bits));
        let what = "most wrong slots are known to be so";
        here.all("noticed", what, worst(), |r| r.unnoticed.value < 0.5 * r.beyond.value);
    }
}
