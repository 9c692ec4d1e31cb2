//! The twelve problems: what moves, what is measured, and how a filter is run on them.

use super::models::{Duffing, Fall, Growth, Lorenz, Measure, Pendulum, Straight, Turning, VanDerPol};
use crate::prelude::*;
use fewbits_core::factor::{Levels, Scalar};
use fewbits_core::{Cell, GaussianDynamics, Likelihood};
use fewbits_filters::{
    BootstrapFilter, EnsembleFilter, GridFilter, MomentFilter, ResamplingRule, SigmaPointFilter, StateFilter,
};
use fewbits_models::{AutoDynamics, AutoSensing, Flow};

/// Steps of a run.
pub(super) const STEPS: usize = 40;

/// Dynamics into each step.
type Motion<const D: usize> = Box<dyn Fn(usize) -> Result<Box<dyn GaussianDynamics<D>>, Error>>;

/// One problem, of a state of `D` coordinates of which the sensors read `K`.
struct Problem<const D: usize, const K: usize> {
    prior: Gaussian<D>,
    /// The motion into each step.
    motion: Motion<D>,
    /// What is measured in each step, and its noise variance.
    sensors: Box<dyn Fn(usize) -> Vec<(Measure, f64)>>,
    /// The coordinates that the sensors read.
    axes: [usize; K],
    /// The coordinates whose error is scored.
    scored: Vec<usize>,
}

/// Members of the ensemble.
const MEMBERS: usize = 100;
/// Particles.
const PARTICLES: usize = 2000;

/// Half the width of the two middle cells, in deviations of the noise.
const WIDTH: f64 = 1.5;

/// The cell of two bits about a prediction that holds a measurement.
fn cell(prediction: f64, noise: f64, z: f64) -> Result<Cell, Error> {
    let width = WIDTH * noise.sqrt();
    let (lower, upper) = match (z - prediction) / width {
        d if d < -1.0 => (f64::NEG_INFINITY, prediction - width),
        d if d < 0.0 => (prediction - width, prediction),
        d if d < 1.0 => (prediction, prediction + width),
        _ => (prediction + width, f64::INFINITY),
    };
    Ok(Cell::new(lower, upper)?)
}

/// True states and measurements of a run.
type Run<const D: usize> = Vec<(SVector<f64, D>, Vec<(AutoSensing<Measure, 1>, f64, f64)>)>;

impl<const D: usize, const K: usize> Problem<D, K> {
    fn draw(&self, stream: Stream) -> Result<Run<D>, Error> {
        let mut rng = stream.named("truth").rng();
        let mut state = self.prior.sample(&mut rng);
        let mut step = |k: usize| {
            state = (self.motion)(k)?.propagate(&mut rng, &state);
            let mut seen = Vec::new();
            for (measure, noise) in (self.sensors)(k) {
                let sensor = AutoSensing::new(measure, Matrix1::new(noise))?;
                let z = Sensing::<D, 1>::sample(&sensor, &mut rng, &state)[0];
                seen.push((sensor, noise, z));
            }
            Ok((state, seen))
        };
        (0..STEPS).map(&mut step).collect()
    }

    /// Mean squared error of a filter, whose sensors ask about its own prediction.
    fn error<F: StateFilter<D>>(&self, mut filter: F, run: &Run<D>, stream: Stream) -> Result<f64, Error> {
        let mut rng = stream.fast_rng();
        let mut belief = filter.start(&mut rng, &self.prior)?;
        let mut sum = 0.0;
        for (k, (truth, seen)) in run.iter().enumerate() {
            filter.predict(&mut rng, &*(self.motion)(k)?, &mut belief)?;
            let mean = belief.mean();
            let mut reports: Vec<Observed<AutoSensing<Measure, 1>, Scalar, 1>> = Vec::new();
            for (sensor, noise, z) in seen {
                let factor = Levels::certain(cell(sensor.mean(&mean)[0], *noise, *z)?, *noise)?;
                reports.push(Observed::new(*sensor, factor.into()));
            }
            let reports: Vec<&dyn Likelihood<D>> = reports.iter().map(|one| one as _).collect();
            match filter.update(&mut rng, &mut belief, &reports) {
                // A filter that has lost the target goes on without the report.
                Ok(_) | Err(fewbits_core::Error::Impossible | fewbits_core::Error::Unresolved { .. }) => {}
                Err(error) => return Err(error.into()),
            }
            let off = belief.mean() - truth;
            sum += self.scored.iter().map(|d| off[*d] * off[*d]).sum::<f64>();
        }
        Ok(sum / run.len() as f64)
    }
}

/// A problem of any dimension.
trait AnyProblem {
    /// Mean squared errors of all filters.
    fn errors(&self, stream: Stream) -> Result<[f64; 5], Error>;
}

impl<const D: usize, const K: usize> AnyProblem for Problem<D, K> {
    fn errors(&self, stream: Stream) -> Result<[f64; 5], Error> {
        let run = self.draw(stream)?;
        let of = |name: &str| stream.named(name);
        let kappa = (3.0 - D as f64).max(0.0);
        Ok([
            self.error(MomentFilter, &run, of("moments"))?,
            self.error(SigmaPointFilter::unscented(kappa)?, &run, of("points"))?,
            self.error(EnsembleFilter::new(MEMBERS)?.with_inflation(1.01)?, &run, of("ensemble"))?,
            self.error(GridFilter::new(self.axes)?, &run, of("grid"))?,
            self.error(BootstrapFilter::new(ResamplingRule::default(), PARTICLES)?, &run, of("particles"))?,
        ])
    }
}

fn normal<const D: usize>(mean: [f64; D], deviations: [f64; D]) -> Result<Gaussian<D>, Error> {
    let deviations = SVector::from(deviations);
    Ok(Gaussian::new(SVector::from(mean), SMatrix::from_diagonal(&deviations.component_mul(&deviations)))?)
}

/// The same motion in every step, with independent noise of these variances.
fn always<F: fewbits_models::Differentiable<D, D> + Copy + 'static, const D: usize>(
    function: F,
    variances: [f64; D],
) -> Motion<D> {
    let noise = SMatrix::from_diagonal(&SVector::from(variances));
    Box::new(move |_| Ok(Box::new(AutoDynamics::new(function, noise)?)))
}

/// A target in a plane seen by `sensors`, straight or turning.
fn plane(
    turning: bool,
    sensors: impl Fn(usize) -> Vec<(Measure, f64)> + 'static,
) -> Result<Box<dyn AnyProblem>, Error> {
    let (axes, scored, sensors) = ([0, 2], vec![0, 2], Box::new(sensors));
    if turning {
        return Ok(Box::new(Problem {
            prior: normal([8.0, 0.3, 15.0, -0.2, 0.1], [2.0, 0.2, 2.0, 0.2, 0.1])?,
            motion: always(Turning, [1e-4, 1e-3, 1e-4, 1e-3, 1e-4]),
            sensors,
            axes,
            scored,
        }));
    }
    Ok(Box::new(Problem {
        prior: normal([8.0, -0.1, 15.0, -0.1], [2.0, 0.2, 2.0, 0.2])?,
        motion: always(Straight, [1e-4, 1e-3, 1e-4, 1e-3]),
        sensors,
        axes,
        scored,
    }))
}

/// An oscillator or another system of one observed coordinate 0.
fn single<F: fewbits_models::Differentiable<D, D> + Copy + 'static, const D: usize>(
    rate: F,
    [seconds, noise]: [f64; 2],
    prior: Gaussian<D>,
    variances: [f64; D],
    (measure, scored): (Measure, Vec<usize>),
) -> Result<Box<dyn AnyProblem>, Error> {
    Ok(Box::new(Problem {
        prior,
        motion: always(Flow::new(rate, seconds, 2)?, variances),
        sensors: Box::new(move |_| vec![(measure, noise)]),
        axes: [0],
        scored,
    }))
}

/// Mean squared errors of all filters on a run of the problem of this name.
pub(super) fn errors(problem: &str, stream: Stream) -> Result<[f64; 5], Error> {
    use Measure::{Bearing, Coordinate, Range, Sine, Slant, Square};
    let (left, right, above) = ([0.0, 0.0], [20.0, 0.0], [10.0, 30.0]);
    let angle = 0.03_f64.powi(2);
    let problem: Box<dyn AnyProblem> = match problem {
        "moving observer" => plane(false, move |k| {
            let (first, then) = (k.min(20) as f64, k.saturating_sub(20) as f64);
            vec![(Bearing([0.5 * first, 0.25 * then]), angle)]
        })?,
        "two bearings" => plane(false, move |_| vec![(Bearing(left), angle), (Bearing(right), angle)])?,
        "range and bearing" => plane(false, move |_| vec![(Range(left), 0.25), (Bearing(left), angle)])?,
        "turn, two bearings" => plane(true, move |_| vec![(Bearing(left), angle), (Bearing(right), angle)])?,
        "turn, range and bearing" => plane(true, move |_| vec![(Range(left), 0.25), (Bearing(left), angle)])?,
        "turn, three ranges" => plane(true, move |_| [left, right, above].map(|at| (Range(at), 0.25)).to_vec())?,
        "pendulum" => single(Pendulum, [0.1, 0.01], normal([0.8, 0.0], [0.3, 0.3])?, [1e-5, 1e-2], (Sine, vec![0]))?,
        "two wells" => {
            single(Duffing, [0.2, 0.04], normal([0.0, 0.0], [0.7, 0.3])?, [1e-4, 1e-2], (Coordinate(0), vec![0]))?
        }
        "limit cycle" => {
            single(VanDerPol, [0.2, 0.09], normal([1.0, 0.0], [1.0, 1.0])?, [1e-4, 1e-2], (Coordinate(0), vec![0]))?
        }
        "Lorenz" => single(
            Lorenz,
            [0.05, 1.0],
            normal([3.0, 5.0, 20.0], [2.0, 2.0, 2.0])?,
            [0.1, 0.1, 0.1],
            (Coordinate(0), vec![0, 1, 2]),
        )?,
        "re-entry" => single(
            Fall,
            [0.3, 0.01],
            normal([60.0, 6.0, 0.0], [1.0, 0.2, 0.3])?,
            [1e-4, 1e-4, 1e-5],
            (Slant(30.0), vec![0]),
        )?,
        _ => Box::new(Problem {
            prior: normal([0.0], [2.0])?,
            motion: Box::new(|k| {
                let growth = Growth {
                    cosine: (1.2 * k as f64).cos(),
                };
                Ok(Box::new(AutoDynamics::new(growth, Matrix1::new(10.0))?))
            }),
            sensors: Box::new(|_| vec![(Square, 1.0)]),
            axes: [0],
            scored: vec![0],
        }),
    };
    problem.errors(stream)
}
