//! Wind as flows through the faces of a domain.

use crate::domain::{Face, OUTSIDE};
use crate::{Domain, Error};
use fewbits_numerics::error::refuse;

/// Flow of air through each face that is not closed, m^3/s (m^2/s in a plane). Nothing flows through walls.
///
/// What flows into a cell flows out of it: a uniform concentration stays uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Flow {
    /// Upwards, through each face of the domain.
    pub(crate) upwards: Vec<f64>,
}

/// Net flow out of a cell that is accepted, relative to the largest flow through a face.
pub(crate) const MAX_DIVERGENCE: f64 = 1e-10;

impl Flow {
    /// No wind.
    pub fn still(domain: &Domain) -> Self {
        Self::through(domain, |_| 0.0)
    }

    /// The flow of each face that wind can pass.
    pub(crate) fn through(domain: &Domain, upwards: impl Fn(&Face) -> f64) -> Self {
        let passing = |face: &Face| if face.is_open() { upwards(face) } else { 0.0 };
        Self {
            upwards: domain.faces.iter().map(passing).collect(),
        }
    }

    /// Net flow out of each free cell, m^3/s.
    pub fn divergence(&self, domain: &Domain) -> Vec<f64> {
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

    /// Refuses a wind of another domain or with divergence.
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
