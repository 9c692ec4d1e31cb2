//! Figure 6(c): the actual error.

use super::filters::{
    PARTICLES, REFERENCE, STEPS, Smoothing, chosen, estimate, median, paper_cut, plain_step, prior, single, world,
};
use super::world::Walk;
use crate::prelude::*;
use fewbits_baselines::mixture_codec::divergence::Divergence;
use fewbits_core::Columns;
use fewbits_densities::{KernelEstimate, Mixture, Particles};
use fewbits_mixture_codec::plug_in::plug_in;

parameters! {
    pub struct Parameters {
        components: usize [1..=100] = 5 => "Components sent.",
        points: usize [2..=2000] = 250 => "Points of the reference at which densities are compared.",
        trials: u64 [2..=100_000] = 150 => quick 4 => "Worlds.",
    }
    cost |p| Cost::new(0.2 * p.trials as f64, 2e3 * p.trials as f64);
}

rows! {
    pub struct Row by "{method}-t{t}" at full_trials {
        t: usize as x("hand-overs t") => "Time.",
        /// What is handed on: a cut by ml, kl or l1; the estimate (kde_only); particles (raw_pf); one Gaussian (gauss).
        method: &'static str as key,
        /// KL from one reference filter to the method, less that to the other reference filter.
        kl_increase: Measured ["nat"] as curve in error,
        median: f64 ["nat"] => "Median over worlds.",
        before_reduction: Option<Measured> ["nat"] => "The same before the step's own reduction.",
    }

    #[derive(Default)]
    pub struct Rows {
        error: Vec<Row> => "The actual error.",
        difference: Vec<Difference> => "Paired differences.",
        bounds: Vec<Unamplified> => "Bounds in the same worlds.",
    }

    struct Unamplified {
        t: usize as x("hand-overs t") => "Time.",
        /// Sum of the KL errors of all hand-overs (KL-optimised): the printed KL bound if nothing were amplified.
        kl_sum: Measured ["nat"] as dashed("KL bound, not amplified") in error,
        /// Twice the sum of the ML errors (ML-optimised): the printed ML bound, which bounds the KL as well.
        ml_bound: Measured ["nat"],
    }

    struct Difference by "{pair}-t{t}" at full_trials {
        t: usize => "Time.",
        pair: &'static str => "Which.",
        kl: Measured ["nat"] => "Difference of their errors, world by world.",
    }
}

/// What is made of an estimate of so many components, if anything.
type Reduce = fn(&KernelEstimate<2>, usize) -> Result<Mixture<2>, Error>;

const METHODS: [(&str, Option<Reduce>); 6] = [
    ("ml", Some(|estimate, components| paper_cut(estimate, 0, components))),
    ("kl", Some(|estimate, components| paper_cut(estimate, 1, components))),
    ("l1", Some(|estimate, components| paper_cut(estimate, 2, components))),
    ("kde_only", None),
    ("raw_pf", None),
    ("gauss", Some(|estimate, _| single(estimate))),
];

/// One filter under test: what it knows.
enum Known {
    Mixture(Mixture<2>),
    Particles(Particles<2>),
}

/// What all methods lose up to one time of a world.
#[derive(Default)]
struct Moment {
    after: [f64; 6],
    /// The same before the reduction.
    before: [f64; 6],
    /// Plug-in error of the ML-optimised cut.
    ml: f64,
    /// Of the KL-optimised one.
    kl: f64,
}

fn trial(p: &Parameters, it: Trial) -> Result<Vec<Moment>, Error> {
    let world = world(it.stream)?;
    let (filter, reference) = (Smoothing::Silverman.filter(PARTICLES)?, Smoothing::Silverman.filter(REFERENCE)?);
    let rng = |name: &str| it.stream.named(name).fast_rng();
    let [mut pick, mut rng_a, mut rng_b] = ["points", "reference a", "reference b"].map(rng);
    let mut a = prior()?.sample_systematic(&mut rng_a, REFERENCE)?;
    let mut b = prior()?.sample_systematic(&mut rng_b, REFERENCE)?;
    let mut filters = Vec::new();
    for (method, _) in METHODS {
        let (mut own, start) = (rng(method), prior()?);
        let known = match method {
            "raw_pf" => Known::Particles(start.sample_systematic(&mut own, PARTICLES)?),
            _ => Known::Mixture(start),
        };
        filters.push((known, own));
    }
    let mut run = Vec::new();
    for reading in &world.readings {
        plain_step(&mut rng_a, &mut a, reading)?;
        plain_step(&mut rng_b, &mut b, reading)?;
        let mut points = a.clone();
        points.select(&chosen(&mut pick, a.weights(), p.points))?;
        let mean_log = |density: &dyn Fn(Columns<'_, 2>, &mut [f64])| {
            let mut logs = vec![0.0; p.points];
            density(points.columns(), &mut logs);
            logs.iter().sum::<f64>() / logs.len() as f64
        };
        let other = estimate(&reference, &b)?;
        let base = mean_log(&|x, out| other.log_pdf_columns(x, out));
        let mut at = Moment::default();
        for (m, (known, own)) in filters.iter_mut().enumerate() {
            let estimate = match known {
                Known::Particles(particles) => {
                    plain_step(own, particles, reading)?;
                    estimate(&filter, particles)?
                }
                Known::Mixture(mixture) => estimate(&filter, &filter.posterior(own, mixture, &Walk, reading)?.0)?,
            };
            at.before[m] = base - mean_log(&|x, out| estimate.log_pdf_columns(x, out));
            at.after[m] = at.before[m];
            let mut sent = None;
            if let Some(reduce) = METHODS[m].1 {
                let mixture = sent.insert(reduce(&estimate, p.components)?);
                at.after[m] = base - mean_log(&|x, out| mixture.log_pdf_columns(x, out));
                match m {
                    0 => at.ml = Divergence::from(plug_in(&estimate, mixture)).ml,
                    1 => at.kl = Divergence::from(plug_in(&estimate, mixture)).kl,
                    _ => {}
                }
            }
            if let Known::Mixture(mixture) = known {
                *mixture = sent.map_or_else(|| estimate.to_mixture(), Ok)?;
            }
        }
        run.push(at);
    }
    Ok(run)
}

pub struct Fig6c;

impl Rows {
    fn at(&self, t: usize, method: &str) -> Option<Measured> {
        first(&self.error, |r| r.t == t && r.method == method).map(|r| r.kl_increase)
    }
}

impl Figure for Fig6c {
    figure!(Parameters => Rows, "handoff-fig6c", "The actual error", "compressed particle filter, Section 6, Figure 6(c)",
        "KL from a reference filter of 2000 particles, less that to an independent copy of it, in 150 worlds. The three criteria are \
         close, ML a little behind; all are far below their bounds, and a single Gaussian is far behind.";
        { error: linear("KL increase / nat", "Five components") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let runs = context.trials(context.stream("handoff-fig6c"), p.trials, |it| trial(p, it))?;
        let mut rows = Rows::default();
        for t in 1..=STEPS {
            let after = |m: usize| runs.iter().map(move |run| run[t - 1].after[m]);
            let before = |m: usize| runs.iter().map(move |run| run[t - 1].before[m]);
            for (m, (method, _)) in METHODS.into_iter().enumerate() {
                rows.error.push(Row {
                    t,
                    method,
                    kl_increase: after(m).collect(),
                    median: median(after(m)),
                    before_reduction: (m < 3).then(|| before(m).collect()),
                });
            }
            let sum =
                |of: fn(&Moment) -> f64| -> Measured { runs.iter().map(|run| run[..t].iter().map(of).sum()).collect() };
            rows.bounds.push(Unamplified {
                t,
                kl_sum: sum(|at| at.kl),
                ml_bound: sum(|at| at.ml).scaled(2.0),
            });
            for (pair, a, b) in [("ml-kl", 0, 1), ("kl-l1", 1, 2)] {
                let kl = after(a).zip(after(b)).map(|(a, b)| a - b).collect();
                rows.difference.push(Difference { t, pair, kl });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        let pair = |pair: &'static str| rows.difference.iter().filter(move |d| d.pair == pair);
        paper.all("ml-behind", "ML is behind KL at every time", pair("ml-kl"), |d| d.kl.value > 0.0);
        let what = "KL and L1 are the same within 0.015 nat and three standard errors";
        here.all("kl-l1", what, pair("kl-l1"), |d| d.kl.value.abs() < 0.015 + 3.0 * d.kl.error());
        let worst = (1..=STEPS).filter_map(|t| {
            let gauss = rows.at(t, "gauss")?.value;
            let better = |(method, _): &(&str, _)| rows.at(t, method).is_some_and(|v| v.value < gauss);
            Some(METHODS[..5].iter().all(better))
        });
        paper.all("gauss-worst", "one Gaussian is worst at every time", worst, |w| w);
        let ratio = |t: usize, of: fn(&Unamplified) -> Measured, method: &str| {
            over(first(&rows.bounds, |b| b.t == t).map(of), rows.at(t, method))
        };
        for (t, least) in [(2, 1.5), (10, 3.0)] {
            let what =
                format!("even with nothing amplified the KL bound at time {t} is {least} times the error or more");
            paper.at_least(format!("kl-bound-t{t}"), what, ratio(t, |b| b.kl_sum, "kl"), least);
        }
        let what = "at time 10 the ML bound is about two hundred times the error of the ML-optimised cut";
        paper.near("ml-bound-t10", what, ratio(10, |b| b.ml_bound, "ml"), 200.0, 80.0);
        let what = "smoothing, not reduction, makes most of the error: the estimate alone is above 0.7 of KL";
        let share = over(rows.at(10, "kde_only"), rows.at(10, "kl"));
        paper.above("smoothing", what, share, 0.7);
    }
}
