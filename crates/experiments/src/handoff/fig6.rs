//! Figures 6(a) and 6(b): what the losses of all hand-overs say about the error at the end.

use super::filters::{CRITERIA, PARTICLES, STEPS, Smoothing, paper_cut, prior, world};
use super::world::Walk;
use crate::plot::{Axis, Layer, Panel, Plot, points};
use crate::{About, Claims, Context, Cost, Error, Figure, Measured};
use fewbits_handoff::{Accounting, Amplification, StepError};
use fewbits_monte_carlo::{Moments, Trial};
use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_10;

/// Settings.
#[derive(Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Worlds.
    #[garde(range(min = 2, max = 100_000))]
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { trials: 400 }
    }
}

/// All tables.
#[derive(Serialize, JsonSchema)]
pub struct Rows {
    /// Bounds against time.
    bounds: Vec<Bound>,
    /// Plug-in errors of a hand-over, averaged over worlds and time.
    steps: Vec<Step>,
}

#[derive(Serialize, JsonSchema)]
struct Bound {
    /// How estimates are smoothed.
    smoothing: &'static str,
    /// Time.
    t: usize,
    /// Twice the sum of mean ML errors (ML-optimised): the printed bound of the ML.
    ml_printed: Measured,
    /// Twice the sum of mean DR errors: never worse.
    ml_from_dr: f64,
    /// Decimal logarithm of the printed KL bound with mean errors (KL-optimised).
    log10_kl_printed: f64,
    /// Of its median over worlds.
    log10_kl_median: f64,
    /// Mean of its decimal logarithm over the worlds whose estimate of the KL is positive (none need be: it is a cubature).
    log10_kl_mean: Measured,
    /// Decimal logarithm of the corrected KL bound with mean errors.
    log10_kl_corrected: f64,
    /// Decimal logarithm of the printed L1 bound with mean errors (L1-optimised).
    log10_l1_printed: f64,
    /// Mean of `2 tanh(sum DR/2)`, a bound of the L1 for every data sequence (ML-optimised).
    l1_from_dr: Measured,
    /// Mean of `phi(2 sum DR)`, a bound of the KL for every data sequence (ML-optimised).
    kl_from_dr: Measured,
}

#[derive(Serialize, JsonSchema)]
struct Step {
    /// How estimates are smoothed.
    smoothing: &'static str,
    /// What the reduction keeps small.
    method: &'static str,
    /// ML at the centres.
    ml: Measured,
    /// KL at the centres.
    kl: Measured,
    /// L1 at the centres.
    l1: Measured,
    /// DR at the centres.
    dr: Measured,
    /// Components sent.
    size: Measured,
}

/// Figure 6(a) or (b).
pub struct Fig6 {
    id: &'static str,
    components: usize,
}

/// Five components.
pub static FIG6A: Fig6 = Fig6 {
    id: "handoff-fig6a",
    components: 5,
};
/// Ten components.
pub static FIG6B: Fig6 = Fig6 {
    id: "handoff-fig6b",
    components: 10,
};

/// Errors and sizes of every hand-over of one world under every criterion.
type Run = [Vec<(StepError, usize)>; 3];

impl Fig6 {
    fn trial(&self, smoothing: Smoothing, trial: Trial) -> Result<Run, Error> {
        let world = world(trial.stream)?;
        let filter = smoothing.filter(PARTICLES)?;
        let mut run = Run::default();
        for (c, steps) in run.iter_mut().enumerate() {
            let mut rng = trial.stream.named(CRITERIA[c].0).fast_rng();
            let mut known = prior()?;
            for reading in &world.readings {
                let (particles, _) = filter.posterior(&mut rng, &known, &Walk, reading)?;
                let (sent, error) = paper_cut(&filter.estimate(&particles)?, c, self.components)?;
                steps.push((error, sent.len()));
                known = sent;
            }
        }
        Ok(run)
    }

    fn rows(smoothing: Smoothing, runs: &[Run]) -> (Vec<Bound>, Vec<Step>) {
        let mean = |c: usize, k: usize, of: fn(&StepError) -> f64| -> f64 {
            runs.iter().map(|run| of(&run[c][k].0)).collect::<Moments>().mean()
        };
        let typical: Vec<Vec<StepError>> = (0..3)
            .map(|c| {
                (0..STEPS)
                    .map(|k| StepError {
                        ml: mean(c, k, |e| e.ml),
                        dr: mean(c, k, |e| e.dr),
                        kl: mean(c, k, |e| e.kl),
                        l1: mean(c, k, |e| e.l1),
                    })
                    .collect()
            })
            .collect();
        let bounds = (1..=STEPS).map(|t| {
            let account = |steps: &[StepError]| {
                steps[..t]
                    .iter()
                    .copied()
                    .collect::<Accounting>()
                    .bounds(Amplification::Ml)
            };
            let [ml, kl, l1] = [0, 1, 2].map(|c| account(&typical[c]));
            let own = |c: usize| -> Vec<_> {
                let of = |run: &Run| {
                    run[c][..t]
                        .iter()
                        .map(|s| s.0)
                        .collect::<Accounting>()
                        .bounds(Amplification::Ml)
                };
                runs.iter().map(of).collect()
            };
            let (own_ml, own_kl) = (own(0), own(1));
            let moments = |values: &mut dyn Iterator<Item = f64>| Measured::mean(&values.collect::<Moments>());
            let mut logs: Vec<f64> = own_kl.iter().map(|b| b.ln_kl_printed / LN_10).collect();
            logs.sort_by(f64::total_cmp);
            Bound {
                smoothing: smoothing.name(),
                t,
                ml_printed: moments(&mut own_ml.iter().map(|b| b.ml_printed)),
                ml_from_dr: ml.ml_from_dr,
                log10_kl_printed: kl.ln_kl_printed / LN_10,
                log10_kl_median: logs[logs.len() / 2],
                log10_kl_mean: moments(&mut logs.iter().copied().filter(|log| log.is_finite())),
                log10_kl_corrected: kl.ln_kl_corrected / LN_10,
                log10_l1_printed: l1.ln_l1_printed / LN_10,
                l1_from_dr: moments(&mut own_ml.iter().map(|b| b.l1_from_dr)),
                kl_from_dr: moments(&mut own_ml.iter().map(|b| b.kl_from_dr)),
            }
        });
        // Errors of one world are averaged over time first: the standard error is over worlds.
        let steps = (0..3).map(|c| {
            let over = |of: &dyn Fn(&(StepError, usize)) -> f64| {
                let world = |run: &Run| run[c].iter().map(of).collect::<Moments>().mean();
                Measured::mean(&runs.iter().map(world).collect::<Moments>())
            };
            Step {
                smoothing: smoothing.name(),
                method: CRITERIA[c].0,
                ml: over(&|s| s.0.ml),
                kl: over(&|s| s.0.kl),
                l1: over(&|s| s.0.l1),
                dr: over(&|s| s.0.dr),
                size: over(&|s| s.1 as f64),
            }
        });
        (bounds.collect(), steps.collect())
    }
}

impl Rows {
    fn under(&self, smoothing: Smoothing) -> Vec<&Bound> {
        self.bounds.iter().filter(|b| b.smoothing == smoothing.name()).collect()
    }
}

/// The last time up to which `log10` stays below the ML bound.
fn useful(rows: &[&Bound], log10: fn(&Bound) -> f64) -> f64 {
    rows.iter()
        .take_while(|b| log10(b) < b.ml_printed.value.log10())
        .count() as f64
}

impl Figure for Fig6 {
    type Parameters = Parameters;
    type Tables = Rows;

    fn about(&self) -> About {
        About {
            id: self.id,
            title: if self.components == 5 {
                "Bounds with five components"
            } else {
                "Bounds with ten components"
            },
            caption: "Bounds on the error after t lossy hand-overs. The ML bound grows in proportion to time, those of KL and L1 \
                      exponentially; the DR bounds (ours) hold for every data sequence and stay below what is trivial.",
            source: "compressed particle filter, Section 6, Figure 6",
        }
    }

    fn quicken(&self, p: &mut Parameters) {
        p.trials = 4;
    }

    fn cost(&self, p: &Parameters) -> Cost {
        Cost {
            seconds: 0.1 * p.trials as f64,
            bytes: 5e3 * p.trials as f64,
        }
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows {
            bounds: Vec::new(),
            steps: Vec::new(),
        };
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let stream = context.stream("handoff-fig6").named(smoothing.name());
            let runs = context
                .monte_carlo(stream, p.trials)
                .run(|trial| self.trial(smoothing, trial))?;
            let (bounds, steps) = Self::rows(smoothing, &runs);
            rows.bounds.extend(bounds);
            rows.steps.extend(steps);
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let key = |s: &Step| format!("{}-{}", s.smoothing, s.method);
        claims
            .references("ml", "mean ML of a hand-over", &rows.steps, |s| (key(s), s.ml))
            .at_full_trials();
        claims
            .references("kl", "mean KL of a hand-over", &rows.steps, |s| (key(s), s.kl))
            .at_full_trials();
        claims
            .references("l1", "mean L1 of a hand-over", &rows.steps, |s| (key(s), s.l1))
            .at_full_trials();
        claims
            .references("dr", "mean DR of a hand-over", &rows.steps, |s| (key(s), s.dr))
            .at_full_trials();
        claims
            .references("size", "components sent", &rows.steps, |s| (key(s), s.size))
            .at_full_trials();
        let at = |b: &Bound| format!("{}-t{}", b.smoothing, b.t);
        claims
            .references("ml-bound", "printed ML bound", &rows.bounds, |b| (at(b), b.ml_printed))
            .at_full_trials();
        claims
            .references("log10-kl", "logarithm of the printed KL bound", &rows.bounds, |b| (at(b), b.log10_kl_printed))
            .at_full_trials();
        claims
            .references("log10-l1", "logarithm of the printed L1 bound", &rows.bounds, |b| (at(b), b.log10_l1_printed))
            .at_full_trials();
        claims
            .references("l1-from-dr", "L1 bound from DR", &rows.bounds, |b| (at(b), b.l1_from_dr))
            .at_full_trials();
        claims
            .references("kl-from-dr", "KL bound from DR", &rows.bounds, |b| (at(b), b.kl_from_dr))
            .at_full_trials();
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let under = rows.under(smoothing);
            let name = smoothing.name();
            let increments: Vec<f64> = under
                .windows(2)
                .map(|w| w[1].ml_printed.value - w[0].ml_printed.value)
                .collect();
            let mean = increments.iter().copied().collect::<Moments>().mean();
            let what = "the ML bound grows by the same amount at every step, within 25 %";
            claims
                .all(format!("{name}-linear"), what, &increments, |d| (d / mean - 1.0).abs() < 0.25)
                .at_full_trials();
            let what = "at time 1 the KL bound is the smallest and the ML bound the largest";
            claims.all(format!("{name}-first"), what, under.first(), |b| {
                b.log10_kl_printed < b.log10_l1_printed && b.log10_l1_printed < b.ml_printed.value.log10()
            });
            let logarithms: [fn(&Bound) -> f64; 2] = [|b| b.log10_kl_printed, |b| b.log10_l1_printed];
            for (measure, log) in ["kl", "l1"].into_iter().zip(logarithms) {
                let increments: Vec<f64> = under.windows(2).map(|w| log(w[1]) - log(w[0])).collect();
                let what = format!("the {measure} bound grows by a factor at every step: exponentially");
                claims.all(format!("{name}-{measure}-exponential"), what, &increments, |d| *d > 0.15);
            }
            let slope =
                |log: fn(&Bound) -> f64| Some((log(under.last()?) - log(under.first()?)) / (under.len() as f64 - 1.0));
            let gap = slope(|b| b.log10_kl_printed)
                .zip(slope(|b| b.log10_l1_printed))
                .map(|(kl, l1)| kl - l1);
            claims
                .below(format!("{name}-slopes"), "the KL bound grows more slowly than the L1 bound", gap, 0.0)
                .at_full_trials();
            let what = "the DR bound of the ML is never above the printed one, and the corrected KL bound never below";
            claims.all(format!("{name}-tight"), what, &under, |b| {
                b.ml_from_dr <= b.ml_printed.value
                    && b.log10_kl_corrected >= b.log10_kl_printed
                    && b.l1_from_dr.value <= 2.0
            });
        }
        let preset = rows.under(Smoothing::Preset);
        let (kl, l1) = if self.components == 5 { (4.0, 2.0) } else { (7.0, 3.0) };
        let what = "the KL bound is below the ML bound up to this time";
        claims
            .near("kl-useful", what, useful(&preset, |b| b.log10_kl_printed), kl, 1.0)
            .at_full_trials();
        let what = "the L1 bound is below the ML bound up to this time";
        claims
            .near("l1-useful", what, useful(&preset, |b| b.log10_l1_printed), l1, 1.0)
            .at_full_trials();
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let panel = |smoothing: Smoothing| {
            let under = rows.under(smoothing);
            let of = |log: fn(&Bound) -> f64| points(&under, |b| (b.t as f64, 10.0_f64.powf(log(b)).min(1e8)));
            Panel::new(
                format!("{} bandwidth", smoothing.name()),
                Axis::linear("hand-overs t"),
                Axis::log("bound on the error"),
            )
            .with(Layer::line("ML, printed", points(&under, |b| (b.t as f64, b.ml_printed.value))))
            .with(Layer::line("KL, printed / nat", of(|b| b.log10_kl_printed)))
            .with(Layer::dashed("KL, corrected / nat", of(|b| b.log10_kl_corrected)))
            .with(Layer::line("L1, printed", of(|b| b.log10_l1_printed)))
            .with(Layer::measured("KL from DR / nat", &under, |b| (b.t as f64, b.kl_from_dr)))
            .with(Layer::measured("L1 from DR", &under, |b| (b.t as f64, b.l1_from_dr)))
        };
        Plot::grid(2, vec![panel(Smoothing::Preset), panel(Smoothing::Silverman)])
    }
}
