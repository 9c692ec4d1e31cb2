//! Figures 3, 4, 7 to 10: error and determinant along many searches.

use super::common::{A, B, Scheme, Settings, Track, fraction, median, quantile, tracks};
use crate::plot::{Axis, Layer, Panel, Plot, points};
use crate::{About, Claims, Context, Cost, Error, Figure, Measured};
use fewbits_diffusive::{Form, Rule};
use schemars::JsonSchema;
use serde::Serialize;

/// Both tables.
#[derive(Serialize, JsonSchema)]
pub struct Rows {
    /// Medians and bands over the deployments, node by node; searches that have ended keep their last values.
    curves: Vec<Curve>,
    /// How the searches ended.
    summary: Vec<Summary>,
}

#[derive(Serialize, JsonSchema)]
struct Curve {
    /// What travels, and how nodes are chosen.
    scheme: &'static str,
    /// Radio range.
    #[schemars(extend("unit" = "m"))]
    range: f64,
    /// Nodes that have sampled.
    step: usize,
    /// Median distance of estimate and source.
    #[schemars(extend("unit" = "m"))]
    err_med: f64,
    /// Its lower decile.
    #[schemars(extend("unit" = "m"))]
    err_q10: f64,
    /// Its upper decile.
    #[schemars(extend("unit" = "m"))]
    err_q90: f64,
    /// Median of the root of the distance: the paper's "bias", read literally.
    #[schemars(extend("unit" = "m^0.5"))]
    sqrt_err_med: f64,
    /// Median decimal logarithm of the covariance's determinant (of m^4).
    log10det_med: f64,
    /// Median squared error in units of the covariance, 1.39 if the belief is calibrated.
    nees_med: f64,
}

#[derive(Serialize, JsonSchema)]
struct Summary {
    /// What travels, and how nodes are chosen.
    scheme: &'static str,
    /// Radio range.
    #[schemars(extend("unit" = "m"))]
    range: f64,
    /// Numbers in one message; none for raw records, which grow.
    scalars: Option<usize>,
    /// Share of the searches that reach the threshold.
    reach: Measured,
    /// Median nodes of those that do.
    nodes_median: Option<Measured>,
    /// Lower decile.
    nodes_q10: Option<f64>,
    /// Upper decile.
    nodes_q90: Option<f64>,
    /// Median distance of estimate and source at the end.
    #[schemars(extend("unit" = "m"))]
    final_err_median: Option<Measured>,
    /// Share of all searches that end more than a metre off.
    wrong: Measured,
    /// Share of those that report convergence and are more than a metre off.
    converged_wrong: Measured,
    /// Median squared error in units of the covariance at the end, 1.39 if calibrated.
    nees_median: Option<f64>,
    /// Median distance of estimate and source after three nodes.
    #[schemars(extend("unit" = "m"))]
    err_after_3: Option<Measured>,
    /// Median size of all messages together.
    #[schemars(extend("unit" = "bytes"))]
    bytes_median: Option<f64>,
}

impl Summary {
    fn key(&self) -> String {
        format!("{} {}", self.scheme, self.range)
    }
}

/// One of these figures.
pub struct Chains {
    about: About,
    schemes: fn() -> Vec<Scheme>,
    claims: fn(&Rows, &mut Claims),
}

const LPG: Form = Form::Lpg {
    components: 2,
    degree: 5,
};

fn schemes_a_few() -> Vec<Scheme> {
    [15.0, 10.0]
        .into_iter()
        .flat_map(|range| {
            [
                Scheme::new("exact", A).at(range).up_to(30),
                Scheme::new("gmm-4", A).at(range).of(Form::Mixture(4)),
                Scheme::new("gaussian known rate", A)
                    .at(range)
                    .of(Form::Gaussian)
                    .known(),
            ]
        })
        .collect()
}

fn schemes_a() -> Vec<Scheme> {
    let mut all = schemes_a_few();
    for range in [15.0, 10.0] {
        all.push(Scheme::new("gaussian-9", A).at(range).of(Form::Gaussian));
    }
    all.push(Scheme::new("lpg-2x5 known rate", A).of(LPG).known());
    all
}

fn schemes_b_few() -> Vec<Scheme> {
    vec![
        Scheme::new("exact", B).up_to(30),
        Scheme::new("lpg-2x5 known rate", B).of(LPG).known(),
        Scheme::new("gaussian known rate", B).of(Form::Gaussian).known(),
        Scheme::new("gaussian-9", B).of(Form::Gaussian),
        Scheme::new("exact known rate", B).known().up_to(30),
    ]
}

fn schemes_b() -> Vec<Scheme> {
    let mut all = schemes_b_few();
    all.extend([
        Scheme::new("gmm-4", B).of(Form::Mixture(4)),
        Scheme::new("gmm-4 known rate", B).of(Form::Mixture(4)).known(),
        Scheme::new("lpg-1x5 known rate", B)
            .of(Form::Lpg {
                components: 1,
                degree: 5,
            })
            .known(),
        Scheme::new("particles-25 known rate", B)
            .of(Form::Particles(25))
            .known(),
        Scheme::new("mode and curvature known rate", B)
            .of(Form::Laplace)
            .known(),
    ]);
    all
}

fn windy(example: super::common::Example) -> Vec<Scheme> {
    [
        ("covariance", Rule::Covariance),
        ("information", Rule::MutualInformation),
        ("mahalanobis", Rule::Mahalanobis),
    ]
    .map(|(name, rule)| {
        Scheme::new(name, example)
            .of(Form::Mixture(4))
            .by(rule)
            .in_wind()
            .up_to(14)
    })
    .to_vec()
}

fn find<'a>(rows: &'a Rows, key: &str) -> Option<&'a Summary> {
    rows.summary.iter().find(|s| s.key() == key)
}

fn nodes(rows: &Rows, key: &str) -> Option<f64> {
    Some(find(rows, key)?.nodes_median?.value)
}

fn references(rows: &Rows, claims: &mut Claims) {
    let summary = || rows.summary.iter();
    claims.references("reach", "share that reaches the threshold", summary(), |r| (r.key(), r.reach));
    claims.references("nodes_median", "median nodes to the threshold", summary(), |r| (r.key(), r.nodes_median));
    claims.references("final_err_median", "median error at the end", summary(), |r| (r.key(), r.final_err_median));
}

fn calibrated(rows: &Rows, claims: &mut Claims, key: &str) {
    let nees = find(rows, key).and_then(|s| s.nees_median);
    let what = "the exact belief is calibrated: the median squared error is 1.39 covariances";
    claims.near("calibrated", what, nees, 1.386, 0.4).at_full_trials();
    // A small determinant allows a long thin belief: a metre along it is no error of the belief (errata diffusive-15).
    let wrong = find(rows, key).map(|s| s.converged_wrong.value);
    let what = "at most one in a hundred exact beliefs converges more than a metre off";
    claims.at_most("exact-is-right", what, wrong, 0.01).at_full_trials();
}

fn claims_fig3(rows: &Rows, claims: &mut Claims) {
    for key in ["exact 15", "exact 10", "gmm-4 15", "gmm-4 10"] {
        let end = find(rows, key).and_then(|s| s.final_err_median).map(|m| m.value);
        let what = format!("the search ends at the source: {key}");
        claims
            .below(format!("arrives/{}", key.replace(' ', "-")), what, end, 0.1)
            .at_full_trials();
    }
    let at = |scheme: &str, range: f64, step: usize| {
        rows.curves
            .iter()
            .find(|c| (c.scheme, c.range, c.step) == (scheme, range, step))
            .map(|c| c.err_med)
    };
    for range in [15.0, 10.0] {
        let errors = [1, 3, 6].map(|step| at("exact", range, step));
        claims
            .decreasing(format!("falls/{range}"), "the error falls as nodes are added", errors)
            .at_full_trials();
    }
    let shorter = at("exact", 15.0, 6)
        .zip(at("exact", 10.0, 6))
        .map(|(wide, narrow)| wide - narrow);
    claims
        .below("range", "after six nodes 15 m of range are ahead of 10 m", shorter, 0.0)
        .at_full_trials();
    calibrated(rows, claims, "exact 15");
    let wrong = find(rows, "gaussian known rate 15").map(|s| s.wrong.value);
    let what = "one Gaussian stops more than a metre off in a good part of the searches; the paper shows none (errata diffusive-12)";
    claims
        .at_least("gaussian-is-often-wrong", what, wrong, 0.1)
        .at_full_trials();
}

fn claims_fig4(rows: &Rows, claims: &mut Claims) {
    references(rows, claims);
    for scheme in ["exact", "gmm-4", "gaussian known rate", "gaussian-9"] {
        let (wide, narrow) = (nodes(rows, &format!("{scheme} 15")), nodes(rows, &format!("{scheme} 10")));
        let id = format!("range/{}", scheme.replace(' ', "-"));
        let what = format!("15 m of range need fewer nodes than 10 m: {scheme}");
        claims
            .below(id, what, wide.zip(narrow).map(|(w, n)| w - n), 0.0)
            .at_full_trials();
    }
    let what = "the printed 14 nodes are below almost every single-Gaussian search (errata diffusive-12)";
    let lowest = find(rows, "gaussian known rate 15").and_then(|s| s.nodes_q10);
    claims
        .above("printed-14", what, lowest, 14.0)
        .at_defaults()
        .at_full_trials();
    calibrated(rows, claims, "exact 15");
}

fn claims_fig7(rows: &Rows, claims: &mut Claims) {
    let at = |scheme: &str, step: usize| rows.curves.iter().find(|c| c.scheme == scheme && c.step == step);
    let difference = |step| {
        at("lpg-2x5 known rate", step)
            .zip(at("gaussian known rate", step))
            .map(|(l, g)| l.err_med - g.err_med)
    };
    for step in [4, 6, 8] {
        let what = format!("polynomial Gaussians are nearer than one Gaussian after {step} nodes");
        claims
            .below(format!("lpg-ahead/{step}"), what, difference(step), 0.0)
            .at_full_trials();
    }
    let determinant = |scheme| at(scheme, 5).map(|c| c.log10det_med);
    let what = "after five nodes polynomial Gaussians are as sharp as the other program's (log10 det -3.8) or sharper";
    claims
        .at_most("det5/lpg", what, determinant("lpg-2x5 known rate"), -3.8)
        .at_defaults()
        .at_full_trials();
    let what = "and no sharper than the exact belief with the rate known";
    let gap = determinant("lpg-2x5 known rate")
        .zip(determinant("exact known rate"))
        .map(|(l, e)| l - e);
    claims
        .at_least("det5/honest", what, gap, 0.0)
        .at_defaults()
        .at_full_trials();
    let what = "log10 det after five nodes, one Gaussian";
    claims
        .near("det5/gaussian", what, determinant("gaussian known rate"), 3.6, 1.0)
        .at_defaults()
        .at_full_trials();
    calibrated(rows, claims, "exact 15");
}

fn claims_fig8(rows: &Rows, claims: &mut Claims) {
    references(rows, claims);
    let median = |key: &str| nodes(rows, &format!("{key} 15"));
    let what = "polynomial Gaussians reach the threshold with the printed 7 nodes or fewer";
    claims
        .at_most("printed-7", what, median("lpg-2x5 known rate"), 7.0)
        .at_full_trials();
    let gap = median("lpg-2x5 known rate")
        .zip(median("exact known rate"))
        .map(|(l, e)| l - e);
    let what = "and with no more than one node beyond the exact belief";
    claims.at_most("lpg-near-exact", what, gap, 1.0).at_full_trials();
    let what = "one Gaussian with the rate carried takes about the printed 20";
    claims
        .near("printed-20", what, median("gaussian-9"), 20.0, 4.0)
        .at_full_trials();
    let gap = |other: &str| median("lpg-2x5 known rate").zip(median(other)).map(|(l, g)| l - g);
    claims
        .below(
            "lpg-first",
            "polynomial Gaussians need fewer nodes than one Gaussian",
            gap("gaussian known rate"),
            0.0,
        )
        .at_full_trials();
    let what = "a mixture of 23 numbers is as good, within a node, as 51 of polynomial Gaussians (errata diffusive-9)";
    let difference = median("gmm-4 known rate")
        .zip(median("lpg-2x5 known rate"))
        .map(|(m, l)| m - l);
    claims.at_most("mixtures-do", what, difference, 1.0).at_full_trials();
    let wrong = find(rows, "mode and curvature known rate 15").map(|s| s.wrong.value);
    let what = "mode and curvature report convergence in the wrong place in most searches: never trust a determinant from them";
    claims.at_least("curvature-misleads", what, wrong, 0.5).at_full_trials();
    calibrated(rows, claims, "exact 15");
}

fn claims_wind(rows: &Rows, claims: &mut Claims) {
    let summary = || rows.summary.iter();
    claims.references("reach", "share that reaches the threshold", summary(), |r| (r.key(), r.reach));
    // The other program's mixtures are farther from the exact belief (diffusive-kl), and its searches longer.
    claims
        .references_at_most("nodes_median", "median nodes to the threshold", summary(), |r| (r.key(), r.nodes_median));
    claims.references_at_most("final_err_median", "median error at the end", summary(), |r| {
        (r.key(), r.final_err_median)
    });
    let reach = |key: &str| find(rows, key).map(|s| s.reach.value);
    for (rule, id) in [
        ("covariance 15", "covariance-first"),
        ("information 15", "information-first"),
    ] {
        let gap = reach(rule).zip(reach("mahalanobis 15")).map(|(a, b)| a - b);
        let what = format!("in wind the rule reaches the threshold more often than Mahalanobis: {rule}");
        claims.above(id, what, gap, 0.1).at_full_trials();
    }
    let error = |key: &str| find(rows, key).and_then(|s| s.err_after_3).map(|m| m.value);
    for other in ["covariance 15", "mahalanobis 15"] {
        let id = format!("information-after-3/{}", other.replace(' ', "-"));
        let gap = error("information 15").zip(error(other)).map(|(a, b)| a - b);
        let what = format!("after three nodes information has the smaller median error than {other}");
        claims.below(id, what, gap, 0.0).at_full_trials();
    }
}

/// Figure 3: error, example A.
pub static FIG3: Chains = Chains {
    about: About {
        id: "diffusive-fig3",
        title: "Error along the search, two radio ranges",
        caption: "Median distance of estimate and source after each node (bands: deciles), example A, ranges of 15 and 10 m, \
                  over random deployments. What the paper calls bias is the root of this distance; both are in the table.",
        source: "Zhao and Nehorai 2007, Fig. 3",
    },
    schemes: schemes_a_few,
    claims: claims_fig3,
};

/// Figure 4: determinant, example A.
pub static FIG4: Chains = Chains {
    about: About {
        id: "diffusive-fig4",
        title: "Determinant along the search, two radio ranges",
        caption: "Median log10 determinant of the position's covariance after each node, example A, ranges of 15 and 10 m. The \
                  threshold is 1e-6. One Gaussian spends about ten nodes near the start, because a ring matched by moments is a \
                  broad blob; mixtures and the exact belief do not.",
        source: "Zhao and Nehorai 2007, Fig. 4",
    },
    schemes: schemes_a,
    claims: claims_fig4,
};

/// Figure 7: error, example B.
pub static FIG7: Chains = Chains {
    about: About {
        id: "diffusive-fig7",
        title: "Error along the search, Gaussian and polynomial Gaussians",
        caption: "Median distance of estimate and source after each node, example B: polynomial Gaussians of degree 5 with two \
                  components against one Gaussian, and the exact belief as the referee.",
        source: "Zhao and Nehorai 2007, Fig. 7",
    },
    schemes: schemes_b_few,
    claims: claims_fig7,
};

/// Figure 8: determinant, example B.
pub static FIG8: Chains = Chains {
    about: About {
        id: "diffusive-fig8",
        title: "Nodes to the threshold, by what travels",
        caption: "Median log10 determinant after each node, example B, threshold 1e-5, for every form of the belief. A \
                  determinant alone can mislead: the summary says how many searches end more than a metre off.",
        source: "Zhao and Nehorai 2007, Fig. 8",
    },
    schemes: schemes_b,
    claims: claims_fig8,
};

/// Figure 9: wind, sensors and source of example B.
pub static FIG9: Chains = Chains {
    about: About {
        id: "diffusive-fig9",
        title: "Choosing nodes in wind, source of example B",
        caption: "Error and determinant along searches in a wind of (-20, -10) m/s, source at (62, 50), by the rule that chooses \
                  nodes. A mixture of four Gaussians over position and rate travels. The paper does not print its source: \
                  diffusive-fig10 has the other one.",
        source: "Zhao and Nehorai 2007, Figs. 9 and 10",
    },
    schemes: || windy(B),
    claims: claims_wind,
};

/// Figure 10: wind, sensors and source of example A.
pub static FIG10: Chains = Chains {
    about: About {
        id: "diffusive-fig10",
        title: "Choosing nodes in wind, source of example A",
        caption: "The same with the source at (73, 38), ten samples a node and threshold 1e-6.",
        source: "Zhao and Nehorai 2007, Figs. 9 and 10",
    },
    schemes: || windy(A),
    claims: claims_wind,
};

impl Figure for Chains {
    type Parameters = Settings;
    type Tables = Rows;

    fn about(&self) -> About {
        self.about
    }

    fn quicken(&self, p: &mut Settings) {
        p.trials = 8;
    }

    fn cost(&self, p: &Settings) -> Cost {
        Cost {
            seconds: p.trials as f64 * (self.schemes)().len() as f64 * 0.1,
            bytes: p.trials as f64 * (self.schemes)().len() as f64 * 2e3,
        }
    }

    fn run(&self, p: &Settings, context: &Context<'_>) -> Result<Rows, Error> {
        let schemes = (self.schemes)();
        // One name for all: every figure sees the same deployments and noise.
        let all = tracks(context, "diffusive-chains", p, &schemes)?;
        let (mut curves, mut summary) = (Vec::new(), Vec::new());
        for (i, scheme) in schemes.iter().enumerate() {
            let own: Vec<&Track> = all.iter().map(|tracks| &tracks[i]).collect();
            curves.extend(curve(scheme, &own));
            summary.push(summarise(scheme, p, &own)?);
        }
        Ok(Rows { curves, summary })
    }

    fn claims(&self, _: &Settings, rows: &Rows, claims: &mut Claims) {
        (self.claims)(rows, claims);
    }

    fn plot(&self, _: &Settings, rows: &Rows) -> Plot {
        let schemes = (self.schemes)();
        let several = schemes.iter().any(|s| s.range != schemes[0].range);
        let label = |s: &Scheme| {
            if several {
                format!("{}, {} m", s.name, s.range)
            } else {
                s.name.to_owned()
            }
        };
        let of = |s: &Scheme| {
            let (name, range) = (s.name, s.range);
            rows.curves.iter().filter(move |c| c.scheme == name && c.range == range)
        };
        let threshold = schemes[0].example.threshold.log10();
        let last = rows.curves.iter().map(|c| c.step).max().unwrap_or(1) as f64;
        let limit = || Layer::dashed("threshold", vec![(1.0, threshold), (last, threshold)]).coloured(7);
        let determinants = |title: &str, chosen: &dyn Fn(&Scheme) -> bool| {
            let axis = Axis::linear("log10 det of the covariance (m^4)");
            let mut panel = Panel::new(title, Axis::linear("nodes"), axis).with(limit());
            for (i, scheme) in schemes.iter().filter(|s| chosen(s)).enumerate() {
                let line = points(of(scheme), |c| (c.step as f64, c.log10det_med));
                panel = panel.with(Layer::line(label(scheme), line).coloured(i));
            }
            panel
        };
        if schemes.len() > 7 {
            // Too many lines for one panel.
            let (unknown, known) = ("Rate unknown", "Rate known");
            return Plot::grid(
                2,
                vec![
                    determinants(unknown, &|s| !s.known_rate),
                    determinants(known, &|s| s.known_rate),
                ],
            );
        }
        let mut errors =
            Panel::new("Error", Axis::linear("nodes"), Axis::log("distance to the source (m)")).without_legend();
        for (i, scheme) in schemes.iter().enumerate() {
            if i == 0 {
                let band = of(scheme).map(|c| (c.step as f64, c.err_q10, c.err_q90)).collect();
                errors = errors.with(Layer::band("", band).coloured(i));
            }
            errors =
                errors.with(Layer::line(label(scheme), points(of(scheme), |c| (c.step as f64, c.err_med))).coloured(i));
        }
        let determinants = determinants("Determinant", &|_| true);
        Plot::grid(2, vec![errors, determinants])
    }
}

fn curve(scheme: &Scheme, tracks: &[&Track]) -> Vec<Curve> {
    let longest = tracks.iter().map(|t| t.nodes()).max().unwrap_or(0);
    (1..=longest)
        .filter_map(|step| {
            let at = |values: &Vec<f64>| values.get(step - 1).or(values.last()).copied();
            let errors = || tracks.iter().filter_map(|t| at(&t.errors));
            Some(Curve {
                scheme: scheme.name,
                range: scheme.range,
                step,
                err_med: quantile(errors(), 0.5)?,
                err_q10: quantile(errors(), 0.1)?,
                err_q90: quantile(errors(), 0.9)?,
                sqrt_err_med: quantile(errors().map(f64::sqrt), 0.5)?,
                log10det_med: quantile(tracks.iter().filter_map(|t| at(&t.log10_determinants)), 0.5)?,
                nees_med: quantile(tracks.iter().filter_map(|t| at(&t.nees)), 0.5)?,
            })
        })
        .collect()
}

fn summarise(scheme: &Scheme, settings: &Settings, tracks: &[&Track]) -> Result<Summary, Error> {
    let reached: Vec<&&Track> = tracks.iter().filter(|t| t.converged()).collect();
    let counts: Vec<f64> = reached.iter().map(|t| t.nodes() as f64).collect();
    let finals: Vec<f64> = tracks.iter().map(|t| t.final_error()).collect();
    let third: Vec<f64> = tracks
        .iter()
        .filter_map(|t| t.errors.get(2).or(t.errors.last()).copied())
        .collect();
    let wrong = |t: &Track| t.final_error() > 1.0;
    let rate = scheme.search(settings)?.rate;
    Ok(Summary {
        scheme: scheme.name,
        range: scheme.range,
        scalars: scheme.form.scalars(&rate),
        reach: fraction(reached.len(), tracks.len()),
        nodes_median: median(&counts),
        nodes_q10: quantile(counts.iter().copied(), 0.1),
        nodes_q90: quantile(counts.iter().copied(), 0.9),
        final_err_median: median(&finals),
        wrong: fraction(tracks.iter().filter(|t| wrong(t)).count(), tracks.len()),
        converged_wrong: fraction(reached.iter().filter(|t| wrong(t)).count(), reached.len()),
        nees_median: quantile(tracks.iter().filter_map(|t| t.nees.last().copied()), 0.5),
        err_after_3: median(&third),
        bytes_median: quantile(tracks.iter().map(|t| t.bits as f64 / 8.0), 0.5),
    })
}
