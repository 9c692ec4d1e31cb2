//! Wind as flows through the faces of a domain.

use crate::domain::{EdgeFace, Face};
use crate::solver::{Direction, Solver};
use crate::{Boundary, Domain, Error};
use faer::Mat;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{positive, within};

/// What is done with a wind that is not free of divergence on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Divergence {
    /// It is refused: concentration would pile up or thin out where air seems to vanish or appear.
    Refuse,
    /// The nearest wind without divergence is taken: the gradient of a potential, zero at inflows and outflows, is subtracted.
    Project,
}

/// Flow of air through each face that is not closed, m^3/s (m^2/s in a plane). Nothing flows through walls.
///
/// What flows into a cell flows out of it: a uniform concentration stays uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Flow {
    /// Through faces between free cells, upwards.
    pub(crate) inside: Vec<f64>,
    /// Through faces at the edge, outwards.
    pub(crate) edge: Vec<f64>,
}

/// Potential flow from the inflows of a domain to its outflows.
#[derive(Debug, Clone, PartialEq)]
pub struct PotentialFlow {
    /// The flow.
    pub flow: Flow,
    /// Potential in each free cell, m^2/s: `v = -grad potential`. Zero on all outflows, and in parts without any opening.
    pub potential: Vec<f64>,
    /// Potential on all inflows, m^2/s.
    pub difference: f64,
}

/// Net flow out of a cell that is accepted, relative to the largest flow through a face.
const MAX_DIVERGENCE: f64 = 1e-10;
/// Largest flow through a face, m^3/s.
const MAX_FLOW: f64 = 1e90;

impl Flow {
    /// No wind.
    pub fn still(domain: &Domain) -> Self {
        Self::through(domain, |_| 0.0, |_| 0.0)
    }

    /// Flows through all faces between cells, and through the open faces at the edge.
    fn through(domain: &Domain, inside: impl Fn(&Face) -> f64, edge: impl Fn(&EdgeFace) -> f64) -> Self {
        let edge = |face: &EdgeFace| if face.boundary.is_open() { edge(face) } else { 0.0 };
        Self {
            inside: domain.faces.iter().map(inside).collect(),
            edge: domain.edge_faces.iter().map(edge).collect(),
        }
    }

    /// The wind whose velocity, m/s, is a function of the point, m. It is evaluated at the centres of faces.
    ///
    /// # Errors
    /// If a velocity is not finite, or a flow above 1e90 m^3/s; [`Error::Divergence`] where divergence is refused.
    pub fn from_velocity(
        domain: &Domain,
        velocity: impl Fn([f64; 3]) -> [f64; 3],
        divergence: Divergence,
    ) -> Result<Self, Error> {
        let grid = domain.grid();
        let at = |number: usize, axis: usize, by: f64| {
            let mut point = grid.centre(domain.free()[number]);
            point[axis] += by;
            velocity(point)[axis]
        };
        let inside = |face: &Face| face.area * at(face.cells[0], face.axis, face.halves[0]);
        let edge = |face: &EdgeFace| {
            let outwards = if face.upper { 1.0 } else { -1.0 };
            outwards * face.area * at(face.cell, face.axis, outwards * face.half)
        };
        Self::through(domain, inside, edge).treated(domain, divergence)
    }

    /// The wind measured as mean velocities in the free cells, m/s, such as from a file: at a face the mean of both cells, weighted
    /// by nearness.
    ///
    /// # Errors
    /// If there is not one velocity for each free cell, one is not finite, or as [`Flow::from_velocity`].
    pub fn from_cells(domain: &Domain, velocities: &[[f64; 3]], divergence: Divergence) -> Result<Self, Error> {
        if velocities.len() != domain.free().len() {
            let expected = format!("{}, one for each free cell", domain.free().len());
            return Err(ArgumentError::new("velocities", velocities.len(), expected).into());
        }
        let inside = |face: &Face| {
            let [low, high] = face.cells.map(|cell| velocities[cell][face.axis]);
            let [below, above] = face.halves;
            face.area * (low * above + high * below) / (below + above)
        };
        let edge = |face: &EdgeFace| {
            let outwards = if face.upper { face.area } else { -face.area };
            outwards * velocities[face.cell][face.axis]
        };
        Self::through(domain, inside, edge).treated(domain, divergence)
    }

    /// Net flow out of each free cell, m^3/s.
    pub fn divergence(&self, domain: &Domain) -> Vec<f64> {
        let mut net = vec![0.0; domain.free().len()];
        for (face, flow) in domain.faces.iter().zip(&self.inside) {
            net[face.cells[0]] += flow;
            net[face.cells[1]] -= flow;
        }
        for (face, flow) in domain.edge_faces.iter().zip(&self.edge) {
            net[face.cell] += flow;
        }
        net
    }

    fn treated(mut self, domain: &Domain, divergence: Divergence) -> Result<Self, Error> {
        for flow in self.inside.iter().chain(&self.edge) {
            within("flow", *flow, -MAX_FLOW, MAX_FLOW)?;
        }
        if divergence == Divergence::Project {
            let before = self.largest();
            let net: Vec<f64> = self.divergence(domain).iter().map(|net| -net).collect();
            let phi = solve_potential(domain, net)?;
            for (flow, face) in self.inside.iter_mut().zip(&domain.faces) {
                *flow += conductance(face) * (phi[face.cells[0]] - phi[face.cells[1]]);
            }
            for (flow, face) in self.edge.iter_mut().zip(&domain.edge_faces) {
                if face.boundary.is_open() {
                    *flow += face.area / face.half * phi[face.cell];
                }
            }
            // Nothing but rounding is left of a wind that cannot blow at all.
            if self.largest() <= MAX_DIVERGENCE * before {
                self = Self::still(domain);
            }
        }
        self.check(domain)?;
        Ok(self)
    }

    pub(crate) fn largest(&self) -> f64 {
        let all = self.inside.iter().chain(&self.edge);
        all.fold(0.0, |most, flow| flow.abs().max(most))
    }

    /// Refuses a wind of another domain or with divergence.
    pub(crate) fn check(&self, domain: &Domain) -> Result<(), Error> {
        let found = [self.inside.len(), self.edge.len()];
        let expected = [domain.faces.len(), domain.edge_faces.len()];
        if found != expected {
            let expected = format!("a flow of this domain's {expected:?}");
            return Err(ArgumentError::new("flow", format!("of {found:?} faces"), expected).into());
        }
        let largest = self.largest();
        let net = self.divergence(domain);
        let worst = net
            .into_iter()
            .enumerate()
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        match worst.filter(|(_, net)| net.abs() > MAX_DIVERGENCE * largest) {
            None => Ok(()),
            Some((number, net)) => {
                let cell = domain.grid().place(domain.free()[number]);
                Err(Error::Divergence { cell, net, largest })
            }
        }
    }

    /// Flow through the upper face of a free cell across an axis, m^3/s; 0 at walls.
    pub fn above(&self, domain: &Domain, number: usize, axis: usize) -> f64 {
        let inside = domain.faces.iter().zip(&self.inside);
        let inside = inside.filter(|(face, _)| face.cells[0] == number && face.axis == axis);
        let edge = domain.edge_faces.iter().zip(&self.edge);
        let edge = edge.filter(|(face, _)| face.cell == number && face.axis == axis && face.upper);
        inside.map(|pair| pair.1).chain(edge.map(|pair| pair.1)).sum()
    }

    /// Mean velocity in each free cell, m/s: half the sum of its two faces across each axis, over their area.
    pub fn velocities(&self, domain: &Domain) -> Vec<[f64; 3]> {
        let mut velocities = vec![[0.0; 3]; domain.free().len()];
        for (face, flow) in domain.faces.iter().zip(&self.inside) {
            for cell in face.cells {
                velocities[cell][face.axis] += 0.5 * flow / face.area;
            }
        }
        for (face, flow) in domain.edge_faces.iter().zip(&self.edge) {
            velocities[face.cell][face.axis] += if face.upper { 0.5 } else { -0.5 } * flow / face.area;
        }
        velocities
    }
}

impl PotentialFlow {
    /// The flow `v = -grad phi` with one potential on all inflows, 0 on all outflows and no flow through walls, scaled so that `total`
    /// (m^3/s; m^2/s in a plane) passes.
    ///
    /// # Errors
    /// If `total` is not a positive number up to 1e90; [`Error::NoPassage`] if no connected part touches both.
    pub fn new(domain: &Domain, total: f64) -> Result<Self, Error> {
        within("total", positive("total", total)?, 0.0, MAX_FLOW)?;
        let mut supply = vec![0.0; domain.free().len()];
        let edges = || domain.edge_faces.iter();
        let inflows = || edges().filter(|face| face.boundary == Boundary::Inflow);
        for face in inflows() {
            supply[face.cell] += face.area / face.half;
        }
        let mut potential = solve_potential(domain, supply)?;
        let carried = |face: &EdgeFace| face.area / face.half * (1.0 - potential[face.cell]);
        let passing: f64 = inflows().map(carried).sum();
        let conductances: f64 = inflows().map(|face| face.area / face.half).sum();
        // A part with inflows only has potential one but for rounding.
        if passing.is_nan() || passing <= 1e-12 * conductances {
            return Err(Error::NoPassage);
        }
        let difference = total / passing;
        potential.iter_mut().for_each(|phi| *phi *= difference);
        let fall = |face: &Face| conductance(face) * (potential[face.cells[0]] - potential[face.cells[1]]);
        let flow = Flow::through(domain, fall, |face| {
            let inside = potential[face.cell];
            face.area / face.half
                * if face.boundary == Boundary::Inflow {
                    inside - difference
                } else {
                    inside
                }
        });
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

/// The potential whose flow out of each free cell is `supply`, zero on inflows and outflows. A part without opening has potential zero
/// in one of its cells; its supplies must sum to zero.
fn solve_potential(domain: &Domain, supply: Vec<f64>) -> Result<Vec<f64>, Error> {
    let count = supply.len();
    let rates: Vec<[f64; 2]> = domain.faces.iter().map(|face| [conductance(face); 2]).collect();
    let mut diagonal = vec![0.0; count];
    for (face, rate) in domain.faces.iter().zip(&rates) {
        face.cells.iter().for_each(|cell| diagonal[*cell] += rate[0]);
    }
    let (part, parts) = domain.parts();
    let mut open = vec![false; parts];
    for face in domain.edge_faces.iter().filter(|face| face.boundary.is_open()) {
        diagonal[face.cell] += face.area / face.half;
        open[part[face.cell]] = true;
    }
    for (cell, part) in part.iter().enumerate() {
        if !open[*part] {
            diagonal[cell] = 2.0 * diagonal[cell].max(f64::MIN_POSITIVE);
            open[*part] = true;
        }
    }
    let solver = Solver::new(count, &domain.faces, &rates)?;
    let factor = solver.factor(&diagonal, &rates, 1.0)?;
    let mut columns = Mat::from_fn(count, 1, |i, _| supply[i]);
    factor.solve(Direction::Forward, &mut columns);
    let mut potential = columns.col_as_slice(0).to_vec();
    // One step of refinement: flows are differences of the potential.
    for i in 0..count {
        columns[(i, 0)] = supply[i] - diagonal[i] * potential[i];
    }
    for (face, rate) in domain.faces.iter().zip(&rates) {
        columns[(face.cells[0], 0)] += rate[0] * potential[face.cells[1]];
        columns[(face.cells[1], 0)] += rate[1] * potential[face.cells[0]];
    }
    factor.solve(Direction::Forward, &mut columns);
    let changes = potential.iter_mut().zip(columns.col_as_slice(0));
    changes.for_each(|(phi, change)| *phi += change);
    Ok(potential)
}
