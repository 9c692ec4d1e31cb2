//! Errors of the diffusion solver.

use fewbits_numerics::ArgumentError;
use thiserror::Error as ThisError;

/// Errors of this crate. Cells are given by column, line and layer, points by their coordinates in metres.
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A source or a sensor is outside the grid.
    #[error("the point {point:?} is outside the grid")]
    Outside {
        /// The point.
        point: [f64; 3],
    },
    /// A source or a sensor is in a blocked cell.
    #[error("the point {point:?} is in a blocked cell: the centre of the nearest free cell is {nearest:?}")]
    Blocked {
        /// The point.
        point: [f64; 3],
        /// Centre of the free cell nearest to it.
        nearest: [f64; 3],
    },
    /// Every cell is blocked.
    #[error("every cell is blocked: at least one must be free")]
    NoFreeCell,
    /// The wind is not free of divergence on this grid.
    #[error(
        "the wind is not free of divergence: {net} leaves cell {cell:?} (the largest flow through a face is {largest}); use \
         `Divergence::Project`"
    )]
    Divergence {
        /// The cell with the largest net flow.
        cell: [usize; 3],
        /// Net flow out of it, m^3/s.
        net: f64,
        /// Largest flow through a face, m^3/s.
        largest: f64,
    },
    /// A connected part has neither an exit nor decay, so it has no steady state.
    #[error("nothing can leave the part of cell {cell:?} and nothing decays there: it has no steady state")]
    NoSink {
        /// A cell of the part.
        cell: [usize; 3],
    },
    /// No connected part touches an inflow and an outflow.
    #[error("no connected part touches both an inflow and an outflow: no potential flow passes")]
    NoPassage,
    /// Wind enters through an outflow. Its boundary condition (no diffusive flux) does not define the incoming concentration.
    #[error("wind enters through the outflow at cell {cell:?} ({flow} m^3/s outwards): declare an inflow there")]
    Backflow {
        /// The cell inside the face.
        cell: [usize; 3],
        /// Flow outwards, m^3/s.
        flow: f64,
    },
    /// A sparse factorisation failed: there is not enough memory, or the matrix is singular to rounding.
    #[error("the matrix of {unknowns} cells cannot be factored: {}", if *.singular { "it is singular to rounding" } else { "not enough memory" })]
    Factorisation {
        /// Number of free cells.
        unknowns: usize,
        /// Whether the matrix is singular; otherwise memory ran out.
        singular: bool,
    },
    /// The tolerance requires a time step below the resolution of time.
    #[error("a time step of {step} s does not reach the tolerance")]
    StepTooSmall {
        /// The smallest step tried, s.
        step: f64,
    },
}

impl Error {
    /// The refused argument, if that is the error.
    pub fn argument(&self) -> Option<&ArgumentError> {
        match self {
            Self::Argument(argument) => Some(argument),
            _ => None,
        }
    }
}
