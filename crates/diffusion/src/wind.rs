//! Winds on a domain: potential flow, a function of the point, measured velocities.

use crate::domain::{Face, OUTSIDE};
use crate::flow::MAX_DIVERGENCE;
use crate::solver::Direction;
use crate::{Boundary, Domain, Error, Flow, FluxRule, Transport};
use faer::Mat;
use fewbits_numerics::error::{positive, within};

/// Treatment of a wind that is not free of divergence on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Divergence {
    /// It is an error: concentration would accumulate or vanish in cells.
    Refuse,
    /// It is replaced by the nearest wind without divergence: the gradient of a potential, zero at inflows and outflows, is subtracted.
    Project,
}

/// Potential flow from the inflows of a domain to its outflows.
#[derive(Debug, Clone, PartialEq)]
pub struct PotentialFlow {
    /// The flow.
    pub flow: Flow,
    /// Potential in each free cell, m^2/s: `v = -grad potential`. It is zero on all outflows, and in parts without any opening.
    pub potential: Vec<f64>,
    /// Potential on all inflows, m^2/s.
    pub difference: f64,
}

/// Largest flow through a face, m^3/s.
const MAX_FLOW: f64 = 1e90;

impl Flow {
    /// The wind whose velocity, m/s, is a function of the point, m. It is evaluated at the centres of faces.
    ///
    /// # Errors
    /// If a velocity is not finite, or a flow above 1e90 m^3/s; [`Error::Divergence`] where divergence is refused.
    pub fn from_velocity(
        domain: &Domain,
        velocity: impl Fn([f64; 3]) -> [f64; 3],
        divergence: Divergence,
    ) -> Result<Self, Error> {
        let flow = |face: &Face| face.area * velocity(domain.face_centre(face))[face.axis];
        Self::through(domain, flow).treated(domain, divergence)
    }

    /// The wind from mean velocities in the free cells, m/s, for example from a file. The velocity at a face is the mean of both cells,
    /// weighted by nearness.
    ///
    /// # Errors
    /// If there is not one velocity for each free cell, one is not finite, or as [`Flow::from_velocity`].
    pub fn from_cells(domain: &Domain, velocities: &[[f64; 3]], divergence: Divergence) -> Result<Self, Error> {
        domain.check_count("velocities", velocities.len())?;
        let flow = |face: &Face| {
            let own = &velocities[face.cell()];
            let [low, high] = face.cells.map(|cell| velocities.get(cell).unwrap_or(own)[face.axis]);
            let [below, above] = face.halves;
            face.area * (low * above + high * below) / (below + above)
        };
        Self::through(domain, flow).treated(domain, divergence)
    }

    fn treated(mut self, domain: &Domain, divergence: Divergence) -> Result<Self, Error> {
        for flow in &self.upwards {
            within("flow", *flow, -MAX_FLOW, MAX_FLOW)?;
        }
        if divergence == Divergence::Project {
            let before = self.largest();
            let net = self.divergence(domain).into_iter().map(|net| -net).collect();
            let potential = solve_potential(domain, net)?;
            let correction = fall(domain, &potential, 0.0).upwards;
            self.upwards
                .iter_mut()
                .zip(correction)
                .for_each(|(flow, change)| *flow += change);
            // Only rounding errors remain if the domain has no passage for wind.
            if self.largest() <= MAX_DIVERGENCE * before {
                self = Self::still(domain);
            }
        }
        self.check(domain)?;
        Ok(self)
    }
}

impl PotentialFlow {
    /// The flow `v = -grad phi` with one potential on all inflows, 0 on all outflows and no flow through walls. It is scaled so that
    /// `total` (m^3/s; m^2/s in a plane) passes.
    ///
    /// # Errors
    /// If `total` is not a positive number up to 1e90; [`Error::NoPassage`] if no connected part touches both.
    pub fn new(domain: &Domain, total: f64) -> Result<Self, Error> {
        within("total", positive("total", total)?, 0.0, MAX_FLOW)?;
        let inflows = || {
            domain
                .faces
                .iter()
                .filter(|face| face.boundary == Some(Boundary::Inflow))
        };
        let mut supply = vec![0.0; domain.free().len()];
        inflows().for_each(|face| supply[face.cell()] += conductance(face));
        let mut potential = solve_potential(domain, supply)?;
        let passing: f64 = inflows()
            .map(|face| conductance(face) * (1.0 - potential[face.cell()]))
            .sum();
        // In a part with inflows only the potential is one everywhere, up to rounding.
        if passing.is_nan() || passing <= 1e-12 * inflows().map(conductance).sum::<f64>() {
            return Err(Error::NoPassage);
        }
        let difference = total / passing;
        potential.iter_mut().for_each(|phi| *phi *= difference);
        let flow = fall(domain, &potential, difference);
        flow.check(domain)?;
        Ok(Self {
            flow,
            potential,
            difference,
        })
    }
}

fn conductance(face: &Face) -> f64 {
    face.area / (face.halves[0] + face.halves[1])
}

/// The flow for a potential that is 0 on outflows and `difference` on inflows.
fn fall(domain: &Domain, potential: &[f64], difference: f64) -> Flow {
    let everywhere = [potential, &[0.0, difference]].concat();
    Flow::through(domain, |face| conductance(face) * (everywhere[face.cells[0]] - everywhere[face.cells[1]]))
}

/// The potential for which the flow out of each free cell is `supply`, with potential zero on inflows and outflows. In a part without
/// opening the potential is fixed to zero near one cell, and the supplies must sum to zero.
fn solve_potential(domain: &Domain, supply: Vec<f64>) -> Result<Vec<f64>, Error> {
    // It equals a steady concentration with diffusivity one and all other walls closed.
    let mut open = domain.clone();
    open.faces.retain(Face::is_open);
    let still = Flow::still(&open);
    let mut transport = Transport::new(open, 1.0, &still, 0.0, FluxRule::default())?;
    let mut drained = vec![false; domain.free().len() + OUTSIDE];
    let outwards = &transport.domain().faces[domain.inner..];
    outwards.iter().for_each(|face| drained[face.cell()] = true);
    for part in domain.walk() {
        if !part.iter().any(|(cell, _)| drained[*cell]) {
            let first = &mut transport.diagonal[part[0].0];
            *first = 2.0 * first.max(f64::MIN_POSITIVE);
        }
    }
    let factor = transport.factor(0.0, 1.0)?;
    let mut columns = Mat::from_fn(supply.len(), 1, |i, _| supply[i]);
    factor.solve(Direction::Forward, &mut columns);
    let mut potential = columns.col_as_slice(0).to_vec();
    // One step of iterative refinement, because flows are differences of the potential.
    for (i, supply) in supply.into_iter().enumerate() {
        columns[(i, 0)] = supply - transport.diagonal[i] * potential[i];
    }
    for face in &domain.faces[..domain.inner] {
        let [low, high] = face.cells;
        columns[(low, 0)] += conductance(face) * potential[high];
        columns[(high, 0)] += conductance(face) * potential[low];
    }
    factor.solve(Direction::Forward, &mut columns);
    let changes = potential.iter_mut().zip(columns.col_as_slice(0));
    changes.for_each(|(phi, change)| *phi += change);
    Ok(potential)
}
