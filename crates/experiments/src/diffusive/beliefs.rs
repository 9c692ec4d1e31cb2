//! Figures 5 and 6, and the divergence of what travels from the exact belief.

use super::common::{B, Scheme, Settings, quantile, trials};
use super::two_phase::TwoPhase;
use crate::plot::{Axis, Layer, Marker, Panel, Plot, points};
use crate::{About, Claims, Context, Cost, Error, Figure};
use fewbits_core::{Belief, Density, Gaussian, Likelihood};
use fewbits_densities::{Clumps, Mixture, MixtureFit};
use fewbits_diffusive::{Form, Outcome, PositionBelief, Posterior, RateModel, SourceLikelihood, Travelling, project};
use fewbits_monte_carlo::Trial;
use garde::Validate;
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const LPG: Form = Form::Lpg {
    components: 2,
    degree: 5,
};

/// Only the position is approximated here.
const POSITION_ONLY: RateModel = RateModel::Known(1.0);

/// The exact posterior of the position after so many nodes of example B, the rate integrated out.
fn exact(settings: &Settings, trial: Trial, nodes: usize) -> Result<Option<Posterior>, Error> {
    Ok(exact_search(settings, trial, nodes)?.posterior)
}

fn exact_search(settings: &Settings, trial: Trial, nodes: usize) -> Result<Outcome, Error> {
    // The threshold must not end the search early.
    let endless = super::common::Example { threshold: 1e-300, ..B };
    Scheme::new("exact", endless).up_to(nodes).run(settings, trial)
}

/// `KL(exact || the paper's form)`, nats.
fn divergence_of_two_phases(settings: &Settings, outcome: &Outcome, posterior: &Posterior) -> Result<f64, Error> {
    let alarm = Vector2::from(super::common::ALARM);
    let spread = nalgebra::Matrix2::identity() * settings.prior_sd.powi(2);
    let prior = Gaussian::new(alarm, spread)
        .and_then(|g| g.factored())
        .map_err(Error::failed)?;
    let likelihood = SourceLikelihood::new(outcome.records.clone(), settings.joint()?).map_err(Error::failed)?;
    let log_density = |x: &Vector2<f64>| prior.log_pdf(x) + likelihood.log_likelihood(x);
    TwoPhase::fit(posterior, &log_density, 2, 5)?.divergence_from(&posterior.cells)
}

/// `KL(exact || form)`, nats.
fn divergence(posterior: &Posterior, form: Form) -> Result<f64, Error> {
    let Some(Travelling::Position(belief)) = project(posterior, form, &POSITION_ONLY).map_err(Error::failed)? else {
        return Ok(0.0);
    };
    let kl = match &belief {
        PositionBelief::Mixture(mixture) => posterior.cells.kl_to(&Dense(mixture)),
        PositionBelief::Lpg(lpg) => posterior.cells.kl_to(lpg),
    };
    Ok(kl)
}

/// A mixture as a density.
struct Dense<'a>(&'a Mixture<2>);

impl Belief<2> for Dense<'_> {
    fn mean(&self) -> Vector2<f64> {
        self.0.mean()
    }

    fn covariance(&self) -> nalgebra::Matrix2<f64> {
        self.0.covariance()
    }

    fn sample_columns<R: rand::Rng + ?Sized>(&self, rng: &mut R, states: fewbits_core::ColumnsMut<'_, 2>) {
        let [x, y] = states;
        for (x, y) in x.iter_mut().zip(y) {
            let point = self.0.sample(rng);
            (*x, *y) = (point.x, point.y);
        }
    }
}

impl Density<2> for Dense<'_> {
    fn log_density(&self, state: &Vector2<f64>) -> f64 {
        self.0.log_pdf(state)
    }
}

/// How far apart the two lobes of a belief are: distance of the components of a two-component fit in standard deviations along
/// the line between them, 0 if one holds less than a twentieth.
fn lobes(posterior: &Posterior) -> Result<f64, Error> {
    let cells = &posterior.cells;
    let clumps = Clumps::new(&cells.columns(), &[&[], &[]], cells.weights(), 200).map_err(Error::failed)?;
    let options = MixtureFit::new(2)
        .and_then(|fit| fit.with_least_weight(0.05))
        .map_err(Error::failed)?;
    let fit = clumps.fit(&options).map_err(Error::failed)?;
    let [a, b] = fit.components() else { return Ok(0.0) };
    let line = a.mean() - b.mean();
    let spread = |c: &fewbits_densities::Component<2>| line.dot(&(c.covariance() * line)) / line.norm_squared();
    Ok(line.norm() / (0.5 * (spread(a) + spread(b))).sqrt())
}

/// Settings of Figures 5 and 6.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Number of the random deployment; it is moved on to the next whose belief has two lobes.
    #[garde(range(max = 1_000_000))]
    deployment: u64,
    /// Nodes that have sampled.
    #[garde(range(min = 1, max = 20))]
    nodes: usize,
    /// Points of the grid along each axis.
    #[garde(range(min = 10, max = 400))]
    grid: usize,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            deployment: 0,
            nodes: 3,
            grid: 160,
        }
    }
}

/// Tables of Figures 5 and 6.
#[derive(Serialize, JsonSchema)]
pub struct Fields {
    /// Densities on a grid.
    field: Vec<Point>,
    /// How far each form is from the exact belief.
    divergences: Vec<Divergence>,
}

#[derive(Serialize, JsonSchema)]
struct Point {
    /// Position.
    #[schemars(extend("unit" = "m"))]
    x: f64,
    /// Position.
    #[schemars(extend("unit" = "m"))]
    y: f64,
    /// Density of the figure's belief.
    #[schemars(extend("unit" = "m^-2"))]
    p: f64,
    /// Density of the exact belief.
    #[schemars(extend("unit" = "m^-2"))]
    exact: f64,
}

#[derive(Serialize, JsonSchema)]
struct Divergence {
    /// The deployment shown.
    deployment: u64,
    /// What the belief is approximated by.
    form: String,
    /// Numbers in a message.
    scalars: usize,
    /// `KL(exact || form)`.
    #[schemars(extend("unit" = "nats"))]
    kl: f64,
    /// Distance of the exact belief's two lobes in standard deviations.
    lobes: f64,
}

/// Figure 5: the true belief.
pub struct True;
/// Figure 6: the approximated one.
pub struct Approximated;

fn field(p: &Parameters, context: &Context<'_>, approximated: bool) -> Result<Fields, Error> {
    let settings = Settings::default();
    let run = context.monte_carlo(context.stream("diffusive-chains"), 1);
    let mut shown = None;
    for deployment in p.deployment..p.deployment + 100 {
        context.check()?;
        let Some(posterior) = exact(&settings, run.trial(deployment), p.nodes)? else {
            continue;
        };
        let apart = lobes(&posterior)?;
        let better = shown.as_ref().is_none_or(|(_, _, most)| apart > *most);
        if better {
            shown = Some((deployment, posterior, apart));
        }
        if apart > 4.0 {
            break;
        }
    }
    let Some((deployment, posterior, apart)) = shown else {
        return Err(Error::Table("no search gave a belief".to_owned()));
    };
    let belief = project(&posterior, LPG, &POSITION_ONLY).map_err(Error::failed)?;
    let (lower, upper) = posterior.cells.bounds();
    let at = |d: usize, i: usize| {
        let (low, high) = (lower[d] - 0.05 * (upper[d] - lower[d]), upper[d] + 0.05 * (upper[d] - lower[d]));
        low + (high - low) * (i as f64 + 0.5) / p.grid as f64
    };
    let density = |x: &Vector2<f64>| match (&belief, approximated) {
        (Some(Travelling::Position(belief)), true) => belief.log_density(x).exp(),
        _ => posterior.cells.log_density(x).exp(),
    };
    let places = (0..p.grid).flat_map(|j| (0..p.grid).map(move |i| (i, j)));
    let field = places.map(|(i, j)| {
        let x = Vector2::new(at(0, i), at(1, j));
        Point {
            x: x.x,
            y: x.y,
            p: density(&x),
            exact: posterior.cells.log_density(&x).exp(),
        }
    });
    let field = field.collect();
    let mut divergences = Vec::new();
    for (name, form) in [
        ("gaussian", Form::Gaussian),
        ("gmm-2", Form::Mixture(2)),
        ("lpg-2x5", LPG),
    ] {
        divergences.push(Divergence {
            deployment,
            form: name.to_owned(),
            scalars: form.scalars(&POSITION_ONLY).unwrap_or(0),
            kl: divergence(&posterior, form)?,
            lobes: apart,
        });
    }
    Ok(Fields { field, divergences })
}

fn field_claims(rows: &Fields, claims: &mut Claims) {
    let kl = |form: &str| rows.divergences.iter().find(|d| d.form == form).map(|d| d.kl);
    let apart = rows.divergences.first().map(|d| d.lobes);
    claims
        .above("two-lobes", "the belief after three nodes has two lobes", apart, 4.0)
        .at_defaults();
    let what = "polynomial Gaussians are within 0.3 nats of it";
    claims.below("lpg-is-close", what, kl("lpg-2x5"), 0.3).at_defaults();
    let ratio = kl("gaussian").zip(kl("lpg-2x5")).map(|(g, l)| g / l);
    claims
        .above("gaussian-is-not", "one Gaussian is at least five times as far", ratio, 5.0)
        .at_defaults();
    let what = "two Gaussians show both lobes, too: the paper's claim that a Gaussian sum cannot is overstated (errata diffusive-9)";
    let ratio = kl("gaussian").zip(kl("gmm-2")).map(|(g, m)| g / m);
    claims.above("gaussian-sums-can", what, ratio, 2.0).at_defaults();
}

/// Decades of the density that are shown.
const DECADES: f64 = 4.0;

fn field_panel(title: &str, rows: &Fields, of: fn(&Point) -> f64) -> Panel {
    let mut x: Vec<f64> = rows.field.iter().map(|p| p.x).collect();
    x.dedup();
    let side = rows
        .field
        .iter()
        .take_while(|p| Some(p.y) == rows.field.first().map(|f| f.y))
        .count()
        .max(1);
    let x: Vec<f64> = x.into_iter().take(side).collect();
    let y: Vec<f64> = rows.field.iter().step_by(side).map(|p| p.y).collect();
    // Lobes are thin and of different heights: decades below the exact belief's peak show them all.
    let peak = rows
        .field
        .iter()
        .map(|p| p.exact)
        .fold(f64::MIN_POSITIVE, f64::max)
        .log10();
    let decades = |p: &Point| (of(p).log10() - peak).clamp(-DECADES, 0.5);
    let values = rows
        .field
        .chunks(side)
        .map(|row| row.iter().map(decades).collect())
        .collect();
    let ends = |axis: &[f64]| (axis.first().copied().unwrap_or(0.0), axis.last().copied().unwrap_or(1.0));
    let ((x0, x1), (y0, y1)) = (ends(&x), ends(&y));
    Panel::new(title, Axis::linear("x (m)").between(x0, x1), Axis::linear("y (m)").between(y0, y1))
        .with(Layer::heat("log10 p/peak", x, y, values))
        .with(
            Layer::points("source", vec![B.source.into()])
                .coloured(3)
                .marked(Marker::OpenCircle),
        )
}

impl Figure for True {
    type Parameters = Parameters;
    type Tables = Fields;

    fn about(&self) -> About {
        About {
            id: "diffusive-fig5",
            title: "The belief after three nodes",
            caption: "Exact density of the source's position after three nodes of example B, rate unknown, in the first random \
                      deployment whose belief has two clear lobes.",
            source: "Zhao and Nehorai 2007, Fig. 5",
        }
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Fields, Error> {
        field(p, context, false)
    }

    fn claims(&self, _: &Parameters, rows: &Fields, claims: &mut Claims) {
        field_claims(rows, claims);
    }

    fn plot(&self, _: &Parameters, rows: &Fields) -> Plot {
        Plot::of(field_panel("Exact belief", rows, |p| p.exact))
    }
}

impl Figure for Approximated {
    type Parameters = Parameters;
    type Tables = Fields;

    fn about(&self) -> About {
        About {
            id: "diffusive-fig6",
            title: "The same belief in polynomial Gaussians",
            caption: "The belief of diffusive-fig5 as two polynomial Gaussians of degree 5 in square-root (Galerkin) form, 51 \
                      numbers, beside the exact one: decades below the exact peak.",
            source: "Zhao and Nehorai 2007, Fig. 6",
        }
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Fields, Error> {
        field(p, context, true)
    }

    fn claims(&self, _: &Parameters, rows: &Fields, claims: &mut Claims) {
        field_claims(rows, claims);
    }

    fn plot(&self, _: &Parameters, rows: &Fields) -> Plot {
        Plot::grid(
            2,
            vec![
                field_panel("Exact belief", rows, |p| p.exact),
                field_panel("Polynomial Gaussians", rows, |p| p.p),
            ],
        )
    }
}

/// Settings of the divergences.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct KlParameters {
    /// Random deployments.
    #[garde(range(min = 1, max = 100_000))]
    trials: u64,
    /// Nodes that have sampled.
    #[garde(length(min = 1), inner(range(min = 1, max = 20)))]
    nodes: Vec<usize>,
}

impl Default for KlParameters {
    fn default() -> Self {
        Self {
            trials: 200,
            nodes: vec![1, 2, 3, 4],
        }
    }
}

#[derive(Serialize, JsonSchema)]
pub struct KlRow {
    /// Nodes that have sampled.
    nodes: usize,
    /// What the belief is approximated by.
    rep: &'static str,
    /// Numbers in a message.
    scalars: usize,
    /// Median `KL(exact || rep)`.
    #[schemars(extend("unit" = "nats"))]
    kl_median: f64,
    /// Its upper decile.
    #[schemars(extend("unit" = "nats"))]
    kl_q90: f64,
    /// Its mean.
    #[schemars(extend("unit" = "nats"))]
    kl_mean: f64,
    /// Its maximum.
    #[schemars(extend("unit" = "nats"))]
    kl_max: f64,
    /// Deployments.
    trials: usize,
}

const FORMS: [(&str, Form); 8] = [
    ("gaussian", Form::Gaussian),
    ("gmm-2", Form::Mixture(2)),
    ("gmm-4", Form::Mixture(4)),
    ("gmm-8", Form::Mixture(8)),
    (
        "lpg-1x5",
        Form::Lpg {
            components: 1,
            degree: 5,
        },
    ),
    (
        "lpg-2x3",
        Form::Lpg {
            components: 2,
            degree: 3,
        },
    ),
    ("lpg-2x5", LPG),
    ("particles-25", Form::Particles(25)),
];

/// Polynomial Gaussians as printed: a plain density, fitted in two phases.
const TWO_PHASES: &str = "lpg-2x5 printed";

/// Divergence against the numbers sent.
pub struct Divergences;

impl Figure for Divergences {
    type Parameters = KlParameters;
    type Tables = Vec<KlRow>;

    fn about(&self) -> About {
        About {
            id: "diffusive-kl",
            title: "What a number buys",
            caption: "Kullback-Leibler divergence of the exact belief (example B, rate integrated out) from what would travel, against \
                      the numbers in a message, after one to four nodes.",
            source: "",
        }
    }

    fn quicken(&self, p: &mut KlParameters) {
        p.trials = 8;
    }

    fn cost(&self, p: &KlParameters) -> Cost {
        Cost {
            seconds: p.trials as f64 * p.nodes.len() as f64 * 0.1,
            bytes: 1e6,
        }
    }

    fn run(&self, p: &KlParameters, context: &Context<'_>) -> Result<Vec<KlRow>, Error> {
        let settings = Settings::default();
        let all = trials(context, "diffusive-chains", p.trials, |trial| {
            p.nodes
                .iter()
                .map(|nodes| {
                    let outcome = exact_search(&settings, trial, *nodes)?;
                    let Some(posterior) = &outcome.posterior else {
                        return Ok(None);
                    };
                    let kls = FORMS.iter().map(|(_, form)| divergence(posterior, *form));
                    let mut kls = kls.collect::<Result<Vec<_>, _>>()?;
                    kls.push(divergence_of_two_phases(&settings, &outcome, posterior)?);
                    Ok(Some(kls))
                })
                .collect::<Result<Vec<_>, Error>>()
        })?;
        let mut rows = Vec::new();
        for (n, nodes) in p.nodes.iter().enumerate() {
            let printed = (TWO_PHASES, LPG);
            for (f, (rep, form)) in FORMS.iter().chain([&printed]).enumerate() {
                let kls = || all.iter().filter_map(|trial| Some(trial[n].as_ref()?[f]));
                let count = kls().count();
                let (Some(kl_median), Some(kl_q90)) = (quantile(kls(), 0.5), quantile(kls(), 0.9)) else {
                    continue;
                };
                rows.push(KlRow {
                    nodes: *nodes,
                    rep,
                    scalars: form.scalars(&POSITION_ONLY).unwrap_or(0),
                    kl_median,
                    kl_q90,
                    kl_mean: kls().sum::<f64>() / count as f64,
                    kl_max: kls().fold(0.0, f64::max),
                    trials: count,
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &KlParameters, rows: &Vec<KlRow>, claims: &mut Claims) {
        let find = |nodes: usize, rep: &str| {
            rows.iter()
                .find(|r| r.nodes == nodes && r.rep == rep)
                .map(|r| r.kl_median)
        };
        // Twelve deployments of the other program, whose mixtures are fitted less closely.
        let key = |r: &KlRow| format!("{} {}", r.nodes, r.rep);
        claims
            .references_at_most("kl_median", "median divergence", rows, |r| (key(r), r.kl_median))
            .at_full_trials();
        let what = "no mean divergence is negative, but for what sums over cells leave (0.01 nats)";
        claims.all("positive", what, rows, |r| r.kl_mean >= -0.01);
        let what = "after the first ring eight Gaussians are closer than two polynomial Gaussians";
        let gap = find(1, "gmm-8").zip(find(1, "lpg-2x5")).map(|(m, l)| m - l);
        claims.below("ring", what, gap, 0.0).at_full_trials();
        for nodes in [2, 3] {
            let what = "polynomial Gaussians are far closer than one Gaussian";
            let ratio = find(nodes, "gaussian").zip(find(nodes, "lpg-2x5")).map(|(g, l)| g / l);
            claims
                .above(format!("lpg-beats-gaussian/{nodes}"), what, ratio, 5.0)
                .at_full_trials();
        }
        let mean = |rep: &str| rows.iter().find(|r| r.nodes == 3 && r.rep == rep).map(|r| r.kl_mean);
        let gap = find(1, TWO_PHASES).zip(find(1, "lpg-2x5")).map(|(p, g)| p - g);
        let what = "on the first ring the printed two-phase fit is farther away than the Galerkin form";
        claims.above("printed-ring", what, gap, 0.0).at_full_trials();
        let ratio = mean(TWO_PHASES)
            .zip(find(3, TWO_PHASES))
            .map(|(mean, median)| mean / median);
        let what = "after three nodes the printed fit has a heavy tail: its mean divergence is ten medians or more";
        claims.above("printed-tail", what, ratio, 10.0).at_full_trials();
        let what = "more components bring a mixture closer";
        claims
            .decreasing("more-is-closer", what, ["gaussian", "gmm-2", "gmm-4", "gmm-8"].map(|rep| find(3, rep)))
            .at_full_trials();
    }

    fn plot(&self, _: &KlParameters, rows: &Vec<KlRow>) -> Plot {
        let mut panel = Panel::new("Divergence per number", Axis::linear("nodes"), Axis::log("median KL (nats)"));
        let shown = FORMS.iter().map(|form| form.0).filter(|rep| *rep != "lpg-2x3");
        for (i, rep) in shown.chain([TWO_PHASES]).enumerate() {
            let of = || rows.iter().filter(|r| r.rep == rep);
            let scalars = of().next().map_or(0, |r| r.scalars);
            panel = panel.with(
                Layer::line(format!("{rep} ({scalars})"), points(of(), |r| (r.nodes as f64, r.kl_median))).coloured(i),
            );
        }
        Plot::of(panel)
    }
}
