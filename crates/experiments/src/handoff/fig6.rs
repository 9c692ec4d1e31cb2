//! Figures 6(a) and 6(b): what the losses of all hand-overs say about the error at the end.

use super::filters::{CRITERIA, PARTICLES, STEPS, Smoothing, estimate, paper_cut, prior, world};
use super::world::Walk;
use crate::prelude::*;
use fewbits_handoff::published::{Accounting, Amplification, StepError};
use std::f64::consts::LN_10;

parameters! {
    pub struct Parameters {
        trials: u64 [2..=100_000] = 400 => quick 4 => "Worlds.",
    }
}

rows! {
    #[derive(Default)]
    pub struct Rows {
        bounds: Vec<Bound> => "Bounds against time.",
        steps: Vec<Step> => "Plug-in errors of a hand-over, averaged over worlds and time.",
        five: Vec<Bound> => "Bounds in the same worlds with five components, beside ten.",
    }

    struct Bound by "{smoothing}-t{t}" {
        smoothing: &'static str => "How estimates are smoothed.",
        t: usize => "Time.",
        ml_printed: Measured => "Twice the sum of mean ML errors (ML-optimised): the printed bound of the ML.",
        ml_from_dr: f64 => "Twice the sum of mean DR errors: never worse.",
        log10_kl_printed: Measured => "Decimal logarithm of the printed KL bound with mean errors (KL-optimised).",
        log10_kl_median: f64 => "Of its median over worlds.",
        log10_kl_corrected: f64 => "Decimal logarithm of the corrected KL bound with mean errors.",
        log10_l1_printed: Measured => "Decimal logarithm of the printed L1 bound with mean errors (L1-optimised).",
        l1_from_dr: Measured => "Mean of `2 tanh(sum DR/2)`, a bound of the L1 for every data sequence (ML-optimised).",
        kl_from_dr: Measured => "Mean of `phi(2 sum DR)`, a bound of the KL for every data sequence (ML-optimised).",
    }

    struct Step by "{smoothing}-{method}" {
        smoothing: &'static str => "How estimates are smoothed.",
        method: &'static str => "What the reduction keeps small.",
        ml: Measured => "ML at the centres.",
        kl: Measured => "KL at the centres.",
        l1: Measured => "L1 at the centres.",
        dr: Measured => "DR at the centres.",
        size: Measured => "Components sent.",
    }
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
    fn trial(components: usize, smoothing: Smoothing, trial: Trial) -> Result<Run, Error> {
        let world = world(trial.stream)?;
        let filter = smoothing.filter(PARTICLES)?;
        let mut run = Run::default();
        for (c, steps) in run.iter_mut().enumerate() {
            let mut rng = trial.stream.named(CRITERIA[c].0).fast_rng();
            let mut known = prior()?;
            for reading in &world.readings {
                let (particles, _) = filter.posterior(&mut rng, &known, &Walk, reading)?;
                let estimate = estimate(&filter, &particles)?;
                let sent = paper_cut(&estimate, c, components)?;
                steps.push((StepError::plug_in(&estimate, &sent), sent.len()));
                known = sent;
            }
        }
        Ok(run)
    }

    fn rows(smoothing: Smoothing, runs: &[Run]) -> (Vec<Bound>, Vec<Step>) {
        let sums = Sums::of(runs);
        let typical = [0, 1, 2].map(|c| sums.mean(c));
        let bounds = (1..=STEPS).map(|t| {
            let [ml, kl] = [0, 1].map(|c| account(&typical[c], t));
            let jackknifed = |c: usize, log: fn(&fewbits_handoff::published::Bounds) -> f64| Measured {
                value: log(&account(&typical[c], t)) / LN_10,
                standard_error: sums.jackknife(runs, c, |steps| log(&account(steps, t)) / LN_10),
            };
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
            // An estimate of a KL may be zero, its logarithm -inf: the median does not mind.
            let mut logs: Vec<f64> = own_kl.iter().map(|b| b.ln_kl_printed / LN_10).collect();
            logs.sort_by(f64::total_cmp);
            Bound {
                smoothing: smoothing.name(),
                t,
                ml_printed: own_ml.iter().map(|b| b.ml_printed).collect(),
                ml_from_dr: ml.ml_from_dr,
                log10_kl_printed: jackknifed(1, |b| b.ln_kl_printed),
                log10_kl_median: logs[logs.len() / 2],
                log10_kl_corrected: kl.ln_kl_corrected / LN_10,
                log10_l1_printed: jackknifed(2, |b| b.ln_l1_printed),
                l1_from_dr: own_ml.iter().map(|b| b.l1_from_dr).collect(),
                kl_from_dr: own_ml.iter().map(|b| b.kl_from_dr).collect(),
            }
        });
        // Errors of one world are averaged over time first: the standard error is over worlds.
        let steps = (0..3).map(|c| {
            let over = |of: &dyn Fn(&(StepError, usize)) -> f64| -> Measured {
                let world = |run: &Run| run[c].iter().map(of).collect::<Moments>().mean();
                runs.iter().map(world).collect()
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

/// Bounds after `t` hand-overs.
fn account(steps: &[StepError], t: usize) -> fewbits_handoff::published::Bounds {
    let first = steps[..t].iter().copied();
    first.collect::<Accounting>().bounds(Amplification::Ml)
}

/// Sums over all worlds of every hand-over's errors, by criterion: `[ml, dr, kl, l1]` each.
struct Sums {
    totals: [Vec<[f64; 4]>; 3],
    worlds: f64,
}

fn parts(e: &StepError) -> [f64; 4] {
    [e.ml, e.dr, e.kl, e.l1]
}

fn step_error([ml, dr, kl, l1]: [f64; 4]) -> StepError {
    StepError { ml, dr, kl, l1 }
}

impl Sums {
    fn of(runs: &[Run]) -> Self {
        let mut totals = [0, 1, 2].map(|_| vec![[0.0; 4]; STEPS]);
        for run in runs {
            for (totals, steps) in totals.iter_mut().zip(run) {
                for (total, (error, _)) in totals.iter_mut().zip(steps) {
                    total.iter_mut().zip(parts(error)).for_each(|(t, x)| *t += x);
                }
            }
        }
        Self {
            totals,
            worlds: runs.len() as f64,
        }
    }

    /// Mean errors of every hand-over under a criterion.
    fn mean(&self, c: usize) -> Vec<StepError> {
        let mean = |total: &[f64; 4]| step_error(total.map(|x| x / self.worlds));
        self.totals[c].iter().map(mean).collect()
    }

    /// Standard error of a function of the mean errors, by leaving out one world at a time.
    fn jackknife(&self, runs: &[Run], c: usize, of: impl Fn(&[StepError]) -> f64) -> Option<f64> {
        if runs.len() < 2 {
            return None;
        }
        let without = |run: &Run| {
            let left = self.totals[c].iter().zip(&run[c]).map(|(total, (error, _))| {
                let own = parts(error);
                step_error(std::array::from_fn(|k| ((total[k] - own[k]) / (self.worlds - 1.0)).max(0.0)))
            });
            of(&left.collect::<Vec<_>>())
        };
        let values: Moments = runs.iter().map(without).collect();
        let error = (self.worlds - 1.0) * values.standard_error();
        error.is_finite().then_some(error)
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

    fn cost(&self, p: &Parameters) -> Cost {
        Cost::new(0.1 * p.trials as f64, 5e3 * p.trials as f64)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let stream = context.stream("handoff-fig6").named(smoothing.name());
            let runs = |components| {
                context
                    .monte_carlo(stream, p.trials)
                    .run(|trial| Self::trial(components, smoothing, trial))
            };
            let (bounds, steps) = Self::rows(smoothing, &runs(self.components)?);
            rows.bounds.extend(bounds);
            rows.steps.extend(steps);
            if self.components > 5 {
                rows.five.extend(Self::rows(smoothing, &runs(5)?).0);
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let full = claims.at_full_trials();
        full.keyed(
            "ml",
            "largest log-ratio at the centres (erratum handoff-11), mean over hand-overs",
            &rows.steps,
            |s| s.ml,
        );
        full.keyed(
            "kl",
            "mean KL of a hand-over, bandwidth by the particles kept (erratum handoff-13)",
            &rows.steps,
            |s| s.kl,
        );
        full.keyed("l1", "mean L1 of a hand-over, noise of variance 0.05 (erratum handoff-12)", &rows.steps, |s| s.l1);
        full.keyed("dr", "mean DR of a hand-over", &rows.steps, |s| s.dr);
        full.keyed("size", "components sent", &rows.steps, |s| s.size);
        full.keyed("ml-bound", "printed ML bound", &rows.bounds, |b| b.ml_printed);
        full.keyed("log10-kl", "logarithm of the printed KL bound", &rows.bounds, |b| b.log10_kl_printed);
        full.keyed("log10-l1", "logarithm of the printed L1 bound", &rows.bounds, |b| b.log10_l1_printed);
        full.keyed("l1-from-dr", "L1 bound from DR", &rows.bounds, |b| b.l1_from_dr);
        full.keyed("kl-from-dr", "KL bound from DR", &rows.bounds, |b| b.kl_from_dr);
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let under = rows.under(smoothing);
            let name = smoothing.name();
            let increments: Vec<f64> = under
                .windows(2)
                .map(|w| w[1].ml_printed.value - w[0].ml_printed.value)
                .collect();
            let mean = increments.iter().copied().collect::<Moments>().mean();
            let what = "the ML bound grows by the same amount at every step, within 25 %";
            full.all(format!("{name}-linear"), what, &increments, |d| (d / mean - 1.0).abs() < 0.25);
            let what = "at time 1 the KL bound is the smallest and the ML bound the largest";
            claims.all(format!("{name}-first"), what, under.first(), |b| {
                b.log10_kl_printed.value < b.log10_l1_printed.value
                    && b.log10_l1_printed.value < b.ml_printed.value.log10()
            });
            let logarithms: [fn(&Bound) -> f64; 2] = [|b| b.log10_kl_printed.value, |b| b.log10_l1_printed.value];
            for (measure, log) in ["kl", "l1"].into_iter().zip(logarithms) {
                let increments: Vec<f64> = under.windows(2).map(|w| log(w[1]) - log(w[0])).collect();
                let what = format!("the {measure} bound grows by a factor at every step: exponentially");
                claims.all(format!("{name}-{measure}-exponential"), what, &increments, |d| *d > 0.15);
            }
            let slope =
                |log: fn(&Bound) -> f64| Some((log(under.last()?) - log(under.first()?)) / (under.len() as f64 - 1.0));
            let gap = minus(slope(|b| b.log10_kl_printed.value), slope(|b| b.log10_l1_printed.value));
            full.below(format!("{name}-slopes"), "the KL bound grows more slowly than the L1 bound", gap, 0.0);
            let what = "the DR bound of the ML is never above the printed one, and the corrected KL bound never below";
            claims.all(format!("{name}-tight"), what, &under, |b| {
                b.ml_from_dr <= b.ml_printed.value
                    && b.log10_kl_corrected >= b.log10_kl_printed.value
                    && b.l1_from_dr.value <= 2.0
            });
        }
        if !rows.five.is_empty() {
            let what = "in the same worlds every bound is smaller with ten components than with five, at every time";
            full.all("ten-below-five", what, rows.bounds.iter().zip(&rows.five), |(ten, five)| {
                ten.ml_printed.value < five.ml_printed.value
                    && ten.log10_kl_printed.value < five.log10_kl_printed.value
                    && ten.log10_kl_corrected < five.log10_kl_corrected
                    && ten.log10_l1_printed.value < five.log10_l1_printed.value
                    && ten.kl_from_dr.value < five.kl_from_dr.value
                    && ten.l1_from_dr.value < five.l1_from_dr.value
            });
        }
        let preset = rows.under(Smoothing::Preset);
        let (kl, l1) = if self.components == 5 { (4.0, 2.0) } else { (7.0, 3.0) };
        let what = "the KL bound is below the ML bound up to this time";
        full.near("kl-useful", what, useful(&preset, |b| b.log10_kl_printed.value), kl, 1.0);
        let what = "the L1 bound is below the ML bound up to this time";
        full.near("l1-useful", what, useful(&preset, |b| b.log10_l1_printed.value), l1, 1.0);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let panel = |smoothing: Smoothing| {
            let under = rows.under(smoothing);
            let of = |log: fn(&Bound) -> f64| {
                points(under.iter().filter(|b| log(b) < 6.0), |b| (b.t as f64, 10.0_f64.powf(log(b))))
            };
            Panel::new(
                format!("{} bandwidth", smoothing.name()),
                Axis::linear("hand-overs t"),
                Axis::log("bound (KL in nats)").between(1e-2, 1e6),
            )
            .with(Layer::line("ML, printed", points(&under, |b| (b.t as f64, b.ml_printed.value))))
            .with(Layer::line("KL, printed", of(|b| b.log10_kl_printed.value)))
            .with(Layer::dashed("KL, corrected", of(|b| b.log10_kl_corrected)))
            .with(Layer::line("L1, printed", of(|b| b.log10_l1_printed.value)))
            .with(Layer::measured("KL from DR", &under, |b| (b.t as f64, b.kl_from_dr)))
            .with(Layer::measured("L1 from DR", &under, |b| (b.t as f64, b.l1_from_dr)).styled(6, Marker::Triangle))
        };
        Plot::grid(2, vec![panel(Smoothing::Preset), panel(Smoothing::Silverman)])
    }
}
