//! What faults do to the error, and how long a restarted sensor is out of step.

use super::receivers::{each, over_bits};
use super::worlds::{self, COEFFICIENT, PROCESS, RADIUS, SENSORS};
use crate::prelude::*;
use fewbits_baselines::dymbo::centre::ParallelEstimator;
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant};
use fewbits_network::{BitStar, Channel, Fault, FaultKind, Loss, Seconds, SensorId, Setup};
use fewbits_protocol::{Feedback, ReportLength};

parameters! {
    pub struct Parameters {
        loss: Vec<f64> [0.0..=0.8; 1..] = vec![0.0, 0.05, 0.1, 0.2, 0.4, 0.6] => "Probabilities that a frame is lost.",
        /// Probabilities that a bit is inverted.
        crossover: Vec<f64> [0.0..=0.1; 1..] = vec![0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2],
        delay: Vec<f64> [0.0..=10.0; 1..] = vec![0.0, 0.05, 0.1, 0.2, 0.4, 0.8] => "Mean delays of a frame, in slots.",
        deaths: Vec<u32> [0..=4; 1..] = vec![0, 1, 2, 3, 4] => "Sensors of four that die after a quarter of the run.",
        slots: usize [60..=100_000] = 200 => quick 80 => "Slots of a run.",
        trials: u64 [2..=1_000_000] = 40 => quick 2 => "Runs at each point.",
    }
}

rows! {
    pub struct Row {
        fault: &'static str => "loss, flips, delay or deaths.",
        level: f64 => "Its level.",
        feedback: &'static str => "told: the centre sends its prediction; echoed: sensors follow by what it received.",
        rmse: Measured => "Root mean squared error.",
        /// Slots until a sensor that restarts in the middle of the run answers again; 50 where it has not by then.
        recovery: Measured,
        unrecovered: Measured => "Share of the runs in which it has not within 50 slots.",
        disagreements: Measured => "Disagreements noted, of 100 slots.",
    }
}

pub struct Faulty;

/// How sensors follow, and its name in the table and in the picture.
const TALKS: [(Feedback, &str, &str); 2] = [
    (Feedback::Told, "told", "told"),
    (Feedback::Echoed, "echoed", "following by echo"),
];

/// Squared error, slots to recover, disagreements of 100 slots, whether the sensor did not recover.
fn run((fault, level): (&str, f64), feedback: Feedback, stream: Stream, slots: usize) -> Result<[f64; 4], Error> {
    let world = worlds::scalar(slots)?;
    let (truths, measurements) = world.draw(&world.sensors, stream);
    let clock = worlds::clock()?;
    let period = clock.period().value();
    let mut channel = Channel::PERFECT;
    let (restarted, middle) = (SensorId(1), slots as u32 / 2);
    let at = |slot: f64| Seconds::new(slot * period);
    let mut faults = vec![Fault {
        at: at(f64::from(middle) + 0.95)?,
        node: restarted,
        kind: FaultKind::Restart,
    }];
    match fault {
        "loss" => channel.loss = Loss::Fixed(level),
        "flips" => channel.crossover = level,
        "delay" => channel.jitter = at(level)?,
        _ => {
            // The last sensors die first, so that the restarted one is the last to go.
            for i in 0..level as u32 {
                let node = SensorId(SENSORS as u32 - i);
                let (at, kind) = (at(slots as f64 / 4.0)?, FaultKind::Death);
                faults.push(Fault { at, node, kind });
            }
        }
    }
    // What may be lost is what the receiver knows of: the question and the report.
    let lost = match fault {
        "loss" => 1.0 - (1.0 - level).powi(2),
        "flips" => 1.0 - (1.0 - level).powi(144 + 81),
        "delay" => 0.5,
        _ => 0.2,
    };
    let filter = ParallelFilter::new(ScalarPlant::new(COEFFICIENT, PROCESS, 1.0)?, SENSORS, CountFusion::Exact)?;
    let filter = filter.with_link(Link::lossy(lost.min(0.99))?);
    let estimator = ParallelEstimator::new(filter, world.start)?;
    let (node, centre) = (each(vec![estimator.scheme()]), over_bits(estimator));
    let own = stream.named("filter");
    let star = BitStar::new(centre, feedback, ReportLength::Fixed(1), node, measurements, clock, own);
    let setup = Setup {
        channel,
        faults,
        ..worlds::setup(stream)?
    };
    let mut network = star.and_then(|star| star.simulate(RADIUS, setup))?;
    network.run_until(clock.end(middle))?;
    let (mut recovery, mut answers) = (0, false);
    while !answers && recovery < 50 && middle + recovery < slots as u32 {
        recovery += 1;
        network.run_until(clock.end(middle + recovery))?;
        answers = network.nodes()[restarted.index()].answered() == Some(middle + recovery);
    }
    network.run_until(clock.end(slots as u32))?;
    let noted = network.ledger().faults().disagreements as f64;
    Ok([
        world.squared(&truths, &network.nodes()[0].means()),
        f64::from(recovery),
        100.0 * noted / slots as f64,
        f64::from(u8::from(!answers)),
    ])
}

impl Figure for Faulty {
    figure!(Parameters => Vec<Row>, "network-faults", "What faults cost", "our own comparison",
        "Four one-bit sensors of the scalar world under lost frames, inverted bits, random delays and dying sensors. Told the \
         prediction in full, a sensor loses only the slot whose question is lost; following by echo, it must first be given the \
         belief again, which takes two slots and grows with the loss. Right: slots until a restarted sensor answers.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let levels = [
            ("loss", p.loss.clone()),
            ("flips", p.crossover.clone()),
            ("delay", p.delay.clone()),
            ("deaths", p.deaths.iter().map(|n| f64::from(*n)).collect()),
        ];
        let mut rows = Vec::new();
        for (fault, levels) in levels {
            for level in levels {
                let stream = context.stream("network-faults").named(&format!("{fault} {level}"));
                for (talk, feedback, _) in TALKS {
                    let one = |it: Trial| run((fault, level), talk, it.stream, p.slots);
                    let sums = context.moments(stream, p.trials, one)?;
                    rows.push(Row {
                        fault,
                        level,
                        feedback,
                        rmse: Measured::root_mean(&sums[0]),
                        recovery: sums[1].into(),
                        disagreements: sums[2].into(),
                        unrecovered: sums[3].into(),
                    });
                }
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        let at = |fault: &str, level: f64, feedback: &str| {
            first(rows, |r| (r.fault, r.level, r.feedback) == (fault, level, feedback))
        };
        let rmse = |level, feedback| at("loss", level, feedback).map(|r| r.rmse);
        for feedback in ["told", "echoed"] {
            let gap = minus(rmse(0.6, feedback), rmse(0.0, feedback));
            here.above(format!("loss-{feedback}"), "lost frames cost accuracy", gap, 0.0);
        }
        let worse = over(rmse(0.4, "echoed"), rmse(0.4, "told"));
        paper.above("replicas", "over links that lose much, replicas do worse than questions in full", worse, 1.0);
        let recovery = |feedback| at("loss", 0.0, feedback).map(|r| r.recovery.value);
        let what = "a restarted sensor that is told answers in the next slot";
        here.near("recovery-told", what, recovery("told"), 1.0, 0.0);
        let what = "one that follows by echo answers in the slot after";
        here.near("recovery-echoed", what, recovery("echoed"), 2.0, 0.0);
        let restart = at("loss", 0.0, "told").map(|r| r.disagreements.value);
        here.near("told", "without faults on air nobody disagrees with a centre that tells", restart, 0.0, 0.0);
        let lossy = select(rows, |r| r.fault == "loss" && r.level > 0.0 && r.feedback == "echoed");
        claims.all("noted", "replicas that miss frames are seen to disagree", lossy, |r| r.disagreements.value > 0.0);
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        let mut panels = Vec::new();
        for (fault, axis) in [
            ("loss", Axis::linear("probability of loss")),
            ("flips", Axis::log("probability of an inverted bit")),
            ("delay", Axis::linear("mean delay / slots")),
            ("deaths", Axis::linear("sensors that died")),
        ] {
            let panel = |title: &str, label: &str, of: fn(&Row) -> Option<Measured>| {
                let curves = TALKS.iter().enumerate().map(|(colour, (_, feedback, label))| {
                    let own = select(rows, |r| r.fault == fault && r.feedback == *feedback);
                    Layer::measured(*label, own, |r| (r.level, of(r))).coloured(colour)
                });
                Panel::new(title, axis.clone(), Axis::linear(label)).with_all(curves)
            };
            panels.push(panel("error", "RMSE / noise deviation", |r| Some(r.rmse)));
            // A mean over runs that were cut off is no time of recovery.
            let recovered = |r: &Row| (r.unrecovered.value == 0.0).then_some(r.recovery);
            panels.push(panel("recovery of a restarted sensor", "slots", recovered));
        }
        Plot::grid(2, panels)
    }
}
