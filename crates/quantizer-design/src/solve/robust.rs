//! Designs for priors and noise that are not known exactly.

use super::control::Control;
use super::landscape::{Grid, Landscape};
use super::participant::{SensorDesign, WordedCells};
use super::request::Request;
use super::search::{cells_of, climb, grid_with, refine, spacing};
use super::solution::Solution;
use crate::criterion::{AllowedCells, Criterion};
use crate::deadline::system_clock;
use crate::error::{Error, refuse};
use crate::law::report_tables;
use crate::observation_model::{ObservationModel, Resolution};
use crate::outcomes::moments;
use crate::system::System;
use fewbits_numerics::error::{non_negative, within};

/// Number of rounds in which the weights of the models are changed.
const ROUNDS: usize = 40;
/// Rate at which a model of more than average error gains weight in the first round.
const LEARNING: f64 = 4.0;
/// Number of grid cells of a sensor.
const GRID: usize = 96;

/// The error of a design under another observation model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mismatch {
    /// Mean squared error with the decoder of the design, which assumes its own model.
    pub mean_squared_error: f64,
    /// Mean squared error of the same cells and words with the decoder for the other model.
    pub with_best_decoder: f64,
}

/// The error of a design after one change of the observation model.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    /// Name of the changed quantity.
    pub what: &'static str,
    /// The relative change; for the mean, the change in standard deviations of the prior.
    pub change: f64,
    /// Errors after the change.
    pub mismatch: Mismatch,
}

impl Solution {
    /// The mean squared error of this design under another model of the same sensors.
    ///
    /// # Errors
    /// If the model has another number of sensors; [`Error::TooLarge`] for too many joint symbols.
    pub fn in_model(&self, model: &ObservationModel) -> Result<Mismatch, Error> {
        let own = self.system_in(self.system().model())?;
        let other = self.system_in(model)?;
        Ok(Mismatch {
            mean_squared_error: error_of(&other, &estimates(&[own], &[1.0])?)?,
            with_best_decoder: other.value(Criterion::MeanSquaredError)?,
        })
    }

    /// The mean squared error if one number of the model is larger or smaller by the fraction `change` than the design assumes: the
    /// prior's standard deviation, its mean (by `change` standard deviations), or the noise.
    ///
    /// # Errors
    /// If `change` is not in `[0, 0.9]`; as [`Solution::in_model`].
    pub fn sensitivity(&self, change: f64) -> Result<Vec<Sensitivity>, Error> {
        within("change", change, 0.0, 0.9)?;
        let model = self.system().model();
        let mut found = Vec::new();
        for change in [-change, change] {
            let varied = [
                ("prior deviation", varied(model, 0.0, 1.0 + change, 1.0)?),
                ("prior mean", varied(model, change * model.prior().deviation(), 1.0, 1.0)?),
                ("noise deviations", varied(model, 0.0, 1.0, 1.0 + change)?),
            ];
            for (what, other) in varied {
                found.push(Sensitivity {
                    what,
                    change,
                    mismatch: self.in_model(&other)?,
                });
            }
        }
        Ok(found)
    }
}

/// The model with its prior shifted and scaled about its mean, and its noise scaled.
fn varied(model: &ObservationModel, offset: f64, prior: f64, noise: f64) -> Result<ObservationModel, Error> {
    let mean = model.prior().mean();
    let moved = model.prior().affine(offset + mean - prior * mean, prior)?;
    ObservationModel::new(moved, model.noise().rescaled(noise)?)
}

/// Probability and moment about the prior mean of every joint symbol; the first sensor varies slowest.
fn outcome_moments(system: &System) -> Result<Vec<f64>, Error> {
    let model = system.model();
    Ok(moments(&report_tables(system)?, &[model.mass.clone(), model.moment.clone()]))
}

/// Mean squared error of a table of estimates: `E (X - m)^2 + sum_t (P_t d_t^2 + 2 d_t M_t)` with `d_t = m - estimate_t`.
fn error_of(system: &System, estimates: &[f64]) -> Result<f64, Error> {
    let model = system.model();
    let terms = outcome_moments(system)?;
    let change: f64 = terms
        .chunks_exact(2)
        .zip(estimates)
        .map(|(m, estimate)| {
            let off = model.mean - estimate;
            off * (m[0] * off + 2.0 * m[1])
        })
        .sum();
    Ok((model.variance + change).max(0.0))
}

/// The design for the worst model of a box of models.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimax {
    /// Cells and words of the sensors that take part.
    pub sensors: Vec<SensorDesign>,
    /// The estimate for every joint symbol; the first sensor's symbol varies slowest.
    pub estimates: Vec<f64>,
    /// Largest mean squared error over the corners and the centre of the box.
    pub worst_case: f64,
    /// The same for the design that assumes the request's model.
    pub nominal_worst_case: f64,
    /// A lower bound of the worst case, if the search found the optimum: the error of the best design found against the least favourable
    /// mixture of models.
    pub bound: f64,
    /// The weight of each model in that mixture: the centre first, then the corners.
    pub weights: Vec<f64>,
}

/// The design of smallest worst-case mean squared error over a box of models. The prior's mean may differ by
/// `mean_offset` (in the unit of the unknown), its deviation and all noise deviations by the given fractions. Cells, words and
/// decoder are the same for all models.
///
/// ```text
/// weights <- equal, over the corners of the box and its centre
/// repeat
///     design  <- best against the mixture of models, from the last design
///     errors  <- of that design in each model
///     weights <- weights * exp(rate * (error / mean error - 1)), normalised
/// answer  <- the design with the smallest maximum error
/// ```
///
/// # Errors
/// If the request is not for estimation, an offset is negative or a fraction is not in `[0, 0.9]`; as [`Request::run`].
pub fn minimax(
    request: Request<'_>,
    mean_offset: f64,
    deviation_share: f64,
    noise_share: f64,
) -> Result<Minimax, Error> {
    if request.criterion != Criterion::MeanSquaredError {
        return refuse("request", "another criterion", "a request for the least mean squared error");
    }
    non_negative("mean_offset", mean_offset)?;
    within("deviation_share", deviation_share, 0.0, 0.9)?;
    within("noise_share", noise_share, 0.0, 0.9)?;
    let centre = request.model.clone();
    let solutions = request.run()?;
    let nominal = solutions.best();
    let own: Vec<usize> = nominal.sensors().iter().map(|s| s.sensor).collect();
    let centre = centre.subset(&own)?;
    let models = corners([mean_offset, deviation_share, noise_share])
        .into_iter()
        .map(|[mean, deviation, noise]| varied(&centre, mean, 1.0 + deviation, 1.0 + noise))
        .collect::<Result<Vec<_>, _>>()?;
    let laws = SensorDesign::laws(nominal.sensors())?;
    let mut weights = vec![1.0 / models.len() as f64; models.len()];
    let weighted: Vec<(f64, &ObservationModel)> = weights.iter().copied().zip(&models).collect();
    let mut landscape = Landscape::new(&weighted, Criterion::MeanSquaredError, laws, Resolution::COARSE)?;
    let mut cells = nominal.cells();
    let nominal_estimates = estimates(&[nominal.system_in(&centre)?], &[1.0])?;
    let systems_of = |design: &Solution| {
        models
            .iter()
            .map(|m| design.system_in(m))
            .collect::<Result<Vec<_>, _>>()
    };
    let nominal_worst_case = worst(&errors_of(&systems_of(nominal)?, &nominal_estimates)?);
    let mut best: Option<Minimax> = None;
    let mut bound = 0.0_f64;
    for round in 0..ROUNDS {
        landscape.set_weights(&weights);
        cells = best_cells(&landscape, &cells);
        let design = nominal.with_cells(cells.clone())?;
        let systems = systems_of(&design)?;
        let mixed = estimates(&systems, &weights)?;
        let errors = errors_of(&systems, &mixed)?;
        let worst_case = worst(&errors);
        let average: f64 = errors.iter().zip(&weights).map(|(e, w)| e * w).sum();
        // No design has a smaller worst case than the least mean error over any mixture of the models.
        bound = bound.max(average);
        if best.as_ref().is_none_or(|b| worst_case < b.worst_case) {
            best = Some(Minimax {
                sensors: design.sensors().to_vec(),
                estimates: mixed,
                worst_case,
                nominal_worst_case,
                bound,
                weights: weights.clone(),
            });
        }
        // Smaller steps later, so that the weights converge.
        let rate = LEARNING / (1.0 + 0.2 * round as f64);
        weights
            .iter_mut()
            .zip(&errors)
            .for_each(|(w, e)| *w *= (rate * (e / average - 1.0)).exp());
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= total);
    }
    match best {
        Some(best) => Ok(Minimax {
            bound: bound.min(best.worst_case),
            ..best
        }),
        None => refuse("request", "no design", "a request with a design"),
    }
}

/// The centre of a box and its corners, without duplicates.
fn corners(sizes: [f64; 3]) -> Vec<[f64; 3]> {
    let mut all = vec![[0.0; 3]];
    for corner in 0..8 {
        let sign = |axis: usize| if corner >> (2 - axis) & 1 == 0 { -1.0 } else { 1.0 };
        let corner = [0, 1, 2].map(|axis| sign(axis) * sizes[axis]);
        if !all.contains(&corner) {
            all.push(corner);
        }
    }
    all
}

/// The cells to which a local search from the present ones leads.
fn best_cells(landscape: &Landscape, cells: &[WordedCells]) -> Vec<WordedCells> {
    let grids: Vec<Grid> = (0..cells.len())
        .map(|n| grid_with(landscape, n, GRID, &cells[n].breakpoints))
        .collect();
    let words = cells.iter().zip(&grids).map(|(c, g)| c.on(&g.edges)).collect();
    let control = &mut Control::new(system_clock, None, None);
    let Some(mut point) = climb(landscape, grids, words, AllowedCells::Intervals, control) else {
        return cells.to_vec();
    };
    let mut spacings: Vec<f64> = (0..cells.len()).map(|n| spacing(landscape, n, GRID)).collect();
    for _ in 0..3 {
        point = refine(landscape, point, &mut spacings, AllowedCells::Intervals, control);
    }
    cells_of(&point)
}

/// The error of a table of estimates in each model.
fn errors_of(systems: &[System], estimates: &[f64]) -> Result<Vec<f64>, Error> {
    systems.iter().map(|system| error_of(system, estimates)).collect()
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

/// The posterior mean for every joint symbol under a mixture of models; the first prior mean for symbols of probability zero.
fn estimates(systems: &[System], weights: &[f64]) -> Result<Vec<f64>, Error> {
    let reference = systems[0].model().mean;
    let mut sums: Vec<[f64; 2]> = Vec::new();
    for (system, weight) in systems.iter().zip(weights) {
        let offset = system.model().mean - reference;
        let own = outcome_moments(system)?;
        sums.resize(own.len() / 2, [0.0; 2]);
        for (sum, m) in sums.iter_mut().zip(own.chunks_exact(2)) {
            sum[0] += weight * m[0];
            sum[1] += weight * (m[1] + offset * m[0]);
        }
    }
    Ok(sums
        .iter()
        .map(|[mass, moment]| reference + if *mass > 0.0 { moment / mass } else { 0.0 })
        .collect())
}
