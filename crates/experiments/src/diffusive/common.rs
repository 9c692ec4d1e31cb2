//! What the figures of this system share: the two examples, networks, searches, and statistics of many searches.

use crate::kept::Kept;
use crate::prelude::*;
use fewbits_diffusive::message::Wire;
use fewbits_diffusive::{Form, Outcome, RateModel, RateRange, Rule, Search, SearchBox, SourceSensor, Status};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};

/// Diffusivity, m^2/s.
pub(super) const DIFFUSIVITY: f64 = 40.0;
/// The node that raises the alarm and samples first, m.
pub(super) const ALARM: [f64; 2] = [44.396, 52.042];
/// The wind of the last two figures, m/s.
const WIND: [f64; 2] = [-20.0, -10.0];
/// Bias of the sensors, kg/m^3.
const BIAS: f64 = 1e-5;
/// The true rate, kg/s.
pub(super) const RATE: f64 = 1.0;
/// How far outside the field the source may be, m.
const MARGIN: f64 = 20.0;

/// The polynomial Gaussians of the paper: two, of degree 5.
pub(super) const LPG: Form = Form::Lpg {
    components: 2,
    degree: 5,
};

parameters! {
    /// Settings of every search.
    #[derive(Debug, Clone)]
    pub struct Settings {
        pub(super) trials: u64 [1..=100_000] = 200 => quick 8 => "Random deployments, each searched by every scheme.",
        pub(super) nodes: usize [2..=100_000] = 300 => "Deployed nodes.",
        pub(super) prior_sd: f64 [1.0..=1e4] = 50.0 => "Standard deviation of the prior about the first node, m.",
        pub(super) rate_low: f64 [0.0..=0.99] = 0.5 => "Lower end of the rate's prior, kg/s.",
        pub(super) rate_high: f64 [1.01..=1e3] = 1.5 => "Upper end of the rate's prior, kg/s.",
    }
}

impl Settings {
    pub(super) fn joint(&self) -> Result<RateModel, Error> {
        Ok(RateModel::Joint(RateRange::new(self.rate_low, self.rate_high)?))
    }
}

/// One of the paper's two examples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Example {
    pub source: [f64; 2],
    pub noise: f64,
    pub samples: usize,
    pub threshold: f64,
}

/// Example A: ten samples a node, noise 4e-6.
pub(super) const A: Example = Example {
    source: [73.0, 38.0],
    noise: 4e-6,
    samples: 10,
    threshold: 1e-6,
};
/// Example B: five samples a node, noise 8e-6.
pub(super) const B: Example = Example {
    source: [62.0, 50.0],
    noise: 8e-6,
    samples: 5,
    threshold: 1e-5,
};

impl Example {
    pub fn source(&self) -> Vector2<f64> {
        Vector2::from(self.source)
    }

    pub fn sensor(&self, windy: bool) -> Result<SourceSensor, Error> {
        let wind = if windy {
            Vector3::new(WIND[0], WIND[1], 0.0)
        } else {
            Vector3::zeros()
        };
        let air = Air::new(DIFFUSIVITY, wind, Ground::Impermeable)?;
        let instants = (1..=self.samples).map(|j| 5.0 * j as f64).collect();
        let sensor = SourceSensor::new(air, instants, self.noise)?;
        sensor.with_bias(BIAS).map_err(Error::failed)
    }
}

/// A deployment and its radio graph.
pub(super) struct Network {
    pub deployment: Deployment,
    pub graph: Graph,
    pub start: usize,
}

impl Network {
    /// The network of a trial: uniform on 100 m by 100 m, the node nearest to the alarm moved there.
    pub fn draw(stream: Stream, nodes: usize, range: f64) -> Result<Self, Error> {
        let mut rng = stream.named("deployment").rng();
        let field = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], nodes)?;
        let alarm = Vector2::from(ALARM);
        let start = field.nearest_to(&alarm);
        let deployment = field.with_moved(start, alarm)?;
        let graph = Graph::within(deployment.positions(), range)?;
        Ok(Self {
            deployment,
            graph,
            start,
        })
    }
}

pub(super) fn search_box() -> SearchBox {
    SearchBox {
        lower: [-MARGIN; 2],
        upper: [100.0 + MARGIN; 2],
    }
}

/// How one search is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scheme {
    pub name: &'static str,
    pub example: Example,
    pub windy: bool,
    pub range: f64,
    pub form: Form,
    pub known_rate: bool,
    pub rule: Rule,
    pub most_nodes: usize,
    pub wire: Wire,
}

impl Scheme {
    /// Raw records, unknown rate, 15 m, Mahalanobis, at most 40 nodes.
    pub fn new(name: &'static str, example: Example) -> Self {
        Self {
            name,
            example,
            windy: false,
            range: 15.0,
            form: Form::Raw,
            known_rate: false,
            rule: Rule::Mahalanobis,
            most_nodes: 40,
            wire: Wire::default(),
        }
    }

    /// Its place in the palette: a form of the belief, or a rule, has one colour in every figure, whether the rate is known or not.
    pub fn place(&self) -> usize {
        place(self.name)
    }

    pub fn at(self, range: f64) -> Self {
        Self { range, ..self }
    }

    pub fn of(self, form: Form) -> Self {
        Self { form, ..self }
    }

    pub fn known(self) -> Self {
        Self {
            known_rate: true,
            ..self
        }
    }

    pub fn by(self, rule: Rule) -> Self {
        Self { rule, ..self }
    }

    pub fn up_to(self, most_nodes: usize) -> Self {
        Self { most_nodes, ..self }
    }

    pub fn in_wind(self) -> Self {
        Self { windy: true, ..self }
    }

    pub fn wired(self, wire: Wire) -> Self {
        Self { wire, ..self }
    }

    /// The search of this scheme from the alarm node.
    pub fn search(&self, settings: &Settings) -> Result<Search, Error> {
        let rate = if self.known_rate {
            RateModel::Known(RATE)
        } else {
            settings.joint()?
        };
        let alarm = Vector2::from(ALARM);
        let mut search = Search::new(&alarm, settings.prior_sd, search_box(), rate, self.example.threshold)?;
        search.form = self.form;
        search.rule = self.rule;
        search.most_nodes = self.most_nodes;
        search.wire = self.wire;
        // The figures compare the share of searches that reach the threshold, and their nodes and errors, with references of a program
        // that never refuses a model. A refused search would count as one that stopped short, most often where a form is shown to stop
        // in the wrong place (`converged_wrong`).
        search.refusal = None;
        if self.form != Form::Raw {
            // What is projected need not be exact to seven digits.
            search.cells.keep = 14.0;
            search.cells.width = 1.0;
        }
        Ok(search)
    }

    /// Runs it on the network and noise of a trial, which all schemes share.
    pub fn run(&self, settings: &Settings, trial: Trial) -> Result<Outcome, Error> {
        let network = Network::draw(trial.stream, settings.nodes, self.range)?;
        let sensor = self.example.sensor(self.windy)?;
        let source = self.example.source();
        let positions = network.deployment.positions();
        let samples = |node: usize| {
            let mut rng = trial.stream.named("noise").indexed(node as u64).rng();
            sensor.sample(&mut rng, &positions[node], &source, RATE)
        };
        self.search(settings)?
            .run(&sensor, &network.deployment, &network.graph, network.start, samples)
            .map_err(Error::failed)
    }
}

/// The place in the palette of a form of the belief, or of a rule; 7 is the threshold's.
pub(super) fn place(name: &str) -> usize {
    match name.trim_end_matches(" known rate") {
        "exact" | "information" => 0,
        "gmm-4" | "covariance" => 1,
        "gaussian" | "mahalanobis" => 2,
        "gaussian-9" | "pairwise" => 3,
        "lpg-2x5" => 4,
        "lpg-1x5" => 5,
        "particles-25" => 6,
        _ => 8,
    }
}

/// What is kept of one search.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    pub status: Status,
    pub errors: Vec<f64>,
    pub log10_determinants: Vec<f64>,
    pub nees: Vec<f64>,
    pub bits: usize,
}

impl Track {
    pub fn of(outcome: &Outcome, source: &Vector2<f64>) -> Self {
        let steps = &outcome.steps;
        let mut errors: Vec<f64> = steps.iter().map(|s| (s.estimate.mean() - source).norm()).collect();
        if errors.is_empty() {
            // The first samples already excluded the prior.
            errors.push((Vector2::from(ALARM) - source).norm());
        }
        Self {
            status: outcome.status,
            errors,
            log10_determinants: steps.iter().map(|s| s.log10_determinant).collect(),
            nees: steps
                .iter()
                .filter_map(|s| s.estimate.mahalanobis_squared(source).ok())
                .collect(),
            bits: outcome.bits(),
        }
    }

    pub fn converged(&self) -> bool {
        self.status == Status::Converged
    }

    pub fn nodes(&self) -> usize {
        self.errors.len()
    }

    pub fn final_error(&self) -> f64 {
        self.errors.last().copied().unwrap_or(f64::INFINITY)
    }
}

/// Every scheme on every trial: `tracks[trial][scheme]`.
pub(super) fn tracks(
    context: &Context<'_>,
    experiment: &str,
    settings: &Settings,
    schemes: &[Scheme],
) -> Result<Vec<Vec<Track>>, Error> {
    // All that the tracks of a scheme depend on; its name is none of it.
    let name = |scheme: &Scheme| {
        let unnamed = Scheme { name: "", ..*scheme };
        format!("{experiment} {} {settings:?} {unnamed:?}", context.seed)
    };
    let own = Kept::default();
    let kept = context.kept.unwrap_or(&own);
    let missing: Vec<&Scheme> = select(schemes, |s| kept.get::<Vec<Track>>(&name(s)).is_none()).collect();
    let every = |trial: Trial| -> Result<Vec<Track>, Error> {
        let one = |scheme: &&Scheme| Ok(Track::of(&scheme.run(settings, trial)?, &scheme.example.source()));
        missing.iter().map(one).collect()
    };
    if !missing.is_empty() {
        let new = context.trials(experiment, settings.trials, every)?;
        for (i, scheme) in missing.iter().enumerate() {
            kept.put(name(scheme), new.iter().map(|tracks| tracks[i].clone()).collect::<Vec<_>>());
        }
    }
    let all: Vec<Vec<Track>> = schemes.iter().filter_map(|s| kept.get(&name(s))).collect();
    let count = all.first().map_or(0, Vec::len);
    Ok((0..count)
        .map(|trial| all.iter().map(|tracks| tracks[trial].clone()).collect())
        .collect())
}

/// The quantile of unsorted values; none of none.
pub(super) fn quantile(values: impl IntoIterator<Item = f64>, at: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    let position = at * (sorted.len().checked_sub(1)? as f64);
    let (low, share) = (position.floor() as usize, position.fract());
    let high = (low + 1).min(sorted.len() - 1);
    Some(if share == 0.0 {
        sorted[low]
    } else {
        sorted[low] + share * (sorted[high] - sorted[low])
    })
}

/// The median with a standard error from the spread of the middle half, as of a normal sample: `1.2533 sd / sqrt n`.
pub(super) fn median(values: &[f64]) -> Option<Measured> {
    let value = quantile(values.iter().copied(), 0.5)?;
    let spread = quantile(values.iter().copied(), 0.75)? - quantile(values.iter().copied(), 0.25)?;
    // Counts may have no spread in their middle half; half a count is the least that they resolve.
    let discrete = values.iter().all(|v| v.fract() == 0.0);
    let deviation = (spread / 1.349).max(if discrete { 0.5 } else { 0.0 });
    let n = values.len() as f64;
    Some(Measured {
        value,
        standard_error: (values.len() > 1).then(|| 1.2533 * deviation / n.sqrt()),
    })
}

/// A fraction of trials. Its standard error is that of the fraction with one success and one failure more, never zero.
pub(super) fn fraction(hits: usize, trials: usize) -> Measured {
    let smoothed = (hits as f64 + 1.0) / (trials as f64 + 2.0);
    Measured {
        value: hits as f64 / trials.max(1) as f64,
        standard_error: (trials > 1).then(|| (smoothed * (1.0 - smoothed) / trials as f64).sqrt()),
    }
}
