//! Figure 6(c): the actual error.

use super::filters::{
    CRITERIA, PARTICLES, REFERENCE, STEPS, Smoothing, estimate, paper_cut, plain_step, prior, single, world,
};
use super::world::{Reading, Walk};
use crate::prelude::*;
use fewbits_core::Columns;
use fewbits_densities::{KernelEstimate, Mixture, Particles};
use fewbits_handoff::published::StepError;
use fewbits_handoff::{HandoffFilter, Whole};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

parameters! {
    pub struct Parameters {
        components: usize [1..=100] = 5 => "Components sent.",
        points: usize [2..=2000] = 250 => "Points of the reference at which densities are compared.",
        trials: u64 [2..=100_000] = 500 => quick 4 => "Worlds.",
    }
}

rows! {
    pub struct Row by "{method}-t{t}" {
        t: usize => "Time.",
        /// What is handed on: a cut by ml, kl or l1; the estimate (kde_only); particles (raw_pf); one Gaussian (gauss).
        method: &'static str,
        /// KL from one reference filter to the method, less that to the other reference filter.
        kl_increase: Measured ["nat"],
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
        t: usize => "Time.",
        /// Sum of the KL errors of all hand-overs (KL-optimised): the printed KL bound if nothing were amplified.
        kl_sum: Measured ["nat"],
        /// Twice the sum of the ML errors (ML-optimised): the printed ML bound, which bounds the KL as well.
        ml_bound: Measured ["nat"],
    }

    struct Difference by "{pair}-t{t}" {
        t: usize => "Time.",
        pair: &'static str => "Which.",
        kl: Measured ["nat"] => "Difference of their errors, world by world.",
    }
}

const METHODS: [&str; 6] = ["ml", "kl", "l1", "kde_only", "raw_pf", "gauss"];

/// One filter under test: what it knows.
enum Known {
    Mixture(Mixture<2>),
    Particles(Particles<2>),
}

/// A systematic choice of weighted particles.
fn chosen(rng: &mut Pcg64Mcg, particles: &Particles<2>, count: usize) -> [Vec<f64>; 2] {
    let offset: f64 = rng.random();
    let (mut i, mut cumulative) = (0, particles.weights()[0]);
    let mut points = [Vec::with_capacity(count), Vec::with_capacity(count)];
    for k in 0..count {
        while (k as f64 + offset) / count as f64 >= cumulative && i + 1 < particles.len() {
            i += 1;
            cumulative += particles.weights()[i];
        }
        points
            .iter_mut()
            .zip(particles.columns())
            .for_each(|(p, c)| p.push(c[i]));
    }
    points
}

/// Mean log density.
fn mean_log(columns: Columns<'_, 2>, density: impl FnOnce(Columns<'_, 2>, &mut [f64])) -> f64 {
    let mut logs = vec![0.0; columns[0].len()];
    density(columns, &mut logs);
    logs.iter().sum::<f64>() / logs.len() as f64
}

/// A method's belief before and after its reduction.
fn advance(
    method: usize,
    known: &mut Known,
    rng: &mut Pcg64Mcg,
    filter: &HandoffFilter<Whole>,
    reading: &Reading,
    components: usize,
) -> Result<(KernelEstimate<2>, Option<Mixture<2>>), Error> {
    match known {
        Known::Particles(particles) => {
            plain_step(rng, particles, reading)?;
            Ok((estimate(filter, particles)?, None))
        }
        Known::Mixture(mixture) => {
            let (particles, _) = filter.posterior(rng, mixture, &Walk, reading)?;
            let estimate = estimate(filter, &particles)?;
            let sent = match method {
                0..3 => Some(paper_cut(&estimate, method, components)?),
                5 => Some(single(&estimate)?),
                _ => None,
            };
            *mixture = match &sent {
                Some(sent) => sent.clone(),
                None => estimate.to_mixture()?,
            };
            Ok((estimate, sent))
        }
    }
}

/// Of one time: errors after and before the reduction of every method, the KL of the KL-optimised cut and the ML of the
/// ML-optimised one.
type Moment = ([[f64; 2]; 6], [f64; 2]);

fn trial(p: &Parameters, it: Trial) -> Result<Vec<Moment>, Error> {
    let world = world(it.stream)?;
    let (filter, reference) = (Smoothing::Silverman.filter(PARTICLES)?, Smoothing::Silverman.filter(REFERENCE)?);
    let rng = |name: &str| -> Pcg64Mcg { Stream::named(it.stream, name).fast_rng() };
    let mut pick = rng("points");
    let (mut rng_a, mut rng_b) = (rng("reference a"), rng("reference b"));
    let mut a = prior()?.sample_systematic(&mut rng_a, REFERENCE)?;
    let mut b = prior()?.sample_systematic(&mut rng_b, REFERENCE)?;
    let mut filters = Vec::new();
    for method in METHODS {
        let mut own = rng(method);
        let known = if method == "raw_pf" {
            Known::Particles(prior()?.sample_systematic(&mut own, PARTICLES)?)
        } else {
            Known::Mixture(prior()?)
        };
        filters.push((known, own));
    }
    let mut run = Vec::new();
    for reading in &world.readings {
        plain_step(&mut rng_a, &mut a, reading)?;
        plain_step(&mut rng_b, &mut b, reading)?;
        let points = chosen(&mut pick, &a, p.points);
        let columns = [points[0].as_slice(), points[1].as_slice()];
        let other = estimate(&reference, &b)?;
        let base = mean_log(columns, |x, out| other.log_pdf_columns(x, out));
        let (mut row, mut own_errors) = ([[0.0; 2]; 6], [0.0; 2]);
        for (method, (known, own)) in filters.iter_mut().enumerate() {
            let (estimate, sent) = advance(method, known, own, &filter, reading, p.components)?;
            let before = base - mean_log(columns, |x, out| estimate.log_pdf_columns(x, out));
            if let (0 | 1, Some(sent)) = (method, &sent) {
                let error = StepError::plug_in(&estimate, sent);
                own_errors[method] = [error.ml, error.kl][method];
            }
            let after = sent.map_or(before, |q| base - mean_log(columns, |x, out| q.log_pdf_columns(x, out)));
            row[method] = [after, before];
        }
        run.push((row, own_errors));
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
        "KL from a reference filter of 2000 particles, less that to an independent copy of it. The three criteria are \
         close, ML a little behind; all are far below their bounds, and a single Gaussian is far behind.");

    fn cost(&self, p: &Parameters) -> Cost {
        Cost::new(0.2 * p.trials as f64, 2e3 * p.trials as f64)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let runs = context.trials("handoff-fig6c", p.trials, |it| trial(p, it))?;
        let mut rows = Rows::default();
        for t in 1..=STEPS {
            let of = |method: usize, when: usize| runs.iter().map(move |run| run[t - 1].0[method][when]);
            for (m, method) in METHODS.into_iter().enumerate() {
                let mut sorted: Vec<f64> = of(m, 0).collect();
                sorted.sort_by(f64::total_cmp);
                rows.error.push(Row {
                    t,
                    method,
                    kl_increase: of(m, 0).collect(),
                    median: sorted[sorted.len() / 2],
                    before_reduction: (m < 3).then(|| of(m, 1).collect()),
                });
            }
            let sum = |which: usize| -> Measured {
                let own = runs.iter().map(|run| run[..t].iter().map(|at| at.1[which]).sum());
                own.collect()
            };
            rows.bounds.push(Unamplified {
                t,
                kl_sum: sum(1),
                ml_bound: sum(0).scaled(2.0),
            });
            for (pair, a, b) in [("ml-kl", 0, 1), ("kl-l1", 1, 2)] {
                let kl = of(a, 0).zip(of(b, 0)).map(|(a, b)| a - b).collect();
                rows.difference.push(Difference { t, pair, kl });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let (here, full) = (claims.at_defaults(), claims.at_full_trials());
        let paper = here.at_full_trials();
        full.keyed("kl", "actual error", &rows.error, |r| r.kl_increase);
        let before = rows.error.iter().filter_map(|r| Some((r, r.before_reduction?)));
        full.references("before", "error before the reduction", before, |(r, m)| (format!("{}-t{}", r.method, r.t), m));
        full.keyed("difference", "paired difference", &rows.difference, |d| d.kl);
        let pair = |pair: &'static str| rows.difference.iter().filter(move |d| d.pair == pair);
        paper.all("ml-behind", "ML is behind KL at every time", pair("ml-kl"), |d| d.kl.value > 0.0);
        let what = "KL and L1 are the same within 0.015 nat and three standard errors";
        here.all("kl-l1", what, pair("kl-l1"), |d| {
            d.kl.value.abs() < 0.015 + 3.0 * d.kl.standard_error.unwrap_or(0.0)
        });
        let worst = (1..=STEPS).filter_map(|t| {
            let gauss = rows.at(t, "gauss")?.value;
            Some(
                METHODS[..5]
                    .iter()
                    .all(|m| rows.at(t, m).is_some_and(|v| v.value < gauss)),
            )
        });
        paper.all("gauss-worst", "one Gaussian is worst at every time", worst, |w| w);
        let bound = |t: usize| rows.bounds.iter().find(|b| b.t == t);
        for (t, least) in [(2, 1.5), (10, 3.0)] {
            let ratio = bound(t)
                .zip(rows.at(t, "kl"))
                .map(|(b, error)| b.kl_sum.value / error.value);
            let what =
                format!("even with nothing amplified the KL bound at time {t} is {least} times the error or more");
            paper.at_least(format!("kl-bound-t{t}"), what, ratio, least);
        }
        let ratio = bound(10)
            .zip(rows.at(10, "ml"))
            .map(|(b, error)| b.ml_bound.value / error.value);
        let what = "at time 10 the ML bound is about two hundred times the error of the ML-optimised cut";
        paper.near("ml-bound-t10", what, ratio, 200.0, 80.0);
        let what = "smoothing, not reduction, makes most of the error: the estimate alone is above 0.7 of KL";
        let share = over(rows.at(10, "kde_only"), rows.at(10, "kl"));
        paper.above("smoothing", what, share, 0.7);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let label = ["ML", "KL", "L1", "no reduction", "particles, no kernel", "one Gaussian"];
        let layers = METHODS.iter().zip(label).enumerate().map(|(i, (method, label))| {
            let of = rows.error.iter().filter(|r| r.method == *method);
            Layer::measured(label, of, |r| (r.t as f64, r.kl_increase)).coloured(i)
        });
        let lines = METHODS.iter().enumerate().map(|(i, method)| {
            let of = rows.error.iter().filter(|r| r.method == *method);
            Layer::line("", of.map(|r| (r.t as f64, r.kl_increase.value)).collect()).coloured(i)
        });
        let sums = points(&rows.bounds, |b| (b.t as f64, b.kl_sum.value));
        let panel = Panel::linear("Five components", "hand-overs t", "KL increase / nat")
            .with_all(lines)
            .with_all(layers)
            .with(Layer::dashed("KL bound, not amplified", sums).coloured(6));
        Plot::of(panel)
    }
}

/// Names are those of the criteria.
const _: () = assert!(CRITERIA.len() == 3);
