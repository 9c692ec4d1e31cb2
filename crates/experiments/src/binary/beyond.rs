//! `binary-beyond`: what the thesis leaves on the table.

use super::feedback::descend;
use super::{Scene, quantizers};
use crate::prelude::*;
use fewbits_binary_patterns::published::{AdaptiveRule, adaptive};
use fewbits_binary_patterns::search::{Descent, free_breakpoints};
use fewbits_binary_patterns::{BinaryQuantizer, Grid, Mask, Pattern, PatternSensor, Source, gray_basis};
use fewbits_monte_carlo::parallel;
use fewbits_sensor_assignment::{CodedSensors, Estimator, all_errors, exchange, pair_costs};

pub struct Beyond;

parameters! {
    pub struct Parameters {
        /// Include the designs with free thresholds and the larger searches, which take most of the time.
        thorough: bool = true => quick false,
    }
}

rows! {
    pub struct Rows {
        changes: Vec<Change> => "Errors before and after each change.",
        designs: Vec<Design> => "The designs behind the errors after, where there is one.",
    }

    struct Change by "{id}" {
        id: String => "Name of the comparison.",
        idea: &'static str => "What is changed.",
        case: String => "Where.",
        before: f64 ["V^2"] => "Error before.",
        after: f64 ["V^2"] => "Error after.",
        change_percent: f64 ["%"] => "Relative change.",
    }

    struct Design {
        id: String => "Name of the comparison.",
        start: &'static str => "Where the search began that found it.",
        sensor: usize => "Sensor, from 1.",
        noise_std: f64 ["V"] => "Standard deviation of its noise.",
        mask: Option<Mask> => "Its mask, where it is a linear pattern on a grid.",
        thresholds: String ["V"] => "Thresholds at which its bit changes, from 0 below all of them.",
    }
}

type Outcome = (Change, Vec<Design>);
type Job = Box<dyn Fn() -> Result<Outcome, Error> + Sync + Send>;

/// A comparison without a design of its own.
fn change(id: String, idea: &'static str, case: String, before: f64, after: f64) -> Outcome {
    let change_percent = 100.0 * (after / before - 1.0);
    let row = Change {
        id,
        idea,
        case,
        before,
        after,
        change_percent,
    };
    (row, Vec::new())
}

/// Puts its design beside a comparison.
fn designed(
    (row, _): Outcome,
    start: &'static str,
    masks: Option<&[Mask]>,
    sensors: &[(BinaryQuantizer, f64)],
) -> Outcome {
    let design = |(i, (quantizer, noise_std)): (usize, &(BinaryQuantizer, f64))| Design {
        id: row.id.clone(),
        start,
        sensor: i + 1,
        noise_std: *noise_std,
        mask: masks.and_then(|masks| masks.get(i).copied()),
        thresholds: quantizer
            .breakpoints()
            .iter()
            .map(|b| format!("{b:.10}"))
            .collect::<Vec<_>>()
            .join(" "),
    };
    let designs = sensors.iter().enumerate().map(design).collect();
    (row, designs)
}

/// As [`designed`], for masks on a scene's grid.
fn masked(outcome: Outcome, start: &'static str, scene: &Scene, masks: &[Mask], bits: usize) -> Result<Outcome, Error> {
    let own = quantizers(scene, masks.iter().copied(), bits)?;
    let sensors: Vec<_> = own.into_iter().map(|q| (q, scene.noise)).collect();
    Ok(designed(outcome, start, Some(masks), &sensors))
}

fn any_rank(source: &'static str, sensors: usize, snr: f64) -> Job {
    Box::new(move || {
        let scene = match source {
            "uniform" => Scene::uniform(3, snr)?,
            _ => Scene::gaussian(snr)?,
        };
        let search = scene.search(sensors)?;
        let before = search.best()?.mse;
        let found = search.any_rank().best()?;
        let (id, case) = (format!("any-rank-{source}-n{sensors}-{snr}"), format!("{source}, N={sensors}, {snr} dB"));
        masked(change(id, "any rank", case, before, found.mse), "exhaustive", &scene, &found.masks, 3)
    })
}

fn resolution(bits: usize, sensors: usize, snr: f64) -> Job {
    Box::new(move || {
        let before = Scene::uniform(3, snr)?.search(sensors)?.best()?.mse;
        let (masks, after) = descend(bits, sensors, snr, 2)?;
        let (id, case) = (format!("bits-{bits}-n{sensors}-{snr}"), format!("B={bits}, N={sensors}, {snr} dB"));
        let outcome = change(id, "finer grid", case, before, after);
        masked(outcome, "repeated Gray basis, two scattered", &Scene::uniform(bits, snr)?, &masks, bits)
    })
}

/// Any of the 127 patterns, by descent from linear ones.
fn any_patterns(scene: &Scene, linear: &[Mask]) -> Result<(Vec<BinaryQuantizer>, f64), Error> {
    let all = Pattern::all(8)?;
    let place = |&m: &Mask| {
        let wanted = super::pattern(m, 3)?;
        let place = all.iter().position(|p| *p == wanted);
        place.ok_or_else(|| Error::Table(format!("mask {m} is no pattern of eight cells")))
    };
    let start = linear.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let candidates = all.iter().map(|p| p.on(&scene.grid)).collect::<Result<Vec<_>, _>>()?;
    let descent = Descent::with_deviations(scene.source, vec![scene.noise; linear.len()], candidates.clone())?;
    let found = descent.run(&[start], 12, |_| true)?;
    Ok((found.choice.into_iter().map(|c| candidates[c].clone()).collect(), found.mse))
}

fn any_pattern(snr: f64) -> Job {
    Box::new(move || {
        let scene = Scene::uniform(3, snr)?;
        let best = scene.search(8)?.best()?;
        let (found, after) = any_patterns(&scene, &best.masks)?;
        let case = format!("uniform, N=8, {snr} dB");
        let outcome = change(format!("any-pattern-{snr}"), "any of 127 patterns", case, best.mse, after);
        let sensors: Vec<_> = found.into_iter().map(|q| (q, scene.noise)).collect();
        Ok(designed(outcome, "best linear patterns, twelve scattered", None, &sensors))
    })
}

/// Free thresholds from the best linear patterns, from the best of any rank, from those of a finer grid, and from any patterns.
fn free(id: &'static str, name: &'static str, scene: Scene, sensors: usize, jitter: f64) -> Job {
    Box::new(move || {
        let search = scene.search(sensors)?;
        let linear = search.best()?;
        let any = search.any_rank().best()?;
        let mut starts = vec![
            ("best linear patterns", quantizers(&scene, linear.masks.iter().copied(), 3)?),
            ("linear patterns of any rank", quantizers(&scene, any.masks, 3)?),
        ];
        if sensors > 3 {
            let fine = Scene {
                grid: Grid::uniform(1.0, 4)?,
                ..scene.clone()
            };
            let best = fine.search(sensors)?.any_rank().best()?;
            starts.push(("linear patterns of four bits, any rank", quantizers(&fine, best.masks, 4)?));
            starts.push(("any of 127 patterns", any_patterns(&scene, &linear.masks)?.0));
        }
        let results = parallel::try_map(&starts, |(start, quantizers)| {
            let sensors = quantizers
                .iter()
                .map(|q| PatternSensor::with_deviation(q.clone(), scene.noise));
            let sensors = sensors.collect::<Result<Vec<_>, _>>()?;
            let jitter = jitter / scene.source.scale();
            Ok::<_, Error>((*start, free_breakpoints(&scene.source, &sensors, jitter, 4)?))
        })?;
        let best = results.into_iter().min_by(|a, b| a.1.mse.total_cmp(&b.1.mse));
        let (start, found) = best.ok_or_else(|| Error::Table("no start".to_owned()))?;
        let sensors: Vec<_> = found
            .sensors
            .iter()
            .map(|s| (s.quantizer().clone(), s.noise_deviation()))
            .collect();
        let outcome = change(format!("free-{id}"), "free thresholds", name.to_owned(), linear.mse, found.mse);
        Ok(designed(outcome, start, None, &sensors))
    })
}

/// Two adaptive rules of ten sensors, by the error that each is judged by.
fn rules(
    (id, idea, case): (&'static str, &'static str, &'static str),
    snr: f64,
    before: (AdaptiveRule, bool),
    after: (AdaptiveRule, bool),
) -> Job {
    Box::new(move || {
        let source = Source::uniform(1.0)?;
        let noise = source.noise_deviation(snr)?;
        let run = |(rule, posterior_mean): (AdaptiveRule, bool)| {
            let errors = adaptive(&source, noise, 10, rule)?;
            Ok::<_, Error>(if posterior_mean { errors.mmse } else { errors.mle })
        };
        let (before, after) = (run(before)?, run(after)?);
        Ok(change(format!("{id}-{snr}"), idea, format!("{case}, N=10, {snr} dB"), before, after))
    })
}

fn posterior_mean(snr: f64) -> Job {
    let names = ("posterior-mean", "posterior-mean thresholds", "against AQ-ML");
    rules(names, snr, (AdaptiveRule::MaximumLikelihood, false), (AdaptiveRule::PosteriorMean, true))
}

fn least_variance(snr: f64) -> Job {
    let names = ("least-variance", "variance-minimising thresholds", "against posterior mean");
    rules(names, snr, (AdaptiveRule::PosteriorMean, true), (AdaptiveRule::LeastVariance, true))
}

fn smaller_steps(snr: f64) -> Job {
    let names = ("small-steps", "smaller AQ-VS steps", "0.2 and 1.2 for 0.5 and 1.5");
    let rule = |step, factor| (AdaptiveRule::VariableStep { step, factor }, false);
    rules(names, snr, rule(0.5, 1.5), rule(0.2, 1.2))
}

/// The sensors of Table 6.1.
fn unequal() -> Result<CodedSensors, Error> {
    Ok(CodedSensors::with_variances(1.0, &[0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001])?)
}

const UNEQUAL: &str = "sensors of table 6.1";

fn decoder_of_table_6_1() -> Result<Outcome, Error> {
    let sensors = unequal()?;
    let best = pair_costs(&sensors).solve();
    let (before, after) = (sensors.centre_mse(&best)?, sensors.mmse(&best)?);
    Ok(change("assign-mmse".into(), "posterior mean for Gray bits", UNEQUAL.into(), before, after))
}

fn exchange_of_table_6_1() -> Result<Outcome, Error> {
    let sensors = unequal()?;
    let linear = pair_costs(&sensors).solve();
    let after = exchange(&sensors, &linear, Estimator::PosteriorMean)?.error;
    let case = format!("{UNEQUAL}, posterior mean");
    Ok(change("exchange".into(), "exchange of two sensors", case, sensors.mmse(&linear)?, after))
}

fn joint_of_table_6_1() -> Result<Outcome, Error> {
    let sensors = unequal()?;
    let before = all_errors(&sensors, Estimator::PosteriorMean)?.least;
    let scene = Scene {
        source: Source::uniform(1.0)?,
        grid: Grid::uniform(1.0, 4)?,
        noise: 0.0,
    };
    let candidates = quantizers(&scene, 1..16, 4)?;
    let descent = Descent::with_deviations(scene.source, sensors.noise_deviations().to_vec(), candidates.clone())?;
    let gray = gray_basis(4)?;
    // The most precise sensors come last, and serve the finest bits well.
    let start: Vec<usize> = gray.iter().cycle().take(8).map(|&m| m as usize - 1).collect();
    let constant = gray.iter().map(|&m| vec![m as usize - 1; 8]);
    let starts: Vec<Vec<usize>> = std::iter::once(start).chain(constant).collect();
    let found = descent.run(&starts, 40, |_| true)?;
    let masks: Vec<Mask> = found.choice.iter().map(|&c| c as Mask + 1).collect();
    let own = found.choice.iter().map(|&c| candidates[c].clone());
    let own: Vec<_> = own.zip(sensors.noise_deviations().iter().copied()).collect();
    let case = format!("{UNEQUAL}, B=4");
    let outcome = change("joint".into(), "joint pattern and sensor design", case, before, found.mse);
    Ok(designed(outcome, "repeated Gray basis, 40 scattered", Some(&masks), &own))
}

fn jobs(thorough: bool) -> Result<Vec<Job>, Error> {
    let mut jobs: Vec<Job> = vec![
        any_rank("uniform", 3, 0.0),
        any_rank("uniform", 3, 5.0),
        any_rank("uniform", 3, 10.0),
        any_rank("uniform", 8, 0.0),
        any_rank("uniform", 8, 5.0),
        any_rank("gaussian", 3, 5.2),
        resolution(4, 8, 18.2),
        resolution(4, 10, 30.0),
        resolution(5, 10, 30.0),
        posterior_mean(5.0),
        posterior_mean(15.0),
        posterior_mean(30.0),
        smaller_steps(5.0),
        smaller_steps(10.0),
        smaller_steps(20.0),
        Box::new(decoder_of_table_6_1),
        Box::new(exchange_of_table_6_1),
    ];
    if thorough {
        jobs.push(resolution(6, 10, 30.0));
        jobs.push(any_pattern(10.0));
        jobs.push(Box::new(joint_of_table_6_1));
        jobs.push(least_variance(5.0));
        jobs.push(least_variance(20.0));
        let uniform = |snr| Scene::uniform(3, snr);
        jobs.push(free("n8-18.2", "uniform, N=8, 18.2 dB", uniform(18.2)?, 8, 0.04));
        jobs.push(free("n8-10", "uniform, N=8, 10 dB", uniform(10.0)?, 8, 0.06));
        jobs.push(free("gaussian", "Gaussian, N=3, 5.2 dB", Scene::gaussian(5.2)?, 3, 0.03));
        jobs.push(free("n3-25", "uniform, N=3, 25 dB", uniform(25.0)?, 3, 0.02));
    }
    Ok(jobs)
}

impl Figure for Beyond {
    figure!(Parameters => Rows, "binary-beyond", "Beyond the thesis", "",
        "Exact errors before and after each change: no rank constraint, finer grids, any pattern, thresholds off the grid, joint \
         choice of patterns for unequal sensors, the posterior mean instead of the cell's centre, better adaptive \
         thresholds. The table `designs` has masks and thresholds, and where the search for them began.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let found = parallel::try_map(&jobs(p.thorough)?, |job| job())?;
        let (changes, designs): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        Ok(Rows {
            changes,
            designs: designs.into_iter().flatten().collect(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.all("improvements", "every change lowers the error", &rows.changes, |r| r.after < r.before);
        claims.keyed("after", "error after the change", &rows.changes, |r| r.after);
        claims.keyed("change", "relative change (%)", &rows.changes, |r| r.change_percent);
        let at = |id: &str| rows.changes.iter().find(|r| r.id == id);
        // A search may find a better design than the best known, not a worse one.
        let known = |r: &Change| crate::reference::value(&format!("binary-beyond/best-known/{}", r.id));
        let what = "no search ends above the best design known from elsewhere, but for 0.1 %";
        let searched = rows.changes.iter().filter_map(|r| Some((r.after, known(r)?)));
        here.all("best-known", what, searched, |(after, known)| after <= 1.001 * known);
        for (what, ids, least) in [
            ("posterior-mean thresholds", ["posterior-mean-5", "posterior-mean-15", "posterior-mean-30"], 12.0),
            ("smaller steps", ["small-steps-5", "small-steps-10", "small-steps-20"], 6.0),
        ] {
            let rows = ids.into_iter().map(|id| at(id).map(|r| r.change_percent));
            let statement = format!("{what} lower the error by at least {least} %");
            claims.all(ids[0], statement, rows, |change| change.is_some_and(|c| c <= -least));
        }
        for id in ["least-variance-5", "least-variance-20", "free-n3-25"] {
            let gain = at(id).map(|r| -r.change_percent);
            here.at_most(id, "gains less than 1 %", gain, 1.0);
        }
        let of = |id: &str| rows.designs.iter().filter(move |d| d.id == id).collect::<Vec<_>>();
        for id in ["free-n8-18.2", "free-n8-10", "free-gaussian"] {
            let design = of(id);
            let thresholds: usize = design.iter().map(|d| d.thresholds.split(' ').count()).sum();
            let start = design.first().map_or("", |d| d.start);
            let change = at(id).map(|r| r.change_percent);
            let percent = change.unwrap_or_default();
            let what = format!(
                "free thresholds change the error of the best linear patterns by {percent:.1} %: {thresholds} thresholds, from {start}"
            );
            here.below(format!("{id}-start"), what, change, 0.0);
        }
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let all = || (0..).map(|i: i32| f64::from(-i)).zip(&rows.changes);
        let bars = all().map(|(at, r)| (r.change_percent.min(0.0), 0.0, at - 0.35, at + 0.35));
        let numbers = all().map(|(at, r)| (r.change_percent - 14.0, at, format!("{:.1}", r.change_percent)));
        let names = rows.changes.iter().map(|r| format!("{}: {}", r.idea, r.case));
        Plot::of(
            Panel::new(
                "Change of the mean squared error",
                Axis::linear("change / %").between(-132.0, 2.0),
                Axis::ladder(names),
            )
            .with(Layer::boxes("", bars.collect()).coloured(0))
            .with(Layer::texts(numbers.collect())),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_design_lists_every_sensor_with_its_thresholds() {
        let (row, designs) = any_rank("uniform", 3, 5.0)().unwrap();
        assert_eq!(designs.len(), 3);
        assert!(row.after < row.before);
        assert!(designs.iter().all(|d| d.mask.is_some() && !d.thresholds.is_empty()));
    }
}
