//! Figures 6(a) and 6(b): what the losses of all hand-overs say about the error at the end.

use super::filters::{CRITERIA, PARTICLES, STEPS, Smoothing, estimate, median, paper_cut, prior, world};
use super::world::Walk;
use crate::prelude::*;
use fewbits_baselines::handoff::{Amplification, Bounds, bounds};
use fewbits_baselines::mixture_codec::divergence::Divergence;
use fewbits_mixture_codec::plug_in::plug_in;
use std::f64::consts::LN_10;

parameters! {
    pub struct Parameters {
        trials: u64 [2..=100_000] = 120 => quick 4 => "Worlds.",
    }
    cost |p| Cost::new(0.1 * p.trials as f64, 5e3 * p.trials as f64);
}

rows! {
    #[derive(Default)]
    pub struct Rows {
        bounds: Vec<Bound> => "Bounds against time.",
        steps: Vec<Step> => "Plug-in errors of a hand-over, averaged over worlds and time.",
        five: Vec<Bound> => "Bounds in the same worlds with five components, beside ten.",
    }

    struct Bound by "{smoothing}-t{t}" at full_trials {
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

    struct Step by "{smoothing}-{method}" at full_trials {
        smoothing: &'static str => "How estimates are smoothed.",
        method: &'static str => "What the reduction keeps small.",
        ml: Measured => "Largest log-ratio at the centres (erratum handoff-11).",
        kl: Measured => "KL at the centres, bandwidth by the particles kept (erratum handoff-13).",
        l1: Measured => "L1 at the centres, noise of variance 0.05 (erratum handoff-12).",
        dr: Measured => "DR at the centres.",
        size: Measured => "Components sent.",
    }
}

/// Figure 6(a) or (b).
pub struct Fig6 {
    about: About,
    components: usize,
}

const fn about(id: &'static str, title: &'static str) -> About {
    About::of(id, title, "compressed particle filter, Section 6, Figure 6").showing(
        "Bounds on the error after t lossy hand-overs in 120 worlds. The ML bound grows in proportion to time, those of KL and L1 exponentially; \
         the DR bounds (ours) hold for every data sequence and stay below what is trivial.",
    )
}

pub static FIG6A: Fig6 = Fig6 {
    about: about("handoff-fig6a", "Bounds with five components"),
    components: 5,
};
pub static FIG6B: Fig6 = Fig6 {
    about: about("handoff-fig6b", "Bounds with ten components"),
    components: 10,
};

/// Of a hand-over: its ML, DR, KL and L1 errors, and the components sent.
type Loss = [f64; 5];
/// All hand-overs of one world under every criterion.
type Run = [Vec<Loss>; 3];

impl Fig6 {
    fn trial(components: usize, smoothing: Smoothing, trial: Trial) -> Result<Run, Error> {
        let world = world(trial.stream)?;
        let filter = smoothing.filter(PARTICLES)?;
        let mut run = Run::default();
        for (c, steps) in run.iter_mut().enumerate() {
            let mut rng = trial.stream.named(CRITERIA[c]).fast_rng();
            let mut known = prior()?;
            for reading in &world.readings {
                let (particles, _) = filter.posterior(&mut rng, &known, &Walk, reading)?;
                let estimate = estimate(&filter, &particles)?;
                known = paper_cut(&estimate, c, components)?;
                let Divergence { ml, dr, kl, l1 } = plug_in(&estimate, &known).into();
                steps.push([ml, dr, kl, l1, known.len() as f64]);
            }
        }
        Ok(run)
    }

    fn rows(smoothing: Smoothing, runs: &[Run]) -> (Vec<Bound>, Vec<Step>) {
        let smoothing = smoothing.name();
        let worlds = runs.len() as f64;
        // Sums over all worlds.
        let totals = [0, 1, 2].map(|c| {
            let sum = |t: usize| std::array::from_fn(|k| runs.iter().fold(0.0, |sum, run| sum + run[c][t][k]));
            (0..STEPS).map(sum).collect::<Vec<Loss>>()
        });
        let typical = |c: usize, t: usize| account(totals[c][..t].iter().map(|total| total.map(|x| x / worlds)));
        // A function of the mean errors, with its standard error by leaving out one world at a time.
        let jackknifed = |c: usize, t: usize, log: fn(&Bounds) -> f64| {
            let without = |run: &Run| {
                let rest = |(total, own): (&Loss, &Loss)| -> Loss {
                    std::array::from_fn(|k| ((total[k] - own[k]) / (worlds - 1.0)).max(0.0))
                };
                log(&account(totals[c][..t].iter().zip(&run[c]).map(rest))) / LN_10
            };
            let error = (worlds - 1.0) * runs.iter().map(without).collect::<Moments>().standard_error();
            let error = Some(error).filter(|error| runs.len() > 1 && error.is_finite());
            Measured::new(log(&typical(c, t)) / LN_10, error)
        };
        let bounds = (1..=STEPS).map(|t| {
            let own = |c: usize| runs.iter().map(move |run| account(run[c][..t].iter().copied()));
            Bound {
                smoothing,
                t,
                ml_printed: own(0).map(|b| b.ml_printed).collect(),
                ml_from_dr: typical(0, t).ml_from_dr,
                log10_kl_printed: jackknifed(1, t, |b| b.ln_kl_printed),
                // An estimate of a KL may be zero, its logarithm -inf: the median does not mind.
                log10_kl_median: median(own(1).map(|b| b.ln_kl_printed / LN_10)),
                log10_kl_corrected: typical(1, t).ln_kl_corrected / LN_10,
                log10_l1_printed: jackknifed(2, t, |b| b.ln_l1_printed),
                l1_from_dr: own(0).map(|b| b.l1_from_dr).collect(),
                kl_from_dr: own(0).map(|b| b.kl_from_dr).collect(),
            }
        });
        // Errors of one world are averaged over time first: the standard error is over worlds.
        let steps = CRITERIA.iter().enumerate().map(|(c, method)| {
            let over = |k: usize| -> Measured {
                let world = |run: &Run| run[c].iter().map(|loss| loss[k]).collect::<Moments>().mean();
                runs.iter().map(world).collect()
            };
            Step {
                smoothing,
                method,
                ml: over(0),
                kl: over(2),
                l1: over(3),
                dr: over(1),
                size: over(4),
            }
        });
        (bounds.collect(), steps.collect())
    }
}

/// Bounds after these hand-overs.
fn account(losses: impl Iterator<Item = Loss>) -> Bounds {
    let error = |[ml, dr, kl, l1, _]: Loss| Divergence { ml, dr, kl, l1 };
    bounds(&losses.map(error).collect::<Vec<_>>(), Amplification::Ml)
}

impl Rows {
    fn under(&self, smoothing: Smoothing) -> Vec<&Bound> {
        select(&self.bounds, |b| b.smoothing == smoothing.name()).collect()
    }
}

/// A bound by name, and its decimal logarithm.
type Logarithm = (&'static str, fn(&Bound) -> f64);

/// The bounds that grow exponentially.
const EXPONENTIAL: [Logarithm; 2] = [
    ("kl", |b| b.log10_kl_printed.value),
    ("l1", |b| b.log10_l1_printed.value),
];

impl Figure for Fig6 {
    figure!(Parameters => Rows, about);

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let stream = context.stream("handoff-fig6").named(smoothing.name());
            let runs = |components| {
                // The worlds with five components are part of both figures.
                let name = format!("handoff-fig6 {} {} {components} {}", context.seed, p.trials, smoothing.name());
                context.once(name, || context.trials(stream, p.trials, |it| Self::trial(components, smoothing, it)))
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
        for smoothing in [Smoothing::Preset, Smoothing::Silverman] {
            let (under, name) = (rows.under(smoothing), smoothing.name());
            let increments =
                |of: fn(&Bound) -> f64| under.windows(2).map(move |w| of(w[1]) - of(w[0])).collect::<Vec<_>>();
            let ml = increments(|b| b.ml_printed.value);
            let mean = ml.iter().copied().collect::<Moments>().mean();
            let what = "the ML bound grows by the same amount at every step, within 25 %";
            full.all(format!("{name}-linear"), what, &ml, |d| (d / mean - 1.0).abs() < 0.25);
            let what = "at time 1 the KL bound is the smallest and the ML bound the largest";
            claims.all(format!("{name}-first"), what, under.first(), |b| {
                let [kl, l1] = EXPONENTIAL.map(|(_, log)| log(b));
                kl < l1 && l1 < b.ml_printed.value.log10()
            });
            for (measure, log) in EXPONENTIAL {
                let what = format!("the {measure} bound grows by a factor at every step: exponentially");
                claims.all(format!("{name}-{measure}-exponential"), what, increments(log), |d| d > 0.15);
            }
            let slope =
                |log: fn(&Bound) -> f64| Some((log(under.last()?) - log(under.first()?)) / (under.len() as f64 - 1.0));
            let [kl, l1] = EXPONENTIAL.map(|(_, log)| slope(log));
            let what = "the KL bound grows more slowly than the L1 bound";
            full.below(format!("{name}-slopes"), what, minus(kl, l1), 0.0);
            let what = "the DR bound of the ML is never above the printed one, and the corrected KL bound never below";
            claims.all(format!("{name}-tight"), what, &under, |b| {
                b.ml_from_dr <= b.ml_printed.value
                    && b.log10_kl_corrected >= b.log10_kl_printed.value
                    && b.l1_from_dr.value <= 2.0
            });
        }
        if !rows.five.is_empty() {
            let what = "in the same worlds every bound is smaller with ten components than with five, at every time";
            let bounds = |b: &Bound| {
                let measured = [
                    b.ml_printed,
                    b.log10_kl_printed,
                    b.log10_l1_printed,
                    b.kl_from_dr,
                    b.l1_from_dr,
                ];
                measured.map(|m| m.value).into_iter().chain([b.log10_kl_corrected])
            };
            full.all("ten-below-five", what, rows.bounds.iter().zip(&rows.five), |(ten, five)| {
                bounds(ten).zip(bounds(five)).all(|(ten, five)| ten < five)
            });
        }
        let times = if self.components == 5 { [4.0, 2.0] } else { [7.0, 3.0] };
        for ((measure, log), time) in EXPONENTIAL.into_iter().zip(times) {
            let preset = rows.under(Smoothing::Preset).into_iter();
            let useful = preset.take_while(|b| log(b) < b.ml_printed.value.log10()).count();
            let what = format!("the {} bound is below the ML bound up to this time", measure.to_uppercase());
            full.near(format!("{measure}-useful"), what, useful as f64, time, 1.0);
        }
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
