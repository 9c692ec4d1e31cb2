//! Which cells are free, and what bounds them.

use crate::grid::LARGEST;
use crate::{Error, Grid};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::within;

/// What happens to the substance at a face between a free cell and what is not free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Boundary {
    /// Nothing passes.
    Closed,
    /// Everything that arrives is taken away: `c = 0` on the face.
    Absorbing,
    /// `-D dc/dn = leak c`, with the leak velocity in m/s.
    Leaking(f64),
    /// Open to clean air, from which wind enters: `c = 0` on the face.
    Inflow,
    /// Open, and wind leaves: `dc/dn = 0` on the face. Without any wind in the domain `c = 0`.
    Outflow,
}

impl Boundary {
    /// Whether wind passes.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Inflow | Self::Outflow)
    }
}

/// What a cell of the grid is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// Air. Its faces on the edge of the grid have the boundary of that side.
    Free,
    /// Air. Its faces on the edge of the grid have this boundary.
    Open(Boundary),
    /// Something solid. All its faces to air have this boundary.
    Blocked(Boundary),
}

/// A face between two free cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Face {
    /// Numbers of the free cells below and above.
    pub(crate) cells: [usize; 2],
    pub(crate) axis: usize,
    pub(crate) area: f64,
    /// Distances of both centres from the face, m.
    pub(crate) halves: [f64; 2],
}

/// A face between a free cell and what is not free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgeFace {
    /// Number of the free cell.
    pub(crate) cell: usize,
    pub(crate) axis: usize,
    /// Whether it is the upper face of the cell.
    pub(crate) upper: bool,
    pub(crate) area: f64,
    pub(crate) half: f64,
    pub(crate) boundary: Boundary,
}

/// The free cells of a grid, their faces, and the boundary at each face that leads out.
///
/// Two free cells that touch at an edge or a corner only do not exchange anything.
///
/// ```
/// use fewbits_diffusion::{Boundary, Cell, Domain, Grid};
/// // A room of 2 m by 1 m with an absorbing wall at x = 0.
/// let grid = Grid::uniform(&[8, 4], 0.25)?;
/// let closed = [Boundary::Closed; 2];
/// let room = Domain::new(grid, &[Cell::Free; 32], [[Boundary::Absorbing, Boundary::Closed], closed, closed])?;
/// assert_eq!(room.free().len(), 32);
/// # Ok::<(), fewbits_diffusion::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    grid: Grid,
    /// Free cells, increasing.
    free: Vec<usize>,
    /// Number among the free cells, or `BLOCKED`, for each cell of the grid.
    numbers: Vec<usize>,
    pub(crate) faces: Vec<Face>,
    pub(crate) edge_faces: Vec<EdgeFace>,
}

const BLOCKED: usize = usize::MAX;

/// Cells with their shares, which sum to one: a source that releases uniformly in them, or a sensor that measures the mean over them.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Numbers of free cells, and shares.
    pub(crate) shares: Vec<(usize, f64)>,
}

impl Domain {
    /// The domain of a grid whose cells are given in the grid's order; `sides[axis]` are the boundaries of its lower and upper end.
    ///
    /// # Errors
    /// If the number of cells is not that of the grid, a leak is negative or above 1e30 m/s, or [`Error::NoFreeCell`].
    pub fn new(grid: Grid, cells: &[Cell], sides: [[Boundary; 2]; 3]) -> Result<Self, Error> {
        if cells.len() != grid.cells() {
            let expected = format!("{}, one for each cell of the grid", grid.cells());
            return Err(ArgumentError::new("cells", cells.len(), expected).into());
        }
        let of_cells = cells.iter().filter_map(|cell| match cell {
            Cell::Free => None,
            Cell::Open(boundary) | Cell::Blocked(boundary) => Some(boundary),
        });
        for boundary in of_cells.chain(sides.as_flattened()) {
            if let Boundary::Leaking(leak) = boundary {
                within("leak", *leak, 0.0, LARGEST)?;
            }
        }
        let is_free = |cell: &Cell| !matches!(cell, Cell::Blocked(_));
        let free: Vec<usize> = (0..cells.len()).filter(|i| is_free(&cells[*i])).collect();
        if free.is_empty() {
            return Err(Error::NoFreeCell);
        }
        let mut numbers = vec![BLOCKED; cells.len()];
        for (number, cell) in free.iter().enumerate() {
            numbers[*cell] = number;
        }
        let (mut faces, mut edge_faces) = (Vec::new(), Vec::new());
        let counts = grid.counts();
        for (number, cell) in free.iter().enumerate() {
            let at = grid.place(*cell);
            for axis in 0..grid.dimension() {
                let (area, half) = (grid.face_area(&at, axis), 0.5 * grid.width(axis, at[axis]));
                for upper in [false, true] {
                    let mut next = at;
                    // Below the first cell it is beyond the last.
                    next[axis] = if upper { at[axis] + 1 } else { at[axis].wrapping_sub(1) };
                    let boundary = if next[axis] < counts[axis] {
                        let other = grid.index(next);
                        match cells[other] {
                            Cell::Blocked(boundary) => boundary,
                            _ if upper => {
                                let halves = [half, 0.5 * grid.width(axis, next[axis])];
                                faces.push(Face {
                                    cells: [number, numbers[other]],
                                    axis,
                                    area,
                                    halves,
                                });
                                continue;
                            }
                            _ => continue,
                        }
                    } else if let Cell::Open(boundary) = cells[*cell] {
                        boundary
                    } else {
                        sides[axis][usize::from(upper)]
                    };
                    if boundary != Boundary::Closed {
                        edge_faces.push(EdgeFace {
                            cell: number,
                            axis,
                            upper,
                            area,
                            half,
                            boundary,
                        });
                    }
                }
            }
        }
        Ok(Self {
            grid,
            free,
            numbers,
            faces,
            edge_faces,
        })
    }

    /// Multiplies the leak of each face by `|normal . face|`, with the unit normal of the true wall at the centre of the face.
    ///
    /// A curved or slanting wall is a staircase on the grid, whose area is too large (by 4/pi for a disc, 3/2 for a ball). Without this
    /// correction a leaking one does not converge to the truth; absorbing and closed walls do.
    ///
    /// # Errors
    /// If a normal is not of length one.
    pub fn with_wall_normals(mut self, normal: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Self, Error> {
        for face in &mut self.edge_faces {
            let Boundary::Leaking(leak) = face.boundary else {
                continue;
            };
            let mut centre = self.grid.centre(self.free[face.cell]);
            centre[face.axis] += if face.upper { face.half } else { -face.half };
            let n = normal(centre);
            let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length.is_nan() || (length - 1.0).abs() > 1e-6 {
                return Err(ArgumentError::new("normal", format!("{n:?} at {centre:?}"), "a vector of length 1").into());
            }
            face.boundary = Boundary::Leaking(leak * n[face.axis].abs());
        }
        Ok(self)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Free cells, as numbers of the grid, increasing. Fields are given in this order where they are "per free cell".
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Number of a cell of the grid among the free cells; `None` if it is blocked.
    #[inline]
    pub fn number(&self, cell: usize) -> Option<usize> {
        self.numbers.get(cell).copied().filter(|number| *number != BLOCKED)
    }

    /// Volume of each free cell.
    pub fn volumes(&self) -> Vec<f64> {
        self.free.iter().map(|cell| self.grid.volume(*cell)).collect()
    }

    /// A function's values at the centres of the free cells.
    pub fn sample(&self, f: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        self.free.iter().map(|cell| f(self.grid.centre(*cell))).collect()
    }

    /// A field per free cell as one over the whole grid, with `elsewhere` in blocked cells.
    pub fn spread(&self, field: &[f64], elsewhere: f64) -> Vec<f64> {
        let value = |number: &usize| field.get(*number).copied().unwrap_or(elsewhere);
        self.numbers.iter().map(value).collect()
    }

    /// The free cell that holds a point, by its number among the free cells.
    ///
    /// # Errors
    /// [`Error::Outside`] the grid; [`Error::Blocked`] in a blocked cell, with the nearest free one.
    pub fn locate(&self, point: [f64; 3]) -> Result<usize, Error> {
        let cell = self.grid.cell_at(point).ok_or(Error::Outside { point })?;
        self.number(cell).ok_or_else(|| {
            let distance = |cell: &usize| {
                let centre = self.grid.centre(*cell);
                (0..self.grid.dimension())
                    .map(|i| (centre[i] - point[i]).powi(2))
                    .sum::<f64>()
            };
            let nearest = self.free.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            Error::Blocked {
                point,
                nearest: self.grid.centre(nearest.copied().unwrap_or(0)),
            }
        })
    }

    /// The cell that holds a point.
    ///
    /// # Errors
    /// As [`Domain::locate`].
    pub fn point(&self, point: [f64; 3]) -> Result<Patch, Error> {
        Ok(Patch {
            shares: vec![(self.locate(point)?, 1.0)],
        })
    }

    /// All cells whose centres are in the box between two corners, with shares in proportion to their volumes.
    ///
    /// # Errors
    /// If there is no such cell, or one of them is blocked ([`Error::Blocked`]).
    pub fn block(&self, lower: [f64; 3], upper: [f64; 3]) -> Result<Patch, Error> {
        let inside = |axis: usize| -> Vec<usize> {
            let edges = self.grid.edges(axis);
            let within = |i: &usize| {
                let centre = 0.5 * (edges[*i] + edges[*i + 1]);
                axis >= self.grid.dimension() || (lower[axis]..upper[axis]).contains(&centre)
            };
            (0..edges.len() - 1).filter(within).collect()
        };
        let [columns, lines, layers] = [0, 1, 2].map(inside);
        let mut shares = Vec::new();
        for layer in &layers {
            for line in &lines {
                for column in &columns {
                    let cell = self.grid.index([*column, *line, *layer]);
                    let number = self.locate(self.grid.centre(cell))?;
                    shares.push((number, self.grid.volume(cell)));
                }
            }
        }
        let total: f64 = shares.iter().map(|share| share.1).sum();
        if shares.is_empty() {
            let shown = format!("{lower:?} to {upper:?}");
            return Err(ArgumentError::new("lower, upper", shown, "a box that holds the centre of a cell").into());
        }
        shares.iter_mut().for_each(|share| share.1 /= total);
        Ok(Patch { shares })
    }

    /// The number of the connected part that each free cell belongs to, and how many parts there are.
    pub fn parts(&self) -> (Vec<usize>, usize) {
        let mut part = vec![BLOCKED; self.free.len()];
        let neighbours = Neighbours::new(self.free.len(), &self.faces);
        let mut count = 0;
        for seed in 0..part.len() {
            if part[seed] != BLOCKED {
                continue;
            }
            let mut open = vec![seed];
            part[seed] = count;
            while let Some(cell) = open.pop() {
                for (other, _) in neighbours.of(cell) {
                    if part[*other] == BLOCKED {
                        part[*other] = count;
                        open.push(*other);
                    }
                }
            }
            count += 1;
        }
        (part, count)
    }
}

impl Patch {
    /// Mean of a field per free cell over the patch.
    pub fn mean(&self, field: &[f64]) -> f64 {
        self.shares.iter().map(|(cell, share)| share * field[*cell]).sum()
    }
}

/// For each free cell its neighbours and the faces between.
pub(crate) struct Neighbours {
    starts: Vec<usize>,
    entries: Vec<(usize, usize)>,
}

impl Neighbours {
    pub(crate) fn new(count: usize, faces: &[Face]) -> Self {
        let mut starts = vec![0; count + 1];
        for cell in faces.iter().flat_map(|face| face.cells) {
            starts[cell + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0); 2 * faces.len()];
        for (k, face) in faces.iter().enumerate() {
            for (own, other) in [(face.cells[0], face.cells[1]), (face.cells[1], face.cells[0])] {
                entries[next[own]] = (other, k);
                next[own] += 1;
            }
        }
        Self { starts, entries }
    }

    /// `(neighbour, face)` of a cell.
    pub(crate) fn of(&self, cell: usize) -> &[(usize, usize)] {
        &self.entries[self.starts[cell]..self.starts[cell + 1]]
    }
}
