//! Responses of sensors to a source anywhere in the domain, in the form that estimators use.

use crate::{Domain, Error, Patch, Steady, StepControl, Transient, Transport};
use fewbits_models::nalgebra::Vector3;
use fewbits_models::{Receptor, SourceGradient, SourceModel};
use fewbits_numerics::error::{refuse, within};
use std::sync::Arc;

/// Adjoint solutions of several sensors: the concentration that each measures, per unit rate, as a function of the place of the source and
/// of its age (the time since it began to release).
///
/// A sensor measures the mean over its cell. Between the centres of cells values are interpolated linearly along each axis. A blocked
/// corner takes the value of a corner on the near side, so that nothing is interpolated across a wall. Between two ages, and
/// between age 0 and the first, values are interpolated linearly. Beyond the last age they are constant. A steady field has one value for
/// all ages above 0.
///
/// ```
/// use fewbits_diffusion::{Flow, Plan, FluxRule, SensorField, Transport};
/// use fewbits_models::{SourceModel, nalgebra::Vector3};
/// let domain = Plan::parse("I....#\n###..#\n.....O")?.domain(0.5, 2, 0.0)?;
/// let still = Flow::still(&domain);
/// let transport = Transport::new(domain, 0.05, &still, 0.0, FluxRule::default())?;
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
    /// Number of the free cell of each sensor.
    sensors: Vec<usize>,
    /// Ages in increasing order, s; one infinite age if the field is steady.
    ages: Vec<f64>,
    /// Per age and sensor the response for each free cell.
    responses: Vec<Vec<Vec<f64>>>,
}

/// A free cell, its weight in a value, and its weights in a gradient.
type Corner = (usize, f64, Vector3<f64>);

/// Largest response, kg/m^3 per kg/s: the gradient of a larger one could overflow.
const MAX_RESPONSE: f64 = 1e240;

impl SensorField {
    /// Steady responses of sensors at the given points, m.
    ///
    /// # Errors
    /// If a point is outside or blocked, the transport has no steady state, or a response is above 1e240 kg/m^3 per kg/s.
    pub fn steady(transport: &Transport, points: &[[f64; 3]]) -> Result<Self, Error> {
        let steady = Steady::new(transport)?;
        Self::new(transport, points, &[f64::INFINITY], |sensors| Ok(vec![steady.adjoint(sensors)?]))
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
        let mut transient = Transient::new(transport).with_control(control)?;
        Self::new(transport, points, ages, |sensors| transient.step_responses(sensors, ages))
    }

    fn new(
        transport: &Transport,
        points: &[[f64; 3]],
        ages: &[f64],
        respond: impl FnOnce(&[Patch]) -> Result<Vec<Vec<Vec<f64>>>, Error>,
    ) -> Result<Self, Error> {
        let (domain, ages) = (transport.domain().clone(), ages.to_vec());
        let patches: Vec<Patch> = points
            .iter()
            .map(|point| domain.point(*point))
            .collect::<Result<_, _>>()?;
        let sensors = patches.iter().map(|patch| patch.shares[0].0).collect();
        let responses = respond(&patches)?;
        // Gradients divide by widths of cells.
        for response in responses.iter().flatten().flatten() {
            within("response", *response, f64::MIN, MAX_RESPONSE)?;
        }
        Ok(Self {
            domain,
            sensors,
            ages,
            responses,
        })
    }

    /// Response of the sensor of this index at the age of this index, per free cell, kg/m^3 per kg/s. `None` if there is no such sensor or
    /// age.
    pub fn response(&self, sensor: usize, age: usize) -> Option<&[f64]> {
        Some(self.responses.get(age)?.get(sensor)?)
    }

    pub(crate) fn is_steady(&self) -> bool {
        self.ages[0].is_infinite()
    }

    pub(crate) fn domain(&self) -> &Arc<Domain> {
        &self.domain
    }

    pub(crate) fn sensor_count(&self) -> usize {
        self.sensors.len()
    }

    /// Response at an age that [`about`](Self::about) has found; not below zero.
    pub(crate) fn response_at(&self, about: [(usize, f64); 2], sensor: usize, cell: usize) -> f64 {
        let response = about.map(|(age, share)| share * self.responses[age][sensor][cell]);
        (response[0] + response[1]).max(0.0)
    }

    /// Per free cell and axis, the free cells before and after it; the cell itself where there is none.
    pub(crate) fn neighbours(&self) -> Vec<[[usize; 2]; 3]> {
        let grid = self.domain.grid();
        let next = |cell: usize, own: usize, axis: usize, up: bool| {
            let next = grid
                .next(grid.place(cell), axis, up)
                .filter(|_| axis < grid.dimension());
            next.and_then(|next| self.domain.number(grid.index(next)))
                .unwrap_or(own)
        };
        let free = self.domain.free().iter().enumerate();
        free.map(|(own, cell)| [0, 1, 2].map(|axis| [false, true].map(|up| next(*cell, own, axis, up))))
            .collect()
    }

    /// Indices of the two ages around an age, with their weights; weight zero before age 0.
    pub(crate) fn about(&self, age: f64) -> [(usize, f64); 2] {
        let next = self.ages.partition_point(|known| *known < age);
        let before = next.saturating_sub(1);
        match self.ages.get(next) {
            _ if age.is_nan() || age <= 0.0 => [(0, 0.0); 2],
            None => [(before, 1.0), (0, 0.0)],
            Some(known) if known.is_infinite() => [(next, 1.0), (0, 0.0)],
            Some(known) if next == 0 => [(0, age / known), (0, 0.0)],
            Some(known) => {
                let share = (age - self.ages[before]) / (known - self.ages[before]);
                [(next, share), (before, 1.0 - share)]
            }
        }
    }

    /// Free cells and weights of the interpolation at a point. The corners of the interpolation box are cell centres; a free cell may
    /// represent a blocked corner. `None` if the point is not in a free cell.
    fn stencil(&self, point: &[f64; 3]) -> Option<([Corner; 8], usize)> {
        let (grid, axes) = (self.domain.grid(), self.domain.grid().dimension());
        let own = grid.cell_at(*point)?;
        let (at, centre) = (grid.place(own), grid.centre(own));
        let mut corners = [(self.domain.number(own)?, 1.0, Vector3::zeros()); 8];
        // Position of the point in the box along each axis, and width of the box.
        let (mut position, mut widths) = ([0.0; 3], [1.0; 3]);
        let upwards = [0, 1, 2].map(|axis| point[axis] >= centre[axis]);
        for axis in 0..axes {
            if let Some(next) = grid.next(at, axis, upwards[axis]) {
                widths[axis] = 0.5 * (grid.width(axis, at[axis]) + grid.width(axis, next[axis]));
                position[axis] = (point[axis] - centre[axis]).abs() / widths[axis];
            }
        }
        // A corner is used if it is free and connected to the point's own cell through free corners. Otherwise another corner represents
        // it.
        let mut joined = [true, false, false, false, false, false, false, false];
        for corner in 0..1_usize << axes {
            let beyond = |axis: usize| corner >> axis & 1 == 1;
            let moved = || (0..axes).filter(|axis| beyond(*axis));
            // Prefer a corner with its own value: along a wall the field is then that of the near side. Any such corner serves; the one
            // without the last move is at the height of the point's own cell.
            let near = moved()
                .map(|axis| corner ^ (1 << axis))
                .rfind(|without| joined[*without]);
            let place = moved().try_fold(at, |at, axis| grid.next(at, axis, upwards[axis]));
            if corner > 0 {
                // A corner that lacks one of the moves has a smaller number, so the cell that represents it is known by now.
                let free = near.and(place).and_then(|place| self.domain.number(grid.index(place)));
                joined[corner] = free.is_some();
                corners[corner].0 = free.unwrap_or(corners[near.unwrap_or(corner & (corner - 1))].0);
            }
            let factor = |axis: usize| {
                if beyond(axis) {
                    position[axis]
                } else {
                    1.0 - position[axis]
                }
            };
            corners[corner].1 = (0..axes).map(factor).product();
            for axis in 0..axes {
                let others: f64 = (0..axes).filter(|other| *other != axis).map(factor).product();
                let slope = others / widths[axis];
                corners[corner].2[axis] = if beyond(axis) == upwards[axis] { slope } else { -slope };
            }
        }
        Some((corners, 1 << axes))
    }

    /// Calls `f` with the value and gradient of a response at a point for each age.
    fn interpolate(&self, sensor: usize, point: &Vector3<f64>, ages: &[f64], mut f: impl FnMut(usize, SourceGradient)) {
        let nothing = SourceGradient {
            value: 0.0,
            gradient: Vector3::zeros(),
        };
        let stencil = self.stencil(&(*point).into()).filter(|_| sensor < self.sensors.len());
        let mut before = ([(0, 0.0); 2], nothing);
        for (k, age) in ages.iter().enumerate() {
            let about = self.about(*age);
            // Otherwise the value of the age before applies again: the field is steady, or both ages are after the last.
            if let Some((corners, count)) = stencil.as_ref().filter(|_| about != before.0) {
                let mut result = nothing;
                for (known, share) in about.into_iter().filter(|pair| pair.1 > 0.0) {
                    let field = &self.responses[known][sensor];
                    for (cell, weight, slopes) in &corners[..*count] {
                        result.value += share * (field[*cell] * weight);
                        result.gradient += share * field[*cell] * slopes;
                    }
                }
                // Time steps may leave small negative values: set them to zero.
                before = (about, if result.value < 0.0 { nothing } else { result });
            }
            f(k, before.1);
        }
    }

    /// First and last index along each axis of the cells that a horizontal square about a source touches, with `margin`
    /// more on each side. `None` if the square is outside the grid.
    fn square(&self, source: &Vector3<f64>, half_width: f64, margin: usize) -> Option<[(usize, usize); 3]> {
        let (grid, mut places) = (self.domain.grid(), [(0, 0); 3]);
        for (axis, places) in places.iter_mut().enumerate().take(grid.dimension()) {
            let (edges, reach) = (grid.edges(axis), if axis < 2 { half_width } else { 0.0 });
            let (first, last) = (edges[0], edges[edges.len() - 1]);
            let (low, high) = (source[axis] - reach, source[axis] + reach);
            if !(low <= last && high >= first) {
                return None;
            }
            let [low, high] = [low, high].map(|x| grid.along(axis, x.clamp(first, last)));
            *places = (low?.saturating_sub(margin), (high? + margin).min(edges.len() - 2));
        }
        Some(places)
    }
}

impl SourceModel for SensorField {
    /// The sensor whose cell contains the place.
    fn receptor(&self, place: &Vector3<f64>) -> Result<Receptor, fewbits_models::Error> {
        let cell = self.domain.locate((*place).into()).ok();
        match self.sensors.iter().position(|sensor| Some(*sensor) == cell) {
            Some(index) => Ok(Receptor { place: *place, index }),
            None => {
                let shown = format!("({}, {}, {})", place.x, place.y, place.z);
                refuse("place", shown, "a point in the cell of a sensor with an adjoint solution")
            }
        }
    }

    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64 {
        self.source_gradient(receptor, source, age).value
    }

    /// The interpolation weights are computed once for all ages; a steady field gives one value.
    fn concentrations(&self, receptor: &Receptor, source: &Vector3<f64>, ages: &[f64], out: &mut [f64]) {
        let count = ages.len().min(out.len());
        self.interpolate(receptor.index, source, &ages[..count], |k, found| out[k] = found.value);
    }

    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient {
        let mut found = SourceGradient {
            value: 0.0,
            gradient: Vector3::zeros(),
        };
        self.interpolate(receptor.index, source, &[age], |_, gradient| found = gradient);
        found
    }

    /// The range of the response over the cells of the square and one more on each side. Within a single cell, a share of that.
    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64 {
        let Some(places) = self
            .square(source, half_width, 1)
            .filter(|_| receptor.index < self.sensors.len())
        else {
            return 0.0;
        };
        let (grid, about) = (self.domain.grid(), self.about(age));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for number in grid.block(places).filter_map(|cell| self.domain.number(cell)) {
            let response = |(known, weight): &(usize, f64)| weight * self.responses[*known][receptor.index][number];
            let c: f64 = about.iter().map(response).sum();
            (least, most) = (least.min(c), most.max(c));
        }
        let axes = places.into_iter().enumerate().take(grid.dimension());
        let widths = axes.flat_map(|(axis, (low, high))| (low..=high).map(move |i| grid.width(axis, i)));
        let share = 2.0 * half_width / widths.fold(f64::INFINITY, f64::min);
        (most - least).max(0.0) * if share < 1.0 { share.max(0.0) } else { 1.0 }
    }

    /// Whether the square touches a free cell.
    fn admits(&self, source: &Vector3<f64>, half_width: f64) -> bool {
        let places = self.square(source, half_width, 0);
        places.is_some_and(|places| {
            self.domain
                .grid()
                .block(places)
                .any(|cell| self.domain.number(cell).is_some())
        })
    }
}
