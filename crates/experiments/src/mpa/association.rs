//! `mpa-fig3-7`, `mpa-table3-da`: two targets on a line, two measurements in unknown order.

use crate::prelude::*;
use fewbits_baselines::pf_mpa::association::{
    AssociationRule, Hypotheses, PRINTED_GAIN, PairTracker, separation, sigmoid, tanh_rule,
};
use fewbits_filters::Resampling;
use fewbits_numerics::kernels::{self, log_sum_exp};
use rand::seq::SliceRandom;

/// Variance of a step.
const WALK: f64 = 1e-4;
/// Variance of the start.
const START: f64 = 1e-6;
/// Steps.
const STEPS: usize = 100;

/// What happens in one step.
struct Moment {
    targets: [f64; 2],
    /// In the order in which they arrive.
    measured: [f64; 2],
    /// Whether that is the targets' order.
    straight: bool,
}

/// The world of one trial.
fn draw(stream: Stream, variance: f64, apart: f64) -> Vec<Moment> {
    let mut rng = stream.named("truth").rng();
    let mut normal = |variance: f64| variance.sqrt() * rng.sample::<f64, _>(StandardNormal);
    let mut at = [1.0 + normal(START), 1.0 + apart + normal(START)];
    let mut step = |_| {
        at = at.map(|x| x + normal(WALK));
        (at, at.map(|x| x + normal(variance)))
    };
    let steps: Vec<_> = (0..STEPS).map(&mut step).collect();
    let moment = |(targets, z): ([f64; 2], [f64; 2])| {
        let straight = rng.random();
        Moment {
            targets,
            measured: if straight { z } else { [z[1], z[0]] },
            straight,
        }
    };
    steps.into_iter().map(moment).collect()
}

/// A way to associate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    Pair(PairTracker),
    Hypotheses,
    Cloud(CloudRule),
}

/// How particles, paired at random, weigh the two orders.
#[derive(Debug, Clone, Copy, PartialEq)]
enum CloudRule {
    /// All by the evidence of each order.
    Exact,
    /// Each pair by its own value of the printed rule.
    Tanh,
}

const METHODS: [(&str, Method); 8] = [
    ("genie", Method::Pair(PairTracker::Genie)),
    ("mht", Method::Hypotheses),
    ("jpda", Method::Pair(PairTracker::Weighted(AssociationRule::Exact))),
    ("pf-exact", Method::Cloud(CloudRule::Exact)),
    ("logistic", Method::Pair(PairTracker::Weighted(AssociationRule::Logistic))),
    ("tanh", Method::Pair(PairTracker::Weighted(AssociationRule::PRINTED))),
    ("pf-tanh", Method::Cloud(CloudRule::Tanh)),
    ("gnn", Method::Pair(PairTracker::Nearest)),
];

/// Particles of each target.
const PAIRS: usize = 300;

impl Method {
    /// Estimates and `P(r = 0)` of every step; particles draw from `stream`.
    fn run(self, world: &[Moment], variance: f64, apart: f64, stream: Stream) -> Result<Vec<([f64; 2], f64)>, Error> {
        let mut targets = [Gaussian::scalar(1.0, START)?, Gaussian::scalar(1.0 + apart, START)?];
        match self {
            Self::Pair(tracker) => {
                let step = |now: &Moment| {
                    let after = tracker.step(&targets, now.measured, WALK, variance, now.straight)?;
                    targets = after.targets;
                    Ok((targets.map(|t| t.mean()[0]), after.straight))
                };
                world.iter().map(step).collect()
            }
            Self::Hypotheses => {
                let mut kept = Hypotheses::new(16, targets)?;
                let step = |now: &Moment| {
                    let p = kept.step(now.measured, WALK, variance)?;
                    Ok((kept.means(), p))
                };
                world.iter().map(step).collect()
            }
            Self::Cloud(rule) => {
                let mut rng = stream.fast_rng();
                let mut clouds = targets.map(|p| {
                    let at = |_| p.mean()[0] + START.sqrt() * rng.sample::<f64, _>(StandardNormal);
                    (0..PAIRS).map(at).collect()
                });
                let step = |now: &Moment| cloud_step(&mut rng, &mut clouds, now.measured, variance, rule);
                world.iter().map(step).collect()
            }
        }
    }
}

/// One step of both targets' particles: the message to each is a mixture over the orders, as on the printed graph.
fn cloud_step<R: Rng>(
    rng: &mut R,
    clouds: &mut [Vec<f64>; 2],
    z: [f64; 2],
    variance: f64,
    rule: CloudRule,
) -> Result<([f64; 2], f64), Error> {
    for x in clouds.iter_mut().flatten() {
        *x += WALK.sqrt() * rng.sample::<f64, _>(StandardNormal);
    }
    // Constants cancel.
    let fit = |t: f64, z: f64| -0.5 * (z - t) * (z - t) / variance;
    let pairs: Vec<[f64; 2]> = clouds[0].iter().zip(&clouds[1]).map(|(a, b)| [*a, *b]).collect();
    let straight: Vec<f64> = match rule {
        CloudRule::Tanh => {
            let own = |t: &[f64; 2]| tanh_rule(separation(*t, z), PRINTED_GAIN);
            pairs.iter().map(own).collect()
        }
        CloudRule::Exact => {
            let evidence = |z: [f64; 2]| {
                let logs: Vec<f64> = pairs.iter().map(|t| fit(t[0], z[0]) + fit(t[1], z[1])).collect();
                log_sum_exp(&logs)
            };
            vec![sigmoid(evidence(z) - evidence([z[1], z[0]])); pairs.len()]
        }
    };
    let mut log_orders: Vec<f64> = straight.iter().flat_map(|p| [*p, 1.0 - p]).collect();
    kernels::ln(&mut log_orders);
    let mut means = [0.0; 2];
    for (i, cloud) in clouds.iter_mut().enumerate() {
        let terms = pairs.iter().zip(log_orders.chunks(2));
        let mut terms: Vec<f64> = terms
            .flat_map(|(t, log)| [fit(t[i], z[i]) + log[0], fit(t[i], z[1 - i]) + log[1]])
            .collect();
        let top = log_sum_exp(&terms);
        terms.iter_mut().for_each(|term| *term -= top);
        kernels::exp(&mut terms);
        let weights: Vec<f64> = terms.chunks(2).map(|orders| orders[0] + orders[1]).collect();
        means[i] = cloud.iter().zip(&weights).map(|(x, w)| x * w).sum();
        let mut ancestors = vec![0; cloud.len()];
        Resampling::Systematic.ancestors(rng, &weights, &mut ancestors)?;
        *cloud = ancestors.iter().map(|a| pairs[*a as usize][i]).collect();
        // Systematic draws are in order: shuffled, so that pairs are random.
        cloud.shuffle(rng);
    }
    Ok((means, straight.iter().sum::<f64>() / PAIRS as f64))
}

pub struct Fig37;

parameters! {
    pub struct Parameters {
        variance: Vec<f64> [1e-8..=1.0; 1..=4] = vec![1e-4, 4e-4] => "Variances of the measurements.",
        apart: f64 [0.0..=10.0] = 0.1 => "Distance of the targets at the start.",
    }
}

rows! {
    pub struct Step {
        variance: f64 => "Variance of the measurements.",
        rule: &'static str => "Rule.",
        k: usize => "Step, from 1.",
        t: [f64; 2] => "The target of this number.",
        za: f64 => "First measurement received.",
        zb: f64 => "Second measurement received.",
        estimate: [f64; 2] => "Estimate of the target of this number.",
        p0: f64 => "Probability that the first measurement is of the first target.",
    }
}

impl Figure for Fig37 {
    figure!(Parameters => Vec<Step>, "mpa-fig3-7", "Two targets, two measurements in unknown order", "particle message passing, Figure 3.7",
        "Tracks with the printed rule of thumb and with the exact probability. After a crossing the labels cannot be told \
         apart, by any rule.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Step>, Error> {
        let mut tracks = Vec::new();
        for &variance in &p.variance {
            let stream = context.stream("mpa-fig3-7");
            let world = draw(stream, variance, p.apart);
            for (rule, method) in [METHODS[2], METHODS[5]] {
                let run = method.run(&world, variance, p.apart, stream.named(rule))?;
                for (k, (now, (estimate, p0))) in world.iter().zip(run).enumerate() {
                    tracks.push(Step {
                        variance,
                        rule,
                        k: k + 1,
                        t: now.targets,
                        za: now.measured[0],
                        zb: now.measured[1],
                        estimate,
                        p0,
                    });
                }
            }
        }
        Ok(tracks)
    }

    fn claims(&self, _: &Parameters, t: &Vec<Step>, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.all("probabilities", "rules give probabilities", t, |r| (0.0..=1.0).contains(&r.p0));
        let near = |r: &Step| {
            let to = |x: f64| r.t.map(|t| (x - t).abs()).into_iter().fold(f64::INFINITY, f64::min);
            r.estimate.iter().all(|x| to(*x) < 8.0 * r.variance.sqrt())
        };
        here.all("follow", "every estimate follows one of the targets", t, near);
    }

    fn plot(&self, p: &Parameters, t: &Vec<Step>) -> Plot {
        let panel = |variance: &f64| {
            let of = |rule: &'static str, value: fn(&Step) -> f64| {
                points(select(t, |r| r.variance == *variance && r.rule == rule), |r| (r.k as f64, value(r)))
            };
            Panel::linear(format!("R = {variance}"), "step", "position")
                .with(Layer::unbroken("target 1", of("jpda", |r| r.t[0])))
                .with(Layer::unbroken("target 2", of("jpda", |r| r.t[1])).coloured(7))
                .with(Layer::points("printed, 1", of("tanh", |r| r.estimate[0])).coloured(2))
                .with(Layer::points("printed, 2", of("tanh", |r| r.estimate[1])).coloured(3))
                .with(Layer::dashed("exact, 1", of("jpda", |r| r.estimate[0])).coloured(4))
                .with(Layer::dashed("exact, 2", of("jpda", |r| r.estimate[1])).coloured(5))
        };
        Plot::grid(1, p.variance.iter().map(panel).collect())
    }
}

pub struct Table;

parameters! {
    pub struct Effort {
        trials: u64 [2..=100_000] = 400 => quick 10 => "Tracks of each setting.",
    }
}

rows! {
    pub struct Row by "R{variance}-sep{apart}-{method}" at full_trials {
        variance: f64 as panel("R = {}") => "Variance of the measurements.",
        apart: f64 as panel("{} apart") => "Distance of the targets at the start.",
        method: &'static str as x("") => "Rule.",
        labelled: Measured as points("labelled") => "Mean squared error, both targets summed, labels counted.",
        unlabelled: Measured as points("unlabelled") => "The same with the better labels of each step.",
        association: Measured => "Mean distance of the probability from what was.",
    }
}

impl Figure for Table {
    figure!(Effort => Vec<Row>, "mpa-table3-da", "Rules of association", "particle message passing, Section 3.5",
        "Labelled and unlabelled errors of two random walks, and how far the probabilities are from what was. The exact \
         likelihood is better than the printed rule, most of all inside a particle filter."; semilog("mean squared error"));

    fn run(&self, p: &Effort, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rules = Vec::new();
        for variance in [1e-4, 4e-4] {
            for apart in [0.1, 0.3] {
                let one = |trial: Trial| {
                    let world = draw(trial.stream, variance, apart);
                    let mut means = [[0.0; 3]; METHODS.len()];
                    for (means, (name, method)) in means.iter_mut().zip(METHODS) {
                        let run = method.run(&world, variance, apart, trial.stream.named(name))?;
                        for (now, (estimate, p0)) in world.iter().zip(run) {
                            let apart = |i: usize, j: usize| (estimate[i] - now.targets[j]).powi(2);
                            let (labelled, swapped) = (apart(0, 0) + apart(1, 1), apart(0, 1) + apart(1, 0));
                            let truth = f64::from(u8::from(now.straight));
                            let all = [labelled, labelled.min(swapped), (p0 - truth).abs()];
                            means.iter_mut().zip(all).for_each(|(m, x)| *m += x / STEPS as f64);
                        }
                    }
                    Ok(means.concat())
                };
                let stream = context.stream("mpa-table3-da").named(&format!("{apart}"));
                let sums = context.moments(stream, p.trials, one)?;
                for ((method, _), sum) in METHODS.into_iter().zip(sums.chunks(3)) {
                    rules.push(Row {
                        variance,
                        apart,
                        method,
                        labelled: sum[0].into(),
                        unlabelled: sum[1].into(),
                        association: sum[2].into(),
                    });
                }
            }
        }
        Ok(rules)
    }

    fn claims(&self, _: &Effort, t: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        full.no_more()
            .keyed("unlabelled-most", "unlabelled error", t, |r| r.unlabelled);
        full.no_more()
            .keyed("association-most", "error of association", t, |r| r.association);
        for (variance, blur) in [(1e-4, 3.0), (4e-4, 2.0)] {
            let of = |method: &str| first(t, |r| r.variance == variance && r.apart == 0.1 && r.method == method);
            let errors = ["jpda", "tanh", "pf-tanh"].map(|m| of(m).map(|r| r.association.value));
            let what = "exact < printed rule < printed rule over particles (erratum mpa-12)";
            full.increasing(format!("order-{variance}"), what, errors);
            let [printed, exact] = ["pf-tanh", "pf-exact"].map(|m| of(m).map(|r| r.unlabelled));
            let ratio = over(printed, exact);
            let what = "over particles the printed rule blurs the targets";
            full.above(format!("particles-{variance}"), what, ratio, blur);
        }
        let genie = |r: &Row| first(t, |g| g.variance == r.variance && g.apart == r.apart && g.method == "genie");
        full.all("genie", "no rule is below the genie", select(t, |r| r.method != "genie"), |r| {
            genie(r).is_some_and(|g| g.labelled.value <= r.labelled.value)
        });
    }
}
