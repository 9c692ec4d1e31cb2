//! Costs of steady fields of 90,000 cells in the plane and of 50 sensors, as multiples of faer's own factorisation of such a matrix.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use faer::sparse::{SparseColMat, Triplet};
use fewbits_diffusion::{Boundary, CellKind, Domain, FluxRule, Grid, PotentialFlow, SensorField, Steady, Transport};

/// Cells along an axis.
const SIDE: usize = 300;

fn main() {
    divan::main();
}

/// A square of 30 m with wind from left to right past a wall.
fn transport(scheme: FluxRule) -> Transport {
    let grid = Grid::uniform(&[SIDE, SIDE], 0.1).unwrap();
    let wall = |cell: usize| grid.place(cell)[0] == SIDE / 3 && grid.place(cell)[1] < SIDE / 2;
    let cells = (0..SIDE * SIDE).map(|cell| {
        if wall(cell) {
            CellKind::Blocked(Boundary::Closed)
        } else {
            CellKind::Free
        }
    });
    let closed = [Boundary::Closed; 2];
    let cells: Vec<CellKind> = cells.collect();
    let domain = Domain::new(grid, &cells, [[Boundary::Inflow, Boundary::Outflow], closed, closed]).unwrap();
    let wind = PotentialFlow::new(&domain, 1.0).unwrap().flow;
    Transport::new(domain, 0.05, &wind, 0.0, scheme).unwrap()
}

/// The matrix of the same square without wall in a wind along x, by faer alone.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn plain_lu_unit(bencher: Bencher) {
    let mut triplets = Vec::new();
    for line in 0..SIDE {
        for column in 0..SIDE {
            let cell = line * SIDE + column;
            // Diffusion 1 to each side, and a wind of 0.7 that carries what it comes from.
            let mut diagonal = 1e-3;
            if column + 1 < SIDE {
                triplets.push(Triplet::new(cell + 1, cell, -1.7));
                diagonal += 1.7;
            } else {
                diagonal += 0.7;
            }
            if column > 0 {
                triplets.push(Triplet::new(cell - 1, cell, -1.0));
                diagonal += 1.0;
            }
            for other in [line.checked_sub(1), Some(line + 1).filter(|l| *l < SIDE)]
                .into_iter()
                .flatten()
            {
                triplets.push(Triplet::new(other * SIDE + column, cell, -1.0));
                diagonal += 1.0;
            }
            triplets.push(Triplet::new(cell, cell, diagonal));
        }
    }
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(SIDE * SIDE, SIDE * SIDE, &triplets).unwrap();
    bencher.bench(|| black_box(&matrix).sp_lu().unwrap());
}

/// Ordering and factorisation: upwind is not symmetric, exponential fitting in potential flow is.
#[divan::bench(args = [FluxRule::Upwind, FluxRule::ExponentialFitting], sample_count = 5, sample_size = 1)]
fn factor(bencher: Bencher, scheme: FluxRule) {
    bencher.with_inputs(|| transport(scheme)).bench_refs(|transport| {
        black_box(Steady::new(transport).unwrap());
    });
}

/// The matrix, ordering, factorisation and 50 adjoint solutions.
#[divan::bench(args = [FluxRule::Upwind, FluxRule::ExponentialFitting], sample_count = 5, sample_size = 1)]
fn field_of_50_sensors(bencher: Bencher, scheme: FluxRule) {
    let points: Vec<[f64; 3]> = (0..50)
        .map(|i| [0.45 + 0.55 * f64::from(i), 0.45 + 0.5 * f64::from(i * 7 % 50), 0.0])
        .collect();
    bencher
        .with_inputs(|| transport(scheme))
        .bench_refs(|transport| SensorField::steady(transport, &points).unwrap());
}
