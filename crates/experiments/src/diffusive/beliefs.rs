//! Figures 5 and 6.

use super::common::{B, CHAINS, LPG, Scheme, Settings};
use crate::prelude::*;
use fewbits_core::Density;
use fewbits_diffusive::{Form, Posterior, RateModel, SentBelief, Travelling, project};
use fewbits_mixture_codec::{Clumps, MixtureFit};

/// Only the position is approximated here.
const POSITION_ONLY: RateModel = RateModel::Known(1.0);

/// `KL(exact || form)`, nats.
fn divergence(posterior: &Posterior, form: Form) -> Result<f64, Error> {
    let Some(Travelling::Position(belief)) = project(posterior, form, &POSITION_ONLY)? else {
        return Ok(0.0);
    };
    let kl = match &belief {
        SentBelief::Mixture(mixture) => posterior.cells.kl_to(mixture),
        other => {
            let [x, y] = posterior.cells.columns();
            let logs = x.iter().zip(y).map(|(x, y)| other.log_density(&Vector2::new(*x, *y)));
            posterior.cells.kl_to_logs(&logs.collect::<Vec<_>>())
        }
    };
    Ok(kl)
}

/// How far apart the two lobes of a belief are: distance of the components of a two-component fit in standard deviations along
/// the line between them, 0 if one holds less than a twentieth.
fn lobes(posterior: &Posterior) -> Result<f64, Error> {
    let cells = &posterior.cells;
    let clumps = Clumps::new(&cells.columns(), &[&[], &[]], cells.weights(), 200)?;
    let mut options = MixtureFit::new(2)?;
    options.min_weight = 0.05;
    let fit = clumps.fit(&options)?;
    let [a, b] = fit.components() else { return Ok(0.0) };
    let line = a.mean() - b.mean();
    let spread = |c: &fewbits_densities::Component<2>| line.dot(&(c.covariance() * line)) / line.norm_squared();
    Ok(line.norm() / (0.5 * (spread(a) + spread(b))).sqrt())
}

parameters! {
    pub struct Parameters {
        /// Number of the random deployment; it is moved on to the next whose belief has two lobes.
        deployment: u64 [..=1_000_000] = 0,
        nodes: usize [1..=20] = 3 => "Nodes that have sampled.",
        grid: usize [10..=400] = 160 => "Points of the grid along each axis.",
    }
}

rows! {
    pub struct Fields {
        field: Vec<Point> => "Densities on a grid.",
        divergences: Vec<Divergence> => "How far each form is from the exact belief.",
    }

    struct Point {
        x: f64 ["m"] => "Position.",
        y: f64 ["m"] => "Position.",
        p: f64 ["m^-2"] => "Density of the figure's belief.",
        exact: f64 ["m^-2"] => "Density of the exact belief.",
    }

    struct Divergence {
        deployment: u64 => "The deployment shown.",
        form: &'static str => "What the belief is approximated by.",
        scalars: usize => "Numbers in a message.",
        kl: f64 ["nats"] => "`KL(exact || form)`.",
        lobes: f64 => "Distance of the exact belief's two lobes in standard deviations.",
    }
}

/// Figure 5 or 6.
pub struct Lobes {
    about: About,
    /// What the belief that is shown is projected to; none for the exact one.
    form: Option<Form>,
}

pub static FIG5: Lobes = Lobes {
    about: About::of("diffusive-fig5", "The belief after three nodes", "Zhao and Nehorai 2007, Fig. 5").showing(
        "Exact density of the source's position after three nodes of example B, rate unknown, in the first random \
         deployment whose belief has two clear lobes.",
    ),
    form: None,
};

pub static FIG6: Lobes = Lobes {
    about: About::of("diffusive-fig6", "The same belief in polynomial Gaussians", "Zhao and Nehorai 2007, Fig. 6")
        .showing(
            "The belief of diffusive-fig5 as two polynomial Gaussians of degree 5 in square-root (Galerkin) form, 52 \
         numbers, beside the exact one: decades below the exact peak.",
        ),
    form: Some(LPG),
};

/// Decades of the density that are shown.
const DECADES: f64 = 4.0;

fn field_panel(title: &str, rows: &Fields, of: fn(&Point) -> f64) -> Panel {
    let lowest = rows.field.first().map(|f| f.y);
    let line = rows.field.iter().take_while(|p| Some(p.y) == lowest);
    let x: Vec<f64> = line.map(|p| p.x).collect();
    let side = x.len().max(1);
    let y: Vec<f64> = rows.field.iter().step_by(side).map(|p| p.y).collect();
    // Lobes are thin and of different heights: decades below the exact belief's peak show them all.
    let exact = rows.field.iter().map(|p| p.exact);
    let peak = exact.fold(f64::MIN_POSITIVE, f64::max).log10();
    let decades = |p: &Point| (of(p).log10() - peak).clamp(-DECADES, 0.0);
    let ends = |axis: &[f64]| (axis.first().copied().unwrap_or(0.0), axis.last().copied().unwrap_or(1.0));
    let ((x0, x1), (y0, y1)) = (ends(&x), ends(&y));
    Panel::new(title, Axis::linear("x / m").between(x0, x1), Axis::linear("y / m").between(y0, y1))
        .with(Layer::heat("lg(p/peak)", x, y, rows.field.iter().map(decades)))
        .with(Layer::points("source", vec![B.source.into()]).styled(3, Marker::OpenCircle))
}

impl Figure for Lobes {
    figure!(Parameters => Fields, about);

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Fields, Error> {
        let settings = Settings::default();
        let mut shown = None;
        for deployment in p.deployment..p.deployment + 100 {
            context.check()?;
            let outcome = Scheme::exact(p.nodes).run(&settings, context.stream(CHAINS).indexed(deployment))?;
            let Some(posterior) = outcome.posterior else {
                continue;
            };
            let apart = lobes(&posterior)?;
            if shown.as_ref().is_none_or(|(_, _, most)| apart > *most) {
                shown = Some((deployment, posterior, apart));
            }
            if apart > 4.0 {
                break;
            }
        }
        let Some((deployment, posterior, apart)) = shown else {
            return Err(Error::failed("no search gave a belief"));
        };
        let projected = self.form.map(|form| project(&posterior, form, &POSITION_ONLY));
        let belief = projected.transpose()?.flatten();
        let (lower, upper) = posterior.cells.bounds();
        let at = |d: usize, i: usize| {
            let (low, high) = (lower[d] - 0.05 * (upper[d] - lower[d]), upper[d] + 0.05 * (upper[d] - lower[d]));
            low + (high - low) * (i as f64 + 0.5) / p.grid as f64
        };
        let density = |x: &Vector2<f64>| match &belief {
            Some(Travelling::Position(belief)) => belief.log_density(x).exp(),
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
        let forms = [
            ("gaussian", Form::Gaussian),
            ("gmm-2", Form::Mixture(2)),
            ("lpg-2x5", LPG),
        ];
        let divergence = |(name, form): (&'static str, Form)| -> Result<Divergence, Error> {
            Ok(Divergence {
                deployment,
                form: name,
                scalars: form.scalars(&POSITION_ONLY).unwrap_or(0),
                kl: divergence(&posterior, form)?,
                lobes: apart,
            })
        };
        let divergences = forms.into_iter().map(divergence).collect::<Result<_, _>>()?;
        Ok(Fields { field, divergences })
    }

    fn claims(&self, _: &Parameters, rows: &Fields, claims: &mut Claims) {
        let here = claims.at_defaults();
        let kl = |form: &str| rows.divergences.iter().find(|d| d.form == form).map(|d| d.kl);
        let apart = rows.divergences.first().map(|d| d.lobes);
        here.above("two-lobes", "the belief after three nodes has two lobes", apart, 4.0);
        here.below("lpg-is-close", "polynomial Gaussians are within 0.3 nats of it", kl("lpg-2x5"), 0.3);
        let ratio = over(kl("gaussian"), kl("lpg-2x5"));
        here.above("gaussian-is-not", "one Gaussian is at least five times as far", ratio, 5.0);
        let what = "two Gaussians show both lobes, too: the paper's claim that a Gaussian sum cannot is overstated (erratum diffusive-9)";
        let ratio = over(kl("gaussian"), kl("gmm-2"));
        here.above("gaussian-sums-can", what, ratio, 2.0);
    }

    fn plot(&self, _: &Parameters, rows: &Fields) -> Plot {
        let shown = self.form.map(|_| field_panel("Polynomial Gaussians", rows, |p| p.p));
        let exact = field_panel("Exact belief", rows, |p| p.exact);
        let panels: Vec<Panel> = [exact].into_iter().chain(shown).collect();
        Plot::grid(panels.len(), panels)
    }
}
