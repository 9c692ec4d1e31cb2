//! Sparse factorisations of exchange matrices.
//!
//! An exchange matrix is `diag(d) - rates`: what leaves a cell through a face enters the neighbour. If a diagonal scaling makes it
//! symmetric, it is factored by Cholesky (half the work and memory), otherwise by LU.

use crate::{Domain, Error};
use faer::linalg::solvers::{Solve, SolveCore};
use faer::sparse::linalg::solvers::{Llt, Lu, SymbolicLlt, SymbolicLu};
use faer::sparse::linalg::{LltError, LuError};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Side};

/// Whether the system or its transpose is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Forward,
    Adjoint,
}

enum Symbolic {
    /// `exp(h) A exp(-h)` is symmetric; with `exp(h)` for each cell.
    Cholesky(SymbolicLlt<usize>, Vec<f64>),
    Lu(SymbolicLu<usize>),
}

/// The sparsity structure of a matrix, ordered once for all factorisations.
pub(crate) struct Solver {
    pattern: SymbolicSparseColMat<usize>,
    /// Position in the pattern of each entry: diagonal, rates upwards, and (only for LU) rates downwards.
    order: Argsort<usize>,
    symbolic: Symbolic,
}

/// A factored matrix.
pub(crate) struct Factor<'a> {
    scale: Option<&'a [f64]>,
    numeric: Box<dyn SolveCore<f64> + Send + Sync>,
}

/// Largest range of the potential of a scaling: its exponentials and their products must not overflow.
const MAX_SPREAD: f64 = 800.0;
/// Largest sum of potential differences around a loop that counts as zero. The relative error of an entry is a tenth of it.
const MAX_MISFIT: f64 = 1e-11;

/// The potential `psi` with `rate upwards / rate downwards = exp(psi below - psi above)` at every face, if there is one: then
/// `exp(psi / 2) A exp(-psi / 2)` is symmetric. There is one without wind, and in potential flow with one diffusivity.
fn potential(domain: &Domain, rates: &[[f64; 2]]) -> Option<Vec<f64>> {
    let fall = |face: usize| (rates[face][0] / rates[face][1]).ln();
    let mut psi = vec![0.0; domain.free().len()];
    for part in domain.walk() {
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
        for (cell, face) in &part {
            if let Some(face) = *face {
                let [low, high] = domain.faces[face].cells;
                psi[*cell] = if *cell == high {
                    psi[low] - fall(face)
                } else {
                    psi[high] + fall(face)
                };
            }
            ends = [ends[0].min(psi[*cell]), ends[1].max(psi[*cell])];
        }
        if ends[1] - ends[0] > MAX_SPREAD {
            return None;
        }
        let middle = 0.5 * (ends[0] + ends[1]);
        part.iter().for_each(|(cell, _)| psi[*cell] -= middle);
    }
    let misfit = |face: usize| {
        let [low, high] = domain.faces[face].cells;
        (psi[low] - psi[high] - fall(face)).abs()
    };
    // The comparison is false for NaN, which a rate of zero causes.
    (0..domain.inner).all(|face| misfit(face) <= MAX_MISFIT).then_some(psi)
}

impl Solver {
    /// Orders the unknowns of a domain's matrix: `rates[f]` are the amounts per concentration that cross face `f` upwards and downwards.
    pub(crate) fn new(domain: &Domain, rates: &[[f64; 2]]) -> Result<Self, Error> {
        let (count, psi) = (domain.free().len(), potential(domain, rates));
        let cells = || domain.faces[..domain.inner].iter().map(|face| face.cells);
        let mut places: Vec<Pair<usize, usize>> = (0..count).map(|i| Pair::new(i, i)).collect();
        places.extend(cells().map(|[low, high]| Pair::new(high, low)));
        if psi.is_none() {
            places.extend(cells().map(|[low, high]| Pair::new(low, high)));
        }
        // With a potential the scaled rates are symmetric: Cholesky is possible.
        let pattern = SymbolicSparseColMat::try_new_from_indices(count, count, &places);
        let (pattern, order) = pattern.map_err(|_| failed(count, false))?;
        let symbolic = match psi {
            Some(psi) => SymbolicLlt::try_new(pattern.as_ref(), Side::Lower)
                .map(|symbolic| Symbolic::Cholesky(symbolic, psi.into_iter().map(|psi| (0.5 * psi).exp()).collect())),
            None => SymbolicLu::try_new(pattern.as_ref()).map(Symbolic::Lu),
        };
        let symbolic = symbolic.map_err(|_| failed(count, false))?;
        Ok(Self {
            pattern,
            order,
            symbolic,
        })
    }

    /// Whether the matrix is factored by Cholesky.
    pub(crate) fn is_symmetric(&self) -> bool {
        matches!(self.symbolic, Symbolic::Cholesky(..))
    }

    /// Factors `diag(diagonal) - share * rates`, with the rates of faces between cells.
    pub(crate) fn factor(&self, mut diagonal: Vec<f64>, rates: &[[f64; 2]], share: f64) -> Result<Factor<'_>, Error> {
        let (count, values) = (diagonal.len(), &mut diagonal);
        match &self.symbolic {
            Symbolic::Cholesky(..) => values.extend(rates.iter().map(|[up, down]| -share * (up * down).sqrt())),
            Symbolic::Lu(_) => [0, 1]
                .into_iter()
                .for_each(|way| values.extend(rates.iter().map(|rate| -share * rate[way]))),
        }
        let matrix = SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, values);
        let matrix = matrix.map_err(|_| failed(count, false))?;
        Ok(match &self.symbolic {
            Symbolic::Cholesky(symbolic, scale) => {
                let numeric = Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower)
                    .map_err(|error| failed(count, matches!(error, LltError::Numeric(_))))?;
                Factor {
                    scale: Some(scale),
                    numeric: Box::new(numeric),
                }
            }
            Symbolic::Lu(symbolic) => {
                let numeric = Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref())
                    .map_err(|error| failed(count, matches!(error, LuError::SymbolicSingular { .. })))?;
                Factor {
                    scale: None,
                    numeric: Box::new(numeric),
                }
            }
        })
    }
}

fn failed(unknowns: usize, singular: bool) -> Error {
    Error::Factorisation { unknowns, singular }
}

impl Factor<'_> {
    /// Solves for every column in place.
    pub(crate) fn solve(&self, direction: Direction, columns: &mut Mat<f64>) {
        // exp(h) A exp(-h) = S: for the transposed matrix the scaling is reversed.
        let forward = direction == Direction::Forward;
        self.rescale(columns, forward);
        match direction {
            Direction::Forward => self.numeric.solve_in_place(columns.as_mut()),
            Direction::Adjoint => self.numeric.solve_transpose_in_place(columns.as_mut()),
        }
        self.rescale(columns, !forward);
    }

    fn rescale(&self, columns: &mut Mat<f64>, up: bool) {
        for (j, scale) in (0..columns.ncols()).filter_map(|j| Some((j, self.scale?))) {
            for (value, scale) in columns.col_as_slice_mut(j).iter_mut().zip(scale) {
                *value = if up { *value * scale } else { *value / scale };
            }
        }
    }
}
