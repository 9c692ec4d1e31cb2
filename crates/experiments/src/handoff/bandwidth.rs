//! The filters against the exact belief: smoothing costs more than reduction.

use super::exact::{Lattice, StepLaw};
use super::filters::{PARTICLES, REFERENCE, plain_step, prior, world};
use super::world::Walk;
use crate::prelude::*;
use fewbits_densities::Bandwidth;
use fewbits_handoff::{Components, HandoffFilter, Reducer, Whole};
use fewbits_mixture_codec::tree::{At, Axis as SplitAxis};
use fewbits_mixture_codec::{Criterion, Reduction, Split};

parameters! {
    pub struct Parameters {
        trials: u64 [2..=10_000] = 40 => quick 2 => "Worlds.",
    }
}

rows! {
    pub struct Row {
        filter: &'static str => "Filter.",
        factor: f64 => "Multiple of Silverman's bandwidth.",
        shrunk: bool => "Whether the centres are shrunk.",
        kl: Measured ["nat"] => "KL from the exact belief to the filter's, averaged over the ten times.",
    }
}

struct Setup {
    filter: &'static str,
    factor: f64,
    shrink: bool,
    reducer: Option<Box<dyn Reducer<2> + Sync>>,
    particles: usize,
}

fn setups() -> Vec<Setup> {
    let cut = |criterion| Reduction::paper(criterion);
    let refined = Reduction::Pipeline {
        cut: 60,
        iterations: 15,
    };
    let closed = Reduction::Greedy {
        split: Split {
            axis: SplitAxis::Widest,
            at: At::CountMedian,
        },
        criterion: Criterion::LogDeterminant,
    };
    let mut all = Vec::new();
    let mut sent = |filter, reduction, factor, shrink| {
        let reducer: Box<dyn Reducer<2> + Sync> = Box::new(Components {
            components: 5,
            reduction,
        });
        all.push(Setup {
            filter,
            factor,
            shrink,
            reducer: Some(reducer),
            particles: PARTICLES,
        });
    };
    sent("gauss", Reduction::SingleGaussian, 1.0, false);
    sent("gauss", Reduction::SingleGaussian, 1.0, true);
    sent("ml", cut(Criterion::Ml), 1.0, false);
    sent("ml", cut(Criterion::Ml), 1.0, true);
    sent("l1", cut(Criterion::L1), 1.0, false);
    sent("l1", cut(Criterion::L1), 0.5, false);
    sent("kl", cut(Criterion::Kl), 1.0, false);
    sent("kl", cut(Criterion::Kl), 0.5, false);
    sent("kl", cut(Criterion::Kl), 1.0, true);
    sent("kl", cut(Criterion::Kl), 0.5, true);
    sent("closed", closed, 1.0, true);
    sent("pipeline", refined, 1.0, false);
    sent("pipeline", refined, 1.0, true);
    sent("pipeline", refined, 0.5, true);
    for (factor, shrink) in [(1.0, false), (0.5, false), (1.0, true)] {
        all.push(Setup {
            filter: "kde",
            factor,
            shrink,
            reducer: Some(Box::new(Whole)),
            particles: PARTICLES,
        });
    }
    for particles in [PARTICLES, REFERENCE] {
        let filter = if particles == PARTICLES {
            "plain-500"
        } else {
            "plain-2000"
        };
        all.push(Setup {
            filter,
            factor: 1.0,
            shrink: false,
            reducer: None,
            particles,
        });
    }
    all
}

/// Filters against the exact belief.
pub struct Widths;

fn kl(rows: &[Row], filter: &str, factor: f64, shrunk: bool) -> Option<f64> {
    first(rows, |r| r.filter == filter && r.factor == factor && r.shrunk == shrunk).map(|r| r.kl.value)
}

impl Figure for Widths {
    figure!(Parameters => Vec<Row>, "handoff-bandwidth", "Smoothing costs more than reduction", "our own comparison",
        "KL from the exact belief, computed on a lattice, to what each filter hands on, averaged over ten steps. Halving \
         the bandwidth or shrinking the particles removes a third of the error at no bits.");

    fn cost(&self, p: &Parameters) -> Cost {
        Cost::new(2.0 * p.trials as f64, 1e6 * p.trials as f64)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let setups = setups();
        let law = StepLaw::new();
        let one = |it: Trial| -> Result<Vec<f64>, Error> {
            let world = world(it.stream)?;
            let mut exact = Vec::new();
            let mut lattice = Lattice::prior();
            for reading in &world.readings {
                lattice = lattice.advanced(&law, reading);
                exact.push(lattice.points());
            }
            let mut errors = Vec::new();
            for (s, setup) in setups.iter().enumerate() {
                let bandwidth = Bandwidth {
                    factor: setup.factor,
                    ..Bandwidth::default()
                };
                let base = HandoffFilter::of_paper(setup.particles, Whole)?;
                let filter = HandoffFilter {
                    bandwidth,
                    shrink: setup.shrink,
                    ..base
                };
                let mut rng = it.stream.named("filter").indexed(s as u64).fast_rng();
                let mut known = prior()?;
                let mut plain = known.sample_systematic(&mut rng, setup.particles)?;
                let mut total = 0.0;
                for (reading, (points, mass, log_p)) in world.readings.iter().zip(&exact) {
                    let mut log_q = vec![0.0; mass.len()];
                    let columns = [points[0].as_slice(), points[1].as_slice()];
                    match &setup.reducer {
                        Some(reducer) => {
                            let (particles, _) = filter.posterior(&mut rng, &known, &Walk, reading)?;
                            known = reducer.reduce(&filter.estimate(&particles)?)?.into_mixture();
                            known.log_pdf_columns(columns, &mut log_q);
                        }
                        None => {
                            plain_step(&mut rng, &mut plain, reading)?;
                            filter.estimate(&plain)?.log_pdf_columns(columns, &mut log_q);
                        }
                    }
                    let terms = mass.iter().zip(log_p).zip(&log_q);
                    total += terms.map(|((m, p), q)| m * (p - q)).sum::<f64>();
                }
                errors.push(total / world.readings.len() as f64);
            }
            Ok(errors)
        };
        let runs = context.trials("handoff-bandwidth", p.trials, one)?;
        let rows = setups.iter().enumerate().map(|(s, setup)| {
            let kl = runs.iter().map(|run| run[s]).collect();
            Row {
                filter: setup.filter,
                factor: setup.factor,
                shrunk: setup.shrink,
                kl,
            }
        });
        Ok(rows.collect())
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        let key = |r: &Row| format!("{}-c{}{}", r.filter, r.factor, if r.shrunk { "-shrunk" } else { "" });
        claims.references("kl", "KL from the exact belief", rows, |r| (key(r), r.kl));
        let paper = kl(rows, "kl", 1.0, false);
        let what = "shrinking removes a quarter of the error or more at no bits";
        full.at_most("shrinkage", what, over(kl(rows, "kl", 1.0, true), paper), 0.8);
        full.at_most("half", "so does half the bandwidth", over(kl(rows, "kl", 0.5, false), paper), 0.8);
        let what = "but not where the estimate itself is handed on";
        full.at_least("half-kde", what, over(kl(rows, "kde", 0.5, false), kl(rows, "kde", 1.0, false)), 1.1);
        let what = "the pipeline with shrinkage has at most 0.7 of the paper's error";
        full.at_most("pipeline", what, over(kl(rows, "pipeline", 1.0, true), paper), 0.7);
        let what = "reduction to five components adds less than a quarter to what smoothing loses";
        full.at_most("reduction", what, over(paper, kl(rows, "kde", 1.0, false)), 1.25);
        let what = "at the paper's bandwidth one Gaussian is the worst reduction";
        let gauss = kl(rows, "gauss", 1.0, false).unwrap_or(f64::NAN);
        full.all("gauss", what, rows.iter().filter(|r| r.filter != "gauss" && r.factor == 1.0), |r| {
            r.kl.value < gauss
        });
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        let label =
            |r: &Row| format!("{}, c = {}{}", super::title(r.filter), r.factor, if r.shrunk { ", shrunk" } else { "" });
        let mut sorted: Vec<&Row> = rows.iter().collect();
        sorted.sort_by(|a, b| b.kl.value.total_cmp(&a.kl.value));
        // Values run to the right, filters downwards.
        let bars = (0..)
            .map(f64::from)
            .zip(&sorted)
            .map(|(i, r)| (0.0, r.kl.value, i - 0.35, i + 0.35))
            .collect();
        let panel = Panel::new(
            "Error of what is handed on",
            Axis::linear("KL from the exact belief / nat"),
            Axis::categories("", sorted.iter().map(|r| label(r))),
        )
        .with(Layer::boxes("", bars))
        .without_legend();
        Plot::of(panel)
    }
}
