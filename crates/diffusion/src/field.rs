//! What sensors measure of a source anywhere in the domain: the form that estimators take.

use crate::{Domain, Error, Patch, Steady, StepControl, Transient, Transport};
use fewbits_models::nalgebra::Vector3;
use fewbits_models::{Receptor, SourceGradient, SourceModel};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::within;
use std::sync::Arc;

/// Adjoint solutions of several sensors: the concentration that each measures, per unit rate, of a source at any place and of several
/// ages.
///
/// A sensor measures the mean over its cell. Between the centres of cells values are interpolated linearly along each axis. A blocked
/// corner takes the value of the corners on the near side, so that nothing is interpolated across a wall. Between two ages, and
/// between age 0 and the first, values are interpolated linearly; beyond the last finite age its values stand. An infinite age is the
/// steady state.
///
/// ```
/// use fewbits_diffusion::{Flow, Plan, Scheme, SensorField, Transport};
/// use fewbits_models::{SourceModel, nalgebra::Vector3};
/// let domain = Plan::parse("I....#\n###..#\n.....O")?.domain(0.5, 2, 0.0)?;
/// let still = Flow::still(&domain);
/// let transport = Transport::new(domain, 0.05, &still, 0.0, Scheme::default())?;
/// let field = SensorField::steady(&transport, &[[0.7, 1.2, 0.0]])?;
/// let sensor = field.receptor(&Vector3::new(0.7, 1.2, 0.0))?;
/// // Behind the wall, a metre away, a source is hardly measured.
/// let [near, behind] = [1.3, 0.3].map(|y| field.concentration(&sensor, &Vector3::new(0.7, y, 0.0), f64::INFINITY));
/// assert!(near > 5.0 * behind && behind > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SensorField {
    domain: Arc<Domain>,
    /// Free cell of each sensor.
    sensors: Vec<usize>,
    /// Increasing; the last may be infinite.
    ages: Vec<f64>,
    /// For each sensor, for each age, the response per free cell.
    responses: Vec<Vec<Vec<f64>>>,
}

/// Responses above this, kg/m^3 per kg/s, have no gradient in the range of numbers.
const LARGEST_RESPONSE: f64 = 1e240;

impl SensorField {
    /// Steady responses of sensors at the given points, m.
    ///
    /// # Errors
    /// If a point is outside or blocked, the transport has no steady state, or a response is above 1e240 kg/m^3 per kg/s.
    pub fn steady(transport: &Transport, points: &[[f64; 3]]) -> Result<Self, Error> {
        let fields = Steady::new(transport)?.adjoint(&patches(transport, points)?)?;
        let responses = fields.into_iter().map(|field| vec![field]).collect();
        Self::with(transport, points, vec![f64::INFINITY], responses)
    }

    /// Responses of sensors at the given points (m) to sources that have released for the given ages (s, increasing, after 0).
    ///
    /// # Errors
    /// If a point is outside or blocked, ages do not increase from above 0, the control is not positive, or as
    /// [`Transient::step_responses`].
    pub fn transient(
        transport: &Transport,
        points: &[[f64; 3]],
        ages: &[f64],
        control: StepControl,
    ) -> Result<Self, Error> {
        let mut by_sensor = vec![Vec::with_capacity(ages.len()); points.len()];
        let mut transient = Transient::new(transport).with_control(control)?;
        for fields in transient.step_responses(&patches(transport, points)?, ages)? {
            let pairs = by_sensor.iter_mut().zip(fields);
            pairs.for_each(|(sensor, field)| sensor.push(field));
        }
        Self::with(transport, points, ages.to_vec(), by_sensor)
    }

    fn with(
        transport: &Transport,
        points: &[[f64; 3]],
        ages: Vec<f64>,
        responses: Vec<Vec<Vec<f64>>>,
    ) -> Result<Self, Error> {
        let domain = transport.domain().clone();
        let sensors = points
            .iter()
            .map(|point| domain.locate(*point))
            .collect::<Result<_, _>>()?;
        // Gradients divide by widths of cells.
        for response in responses.iter().flatten().flatten() {
            within("response", *response, f64::MIN, LARGEST_RESPONSE)?;
        }
        Ok(Self {
            domain,
            sensors,
            ages,
            responses,
        })
    }

    /// The domain.
    pub fn domain(&self) -> &Arc<Domain> {
        &self.domain
    }

    /// Response of a sensor, by its place in the list, at the `age`-th age, per free cell, kg/m^3 per kg/s. `None` if there is none.
    pub fn response(&self, sensor: usize, age: usize) -> Option<&[f64]> {
        Some(self.responses.get(sensor)?.get(age)?)
    }

    /// The two responses about an age with their weights; nothing before age 0.
    fn about(&self, age: f64) -> [(usize, f64); 2] {
        let next = self.ages.partition_point(|known| *known < age);
        if age.is_nan() || age <= 0.0 {
            return [(0, 0.0); 2];
        }
        match (next.checked_sub(1), self.ages.get(next)) {
            (_, Some(known)) if *known == age => [(next, 1.0), (0, 0.0)],
            (None, Some(known)) if known.is_finite() => [(next, age / known), (0, 0.0)],
            // Only the steady state is known.
            (None, _) => [(next, 1.0), (0, 0.0)],
            (Some(before), Some(known)) if known.is_finite() => {
                let share = (age - self.ages[before]) / (known - self.ages[before]);
                [(before, 1.0 - share), (next, share)]
            }
            (Some(before), _) => [(before, 1.0), (0, 0.0)],
        }
    }

    /// The corners of the box of cell centres about a point: for each subset of axes (by bits) the weights of free cells whose mean stands
    /// for that corner; and the position in the box and its width along each axis.
    fn stencil(&self, point: &[f64; 3]) -> Option<Stencil> {
        let grid = self.domain.grid();
        let own = grid.cell_at(*point)?;
        let number = self.domain.number(own)?;
        let (at, centre, axes) = (grid.place(own), grid.centre(own), grid.dimension());
        let (mut corners, mut position, mut widths, mut upwards) = ([number; 8], [0.0; 3], [1.0; 3], [true; 3]);
        let mut next = at;
        for axis in 0..axes {
            upwards[axis] = point[axis] >= centre[axis];
            // Below the first cell it is beyond the last.
            next[axis] = if upwards[axis] {
                at[axis] + 1
            } else {
                at[axis].wrapping_sub(1)
            };
            if next[axis] < grid.counts()[axis] {
                widths[axis] = 0.5 * (grid.width(axis, at[axis]) + grid.width(axis, next[axis]));
                position[axis] = (point[axis] - centre[axis]).abs() / widths[axis];
            }
        }
        // A corner counts if it is free and joined to the own cell through free corners; otherwise another corner stands for it.
        let mut joined = [true, false, false, false, false, false, false, false];
        for corner in 1..1_usize << axes {
            let moved = || (0..axes).filter(|axis| corner >> axis & 1 == 1);
            let mut cell = at;
            moved().for_each(|axis| cell[axis] = next[axis]);
            // Prefer a corner with a value of its own: along a wall the field is that of the near side.
            let near = moved()
                .map(|axis| corner ^ (1 << axis))
                .rfind(|without| joined[*without]);
            let inside = moved().all(|axis| next[axis] < grid.counts()[axis]);
            let free = near
                .filter(|_| inside)
                .and_then(|_| self.domain.number(grid.index(cell)));
            joined[corner] = free.is_some();
            corners[corner] = free.unwrap_or(corners[near.unwrap_or(corner & (corner - 1))]);
        }
        Some(Stencil {
            corners,
            position,
            widths,
            upwards,
            axes,
        })
    }

    /// Calls `f` with the value and gradient of a response at a point for each age.
    fn interpolate(&self, sensor: usize, point: &Vector3<f64>, ages: &[f64], mut f: impl FnMut(usize, SourceGradient)) {
        const NOTHING: SourceGradient = SourceGradient {
            value: 0.0,
            gradient: Vector3::new(0.0, 0.0, 0.0),
        };
        let known = self.stencil(&(*point).into()).zip(self.responses.get(sensor));
        let mut before: Option<([(usize, f64); 2], SourceGradient)> = None;
        for (k, age) in ages.iter().enumerate() {
            let about = self.about(*age);
            let mut result = NOTHING;
            match (&known, before) {
                // Ages between which the field stands: a steady one, or the last.
                (_, Some((same, found))) if same == about => result = found,
                (Some((stencil, fields)), _) => {
                    for (field, weight) in about.into_iter().filter(|pair| pair.1 > 0.0) {
                        let (value, gradient) = stencil.apply(&fields[field]);
                        result.value += weight * value;
                        result.gradient += weight * gradient;
                    }
                }
                (None, _) => {}
            }
            // Steps in time may leave an error below zero.
            if result.value < 0.0 {
                result = NOTHING;
            }
            before = Some((about, result));
            f(k, result);
        }
    }
}

fn patches(transport: &Transport, points: &[[f64; 3]]) -> Result<Vec<Patch>, Error> {
    points.iter().map(|point| transport.domain().point(*point)).collect()
}

/// Multilinear interpolation between up to eight free cells.
struct Stencil {
    corners: [usize; 8],
    position: [f64; 3],
    widths: [f64; 3],
    upwards: [bool; 3],
    axes: usize,
}

impl Stencil {
    fn apply(&self, field: &[f64]) -> (f64, Vector3<f64>) {
        let (mut value, mut gradient) = (0.0, Vector3::zeros());
        for corner in 0..1_usize << self.axes {
            let beyond = |axis: usize| corner >> axis & 1 == 1;
            let near = |axis: usize| 1.0 - self.position[axis];
            let factor = |axis: usize| if beyond(axis) { self.position[axis] } else { near(axis) };
            let c = field[self.corners[corner]];
            value += c * (0..self.axes).map(factor).product::<f64>();
            for axis in 0..self.axes {
                let outwards = beyond(axis) == self.upwards[axis];
                let others: f64 = (0..self.axes).filter(|other| *other != axis).map(factor).product();
                gradient[axis] += if outwards { c } else { -c } * others / self.widths[axis];
            }
        }
        (value, gradient)
    }
}

impl SourceModel for SensorField {
    /// The sensor in the same cell.
    fn receptor(&self, place: &Vector3<f64>) -> Result<Receptor, fewbits_models::Error> {
        let cell = self.domain.locate((*place).into()).ok();
        match self.sensors.iter().position(|sensor| Some(*sensor) == cell) {
            Some(index) => Ok(Receptor { place: *place, index }),
            None => {
                let shown = format!("({}, {}, {})", place.x, place.y, place.z);
                Err(ArgumentError::new("place", shown, "a point in the cell of a sensor with an adjoint solution")
                    .into())
            }
        }
    }

    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64 {
        self.source_gradient(receptor, source, age).value
    }

    /// One stencil for all ages, one value for all of a steady field.
    fn concentrations(&self, receptor: &Receptor, source: &Vector3<f64>, ages: &[f64], out: &mut [f64]) {
        let count = ages.len().min(out.len());
        self.interpolate(receptor.index, source, &ages[..count], |k, found| out[k] = found.value);
    }

    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient {
        let mut found = None;
        self.interpolate(receptor.index, source, &[age], |_, gradient| found = Some(gradient));
        found.unwrap_or(SourceGradient {
            value: 0.0,
            gradient: Vector3::zeros(),
        })
    }

    /// From the range of the response over the cells of the square and one more on each side; within a cell, its share of that.
    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64 {
        let Some(fields) = self.responses.get(receptor.index) else {
            return 0.0;
        };
        let grid = self.domain.grid();
        let (mut ranges, mut narrowest) = ([(0, 0); 3], f64::INFINITY);
        for (axis, range) in ranges.iter_mut().enumerate().take(grid.dimension()) {
            let edges = grid.edges(axis);
            let last = edges.len() - 2;
            let reach = if axis < 2 { half_width } else { 0.0 };
            let place = |x: f64| grid.along(axis, x.clamp(edges[0], edges[last + 1])).unwrap_or(0);
            let (low, high) =
                (place(source[axis] - reach).saturating_sub(1), (place(source[axis] + reach) + 1).min(last));
            *range = (low, high);
            narrowest = (low..=high).map(|i| grid.width(axis, i)).fold(narrowest, f64::min);
        }
        let weights = self.about(age);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for layer in ranges[2].0..=ranges[2].1 {
            for line in ranges[1].0..=ranges[1].1 {
                for column in ranges[0].0..=ranges[0].1 {
                    if let Some(number) = self.domain.number(grid.index([column, line, layer])) {
                        let c: f64 = weights
                            .iter()
                            .map(|(field, weight)| weight * fields[*field][number])
                            .sum();
                        (least, most) = (least.min(c), most.max(c));
                    }
                }
            }
        }
        let share = 2.0 * half_width / narrowest;
        (most - least).max(0.0) * if share < 1.0 { share.max(0.0) } else { 1.0 }
    }

    /// True if the square holds a part of a free cell.
    fn admits(&self, source: &Vector3<f64>, half_width: f64) -> bool {
        let grid = self.domain.grid();
        let mut ranges = [(0, 0); 3];
        for (axis, range) in ranges.iter_mut().enumerate().take(grid.dimension()) {
            let edges = grid.edges(axis);
            let (first, last) = (edges[0], edges[edges.len() - 1]);
            let reach = if axis < 2 { half_width } else { 0.0 };
            let (low, high) = (source[axis] - reach, source[axis] + reach);
            if !(low <= last && high >= first) {
                return false;
            }
            let place = |x: f64| grid.along(axis, x.clamp(first, last)).unwrap_or(0);
            *range = (place(low), place(high));
        }
        let cells = |axis: usize| ranges[axis].0..=ranges[axis].1;
        cells(2).any(|k| cells(1).any(|j| cells(0).any(|i| self.domain.number(grid.index([i, j, k])).is_some())))
    }
}
