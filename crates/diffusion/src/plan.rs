//! Floor plans as text.

use crate::{Boundary, Cell, Domain, Error, Grid};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, positive};

/// A floor plan: one character per square.
///
/// | character | meaning |
/// |---|---|
/// | `.` or space | air |
/// | `#` | wall, nothing passes |
/// | `L` | wall that leaks |
/// | `A` | wall that absorbs |
/// | `I` | air whose faces on the plan's edge are an inflow |
/// | `O` | air whose faces on the plan's edge are an outflow |
///
/// Line `r` is `y` from `r h` to `(r + 1) h`, column `i` is `x` from `i h` to `(i + 1) h`. The edge of the plan is closed elsewhere.
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
    columns: usize,
    /// Characters of the table, line by line.
    squares: Vec<char>,
}

impl Plan {
    /// Reads a plan: empty lines are skipped, and blanks that begin every line.
    ///
    /// # Errors
    /// If a character has no meaning or lines differ in length; [`Error::NoFreeCell`] if there is no line.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        let indent = lines
            .iter()
            .map(|line| line.len() - line.trim_start().len())
            .min()
            .unwrap_or(0);
        let (mut squares, mut columns) = (Vec::new(), None);
        for (line, text) in lines.iter().enumerate() {
            let before = squares.len();
            for (column, character) in text.chars().skip(indent).enumerate() {
                match character {
                    ' ' => squares.push('.'),
                    '.' | '#' | 'L' | 'A' | 'I' | 'O' => squares.push(character),
                    '\r' => {}
                    _ => return Err(without_meaning(character, [column, line])),
                }
            }
            let found = squares.len() - before;
            let expected = *columns.get_or_insert(found);
            if found != expected {
                let shown = format!("{found} squares in line {line}");
                return Err(ArgumentError::new("plan", shown, format!("{expected}, as in line 0")).into());
            }
        }
        let columns = columns.ok_or(Error::NoFreeCell)?;
        Ok(Self { columns, squares })
    }

    /// Reads a plain PBM picture (`P1`, width, height, then pixels; `#` begins a comment): 1 (black) is wall, 0 (white) is air. Air on
    /// the picture's edge is closed there; use [`Plan::with`] for openings.
    ///
    /// # Errors
    /// If the text is no such picture.
    pub fn from_pbm(text: &str) -> Result<Self, Error> {
        let uncommented = text.lines().map(|line| line.split('#').next().unwrap_or(""));
        let words: Vec<&str> = uncommented.flat_map(str::split_ascii_whitespace).collect();
        let size = |i: usize| words.get(i)?.parse::<usize>().ok().filter(|n| *n > 0);
        let (Some(columns), Some(lines), Some(&"P1")) = (size(1), size(2), words.first()) else {
            return Err(ArgumentError::new("picture", "no plain PBM", "`P1`, width and height").into());
        };
        let pixels = || words[3..].iter().flat_map(|word| word.chars());
        if columns.checked_mul(lines) != Some(pixels().count()) || pixels().any(|pixel| !matches!(pixel, '0' | '1')) {
            let shown = format!("{} pixels", pixels().count());
            return Err(ArgumentError::new("picture", shown, format!("{columns} times {lines} of 0 or 1")).into());
        }
        let squares = pixels().map(|pixel| if pixel == '1' { '#' } else { '.' }).collect();
        Ok(Self { columns, squares })
    }

    /// The plan with another character in some squares, given by column and line.
    ///
    /// # Errors
    /// If it has no meaning or a square is outside the plan.
    pub fn with(mut self, character: char, squares: impl IntoIterator<Item = [usize; 2]>) -> Result<Self, Error> {
        for [column, line] in squares {
            if column >= self.columns || line >= self.lines() || !".#LAIO".contains(character) {
                return Err(without_meaning(character, [column, line]));
            }
            self.squares[line * self.columns + column] = character;
        }
        Ok(self)
    }

    /// Number of squares in a line.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.squares.len() / self.columns
    }

    /// The plan's domain: squares of `width` metres in `split` by `split` cells each; leaking walls take `leak` m/s.
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
        let counts = [[self.columns * split, self.lines() * split].as_slice(), layers].concat();
        let grid = Grid::uniform(&counts, positive("width", width)? / split as f64)?;
        let cell = |cell: usize| {
            let [column, line, _] = grid.place(cell);
            match self.squares[line / split * self.columns + column / split] {
                '#' => Cell::Blocked(Boundary::Closed),
                'L' => Cell::Blocked(Boundary::Leaking(leak)),
                'A' => Cell::Blocked(Boundary::Absorbing),
                'I' => Cell::Open(Boundary::Inflow),
                'O' => Cell::Open(Boundary::Outflow),
                _ => Cell::Free,
            }
        };
        let cells: Vec<Cell> = (0..grid.cells()).map(cell).collect();
        Domain::new(grid, &cells, [[Boundary::Closed; 2]; 3])
    }
}

fn without_meaning(character: char, [column, line]: [usize; 2]) -> Error {
    let shown = format!("{character:?} in line {line}, column {column}");
    ArgumentError::new("plan", shown, "one of . # L A I O in a square of the plan").into()
}
