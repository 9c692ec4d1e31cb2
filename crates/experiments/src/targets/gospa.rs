//! `targets-gospa`: several targets from few bits a report.

use super::world::{self, DETECTION, Moment, Reporting, Scenario, Seen};
use crate::prelude::*;
use fewbits_multi_target::{Gospa, Report, Tracks, gospa};

/// Distance beyond which an estimate is of no target.
const CUTOFF: f64 = 20.0;
/// Deviation of a range, with which the references were computed.
const NOISE: f64 = 6.0;

parameters! {
    pub struct Parameters {
        bits: Vec<u32> [1..=6; 1..] = vec![1, 2, 3, 4] => "Bits of a report.",
        noise: f64 [0.1..=30.0] = NOISE => "Deviation of a range, m.",
        trials: u64 [2..=10_000] = 60 => quick 4 => "Runs of each scenario.",
    }
    cost |p| Cost::new(0.02 * (p.trials * (p.bits.len() as u64 + 1)) as f64, 1e8);
}

rows! {
    pub struct Row {
        scenario: &'static str as panel("{}") => "The world.",
        bits: u32 as x("bits of a report") => "Bits of a report.",
        gospa: Measured ["m"] as points("few bits") => "GOSPA of the confirmed tracks (order 2, cut-off 20 m), root mean square over steps and runs.",
        full: Measured ["m"] as dashed("full values") => "The same with full values on the same worlds.",
        jpda: Option<f64> ["m"] as dashed("Stone Soup, full values") => "Stone Soup's joint probabilistic data association with the same full values, told which targets there are and when.",
        /// Root mean square over steps and runs of each part.
        localisation: Measured ["m"] as curve("its localisation") => "Its part from the distance of assigned pairs.",
        missed: Measured ["m"] as curve("its missed targets") => "Its part from missed targets.",
        false_targets: Measured ["m"] as curve("its false targets") => "Its part from false targets.",
        ratio: f64 => "GOSPA over that of full values.",
    }
}

pub struct Targets;

/// Mean over the steps of the squared GOSPA and of its parts.
fn run(scenario: Scenario, noise: f64, world: &[Moment], reporting: &Reporting) -> Result<[f64; 4], Error> {
    let (tracker, motion, sensors) = (scenario.tracker()?, world::motion()?, world::sensors(noise)?);
    let (mut tracks, mut sums) = (Tracks::default(), [0.0; 4]);
    for (step, moment) in world.iter().enumerate() {
        tracker.predict(&motion, &mut tracks)?;
        for (k, (sensor, ranges)) in sensors.iter().zip(&moment.ranges).enumerate() {
            let mut seen: Vec<(Seen, f64)> = Vec::new();
            for range in ranges {
                let (factor, clutter) = reporting.report(step, k, *range, noise)?;
                seen.push((Observed::new(*sensor, factor), clutter));
            }
            let reports: Vec<Report<'_, 4>> = seen
                .iter()
                .map(|(likelihood, clutter)| Report {
                    likelihood,
                    clutter: *clutter,
                })
                .collect();
            tracker.update(&mut tracks, |_| DETECTION, &reports)?;
        }
        let place = |x: &SVector<f64, 4>| Vector2::new(x[0], x[2]);
        let found: Vec<Vector2<f64>> = tracks.confirmed(0.5).map(|track| place(track.belief.mean())).collect();
        let Gospa {
            value,
            localisation,
            missed,
            false_targets,
            ..
        } = gospa(&found, &moment.targets, CUTOFF, 2.0)?;
        for (sum, part) in sums
            .iter_mut()
            .zip([value * value, localisation, missed, false_targets])
        {
            *sum += part / world.len() as f64;
        }
    }
    Ok(sums)
}

impl Figure for Targets {
    figure!(Parameters => Vec<Row>, "targets-gospa", "Several targets from few bits", "our own comparison",
        "Joint association of reports whose origin is unknown: five range sensors (deviation 6 m) see each target with \
         probability 0.9 and report one false range a step. A report is a full range, or the index of one of 2^b cells; the \
         cells of even and odd steps are half a cell apart, and there is no feedback. Targets enter at known places."; linear("GOSPA / m"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let all: Vec<Reporting> = [Reporting::Full]
            .into_iter()
            .chain(p.bits.iter().map(|bits| Reporting::cells(*bits)))
            .collect();
        let mut rows = Vec::new();
        for (name, scenario) in Scenario::ALL {
            let stream = context.stream("targets-gospa").named(name);
            let sums = context.moments(stream, p.trials, |trial| {
                let world = world::draw(scenario, p.noise, trial.stream)?;
                let mut numbers = Vec::new();
                for reporting in &all {
                    numbers.extend(run(scenario, p.noise, &world, reporting)?);
                }
                Ok(numbers)
            })?;
            let part = |i: usize, k: usize| Measured::root_mean(&sums[4 * i + k]);
            let jpda = reference::value(&format!("targets-gospa/jpda/{name}")).filter(|_| p.noise == NOISE);
            rows.extend(p.bits.iter().enumerate().map(|(i, bits)| Row {
                scenario: name,
                bits: *bits,
                gospa: part(i + 1, 0),
                full: part(0, 0),
                jpda,
                localisation: part(i + 1, 1),
                missed: part(i + 1, 2),
                false_targets: part(i + 1, 3),
                ratio: part(i + 1, 0).value / part(0, 0).value,
            }));
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_defaults().at_full_trials();
        for (name, _) in Scenario::ALL {
            let of = |bits: u32| first(rows, |r| r.scenario == name && r.bits == bits).map(|r| r.ratio);
            let id = name.replace(' ', "-");
            let what = "three bits a report come within 15 per cent of full values";
            full.at_most(format!("three-bits-{id}"), what, of(3), 1.15);
            full.decreasing(format!("bits-{id}"), "more bits, less error", [1, 2, 3].map(of));
        }
        // Another program's numbers, which stand beside ours: it knows what ours has to find.
        claims.shown("jpda");
        let sum = |r: &Row| {
            [r.localisation, r.missed, r.false_targets]
                .map(|part| part.value.powi(2))
                .iter()
                .sum::<f64>()
        };
        claims.all("parts", "the parts sum to the whole", rows, |r| {
            (sum(r) - r.gospa.value.powi(2)).abs() < 1e-9 * sum(r)
        });
    }
}
