//! Wind as volume flows through the faces of a domain.

use crate::domain::{Face, OUTSIDE};
use crate::{Domain, Error};
use fewbits_numerics::error::refuse;

/// Flow of air through each face that is not closed, m^3/s (m^2/s in a plane). The flow through walls is zero.
///
/// Inflow and outflow of each cell are equal, so a uniform concentration stays uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Flow {
    /// Flow from the lower to the upper cell of each face of the domain.
    pub(crate) upwards: Vec<f64>,
}

/// Largest accepted net flow out of a cell, relative to the largest flow through a face.
pub(crate) const MAX_DIVERGENCE: f64 = 1e-10;

impl Flow {
    /// No wind: zero flow through all faces.
    pub fn still(domain: &Domain) -> Self {
        Self::through(domain, |_| 0.0)
    }

    /// The flow `upwards(face)` of each face that wind can pass; zero for the others.
    pub(crate) fn through(domain: &Domain, upwards: impl Fn(&Face) -> f64) -> Self {
        let passing = |face: &Face| if face.is_open() { upwards(face) } else { 0.0 };
        Self {
            upwards: domain.faces.iter().map(passing).collect(),
        }
    }

    /// Net flow out of each free cell, m^3/s.
    pub(crate) fn divergence(&self, domain: &Domain) -> Vec<f64> {
        let mut net = vec![0.0; domain.free().len() + OUTSIDE];
        for (face, flow) in domain.faces.iter().zip(&self.upwards) {
            net[face.cells[0]] += flow;
            net[face.cells[1]] -= flow;
        }
        net.truncate(domain.free().len());
        net
    }

    pub(crate) fn largest(&self) -> f64 {
        self.upwards.iter().fold(0.0, |most, flow| flow.abs().max(most))
    }

    /// Checks that the flow belongs to this domain and has no divergence.
    pub(crate) fn check(&self, domain: &Domain) -> Result<(), Error> {
        let (found, expected) = (self.upwards.len(), domain.faces.len());
        if found != expected {
            return refuse("flow", format!("of {found} faces"), format!("a flow of this domain's {expected}"));
        }
        let largest = self.largest();
        let net = self.divergence(domain).into_iter().enumerate();
        match net.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) {
            Some((number, net)) if net.abs() > MAX_DIVERGENCE * largest => {
                let cell = domain.place(number);
                Err(Error::Divergence { cell, net, largest })
            }
            _ => Ok(()),
        }
    }

    /// Flow through the upper face of a free cell across an axis, m^3/s; 0 at walls.
    pub fn above(&self, domain: &Domain, number: usize, axis: usize) -> f64 {
        let mut faces = domain.faces.iter().zip(&self.upwards);
        let found = faces.find(|(face, _)| face.cells[0] == number && face.axis == axis);
        found.map_or(0.0, |(_, flow)| *flow)
    }

    /// Mean velocity in each free cell, m/s: half the sum of its two faces across each axis, over their area.
    pub fn velocities(&self, domain: &Domain) -> Vec<[f64; 3]> {
        let mut velocities = vec![[0.0; 3]; domain.free().len() + OUTSIDE];
        for (face, flow) in domain.faces.iter().zip(&self.upwards) {
            for cell in face.cells {
                velocities[cell][face.axis] += 0.5 * flow / face.area;
            }
        }
        velocities.truncate(domain.free().len());
        velocities
    }
}
