//! The search for a diffusing source: nodes that are asked one after the other.

use crate::array::{matrix, shown, vector};
use crate::error::{Called, Outcome, refused};
use crate::given::named;
use crate::stored::{self, Reduced, maker};
use crate::table::{Table, doubles};
use arrow_array::{ArrayRef, Int64Array, StringArray};
use fewbits_diffusion::{
    Flow, FluxRule, LeakBelief, LeakPrior, Plan, PotentialFlow, Reading, SensorField, StepControl, Transport,
};
use fewbits_diffusive::{Error, RateModel, RateRange, Search, SearchBox, SearchField, SourceSensor};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Largest number of cells of a plan, times its nodes and instants.
const MOST_NUMBERS: usize = 1 << 27;

/// Rates of the belief about rooms, those beyond the range by an error of the model among them.
const RATES: usize = 84;

/// A search for a source that releases a substance, by sensors on the ground, in open air or in rooms.
///
/// `places` are those of the nodes, (n, 2), in metres; two nodes within `reach` hear each other. Each samples the concentration (kg/m^3) at the
/// `instants`, seconds after the release began, with noise of deviation `noise`. `diffusivity` is in m^2/s, `wind` in m/s. `rate` is the
/// release in kg/s: a number if it is known, or lowest and highest. The source lies between the corners of `box`. The search ends when the
/// determinant of the position's covariance falls below `threshold`, in m^4.
///
/// In rooms, `plan` is a drawing: `#` is wall, `.` air, `I` where air comes in, `O` where it goes out. A character is a square of `square`
/// metres, computed in `split` by `split` cells; the first line begins at y = 0, the first character at x = 0. `flow` (m^2/s) passes from `I`
/// to `O`, and `wind` stays zero. Concentrations are then per metre of height (kg/m^2), and `concentration` is that at a node.
///
/// >>> import numpy as np, fewbits as fb
/// >>> rng = np.random.default_rng(1)
/// >>> places, instants = rng.uniform(0, 100, (300, 2)), [5.0, 10.0, 15.0, 20.0, 25.0]
/// >>> search = fb.SourceSearch(
/// ...     places, reach=15.0, instants=instants, noise=8e-6, diffusivity=40.0, rate=(0.5, 1.5), box=((-20, -20), (120, 120))
/// ... )
/// >>> source = np.array([62.0, 50.0])
/// >>> def samples(node):
/// ...     clean = search.concentration(places[node], source)
/// ...     return clean + 8e-6 * rng.standard_normal(5)
/// >>> found = search.run(samples, start=search.nearest((44, 52)), deviation=50.0)
/// >>> found.status, bool(np.hypot(*(found.mean - source)) < 1)
/// ('converged', True)
///
/// >>> plan = '''
/// ... ########
/// ... ...#...#
/// ... ...#...#
/// ... ##.##.##
/// ... I......O'''
/// >>> places = [(x + 0.5, y + 0.5) for y, line in enumerate(plan.split()) for x, square in enumerate(line) if square != "#"]
/// >>> rooms = fb.SourceSearch(
/// ...     places, reach=1.6, instants=[60.0, 120.0], noise=0.3, diffusivity=0.05, rate=(0.5, 1.5), box=((0, 0), (8, 5)), plan=plan, flow=0.05
/// ... )
/// >>> source = np.array([1.2, 1.6])
/// >>> samples = lambda node: rooms.concentration(places[node], source) + 0.3 * rng.standard_normal(2)
/// >>> found = rooms.run(samples, start=rooms.nearest((6.5, 4.5)), deviation=4.0)
/// >>> bool(np.hypot(*(found.mean - source)) < 0.5)
/// True
///
/// >>> named = plan.replace("..#...#", "kk#bbb#") + "\nk = kitchen\nb = bath"
/// >>> rooms = fb.SourceSearch(
/// ...     places, reach=1.6, instants=[60.0, 120.0], noise=0.3, diffusivity=0.05, rate=(0.5, 1.5), box=((0, 0), (8, 5)), plan=named, flow=0.05
/// ... )
/// >>> print(rooms.rooms({node: samples(node) for node in found.visited["node"]})["room"][0])
/// kitchen
#[pyclass(frozen, module = "fewbits")]
pub(crate) struct SourceSearch {
    given: Setting,
    field: SearchField,
    sensor: SourceSensor,
    search: SearchBox,
}

/// What a search is made of.
#[derive(Clone, Serialize, Deserialize)]
struct Setting {
    places: Vec<Vector2<f64>>,
    reach: f64,
    instants: Vec<f64>,
    noise: f64,
    diffusivity: f64,
    wind: (f64, f64),
    rate: RateModel,
    corners: ((f64, f64), (f64, f64)),
    threshold: f64,
    max_nodes: usize,
    plan: Option<String>,
    square: f64,
    split: usize,
    flow: f64,
}

/// All that a search may end with.
const STATUSES: [&str; 8] = [
    "converged",
    "exhausted",
    "node limit",
    "belief miss",
    "misfit",
    "undecodable",
    "outside field",
    "unresolved",
];

/// What a search found.
#[pyclass(frozen, get_all, module = "fewbits")]
pub(crate) struct SourceFound {
    /// "converged", or why the search ended without: "misfit" (the model does not explain the samples: do not use the estimate),
    /// "outside field", "exhausted", "node limit", "belief miss", "undecodable", "unresolved".
    status: &'static str,
    /// Mean of the position, metres.
    mean: Option<Py<PyArray1<f64>>>,
    /// Its covariance, (2, 2).
    covariance: Option<Py<PyArray2<f64>>>,
    /// Every node that sampled: its number, hops to it, bits of the message to it, and the estimate after its samples.
    visited: Py<Table>,
    /// Bits of all messages.
    bits: usize,
}

type FoundParts<'py> = (
    String,
    Option<Bound<'py, PyArray1<f64>>>,
    Option<Bound<'py, PyArray2<f64>>>,
    Bound<'py, Table>,
    usize,
);

#[pymethods]
impl SourceFound {
    #[staticmethod]
    fn _restored(
        status: &str,
        mean: Option<Py<PyArray1<f64>>>,
        covariance: Option<Py<PyArray2<f64>>>,
        visited: Py<Table>,
        bits: usize,
    ) -> Outcome<Self> {
        let Some(status) = STATUSES.iter().copied().find(|known| *known == status) else {
            return refused("status", format!("'{status}'"), format!("one of {}", STATUSES.join(", ")));
        };
        Ok(Self {
            status,
            mean,
            covariance,
            visited,
            bits,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py, FoundParts<'py>>> {
        let mean = self.mean.as_ref().map(|mean| mean.bind(py).clone());
        let covariance = self.covariance.as_ref().map(|covariance| covariance.bind(py).clone());
        let parts = (self.status.to_owned(), mean, covariance, self.visited.bind(py).clone(), self.bits);
        Ok((maker::<Self>(py)?, parts))
    }
}

#[pymethods]
impl SourceSearch {
    #[new]
    #[pyo3(signature = (places, *, reach, instants, noise, diffusivity, wind=(0.0, 0.0), rate, r#box, threshold=1e-5, max_nodes=40, plan=None, square=1.0, split=2, flow=0.0))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        places: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] reach: f64,
        instants: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] noise: f64,
        #[pyo3(from_py_with = named)] diffusivity: f64,
        #[pyo3(from_py_with = named)] wind: (f64, f64),
        rate: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] r#box: ((f64, f64), (f64, f64)),
        #[pyo3(from_py_with = named)] threshold: f64,
        #[pyo3(from_py_with = named)] max_nodes: usize,
        #[pyo3(from_py_with = named)] plan: Option<&str>,
        #[pyo3(from_py_with = named)] square: f64,
        #[pyo3(from_py_with = named)] split: usize,
        #[pyo3(from_py_with = named)] flow: f64,
    ) -> Outcome<Self> {
        let (rows, columns, numbers) = matrix("places", places)?;
        if columns != 2 {
            return refused("places", format!("{rows} by {columns}"), "two numbers a node, x and y");
        }
        let places: Vec<Vector2<f64>> = numbers
            .chunks_exact(2)
            .map(|place| Vector2::new(place[0], place[1]))
            .collect();
        let rate = match (rate.extract::<f64>(), rate.extract::<(f64, f64)>()) {
            (Ok(known), _) => RateModel::Known(known),
            (_, Ok((low, high))) => RateModel::Joint(RateRange::new(low, high)?),
            _ => return refused("rate", crate::array::shown(rate), "a number, or the lowest and the highest"),
        };
        let given = Setting {
            places,
            reach,
            instants: vector("instants", instants)?,
            noise,
            diffusivity,
            wind,
            rate,
            corners: r#box,
            threshold,
            max_nodes,
            plan: plan.map(str::to_owned),
            square,
            split,
            flow,
        };
        Self::of(py, given)
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, state: &Bound<'_, PyAny>) -> Outcome<Self> {
        Self::of(py, stored::state(state)?)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, (Bound<'py, PyBytes>,)>> {
        Ok((maker::<Self>(py)?, (stored::bytes(py, &self.given)?,)))
    }

    /// The node nearest to a place.
    fn nearest(&self, #[pyo3(from_py_with = named)] place: (f64, f64)) -> Outcome<usize> {
        if !(place.0.is_finite() && place.1.is_finite()) {
            return refused("place", format!("{place:?}"), "finite numbers");
        }
        Ok(self.field.deployment().nearest_to(&Vector2::new(place.0, place.1)))
    }

    /// The concentrations (kg/m^3) without noise at the instants, at a place, of a source of 1 kg/s, or of `rate`.
    #[pyo3(signature = (place, source, *, rate=1.0))]
    fn concentration<'py>(
        &self,
        py: Python<'py>,
        place: &Bound<'py, PyAny>,
        source: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named)] rate: f64,
    ) -> Outcome<Bound<'py, PyArray1<f64>>> {
        let place = crate::model::sized("place", vector("place", place)?, 2)?;
        let source = crate::model::sized("source", vector("source", source)?, 2)?;
        if place.iter().chain(&source).chain([&rate]).any(|x| !x.is_finite()) {
            return refused("place", "not finite, or the source or the rate is not", "finite numbers");
        }
        let (place, source) = (Vector2::new(place[0], place[1]), Vector2::new(source[0], source[1]));
        let mut means = self.sensor.responses(&place, &source)?;
        means.iter_mut().for_each(|mean| *mean *= rate);
        Ok(PyArray1::from_vec(py, means))
    }

    /// Runs the search from node `start`, where the alarm was raised; the source is `deviation` metres from it, give or take. `samples(node)`
    /// returns what a node measures, one number per instant.
    #[pyo3(signature = (samples, *, start, deviation))]
    fn run(
        &self,
        py: Python<'_>,
        samples: Py<PyAny>,
        #[pyo3(from_py_with = named)] start: usize,
        #[pyo3(from_py_with = named)] deviation: f64,
    ) -> Outcome<SourceFound> {
        if !samples.bind(py).is_callable() {
            return refused("samples", shown(samples.bind(py)), "a function of a node's number");
        }
        let search = self.about(start, deviation)?;
        let mut raised = None;
        let outcome = py.detach(|| {
            search.run(&self.field, start, |node| {
                let asked = Python::attach(|py| -> Outcome<Vec<f64>> {
                    py.check_signals()?;
                    vector("samples", samples.call1(py, (node,))?.bind(py))
                });
                asked.map_err(|failure| {
                    raised = Some(failure);
                    Error::NotANumber { what: "a sample" }
                })
            })
        });
        if let Some(failure) = raised {
            return Err(failure);
        }
        let outcome = outcome?;
        let estimate = outcome.estimate();
        let mean = estimate.map(|found| PyArray1::from_slice(py, found.mean().as_slice()).unbind());
        let rows = |found: &fewbits_core::Gaussian<2>| {
            let c = found.covariance();
            vec![vec![c[(0, 0)], c[(0, 1)]], vec![c[(1, 0)], c[(1, 1)]]]
        };
        let covariance = estimate
            .map(|found| PyArray2::from_vec2(py, &rows(found)).map(Bound::unbind))
            .transpose()
            .map_err(PyErr::from)?;
        let whole = |of: fn(&fewbits_diffusive::Step) -> usize| -> ArrayRef {
            Arc::new(Int64Array::from_iter_values(outcome.steps.iter().map(|step| of(step) as i64)))
        };
        let number = |of: fn(&fewbits_diffusive::Step) -> f64| doubles(outcome.steps.iter().map(of).collect());
        let visited = Table::new(vec![
            ("node".to_owned(), whole(|step| step.node)),
            ("hops".to_owned(), whole(|step| step.hops)),
            ("bits".to_owned(), whole(|step| step.bits)),
            ("x".to_owned(), number(|step| step.estimate.mean()[0])),
            ("y".to_owned(), number(|step| step.estimate.mean()[1])),
            ("x_sd".to_owned(), number(|step| step.estimate.covariance()[(0, 0)].sqrt())),
            ("y_sd".to_owned(), number(|step| step.estimate.covariance()[(1, 1)].sqrt())),
        ])?;
        Ok(SourceFound {
            status: status_name(outcome.status),
            mean,
            covariance,
            bits: outcome.steps.iter().map(|step| step.bits).sum(),
            visited: Py::new(py, visited)?,
        })
    }

    /// In rooms: the probability that the source is in each room of the plan, the likeliest first, given what nodes measured at the instants:
    /// `samples` has their numbers and samples. The plan names rooms by characters and lines such as `k = kitchen`; air of no room is
    /// "elsewhere". `model_error` is the relative error of what the model says that a node measures, one standard deviation; a known rate
    /// is taken as known up to it too.
    ///
    /// Raises `fewbits.ArgumentError` if the search has no plan, or the samples do not fit.
    #[pyo3(signature = (samples, *, model_error=0.1))]
    fn rooms(
        &self,
        py: Python<'_>,
        samples: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] model_error: f64,
    ) -> Outcome<Table> {
        let Some(drawing) = &self.given.plan else {
            return refused("plan", "not given", "the plan that has the rooms");
        };
        let Ok(samples) = samples.cast::<PyDict>() else {
            return refused("samples", shown(samples), "a dictionary: nodes and the samples of each");
        };
        let positions = self.field.deployment().positions();
        let (mut places, mut readings) = (Vec::new(), Vec::new());
        for (node, measured) in samples {
            let place = node.extract::<usize>().ok().and_then(|node| positions.get(node));
            let Some(place) = place else {
                return refused("samples", shown(&node), format!("0 to {}, a node", positions.len() - 1));
            };
            places.push(*place);
            readings.push(crate::model::sized("samples", vector("samples", &measured)?, self.given.instants.len())?);
        }
        let rate = match self.given.rate {
            RateModel::Known(rate) => [rate, rate],
            RateModel::Joint(range) | RateModel::NodeWise(range) | RateModel::SampleWise(range) => {
                // Its logarithm is uniform.
                [range.low().max(1e-3 * range.high()), range.high()]
            }
        };
        // Steps of a narrower range would be far smaller than the errors of the model.
        let (middle, half) = ((rate[0] * rate[1]).sqrt(), 0.5 * (rate[1] / rate[0]).ln());
        let rate = [-1.0, 1.0].map(|side: f64| middle * (side * half.max(model_error).max(0.01)).exp());
        let prior = LeakPrior {
            start: [0.0, 0.0],
            rate,
            model_error,
            faults: 0.001,
        };
        let found = py.detach(|| -> Outcome<_> {
            let given = &self.given;
            let squares = (given.square, given.split);
            within_memory(drawing, given.split, RATES * (readings.len() + 2))?;
            let field = rooms(drawing, squares, given.diffusivity, given.flow, &places, &given.instants)?;
            let mut belief = LeakBelief::new(field, &prior)?;
            for (node, measured) in readings.iter().enumerate() {
                for (time, value) in given.instants.iter().zip(measured) {
                    belief.observe(node, *time, &Reading::Value(*value), given.noise)?;
                }
            }
            Ok(belief.rooms(&Plan::parse(drawing)?)?)
        })?;
        let (names, probabilities): (Vec<String>, Vec<f64>) = found.into_iter().unzip();
        Table::new(vec![
            ("room".to_owned(), Arc::new(StringArray::from(names)) as ArrayRef),
            ("probability".to_owned(), doubles(probabilities)),
        ])
    }
}

/// Refuses a plan whose cells have too many numbers, so many each.
fn within_memory(plan: &str, split: usize, each: usize) -> Outcome<()> {
    let squares = plan.chars().filter(|square| *square != '\n').count();
    let numbers = [split, split, squares, each];
    let numbers = numbers
        .iter()
        .try_fold(1_usize, |product, one| product.checked_mul(*one));
    if numbers.is_none_or(|numbers| numbers > MOST_NUMBERS) {
        let expected = format!("at most {MOST_NUMBERS} numbers, {each} a cell: the plan has {squares} squares");
        return refused("split", split, expected);
    }
    Ok(())
}

/// What sensors at these places measure in rooms, at these ages of the source.
fn rooms(
    plan: &str,
    (square, split): (f64, usize),
    diffusivity: f64,
    flow: f64,
    places: &[Vector2<f64>],
    ages: &[f64],
) -> Outcome<SensorField> {
    within_memory(plan, split, places.len().max(1).saturating_mul(ages.len().max(1)))?;
    let plan = Plan::parse(plan)?;
    let domain = plan.domain(square, split, 0.0)?;
    let wind = match flow {
        0.0 => Flow::still(&domain),
        flow => PotentialFlow::new(&domain, flow)?.flow,
    };
    let transport = Transport::new(domain, diffusivity, &wind, 0.0, FluxRule::default())?;
    let points: Vec<[f64; 3]> = places.iter().map(|place| [place.x, place.y, 0.0]).collect();
    Ok(SensorField::transient(&transport, &points, ages, StepControl::default())?)
}

impl SourceSearch {
    fn of(py: Python<'_>, given: Setting) -> Outcome<Self> {
        if given.plan.is_some() && given.wind != (0.0, 0.0) {
            return refused("wind", format!("{:?} with a plan", given.wind), "none: `flow` moves the air in rooms");
        }
        let ((left, low), (right, high)) = given.corners;
        if [left, low, right, high].iter().any(|x| !x.is_finite()) {
            return refused("box", format!("{:?}", given.corners), "finite corners");
        }
        let (field, sensor) = py.detach(|| -> Outcome<_> {
            let instants = given.instants.clone();
            let sensor = match &given.plan {
                Some(plan) => {
                    let squares = (given.square, given.split);
                    let field = rooms(plan, squares, given.diffusivity, given.flow, &given.places, &instants)?;
                    SourceSensor::new(Arc::new(field), instants, given.noise)?
                }
                None => {
                    let wind = Vector3::new(given.wind.0, given.wind.1, 0.0);
                    let air = Air::new(given.diffusivity, wind, Ground::Impermeable)?;
                    SourceSensor::new(air, instants, given.noise)?
                }
            };
            let nodes = Deployment::given(given.places.clone()).called(&[("positions", "places")])?;
            let graph = Graph::within(nodes.positions(), given.reach).called(&[("range", "reach")])?;
            Ok((SearchField::new(sensor.clone(), nodes, graph)?, sensor))
        })?;
        let search = SearchBox {
            lower: [left, low],
            upper: [right, high],
        };
        let made = Self {
            given,
            field,
            sensor,
            search,
        };
        made.about(0, 1.0)?;
        Ok(made)
    }

    fn about(&self, start: usize, deviation: f64) -> Outcome<Search> {
        let nodes = self.field.deployment().positions();
        let Some(place) = nodes.get(start) else {
            return refused("start", start, format!("0 to {}, a node", nodes.len().saturating_sub(1)));
        };
        let mut search = Search::new(place, deviation, self.search, self.given.rate, self.given.threshold)
            .called(&[("upper - lower", "box")])?;
        search.max_nodes = self.given.max_nodes;
        Ok(search)
    }
}

fn status_name(status: fewbits_diffusive::Status) -> &'static str {
    use fewbits_diffusive::Status;
    match status {
        Status::Converged => "converged",
        Status::Exhausted => "exhausted",
        Status::NodeLimit => "node limit",
        Status::BeliefMiss => "belief miss",
        Status::Misfit => "misfit",
        Status::Undecodable => "undecodable",
        Status::OutsideField => "outside field",
        _ => "unresolved",
    }
}
