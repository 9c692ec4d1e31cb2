//! Floor plans as text.

use crate::{Boundary, CellKind, Domain, Error, Grid};
use fewbits_numerics::error::{at_least_one, positive, refuse};

/// A floor plan as text: one character per square.
///
/// | character | meaning |
/// |---|---|
/// | `.` or space | air |
/// | `#` | wall, nothing passes |
/// | `L` | wall that leaks |
/// | `A` | wall that absorbs |
/// | `I` | air whose faces on the plan's edge are an inflow |
/// | `O` | air whose faces on the plan's edge are an outflow |
/// | `a` to `z` | air of the room that a line of its own names: `k = kitchen` |
///
/// With squares of width `h`, line `r` is `y` from `r h` to `(r + 1) h` and column `i` is `x` from `i h` to `(i + 1) h`. Other parts of the
/// plan's edge are closed.
///
/// ```
/// use fewbits_diffusion::Plan;
/// let plan = Plan::parse("##########\n#...#....#\nI........O\n##########")?;
/// let domain = plan.domain(0.25, 2, 0.0)?;     // squares of .25 m, each in 2 x 2 cells
/// assert_eq!(domain.grid().counts(), [20, 8, 1]);
/// # Ok::<(), fewbits_diffusion::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// Characters of the table. All lines have the same length.
    lines: Vec<Vec<char>>,
    /// Letters of the rooms, increasing, each with its name.
    rooms: Vec<(char, String)>,
}

impl Plan {
    /// Reads a plan. Empty lines are skipped, and spaces with which every line begins are removed.
    ///
    /// # Errors
    /// If a character is not in the table or lines differ in length; [`Error::NoFreeCell`] if there is no line.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let named = |line: &&str| line.contains('=');
        let lines = || text.lines().filter(|line| !line.trim().is_empty() && !named(line));
        let indents = lines().map(|line| line.len() - line.trim_start().len());
        let indent = indents.min().ok_or(Error::NoFreeCell)?;
        let air = |character| if character == ' ' { '.' } else { character };
        let lines = lines().map(|line| line.chars().skip(indent).map(air).collect());
        let lines: Vec<Vec<char>> = lines.collect();
        let mut rooms = Vec::new();
        for line in text.lines().filter(named) {
            let (letter, name) = line.split_once('=').unwrap_or_default();
            let mut letters = letter.trim().chars();
            match (letters.next(), letters.next(), name.trim()) {
                (Some(letter @ 'a'..='z'), None, name) if !name.is_empty() => rooms.push((letter, name.to_owned())),
                _ => return refuse("plan", line.trim(), "a letter from a to z, = and the name of a room"),
            }
        }
        rooms.sort();
        if let Some(pair) = rooms.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return refuse("plan", format!("two names of {}", pair[0].0), "one name for each letter");
        }
        Self { lines, rooms }.checked()
    }

    /// Names of the rooms, in the order of their letters.
    pub fn rooms(&self) -> Vec<&str> {
        self.rooms.iter().map(|room| room.1.as_str()).collect()
    }

    /// Of each free cell of a domain of this plan the index of its room in [`rooms`](Self::rooms); `None` for other air.
    ///
    /// # Errors
    /// If the domain is not one of this plan.
    pub fn rooms_of(&self, domain: &Domain) -> Result<Vec<Option<usize>>, Error> {
        let [columns, lines, _] = domain.grid().counts();
        let split = columns / self.lines[0].len();
        if split == 0 || columns != split * self.lines[0].len() || lines != split * self.lines.len() {
            let expected = format!("a domain of {} by {} squares", self.lines[0].len(), self.lines.len());
            return refuse("domain", format!("{columns} by {lines} cells"), expected);
        }
        let room = |cell: &usize| {
            let [column, line, _] = domain.grid().place(*cell);
            let letter = self.lines[line / split][column / split];
            self.rooms.iter().position(|room| room.0 == letter)
        };
        Ok(domain.free().iter().map(room).collect())
    }

    /// The plan with another character in some squares, given by column and line.
    ///
    /// # Errors
    /// If the character is not in the table, or a square is outside the plan.
    pub fn with(mut self, character: char, squares: impl IntoIterator<Item = [usize; 2]>) -> Result<Self, Error> {
        for [column, line] in squares {
            match self.lines.get_mut(line).and_then(|line| line.get_mut(column)) {
                Some(square) => *square = character,
                None => return refuse("squares", format!("line {line}, column {column}"), "a square of the plan"),
            }
        }
        self.checked()
    }

    fn checked(self) -> Result<Self, Error> {
        let expected = self.lines[0].len();
        for (r, line) in self.lines.iter().enumerate() {
            if line.len() != expected {
                let shown = format!("{} squares in line {r}", line.len());
                return refuse("plan", shown, format!("{expected}, as in line 0"));
            }
            if let Some(column) = line
                .iter()
                .position(|c| !(".#LAIO".contains(*c) || self.rooms.iter().any(|room| room.0 == *c)))
            {
                let shown = format!("{:?} in line {r}, column {column}", line[column]);
                return refuse("plan", shown, "one of . # L A I O, or a letter that a line as `k = kitchen` names");
            }
        }
        Ok(self)
    }

    /// The domain of the plan. A square has `width` metres and `split` by `split` cells. `leak` is the leak velocity of leaking walls, m/s.
    ///
    /// # Errors
    /// If `width` is not positive, `split` is zero, `leak` is negative, or all squares are walls.
    pub fn domain(&self, width: f64, split: usize, leak: f64) -> Result<Domain, Error> {
        self.on(width, split, leak, &[])
    }

    /// The plan as a section in the first two axes, extended over `layers` layers of cells along the third, as thick as cells are wide.
    ///
    /// # Errors
    /// As [`Plan::domain`], or if `layers` is zero.
    pub fn extruded(&self, width: f64, split: usize, leak: f64, layers: usize) -> Result<Domain, Error> {
        self.on(width, split, leak, &[layers])
    }

    fn on(&self, width: f64, split: usize, leak: f64, layers: &[usize]) -> Result<Domain, Error> {
        at_least_one("split", split)?;
        let counts = [&[self.lines[0].len() * split, self.lines.len() * split], layers].concat();
        let grid = Grid::uniform(&counts, positive("width", width)? / split as f64)?;
        let cell = |cell: usize| {
            let [column, line, _] = grid.place(cell);
            match self.lines[line / split][column / split] {
                '#' => CellKind::Blocked(Boundary::Closed),
                'L' => CellKind::Blocked(Boundary::Leaking(leak)),
                'A' => CellKind::Blocked(Boundary::Absorbing),
                'I' => CellKind::Open(Boundary::Inflow),
                'O' => CellKind::Open(Boundary::Outflow),
                _ => CellKind::Free,
            }
        };
        let cells: Vec<CellKind> = (0..grid.cells()).map(cell).collect();
        Domain::new(grid, &cells, [[Boundary::Closed; 2]; 3])
    }
}
