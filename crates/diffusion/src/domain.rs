//! The domain: which cells of a grid are free, and the boundary conditions at their faces.

use crate::grid::MAX_MAGNITUDE;
use crate::{Error, Grid};
use fewbits_numerics::error::{refuse, within};

/// Boundary condition at a face between a free cell and a wall or the outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Boundary {
    /// Nothing passes: zero flux.
    Closed,
    /// The substance is absorbed: `c = 0` on the face.
    Absorbing,
    /// `-D dc/dn = leak c`, with the leak velocity in m/s.
    Leaking(f64),
    /// An opening to clean air through which wind enters: `c = 0` on the face.
    Inflow,
    /// An opening through which wind leaves: `dc/dn = 0` on the face. Without any wind in the domain `c = 0`.
    Outflow,
}

/// Kind of a cell of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CellKind {
    /// Air. Faces on the edge of the grid have the boundary condition of that side.
    Free,
    /// Air. Faces on the edge of the grid have this boundary condition.
    Open(Boundary),
    /// Solid. All its faces to air have this boundary condition.
    Blocked(Boundary),
}

/// A face of a free cell that is not closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Face {
    /// Numbers of the cells below and above. The outside counts as two further cells: the last for inflows, the other for all else.
    pub(crate) cells: [usize; 2],
    pub(crate) axis: usize,
    pub(crate) area: f64,
    /// Distances of both centres from the face, m; 0 outside.
    pub(crate) halves: [f64; 2],
    /// Boundary condition; `None` between two free cells.
    pub(crate) boundary: Option<Boundary>,
}

/// Number of further cells that represent the outside.
pub(crate) const OUTSIDE: usize = 2;

impl Face {
    /// On which side of the face its free cell is: 0 below, 1 above. 0 if both cells are free.
    #[inline]
    pub(crate) fn side(&self) -> usize {
        usize::from(self.cells[1] < self.cells[0])
    }

    /// Number of the free cell on [`side`](Self::side).
    #[inline]
    pub(crate) fn cell(&self) -> usize {
        self.cells[self.side()]
    }

    /// Whether wind can pass the face.
    pub(crate) fn is_open(&self) -> bool {
        matches!(self.boundary, None | Some(Boundary::Inflow | Boundary::Outflow))
    }
}

/// The free cells of a grid, their faces, and the boundary condition at each face to a wall or the outside.
///
/// Two free cells that touch only at an edge or a corner exchange nothing.
///
/// ```
/// use fewbits_diffusion::{Boundary, CellKind, Domain, Grid};
/// // A room of 2 m by 1 m with an absorbing wall at x = 0.
/// let grid = Grid::uniform(&[8, 4], 0.25)?;
/// let closed = [Boundary::Closed; 2];
/// let room = Domain::new(grid, &[CellKind::Free; 32], [[Boundary::Absorbing, Boundary::Closed], closed, closed])?;
/// assert_eq!(room.free().len(), 32);
/// # Ok::<(), fewbits_diffusion::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    grid: Grid,
    /// Grid numbers of the free cells, increasing.
    free: Vec<usize>,
    /// For each cell of the grid its number among the free cells, or `BLOCKED`.
    numbers: Vec<usize>,
    /// Faces between free cells, then faces to the outside or to walls that are not closed.
    pub(crate) faces: Vec<Face>,
    /// Number of faces between free cells.
    pub(crate) inner: usize,
}

const BLOCKED: usize = usize::MAX;

/// Free cells with shares that sum to one: a source that releases uniformly in them, or a sensor that measures the mean over them.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Number of each free cell, and its share.
    pub(crate) shares: Vec<(usize, f64)>,
}

impl Domain {
    /// The domain of a grid. `cells` are in the grid's order; `sides[axis]` are the boundary conditions at its lower and upper end.
    ///
    /// # Errors
    /// If the number of cells is not that of the grid, a leak is negative or above 1e30 m/s, or [`Error::NoFreeCell`].
    pub fn new(grid: Grid, cells: &[CellKind], sides: [[Boundary; 2]; 3]) -> Result<Self, Error> {
        if cells.len() != grid.cells() {
            return refuse("cells", cells.len(), format!("{}, one for each cell of the grid", grid.cells()));
        }
        let of_cells = cells.iter().filter_map(|cell| match cell {
            CellKind::Free => None,
            CellKind::Open(boundary) | CellKind::Blocked(boundary) => Some(boundary),
        });
        for boundary in of_cells.chain(sides.as_flattened()) {
            if let Boundary::Leaking(leak) = boundary {
                within("leak", *leak, 0.0, MAX_MAGNITUDE)?;
            }
        }
        let is_free = |cell: &usize| !matches!(cells[*cell], CellKind::Blocked(_));
        let free: Vec<usize> = (0..cells.len()).filter(is_free).collect();
        if free.is_empty() {
            return Err(Error::NoFreeCell);
        }
        // Only free cells are unknowns. Each has a number, and each pair of neighbours a face.
        let mut numbers = vec![BLOCKED; cells.len()];
        for (number, cell) in free.iter().enumerate() {
            numbers[*cell] = number;
        }
        let (mut faces, mut edge) = (Vec::new(), Vec::new());
        let ways = [0, 1, 2].map(|axis| [(axis, false), (axis, true)]);
        for (number, cell) in free.iter().enumerate() {
            let at = grid.place(*cell);
            for &(axis, upper) in ways[..grid.dimension()].as_flattened() {
                let next = grid.next(at, axis, upper);
                let boundary = match (next.map(|next| cells[grid.index(next)]), cells[*cell]) {
                    (Some(CellKind::Blocked(boundary)), _) | (None, CellKind::Open(boundary)) => Some(boundary),
                    (Some(_), _) => None,
                    (None, _) => Some(sides[axis][usize::from(upper)]),
                };
                // Two further numbers represent the outside: one for outflow and walls, one for inflow.
                let (other, other_half) = match (boundary, next) {
                    (None, Some(next)) => (numbers[grid.index(next)], 0.5 * grid.width(axis, next[axis])),
                    _ => (free.len() + usize::from(boundary == Some(Boundary::Inflow)), 0.0),
                };
                let half = 0.5 * grid.width(axis, at[axis]);
                let (mut cells, mut halves) = ([number, other], [half, other_half]);
                if !upper {
                    cells.reverse();
                    halves.reverse();
                }
                let area = grid.across(at, Some(axis));
                let face = Face {
                    cells,
                    axis,
                    area,
                    halves,
                    boundary,
                };
                match boundary {
                    // An inner face is visited from both cells and stored once.
                    None if upper => faces.push(face),
                    None | Some(Boundary::Closed) => {}
                    Some(_) => edge.push(face),
                }
            }
        }
        let inner = faces.len();
        faces.extend(edge);
        Ok(Self {
            grid,
            free,
            numbers,
            faces,
            inner,
        })
    }

    /// Multiplies the leak of each face by `|normal . face|`, with the unit normal of the true wall at the centre of the face.
    ///
    /// On the grid a curved or slanting wall is a staircase, whose area is too large (by 4/pi for a disc, 3/2 for a ball). Without this
    /// correction the solution with a leaking wall does not converge to the exact one. Absorbing and closed walls need no correction.
    ///
    /// # Errors
    /// If a normal does not have length one.
    pub fn with_wall_normals(mut self, normal: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Self, Error> {
        for k in self.inner..self.faces.len() {
            let face = self.faces[k];
            let Some(Boundary::Leaking(leak)) = face.boundary else {
                continue;
            };
            let centre = self.face_centre(&face);
            let n = normal(centre);
            let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length.is_nan() || (length - 1.0).abs() > 1e-6 {
                return refuse("normal", format!("{n:?} at {centre:?}"), "a vector of length 1");
            }
            self.faces[k].boundary = Some(Boundary::Leaking(leak * n[face.axis].abs()));
        }
        Ok(self)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Grid numbers of the free cells, increasing. Fields "per free cell" are in this order.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Number among the free cells of a cell of the grid; `None` if it is blocked.
    #[inline]
    pub fn number(&self, cell: usize) -> Option<usize> {
        self.numbers.get(cell).copied().filter(|number| *number != BLOCKED)
    }

    /// Volume of each free cell, m^3.
    pub fn volumes(&self) -> Vec<f64> {
        self.free.iter().map(|cell| self.grid.volume(*cell)).collect()
    }

    /// The values of a function of the point (m) at the centres of the free cells.
    pub fn sample(&self, f: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        self.free.iter().map(|cell| f(self.grid.centre(*cell))).collect()
    }

    /// Converts a field per free cell to one over the whole grid, with `elsewhere` in blocked cells.
    pub fn spread(&self, field: &[f64], elsewhere: f64) -> Vec<f64> {
        let value = |number: &usize| field.get(*number).copied().unwrap_or(elsewhere);
        self.numbers.iter().map(value).collect()
    }

    /// Number among the free cells of the cell that contains a point, m.
    ///
    /// # Errors
    /// [`Error::Outside`] if the point is outside the grid; [`Error::Blocked`], with the nearest free cell, if it is in a blocked cell.
    pub fn locate(&self, point: [f64; 3]) -> Result<usize, Error> {
        let cell = self.grid.cell_at(point).ok_or(Error::Outside { point })?;
        self.number(cell).ok_or_else(|| {
            let axes = 0..self.grid.dimension();
            let distance = |centre: &[f64; 3]| axes.clone().map(|i| (centre[i] - point[i]).powi(2)).sum::<f64>();
            let centres = self.free.iter().map(|cell| self.grid.centre(*cell));
            let nearest = centres
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(point);
            Error::Blocked { point, nearest }
        })
    }

    /// The cell that contains a point, m, as a patch.
    ///
    /// # Errors
    /// As [`Domain::locate`].
    pub fn point(&self, point: [f64; 3]) -> Result<Patch, Error> {
        let shares = vec![(self.locate(point)?, 1.0)];
        Ok(Patch { shares })
    }

    /// All cells whose centres are in the box between two corners, with shares in proportion to their volumes.
    ///
    /// # Errors
    /// If there is no such cell, or one of them is blocked ([`Error::Blocked`]).
    pub fn block(&self, lower: [f64; 3], upper: [f64; 3]) -> Result<Patch, Error> {
        let mut shares = Vec::new();
        for cell in 0..self.grid.cells() {
            let centre = self.grid.centre(cell);
            if (0..self.grid.dimension()).all(|axis| (lower[axis]..upper[axis]).contains(&centre[axis])) {
                shares.push((self.locate(centre)?, self.grid.volume(cell)));
            }
        }
        if shares.is_empty() {
            return refuse("lower, upper", format!("{lower:?} to {upper:?}"), "a box that holds the centre of a cell");
        }
        let total: f64 = shares.iter().map(|share| share.1).sum();
        shares.iter_mut().for_each(|share| share.1 /= total);
        Ok(Patch { shares })
    }

    /// The cells of each connected part in the order of a search. Each has the face from which it was reached; the first has none.
    pub(crate) fn walk(&self) -> Vec<Vec<(usize, Option<usize>)>> {
        let mut above = vec![[0; 3]; self.free.len()];
        for (k, face) in self.faces[..self.inner].iter().enumerate() {
            above[face.cells[0]][face.axis] = k;
        }
        let ways = [(2, false), (1, false), (0, false), (0, true), (1, true), (2, true)];
        let (mut reached, mut parts) = (vec![false; self.free.len()], Vec::new());
        for seed in 0..self.free.len() {
            if reached[seed] {
                continue;
            }
            reached[seed] = true;
            let (mut part, mut next) = (vec![(seed, None)], 0);
            // Breadth first over the connected part of the seed.
            while let Some((cell, _)) = part.get(next).copied() {
                next += 1;
                let at = self.grid.place(self.free[cell]);
                for (axis, upper) in ways {
                    let place = self.grid.next(at, axis, upper);
                    let other = place.and_then(|place| self.number(self.grid.index(place)));
                    if let Some(other) = other.filter(|other| !reached[*other]) {
                        reached[other] = true;
                        part.push((other, Some(above[cell.min(other)][axis])));
                    }
                }
            }
            parts.push(part);
        }
        parts
    }

    /// Centre of a face, m.
    pub(crate) fn face_centre(&self, face: &Face) -> [f64; 3] {
        let mut centre = self.grid.centre(self.free[face.cell()]);
        centre[face.axis] += [face.halves[0], -face.halves[1]][face.side()];
        centre
    }

    /// Column, line and layer of a free cell, for error messages.
    pub(crate) fn place(&self, number: usize) -> [usize; 3] {
        self.grid.place(self.free[number])
    }

    /// Checks that a list has one entry per free cell.
    pub(crate) fn check_count(&self, name: &'static str, found: usize) -> Result<(), Error> {
        if found != self.free.len() {
            return refuse(name, format!("{found} entries"), format!("{}, one for each free cell", self.free.len()));
        }
        Ok(())
    }
}

impl Patch {
    /// Mean of a field per free cell over the patch.
    pub fn mean(&self, field: &[f64]) -> f64 {
        self.shares.iter().map(|(cell, share)| share * field[*cell]).sum()
    }
}
