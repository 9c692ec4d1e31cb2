//! Error against bits, transmitted bits and joules: every scheme on the same worlds.

use super::schemes;
use super::worlds::{self, Bill, Entry, floor_at};
use crate::prelude::*;

parameters! {
    pub struct Parameters {
        slots: usize [40..=100_000] = 300 => quick 60 => "Slots of a run.",
        trials: u64 [2..=100_000] = 6 => quick 2 => "Runs of each scheme.",
    }
    cost |p| Cost::new(2e-2 * (p.trials * p.slots as u64) as f64, 1e8);
}

rows! {
    pub struct Row {
        /// scalar: AR(1), a = 0.95, process variance 0.2; plane: constant velocity. Four sensors of unit noise.
        world: &'static str,
        scheme: &'static str => "The scheme.",
        /// Its setting: K sensors, m bits, n messages in a slot, L levels, M components at resolution r, a guaranteed error of delta.
        setting: String,
        /// How sensors learn the question: told it in full, following by echo, not at all; or the belief travels.
        feedback: &'static str,
        rmse: Measured => "Root mean squared error of the state, or of the position.",
        payload: Measured ["bit"] => "Payload bits of reports (of beliefs, where these travel) in a slot.",
        /// Bits on air in a slot: all frames of all nodes with preambles, headers, checks and feedback.
        air: Measured ["bit"],
        energy: Measured ["J"] => "Energy of all radios in a slot.",
        /// What no scheme can beat with so many payload bits and no information in silence (scalar), or with all measurements (plane).
        floor: f64,
        best_by_payload: Answer => "Nothing else has a smaller error with at most as many payload bits.",
        best_by_air: Answer => "The same by bits on air.",
        best_by_energy: Answer => "The same by energy.",
    }
}

pub struct Frontier;

fn marks(rows: &[Row], of: impl Fn(&Row) -> f64) -> Vec<Answer> {
    let beaten = |row: &Row| {
        rows.iter().any(|other| {
            other.world == row.world
                && of(other) <= of(row)
                && other.rmse.value <= row.rmse.value
                && (of(other) < of(row) || other.rmse.value < row.rmse.value)
        })
    };
    rows.iter().map(|row| Answer(!beaten(row))).collect()
}

impl Figure for Frontier {
    figure!(Parameters => Vec<Row>, "network-frontier", "One frontier for all schemes", "our own comparison",
        "Root mean squared error of every scheme against its payload, against all bits on air, and against the energy of \
         all radios (CC2420 at 0 dBm), on the same scalar and plane worlds with four sensors. The line joins what nothing else \
         beats in both. By payload one bit a sensor is a bargain; on air a frame's overhead of 200 bits buries the difference \
         between one bit and 32, so that few frames win, and sensors that are silent while they are predicted (adaptive) win most.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let (scalar, plane) = (worlds::scalar(p.slots)?, worlds::plane(p.slots)?);
        let (least, everything) = (scalar.everything()?, plane.everything()?[1].sqrt());
        let rows_of = |world, entries: Vec<Entry>, floor: &dyn Fn(f64) -> f64| -> Result<Vec<Row>, Error> {
            let stream = context.stream("network-frontier").named(world);
            let all = |it: Trial| entries.iter().map(|entry| entry.run(it.stream)).collect();
            let runs: Vec<Vec<Bill>> = context.trials(stream, p.trials, all)?;
            let row = |(i, entry): (usize, &Entry)| {
                let moments = |of: fn(&Bill) -> f64| runs.iter().map(|bills| of(&bills[i])).collect::<Moments>();
                let payload = Measured::from(moments(|bill| bill.reports));
                Row {
                    world,
                    scheme: entry.family,
                    setting: entry.setting.clone(),
                    feedback: entry.feedback,
                    rmse: Measured::root_mean(&moments(|bill| bill.squared)),
                    payload,
                    air: moments(|bill| bill.air).into(),
                    energy: moments(|bill| bill.joules).into(),
                    floor: floor(payload.value),
                    best_by_payload: Answer(false),
                    best_by_air: Answer(false),
                    best_by_energy: Answer(false),
                }
            };
            Ok(entries.iter().enumerate().map(row).collect())
        };
        let mut rows = rows_of("scalar", schemes::of_scalar(&scalar)?, &|rate| floor_at(rate, least))?;
        rows.extend(rows_of("plane", schemes::of_plane(&plane)?, &|_| everything)?);
        let by = [
            marks(&rows, |r| r.payload.value),
            marks(&rows, |r| r.air.value),
            marks(&rows, |r| r.energy.value),
        ];
        for (i, row) in rows.iter_mut().enumerate() {
            (row.best_by_payload, row.best_by_air, row.best_by_energy) = (by[0][i], by[1][i], by[2][i]);
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        let find = |world: &str, scheme: &str, setting: &str, feedback: &str| {
            first(rows, |r| (r.world, r.scheme, r.setting.as_str(), r.feedback) == (world, scheme, setting, feedback))
        };
        let ratio = |a: Option<&Row>, b: Option<&Row>, of: fn(&Row) -> f64| a.zip(b).map(|(a, b)| of(a) / of(b));
        let slack = |r: &&Row| r.floor - 4.0 * r.rmse.error();
        let loud = || select(rows, |r| !["CFwMD", "CFwMD2", "adaptive"].contains(&r.scheme));
        claims.all("floor", "no scheme that pays for every symbol beats the floor", loud(), |r| {
            r.rmse.value >= slack(&r)
        });
        claims.all("overhead", "air time is never below payload", rows, |r| r.air.value >= r.payload.value);
        for world in ["scalar", "plane"] {
            let fine = find(world, "all-send", "32 bit", "none");
            let words = |bits: &str, feedback: &str| find(world, "innovation-words", bits, feedback);
            let last = |bits: &str| ratio(words(bits, "echoed"), fine, |r| r.rmse.value);
            let what = "four bits a sensor come within five per cent of everything";
            full.at_most(format!("four-bits-{world}"), what, last("m=4"), 1.05);
            let errors = ["m=1", "m=2", "m=3", "m=4"].map(last);
            full.decreasing(format!("bits-{world}"), "more bits, less error", errors);
            let told = ratio(words("m=1", "told"), words("m=1", "echoed"), |r| r.air.value);
            claims.above(format!("echo-{world}"), "an echo is cheaper on air than the question in full", told, 1.0);
            let same = ratio(words("m=2", "told"), words("m=2", "echoed"), |r| r.rmse.value);
            claims.near(format!("same-{world}"), "and the estimates are the same", same, 1.0, 1e-12);
            let energy = ratio(words("m=1", "echoed"), fine, |r| r.energy.value);
            let what = "one bit a sensor needs more than half of the radio energy of 32: frames cost, not bits";
            claims.at_least(format!("frames-{world}"), what, energy, 0.5);
        }
        let [censored, spoken] = [("CFwMD", "n=1"), ("innovation-words", "m=1")]
            .map(|(scheme, setting)| find("plane", scheme, setting, "echoed"));
        let silent = ratio(censored, spoken, |r| r.energy.value);
        let quiet =
            |r: &&Row| r.scheme == "adaptive" && ["delta=0.5", "delta=1", "delta=2"].contains(&r.setting.as_str());
        let what = "silence within +-0.5 to 2 of what both ends predict: nothing has less error for less energy";
        full.all("adaptive", what, rows.iter().filter(quiet), |r| r.best_by_energy.0);
        claims.below("silence", "one message a slot costs less energy than four sensors of one bit", silent, 1.0);
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        type Of = fn(&Row) -> f64;
        type Mark = fn(&Row) -> Answer;
        let axes: [(&str, Of, Mark); 3] = [
            ("payload / (bit/slot)", |r| r.payload.value, |r| r.best_by_payload),
            ("bits on air / (bit/slot)", |r| r.air.value, |r| r.best_by_air),
            ("radio energy / (mJ/slot)", |r| 1e3 * r.energy.value, |r| r.best_by_energy),
        ];
        let families = distinct(rows, |r| r.scheme);
        let mut panels = Vec::new();
        for (i, (label, of, best)) in axes.iter().enumerate() {
            // The noise of a measurement has a deviation of 1, in the plane 1 m.
            for (world, unit) in [
                ("scalar", "RMSE / noise deviation"),
                ("plane", "RMSE of the position / m"),
            ] {
                let mut panel = Panel::loglog(world, *label, unit);
                let here = || rows.iter().filter(|r| r.world == world);
                if i == 0 {
                    let mut floor = points(here(), |r| (of(r), r.floor));
                    floor.sort_by(|a, b| a.0.total_cmp(&b.0));
                    panel = panel.with(Layer::dashed("no scheme is below, unless by silence", floor).coloured(7));
                }
                for (colour, family) in families.iter().enumerate() {
                    let rows = here().filter(|r| r.scheme == *family);
                    panel = panel.with(Layer::measured(*family, rows, |r| (of(r), r.rmse)).coloured(colour));
                }
                let mut frontier: Vec<_> = here().filter(|r| best(r).0).collect();
                frontier.sort_by(|a, b| of(a).total_cmp(&of(b)));
                // Names nearer than a factor of 1.6 would hide one another.
                let mut names: Vec<(f64, f64, String)> = Vec::new();
                for row in &frontier {
                    if names.last().is_none_or(|(x, _, _)| of(row) > 1.6 * x) {
                        names.push((of(row), row.rmse.value, row.setting.clone()));
                    }
                }
                // Steps: between two settings nothing is reached but the error of the cheaper one.
                let corners = frontier.windows(2).map(|w| (of(w[1]), w[0].rmse.value));
                let corners = corners.chain(frontier.last().map(|r| (of(r), r.rmse.value)));
                let points = frontier.iter().map(|r| (of(r), r.rmse.value));
                let steps = points.zip(corners).flat_map(|(at, corner)| [at, corner]).collect();
                panels.push(
                    panel
                        .with(Layer::unbroken("nothing beats these", steps))
                        .with(Layer::beside(names)),
                );
            }
        }
        Plot::grid(2, panels)
    }
}
