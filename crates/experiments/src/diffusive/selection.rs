//! Rules that choose the next node: how well they rank it, and what that saves.

use super::common::{A, B, Example, Network, Scheme, Settings, place, tracks};
use super::summary::{Summary, summaries};
use crate::prelude::*;
use fewbits_diffusive::information::Predictions;
use fewbits_diffusive::{Posterior, Rule, Selector, SourceSensor};
use fewbits_numerics::kernels::exp_minus;
use nalgebra::Vector2;
use rand::RngExt;
use rand_distr::StandardNormal;

parameters! {
    /// Settings of the comparison.
    #[derive(Debug, Clone)]
    pub struct Parameters {
        trials: u64 [1..=100_000] = 200 => quick 8 => "Random deployments of the searches.",
        ranking_trials: u64 [1..=10_000] = 60 => quick 2 => "Random deployments in which candidates are ranked.",
        points: usize [10..=2_000] = 200 => "Support points of the bounds.",
        draws: usize [10..=100_000] = 200 => "Draws of the mutual information.",
    }
}

rows! {
    pub struct Rows {
        searches: Vec<Summary> => "Searches with the exact belief, by rule.",
        /// How rules rank the neighbours after three nodes, against the mutual information by draws.
        rankings: Vec<Ranking>,
    }

    struct Ranking {
        rule: &'static str => "Rule.",
        rank_correlation: Measured => "Mean rank correlation with the exact mutual information.",
        lost: Measured ["nats"] => "Information lost by taking the rule's best instead of the best.",
        bias: Option<f64> ["nats"] => "Mean of rule minus exact information, for rules that are in nats.",
    }
}

const RULES: [&str; 7] = [
    "gaussian bound",
    "pairwise lower",
    "pairwise upper",
    "cramer-rao",
    "covariance",
    "nearest",
    "mahalanobis",
];

/// Example and range, each with the names of its searches by rule.
const SETTINGS: [(&str, Example, f64, [&str; 3]); 3] = [
    ("B15", B, 15.0, ["B15 information", "B15 pairwise", "B15 mahalanobis"]),
    ("A15", A, 15.0, ["A15 information", "A15 pairwise", "A15 mahalanobis"]),
    ("A10", A, 10.0, ["A10 information", "A10 pairwise", "A10 mahalanobis"]),
];
const SEARCH_RULES: [(&str, Rule); 3] = [
    ("information", Rule::MutualInformation),
    ("pairwise", Rule::PairwiseInformation),
    ("mahalanobis", Rule::Mahalanobis),
];

fn schemes() -> Vec<Scheme> {
    let of = |(_, example, range, names): &(&str, Example, f64, [&'static str; 3])| {
        let (example, range) = (*example, *range);
        let all = names.iter().zip(SEARCH_RULES);
        all.map(move |(name, (_, rule))| Scheme::new(name, example).at(range).by(rule).up_to(30))
            .collect::<Vec<_>>()
    };
    SETTINGS.iter().flat_map(of).collect()
}

/// The comparison of rules.
pub struct Selection;

impl Figure for Selection {
    figure!(Parameters => Rows, "diffusive-selection", "Choosing the next node", "",
        "Left: mean nodes to the threshold with the exact belief, by mutual information (its Gaussian bound, \
         and its pairwise bound) and by Mahalanobis distance. Right: how rules rank the neighbours after three nodes of example B, as rank \
         correlation with the exact mutual information.");

    fn world(&self) -> Option<&'static str> {
        Some("diffusive-chains")
    }

    fn cost(&self, p: &Parameters) -> Cost {
        Cost::new(p.trials as f64 * 0.3 + p.ranking_trials as f64 * p.draws as f64 * 0.01, 1e7)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let settings = Settings {
            trials: p.trials,
            ..Settings::default()
        };
        let schemes = schemes();
        let all = tracks(context, "diffusive-chains", &settings, &schemes)?;
        let searches = summaries(&schemes, &settings, &all)?;
        let ranked = context.trials("diffusive-chains", p.ranking_trials, |trial| rank(p, &settings, trial))?;
        let mut rankings = Vec::new();
        for (r, rule) in RULES.iter().enumerate() {
            let of = |k: usize| -> Moments { ranked.iter().flatten().map(|trial| trial[r][k]).collect() };
            rankings.push(Ranking {
                rule,
                rank_correlation: Measured::mean(&of(0)),
                lost: Measured::mean(&of(1)),
                bias: (r < 3).then(|| of(2).mean()),
            });
        }
        Ok(Rows { searches, rankings })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let full = claims.at_full_trials();
        let searches = || rows.searches.iter();
        claims.references("nodes_mean", "mean nodes to the threshold", searches(), |s| {
            (s.scheme.to_owned(), s.nodes_mean)
        });
        claims.references("reach", "share that reaches the threshold", searches(), |s| (s.scheme.to_owned(), s.reach));
        let find = |setting: &str, rule: &str| searches().find(|s| s.scheme == format!("{setting} {rule}"));
        for (setting, ..) in SETTINGS {
            let reach = |rule| find(setting, rule).map(|s| s.reach.value);
            let gap = minus(reach("information"), reach("mahalanobis"));
            let what = format!("information reaches the threshold at least as often as Mahalanobis: {setting}");
            full.at_least(format!("no-stall/{setting}"), what, gap, 0.0);
            let mean = |rule| find(setting, rule).and_then(|s| s.nodes_mean).map(|m| m.value);
            let gap = mean("pairwise").zip(mean("information")).map(|(a, b)| (a - b).abs());
            let what = format!("the better ranking of the pairwise bound saves less than half a node: {setting}");
            full.at_most(format!("bound-suffices/{setting}"), what, gap, 0.5);
        }
        let rank = |rule: &str| first(&rows.rankings, |r| r.rule == rule).map(|r| r.rank_correlation.value);
        let what = "the pairwise lower bound ranks as the exact information does";
        full.at_least("pairwise-ranks", what, rank("pairwise lower"), 0.98);
        let lost = |rule: &str| rows.rankings.iter().find(|r| r.rule == rule).map(|r| r.lost.value);
        let what = "choosing by the Gaussian bound loses less than 0.15 nat, though it misjudges beliefs of two peaks (erratum diffusive-16)";
        full.below("gaussian-loses-little", what, lost("gaussian bound"), 0.15);
        let gap = minus(rank("pairwise lower"), rank("mahalanobis"));
        full.above("mahalanobis-does-not", "Mahalanobis distance ranks far worse", gap, 0.2);
        let gap = minus(lost("mahalanobis"), lost("pairwise lower"));
        full.above("mahalanobis-loses", "and loses more information", gap, 0.0);
        let bias = |rule: &str| rows.rankings.iter().find(|r| r.rule == rule).and_then(|r| r.bias);
        let what = "the pairwise lower bound is below the information on average (draws leave some noise)";
        claims.at_most("lower", what, bias("pairwise lower"), 0.05);
        let what = "the Gaussian bound is not below the information on average";
        claims.at_least("gaussian-is-a-bound", what, bias("gaussian bound"), -0.1);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let names = SETTINGS.iter().map(|s| s.0.to_owned());
        let mut nodes = Panel::new(
            "Nodes to the threshold",
            Axis::categories("example and range / m", names),
            Axis::linear("mean nodes").between(0.0, 11.0),
        );
        for (c, (rule, _)) in SEARCH_RULES.into_iter().enumerate() {
            let of = rows.searches.iter().skip(c).step_by(SEARCH_RULES.len()).enumerate();
            let at = |(i, s): (usize, &Summary)| (i as f64 + 0.1 * (c as f64 - 1.0), s.nodes_mean);
            nodes = nodes.with(Layer::measured(rule, of, at).coloured(place(rule)));
        }
        // Rules downwards, best at the top, so that their names have room.
        let mut sorted: Vec<&Ranking> = rows.rankings.iter().collect();
        sorted.sort_by(|a, b| a.rank_correlation.value.total_cmp(&b.rank_correlation.value));
        let names = sorted.iter().map(|r| r.rule.to_owned());
        let bars = sorted.iter().enumerate();
        let bars = bars.map(|(i, r)| (0.0, r.rank_correlation.value.max(0.0), i as f64 - 0.3, i as f64 + 0.3));
        let errors = sorted.iter().enumerate().filter_map(|(i, r)| {
            let error = r.rank_correlation.standard_error?;
            let (at, low) = (r.rank_correlation.value, r.rank_correlation.value - error);
            Some(vec![(low, i as f64), (at + error, i as f64)])
        });
        let ranks = Panel::new(
            "Ranking",
            Axis::linear("rank correlation with exact information").between(0.0, 1.05),
            Axis::categories("", names),
        )
        .with(Layer::boxes("mean over deployments", bars.collect()).coloured(0))
        .with_all(errors.enumerate().map(|(i, line)| {
            let label = if i == 0 { "one standard error" } else { "" };
            Layer::line(label, line).coloured(6)
        }));
        Plot::grid(2, vec![nodes, ranks])
    }
}

/// Of every rule: rank correlation, information lost, bias; none if the search had no candidates.
fn rank(p: &Parameters, settings: &Settings, trial: Trial) -> Result<Option<Vec<[f64; 3]>>, Error> {
    let endless = Example { threshold: 1e-300, ..B };
    let scheme = Scheme::new("exact", endless).up_to(3);
    let outcome = scheme.run(settings, trial)?;
    let (Some(posterior), Some(last)) = (&outcome.posterior, outcome.steps.last()) else {
        return Ok(None);
    };
    let network = Network::draw(trial.stream, settings.nodes, scheme.range)?;
    let sensor = B.sensor(false)?;
    let rate = settings.joint()?;
    let visited: Vec<usize> = outcome.steps.iter().map(|s| s.node).collect();
    let places: Vec<Vector2<f64>> = network
        .graph
        .neighbours(last.node)
        .iter()
        .filter(|node| !visited.contains(&(**node as usize)))
        .map(|node| network.deployment.positions()[*node as usize])
        .collect();
    if places.len() < 4 {
        return Ok(None);
    }
    let reference = Reference::new(posterior, p.draws, trial);
    let clumps = posterior.clumps_with_rate(1.0, p.points)?;
    let weights: Vec<f64> = clumps.clumps().iter().map(|c| c.weight).collect();
    let total: f64 = weights.iter().sum();
    let weights: Vec<f64> = weights.iter().map(|w| w / total).collect();
    let mut exact = Vec::new();
    let mut scores: Vec<Vec<f64>> = vec![Vec::new(); RULES.len()];
    let selector = |rule| Selector::new(rule, posterior, &last.estimate, &rate).map_err(Error::failed);
    let others = [
        selector(Rule::CramerRao)?,
        selector(Rule::Covariance)?,
        selector(Rule::Mahalanobis)?,
    ];
    for place in &places {
        let means: Vec<Vec<f64>> = clumps
            .clumps()
            .iter()
            .map(|c| {
                let responses = sensor.responses(place, &Vector2::new(c.mean[0], c.mean[1]))?;
                Ok(responses.iter().map(|a| a * c.mean[2]).collect())
            })
            .collect::<Result<_, Error>>()?;
        let predictions = Predictions::new(&means, &weights, sensor.noise())?;
        let bounds = predictions.pairwise_bounds();
        exact.push(reference.information(&sensor, place)?);
        scores[0].push(predictions.gaussian_bound());
        scores[1].push(bounds.lower);
        scores[2].push(bounds.upper);
        scores[3].push(others[0].score(&sensor, place));
        scores[4].push(others[1].score(&sensor, place));
        scores[5].push(-(place - last.estimate.mean()).norm());
        scores[6].push(others[2].score(&sensor, place));
    }
    let best = exact.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Ok(Some(
        scores
            .iter()
            .map(|own| {
                let chosen = own
                    .iter()
                    .enumerate()
                    .max_by(|a, b| a.1.total_cmp(b.1))
                    .map_or(0, |(i, _)| i);
                let bias = own.iter().zip(&exact).map(|(a, b)| a - b).sum::<f64>() / exact.len() as f64;
                [correlation(&ranks(own), &ranks(&exact)), best - exact[chosen], bias]
            })
            .collect(),
    ))
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let below = |x: f64| {
        values.iter().filter(|v| **v < x).count() as f64 + 0.5 * values.iter().filter(|v| **v == x).count() as f64
    };
    values.iter().map(|x| below(*x)).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let cross: f64 = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum();
    let own = |v: &[f64], m: f64| v.iter().map(|x| (x - m).powi(2)).sum::<f64>();
    let scale = (own(a, ma) * own(b, mb)).sqrt();
    if scale > 0.0 { cross / scale } else { 0.0 }
}

/// Draws of position, rate and noise from a posterior, and the cells that say how likely samples are under all of it.
struct Reference<'a> {
    posterior: &'a Posterior,
    draws: Vec<Draw>,
}

/// A draw: position, rate, and one noise for every sample in standard deviations.
struct Draw {
    position: Vector2<f64>,
    rate: f64,
    noise: Vec<f64>,
}

impl<'a> Reference<'a> {
    fn new(posterior: &'a Posterior, draws: usize, trial: Trial) -> Self {
        let mut rng = trial.stream.named("information").rng();
        let [x, y] = posterior.cells.columns();
        let mut cumulative: Vec<f64> = posterior.cells.weights().to_vec();
        for i in 1..cumulative.len() {
            cumulative[i] += cumulative[i - 1];
        }
        let total = cumulative.last().copied().unwrap_or(1.0);
        let draw = |k: usize| {
            // Systematic in the cells: the sum over the posterior is nearly exact, the noise is what is left.
            let level = total * (k as f64 + rng.random::<f64>()) / draws as f64;
            let cell = cumulative.partition_point(|c| *c < level).min(cumulative.len() - 1);
            let (mean, variance) = posterior.rates.as_ref().map_or((1.0, 0.0), |(m, v)| (m[cell], v[cell]));
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            Draw {
                position: Vector2::new(x[cell], y[cell]),
                rate: mean + variance.sqrt() * normal(),
                noise: (0..B.samples).map(|_| normal()).collect(),
            }
        };
        Self {
            posterior,
            draws: (0..draws).map(draw).collect(),
        }
    }

    /// Mutual information of (position, rate) and the samples of a node, nats: the mean of `ln p(y | position, rate) - ln p(y)`, with
    /// `p(y)` the sum over all cells, the rate in each integrated out as a normal of its mean and variance.
    fn information(&self, sensor: &SourceSensor, place: &Vector2<f64>) -> Result<f64, Error> {
        let [x, y] = self.posterior.cells.columns();
        let weights = self.posterior.cells.weights();
        let in_noise = |at: Vector2<f64>| -> Result<Vec<f64>, Error> {
            let responses = sensor.responses(place, &at)?;
            Ok(responses.iter().map(|a| a / sensor.noise()).collect())
        };
        // What all draws share: responses at every cell, and the moments of its rate.
        let places = x.iter().zip(y).map(|(x, y)| Vector2::new(*x, *y));
        let predicted: Vec<Vec<f64>> = places.map(in_noise).collect::<Result<_, _>>()?;
        let rate = |i: usize| self.posterior.rates.as_ref().map_or((1.0, 0.0), |(m, v)| (m[i], v[i]));
        let (mut logs, mut terms) = (vec![0.0; weights.len()], vec![0.0; weights.len()]);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // `ln p(y | position, rate)` but for what does not depend on them.
        let log = |rate: f64, response: f64, correlation: f64| rate * (correlation - 0.5 * rate * response);
        let mut total = 0.0;
        for draw in &self.draws {
            let clean = in_noise(draw.position)?;
            let samples: Vec<f64> = clean.iter().zip(&draw.noise).map(|(a, e)| draw.rate * a + e).collect();
            let own = log(draw.rate, dot(&clean, &clean), dot(&clean, &samples));
            for (i, (sum, predicted)) in logs.iter_mut().zip(&predicted).enumerate() {
                let (response, correlation) = (dot(predicted, predicted), dot(predicted, &samples));
                let (mean, variance) = rate(i);
                let spread = 1.0 + variance * response;
                let residual = correlation - mean * response;
                *sum = log(mean, response, correlation) + 0.5 * residual * residual * variance / spread
                    - 0.5 * spread.ln();
            }
            exp_minus(&logs, own, &mut terms);
            total -= dot(weights, &terms).ln();
        }
        Ok(total / self.draws.len() as f64)
    }
}
