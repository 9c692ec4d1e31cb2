//! What the figures of this system share: the two examples, networks, searches, and statistics of many searches.

use crate::prelude::*;
use fewbits_baselines::diffusive::{LAPLACE, lpg, particles};
use fewbits_diffusive::message::Wire;
use fewbits_diffusive::{
    Form, Outcome, RateModel, RateRange, Search, SearchBox, SearchField, SelectionRule, SourceSensor, Status,
};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_topology::{Deployment, Graph};

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
pub(super) const LPG: Form = lpg::<2, 5>();
/// One of them.
const ONE_LPG: Form = lpg::<1, 5>();

parameters! {
    /// Settings of every search.
    #[derive(Debug, Clone)]
    pub struct Settings {
        pub(super) trials: u64 [1..=100_000] = 120 => quick 8 => "Random deployments, each searched by every scheme.",
        pub(super) nodes: usize [2..=100_000] = 300 => "Deployed nodes.",
        pub(super) prior_sd: f64 [1.0..=1e4] = 50.0 => "Standard deviation of the prior about the first node, m.",
        pub(super) rate_low: f64 [0.0..=0.99] = 0.5 => "Lower end of the rate's prior, kg/s.",
        pub(super) rate_high: f64 [1.01..=1e3] = 1.5 => "Upper end of the rate's prior, kg/s.",
    }
    cost |p| Cost::new(p.trials as f64, p.trials as f64 * 2e4);
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
        let [x, y] = if windy { WIND } else { [0.0; 2] };
        let air = Air::new(DIFFUSIVITY, Vector3::new(x, y, 0.0), Ground::Impermeable)?;
        let instants = (1..=self.samples).map(|j| 5.0 * j as f64).collect();
        Ok(SourceSensor::new(air, instants, self.noise)?.with_bias(BIAS)?)
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

/// Forms of the belief and rules that choose nodes in wind, each with its place in the palette: one colour in every figure, whether
/// the rate is known or not.
const KINDS: [(&str, Form, Option<SelectionRule>, usize); 11] = [
    ("exact", Form::Raw, None, 0),
    ("gmm-4", Form::Mixture(4), None, 1),
    ("gaussian", Form::Gaussian, None, 2),
    ("gaussian-9", Form::Gaussian, None, 3),
    ("lpg-2x5", LPG, None, 4),
    ("lpg-1x5", ONE_LPG, None, 5),
    ("particles-25", particles::<25>(), None, 6),
    ("mode and curvature", LAPLACE, None, 8),
    ("information", Form::Mixture(4), Some(SelectionRule::MutualInformation), 0),
    ("covariance", Form::Mixture(4), Some(SelectionRule::Covariance), 1),
    ("mahalanobis", Form::Mixture(4), Some(SelectionRule::Mahalanobis), 2),
];
/// Ends the name of a form that travels without the rate.
const KNOWN: &str = " known rate";

/// How one search is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scheme {
    pub name: &'static str,
    pub example: Example,
    pub windy: bool,
    pub range: f64,
    pub form: Form,
    pub known_rate: bool,
    pub rule: SelectionRule,
    /// Its place in the palette; 7 is the threshold's.
    pub place: usize,
    pub most_nodes: usize,
    pub wire: Wire,
}

impl Scheme {
    /// The scheme of this name. A form travels in still air to the node that is nearest by Mahalanobis distance, a rule chooses in wind; any
    /// other name is that of raw records.
    pub fn new(name: &'static str, example: Example, range: f64) -> Self {
        let kind = KINDS.iter().find(|kind| kind.0 == name.trim_end_matches(KNOWN));
        let (form, rule, place) = kind.map_or((Form::Raw, None, 8), |kind| (kind.1, kind.2, kind.3));
        Self {
            name,
            example,
            windy: rule.is_some(),
            range,
            form,
            known_rate: name.ends_with(KNOWN),
            rule: rule.unwrap_or(SelectionRule::Mahalanobis),
            place,
            most_nodes: match (rule, form) {
                (Some(_), _) => 14,
                (None, Form::Raw) => 30,
                (None, _) => 40,
            },
            wire: Wire::default(),
        }
    }

    /// The exact search of example B until so many nodes have sampled: no threshold ends it early.
    pub fn exact(nodes: usize) -> Self {
        let endless = Example { threshold: 1e-300, ..B };
        Self {
            most_nodes: nodes,
            ..Self::new("exact", endless, 15.0)
        }
    }

    /// The search of this scheme from the alarm node.
    pub fn search(&self, settings: &Settings) -> Result<Search, Error> {
        let rate = match self.known_rate {
            true => RateModel::Known(RATE),
            false => settings.joint()?,
        };
        let alarm = Vector2::from(ALARM);
        let mut search = Search::new(&alarm, settings.prior_sd, search_box(), rate, self.example.threshold)?;
        search.form = self.form;
        search.rule = self.rule;
        search.max_nodes = self.most_nodes;
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

    /// Runs it on the network and noise of a trial's stream, which all schemes share.
    pub fn run(&self, settings: &Settings, stream: Stream) -> Result<Outcome, Error> {
        let Network {
            deployment,
            graph,
            start,
        } = Network::draw(stream, settings.nodes, self.range)?;
        let sensor = self.example.sensor(self.windy)?;
        let source = self.example.source();
        let field = SearchField::new(sensor.clone(), deployment, graph)?;
        let positions = field.deployment().positions();
        let samples = |node: usize| {
            let mut rng = stream.named("noise").indexed(node as u64).rng();
            sensor.sample(&mut rng, &positions[node], &source, RATE)
        };
        let search = self.search(settings)?;
        Ok(search.run(&field, start, samples)?)
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
        let nees = steps
            .iter()
            .filter_map(|s| Some(2.0 * s.estimate.normalised_error_squared(source).ok()?));
        Self {
            status: outcome.status,
            errors,
            log10_determinants: steps.iter().map(|s| s.log10_determinant).collect(),
            nees: nees.collect(),
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

/// The experiment of all searches: every figure sees the same deployments and noise.
pub(super) const CHAINS: &str = "diffusive-chains";

/// A scheme on every trial, computed once for all figures of a run.
pub(super) fn tracks(context: &Context<'_>, settings: &Settings, scheme: &Scheme) -> Result<Vec<Track>, Error> {
    // All that the tracks depend on; the scheme's name is none of it.
    let unnamed = Scheme {
        name: "",
        place: 0,
        ..*scheme
    };
    let source = scheme.example.source();
    let one = |trial: Trial| Ok(Track::of(&scheme.run(settings, trial.stream)?, &source));
    context.once(format!("{CHAINS} {} {settings:?} {unnamed:?}", context.seed), || {
        context.trials(context.stream(CHAINS), settings.trials, one)
    })
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
pub(super) fn median(values: impl IntoIterator<Item = f64>) -> Option<Measured> {
    let values: Vec<f64> = values.into_iter().collect();
    let value = quantile(values.iter().copied(), 0.5)?;
    let spread = quantile(values.iter().copied(), 0.75)? - quantile(values.iter().copied(), 0.25)?;
    // Counts may have no spread in their middle half; half a count is the least that they resolve.
    let discrete = values.iter().all(|v| v.fract() == 0.0);
    let deviation = (spread / 1.349).max(if discrete { 0.5 } else { 0.0 });
    let n = values.len() as f64;
    Some(Measured::new(value, (values.len() > 1).then(|| 1.2533 * deviation / n.sqrt())))
}

/// A fraction of trials. Its standard error is that of the fraction with one success and one failure more, never zero.
pub(super) fn fraction(hits: usize, trials: usize) -> Measured {
    let smoothed = (hits as f64 + 1.0) / (trials as f64 + 2.0);
    let error = (trials > 1).then(|| (smoothed * (1.0 - smoothed) / trials as f64).sqrt());
    Measured::new(hits as f64 / trials.max(1) as f64, error)
}
