//! What else could be unknown, and what the model of the rate does to the estimate.

use super::common::{B, Settings, median, search_box};
use crate::prelude::*;
use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::information::{Unknown, fisher_information};
use fewbits_diffusive::{Posterior, Prior, RateModel, RateRange, Record, SourceLikelihood};

parameters! {
    pub struct Parameters {
        trials: u64 [1..=10_000] = 30 => quick 4 => "Random layouts about the source for the comparison of rate models.",
        nodes: Vec<usize> [1..=100; 1..] = vec![6, 20] => "Nodes of a layout.",
        radius: f64 [1.0..=1000.0] = 25.0 => "Radius of a layout, m.",
    }
    cost |p| Cost::new(p.trials as f64 * p.nodes.iter().sum::<usize>() as f64 * 0.02, 1e6);
}

rows! {
    pub struct Rows {
        bounds: Vec<Bound> => "Cramer-Rao bounds with more and more unknowns.",
        models: Vec<Model> => "Bias and width of the posterior of noise-free samples, by what is assumed of the rate.",
    }

    struct Bound by "{unknown}" {
        unknown: &'static str as x("unknown besides the position") => "What is unknown besides the position.",
        sd_x: f64 ["m"] as points("of x") in bound => "Standard deviation of x at the bound; the references are by differences and Gauss-Jordan.",
    }

    struct Model by "{model} {nodes}" {
        model: &'static str as key => "What is assumed of the rate.",
        nodes: usize as x("nodes") => "Nodes.",
        /// Distance of posterior mean and source, although the samples are free of noise.
        bias: Measured ["m"] as points("distance") in models,
        width: Measured ["m"] as dashed("width") in models => "Fourth root of the determinant of the covariance.",
        bias_in_widths: Measured => "Bias in units of the width.",
    }
}

/// Six nodes on the way from the alarm to the source of example B.
const NODES: [[f64; 2]; 6] = [
    [44.396, 52.042],
    [50.0, 54.0],
    [52.0, 44.0],
    [58.0, 60.0],
    [55.0, 48.0],
    [57.0, 45.0],
];

pub struct Unknowns;

impl Figure for Unknowns {
    figure!(Parameters => Rows, "diffusive-unknowns", "What else is unknown", "",
        "Left: the Cramer-Rao bound of x for six nodes on the way to the source of example B with more and more unknowns. Right: posterior \
         means of noise-free samples by what is assumed of the rate. Redrawing the rate for every sample, as the \
         paper's equations (13) and (18) do, pushes the source away and stays wrong however many nodes there are.";
        { bound: linear("standard deviation / m", "Bound of x"), models: semilog("median distance to the source / m", "Noise-free samples") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let sensor = B.sensor(false)?;
        let source = B.source();
        let nodes: Vec<Vector2<f64>> = NODES.iter().map(|n| Vector2::from(*n)).collect();
        let mut bounds = Vec::new();
        let mut unknowns = vec![Unknown::X, Unknown::Y];
        for (name, next) in [
            ("nothing", None),
            ("rate", Some(Unknown::Rate)),
            ("+ diffusivity", Some(Unknown::Diffusivity)),
            ("+ start", Some(Unknown::Start)),
            ("+ bias", Some(Unknown::Bias)),
        ] {
            unknowns.extend(next);
            let information = fisher_information(&unknowns, &sensor, &nodes, &source, 1.0)?;
            // Rows of very different units: factor with the diagonal scaled to one.
            let scale = information.diagonal().map(|d| d.sqrt().recip());
            let scaled = nalgebra::DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
                information[(i, j)] * scale[i] * scale[j]
            });
            let Some(factor) = scaled.cholesky() else {
                return Err(Error::failed("the information is singular"));
            };
            let variance = factor.inverse()[(0, 0)] * scale[0] * scale[0];
            bounds.push(Bound {
                unknown: name,
                sd_x: variance.sqrt(),
            });
        }
        let range = RateRange::new(0.5, 1.5)?;
        let kinds = [
            ("sample-wise", RateModel::SampleWise(range)),
            ("node-wise", RateModel::NodeWise(range)),
            ("joint", RateModel::Joint(range)),
        ];
        let mut rows = Vec::new();
        for count in &p.nodes {
            let all = context.trials(context.stream("diffusive-layouts"), p.trials, |trial| {
                let mut rng = trial.stream.rng();
                let mut draw = || -> Result<Record, Error> {
                    let angle = std::f64::consts::TAU * rng.random::<f64>();
                    let rho = p.radius * rng.random::<f64>().sqrt();
                    let node = source + Vector2::new(angle.cos(), angle.sin()) * rho.max(3.0);
                    let responses = sensor.responses(&node, &source)?;
                    let clean: Vec<f64> = responses.iter().map(|a| a + sensor.bias()).collect();
                    Ok(sensor.record(&node, &clean)?)
                };
                let records = (0..*count).map(|_| draw()).collect::<Result<Vec<_>, _>>()?;
                let variance = Settings::default().prior_sd.powi(2);
                let prior = Prior::Exact(Gaussian::new(*records[0].node(), Matrix2::identity() * variance)?);
                let under = |(_, model): &(&str, RateModel)| -> Result<(f64, f64), Error> {
                    let likelihood = SourceLikelihood::new(records.clone(), *model)?;
                    let cells =
                        Posterior::new(&prior, &likelihood, &search_box(), None, &CellOptions::default())?.cells;
                    Ok(((cells.mean() - source).norm(), cells.covariance().determinant().powf(0.25)))
                };
                kinds.iter().map(under).collect::<Result<Vec<_>, _>>()
            })?;
            for (k, (model, _)) in kinds.iter().enumerate() {
                let of = |f: fn(&(f64, f64)) -> f64| -> Measured {
                    median(all.iter().map(|trial| f(&trial[k]))).unwrap_or_else(|| Moments::default().into())
                };
                rows.push(Model {
                    model,
                    nodes: *count,
                    bias: of(|v| v.0),
                    width: of(|v| v.1),
                    bias_in_widths: of(|v| v.0 / v.1),
                });
            }
        }
        Ok(Rows { bounds, models: rows })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let paper = claims.at_defaults().at_full_trials();
        let what = "every further unknown widens the bound";
        claims.increasing("more-unknowns", what, rows.bounds.iter().map(|b| b.sd_x));
        let bias = |key: &str| find(&rows.models, key);
        let what = "a rate for each sample is metres off without any noise (erratum diffusive-2)";
        paper.above("sample-wise-is-biased", what, bias("sample-wise 20").map(|m| m.bias.value), 1.0);
        let what = "and many widths off: it is inconsistent";
        paper.above("sample-wise-is-inconsistent", what, bias("sample-wise 20").map(|m| m.bias_in_widths.value), 2.0);
        let what = "one joint rate is right";
        paper.below("joint-is-right", what, bias("joint 20").map(|m| m.bias.value), 0.01);
        let order = ["sample-wise 20", "node-wise 20", "joint 20"].map(|key| bias(key).map(|m| m.width.value));
        paper.decreasing("sharper", "what is assumed shared sharpens the posterior", order);
    }
}
