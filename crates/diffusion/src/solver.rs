//! Sparse factorisations of exchange matrices.
//!
//! An exchange matrix is `diag(d) - rates`: what leaves a cell through a face arrives in the neighbour. It is factored by Cholesky if
//! a diagonal scaling makes it symmetric (half the work and memory), by LU otherwise.

use crate::Error;
use crate::domain::{Face, Neighbours};
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, Lu, SymbolicLlt, SymbolicLu};
use faer::sparse::linalg::{LltError, LuError};
use faer::sparse::{FaerError, SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Side};

/// Whether the system or its transpose is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Forward,
    Adjoint,
}

/// Where an entry of the matrix comes from: the diagonal of a cell, or the rate of a face upwards (0) or downwards (1).
#[derive(Debug, Clone, Copy)]
enum Entry {
    Diagonal(usize),
    Rate { face: usize, downwards: usize },
}

enum Symbolic {
    /// The matrix is symmetric after scaling: `exp(h) A exp(-h)`, with `exp(h)` for each cell.
    Cholesky {
        symbolic: SymbolicLlt<usize>,
        scale: Vec<f64>,
    },
    Lu(SymbolicLu<usize>),
}

/// The structure of a matrix, ordered once for all factorisations.
pub(crate) struct Solver {
    pattern: SymbolicSparseColMat<usize>,
    entries: Vec<Entry>,
    symbolic: Symbolic,
}

enum Numeric {
    Cholesky(Llt<usize, f64>),
    Lu(Box<Lu<usize, f64>>),
}

/// A factored matrix.
pub(crate) struct Factor<'a> {
    solver: &'a Solver,
    numeric: Numeric,
}

/// Largest spread of the potential of a scaling: its exponentials, and their products, stay far from overflow.
const MAX_SPREAD: f64 = 800.0;
/// Largest amount by which the potential may fail to close around a loop. A tenth of it is the relative error of an entry.
const MAX_MISFIT: f64 = 1e-11;

/// The potential `psi` with `rate upwards / rate downwards = exp(psi below - psi above)` at every face, if there is one: then
/// `exp(psi / 2) A exp(-psi / 2)` is symmetric. There is one without wind, and in potential flow with one diffusivity.
fn potential(count: usize, faces: &[Face], rates: &[[f64; 2]]) -> Option<Vec<f64>> {
    let fall = |face: usize| (rates[face][0] / rates[face][1]).ln();
    let neighbours = Neighbours::new(count, faces);
    let mut psi = vec![f64::NAN; count];
    for seed in 0..count {
        if !psi[seed].is_nan() {
            continue;
        }
        psi[seed] = 0.0;
        let (mut part, mut next) = (vec![seed], 0);
        while next < part.len() {
            let cell = part[next];
            next += 1;
            for (other, face) in neighbours.of(cell) {
                let upwards = faces[*face].cells[0] == cell;
                let change = if upwards { -fall(*face) } else { fall(*face) };
                if psi[*other].is_nan() {
                    psi[*other] = psi[cell] + change;
                    part.push(*other);
                }
                let misfit = (psi[*other] - psi[cell] - change).abs();
                // Not a number, if a rate is zero.
                if misfit.is_nan() || misfit > MAX_MISFIT {
                    return None;
                }
            }
        }
        let values = part.iter().map(|cell| psi[*cell]);
        let ends = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
        if ends[1] - ends[0] > MAX_SPREAD {
            return None;
        }
        let middle = 0.5 * (ends[0] + ends[1]);
        part.iter().for_each(|cell| psi[*cell] -= middle);
    }
    Some(psi)
}

impl Solver {
    /// Orders the unknowns of a matrix with the given faces and rates: `rates[f]` are the amounts per concentration that cross face `f`
    /// upwards and downwards.
    pub(crate) fn new(count: usize, faces: &[Face], rates: &[[f64; 2]]) -> Result<Self, Error> {
        let psi = potential(count, faces, rates);
        // Columns of the pattern: a face's upper cell is in the column of its lower one, and the reverse unless symmetric.
        let mut columns: Vec<Vec<(usize, Entry)>> = (0..count).map(|i| vec![(i, Entry::Diagonal(i))]).collect();
        for (face, Face { cells: [low, high], .. }) in faces.iter().enumerate() {
            columns[*low].push((*high, Entry::Rate { face, downwards: 0 }));
            if psi.is_none() {
                columns[*high].push((*low, Entry::Rate { face, downwards: 1 }));
            }
        }
        let (mut starts, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
        for column in &mut columns {
            column.sort_unstable_by_key(|entry| entry.0);
            rows.extend(column.iter().map(|entry| entry.0));
            entries.extend(column.iter().map(|entry| entry.1));
            starts.push(rows.len());
        }
        drop(columns);
        let pattern = SymbolicSparseColMat::new_checked(count, count, starts, None, rows);
        let failed = |_: FaerError| Error::Factorisation {
            unknowns: count,
            singular: false,
        };
        let symbolic = match psi {
            Some(psi) => Symbolic::Cholesky {
                symbolic: SymbolicLlt::try_new(pattern.as_ref(), Side::Lower).map_err(failed)?,
                scale: psi.into_iter().map(|psi| (0.5 * psi).exp()).collect(),
            },
            None => Symbolic::Lu(SymbolicLu::try_new(pattern.as_ref()).map_err(failed)?),
        };
        Ok(Self {
            pattern,
            entries,
            symbolic,
        })
    }

    /// Whether Cholesky serves.
    pub(crate) fn is_symmetric(&self) -> bool {
        matches!(self.symbolic, Symbolic::Cholesky { .. })
    }

    /// Factors `diag(diagonal) - share * rates`.
    pub(crate) fn factor(&self, diagonal: &[f64], rates: &[[f64; 2]], share: f64) -> Result<Factor<'_>, Error> {
        let value = |entry: &Entry| match (entry, &self.symbolic) {
            (Entry::Diagonal(cell), _) => diagonal[*cell],
            (Entry::Rate { face, .. }, Symbolic::Cholesky { .. }) => {
                -share * (rates[*face][0] * rates[*face][1]).sqrt()
            }
            (Entry::Rate { face, downwards }, Symbolic::Lu(_)) => -share * rates[*face][*downwards],
        };
        let matrix = SparseColMat::new(self.pattern.clone(), self.entries.iter().map(value).collect());
        let failed = |singular| Error::Factorisation {
            unknowns: diagonal.len(),
            singular,
        };
        let numeric = match &self.symbolic {
            Symbolic::Cholesky { symbolic, .. } => {
                let factored = Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower);
                Numeric::Cholesky(factored.map_err(|error| failed(matches!(error, LltError::Numeric(_))))?)
            }
            Symbolic::Lu(symbolic) => {
                let factored = Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref());
                Numeric::Lu(Box::new(
                    factored.map_err(|error| failed(matches!(error, LuError::SymbolicSingular { .. })))?,
                ))
            }
        };
        Ok(Factor { solver: self, numeric })
    }
}

impl Factor<'_> {
    /// Solves for every column in place.
    pub(crate) fn solve(&self, direction: Direction, columns: &mut Mat<f64>) {
        match (&self.numeric, &self.solver.symbolic) {
            (Numeric::Cholesky(factor), Symbolic::Cholesky { scale, .. }) => {
                // exp(h) A exp(-h) = S: the adjoint has the scaling reversed.
                let rescale = |columns: &mut Mat<f64>, up: bool| {
                    for j in 0..columns.ncols() {
                        for (value, scale) in columns.col_as_slice_mut(j).iter_mut().zip(scale) {
                            *value = if up { *value * scale } else { *value / scale };
                        }
                    }
                };
                let forward = direction == Direction::Forward;
                rescale(columns, forward);
                factor.solve_in_place(columns.as_mut());
                rescale(columns, !forward);
            }
            (Numeric::Lu(factor), _) if direction == Direction::Forward => factor.solve_in_place(columns.as_mut()),
            (Numeric::Lu(factor), _) => factor.solve_transpose_in_place(columns.as_mut()),
            // The solver that made a Cholesky factor has a scaling.
            (Numeric::Cholesky(factor), _) => factor.solve_in_place(columns.as_mut()),
        }
    }
}
