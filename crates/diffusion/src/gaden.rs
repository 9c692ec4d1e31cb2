//! Rooms, winds and concentrations of the simulator GADEN, read from its text files: no ROS is needed.

use crate::{Boundary, CellKind, Divergence, Domain, Error, Flow, Grid};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive, refuse};

/// A room as `OccupancyGrid3D.csv` states it: cubic cells that are free, solid or an outlet.
///
/// The file has four lines of a name and numbers (least and greatest coordinates in m, numbers of cells, width of a cell), then for each
/// layer of z one line per x with one number per y, and a line `;` after each layer. 0 is free, 1 solid, 2 an outlet.
///
/// ```
/// use fewbits_diffusion::gaden::{Room, Table};
/// let room = Room::parse(
///     "#env_min(m) -1 0 0\n#env_max(m) 1 1 0.5\n#num_cells 4 2 1\n#cell_size(m) 0.5\n2 2\n0 0\n0 1\n2 2\n;\n",
/// )?;
/// let domain = room.domain()?;
/// assert_eq!(domain.free().len(), 7);
/// let wind = Table::parse("Points:0,Points:1,Points:2,U:0,U:1,U:2\n-0.75,0.25,0.25,0.1,0,0\n-0.25,0.25,0.25,0.1,0,0\n")?;
/// let flow = room.wind(&domain, &wind)?;
/// assert_eq!(flow.velocities(&domain).len(), 7);
/// # Ok::<(), fewbits_diffusion::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// The lowest corner, m.
    corner: [f64; 3],
    counts: [usize; 3],
    width: f64,
    /// In the order of a [`Grid`].
    cells: Vec<CellKind>,
}

/// The numbers of a line behind its name.
fn header<const N: usize>(line: Option<&str>, name: &'static str) -> Result<[f64; N], Error> {
    let words: Vec<&str> = line.unwrap_or_default().split_whitespace().skip(1).collect();
    let numbers: Vec<f64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let found: Result<[f64; N], _> = numbers.try_into();
    match found {
        Ok(numbers) if words.len() == N && numbers.iter().all(|x| x.is_finite()) => Ok(numbers),
        _ => refuse(name, format!("`{}`", line.unwrap_or("no line")), format!("a name and {N} numbers")),
    }
}

/// The entries of all cells in the order of a [`Grid`]: for each layer of z one line per x with one word per y, then a line `;`.
fn layers<'a, T: Clone>(
    lines: impl Iterator<Item = &'a str>,
    counts: [usize; 3],
    name: &'static str,
    expected: &str,
    read: impl Fn(&str) -> Option<T>,
) -> Result<Vec<T>, Error> {
    let mut words = Vec::new();
    let (mut column, mut layer) = (0, 0);
    for line in lines {
        if line == ";" {
            (column, layer) = (0, layer + 1);
            continue;
        }
        let line: Vec<&str> = line.split_whitespace().collect();
        if column >= counts[0] || layer >= counts[2] || line.len() != counts[1] {
            let found = format!("{} numbers in line {column} of layer {layer}", line.len());
            let expected = format!("{} numbers in each of {} lines of {} layers", counts[1], counts[0], counts[2]);
            return refuse(name, found, expected);
        }
        for (row, word) in line.into_iter().enumerate() {
            match read(word) {
                Some(entry) => words.push((column + counts[0] * (row + counts[1] * layer), entry)),
                None => return refuse(name, format!("`{word}` in line {column} of layer {layer}"), expected),
            }
        }
        column += 1;
    }
    // Each line has its own place, so as many entries as cells are one for each.
    let whole = counts.iter().try_fold(1_usize, |n, count| n.checked_mul(*count));
    if whole != Some(words.len()) {
        return refuse(
            name,
            words.len(),
            format!("{} x {} x {}, the numbers of cells", counts[0], counts[1], counts[2]),
        );
    }
    words.sort_unstable_by_key(|(cell, _)| *cell);
    Ok(words.into_iter().map(|(_, entry)| entry).collect())
}

/// Largest number of cells along an axis.
const LONGEST: f64 = 100_000.0;

impl Room {
    /// The room of a file's text.
    ///
    /// # Errors
    /// If a line of the head or of the cells is not as stated above; the message names the line.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        let corner = header::<3>(lines.next(), "env_min")?;
        let top = header::<3>(lines.next(), "env_max")?;
        let counts = header::<3>(lines.next(), "num_cells")?;
        let [width] = header::<1>(lines.next(), "cell_size")?;
        positive("cell_size", width)?;
        if let Some(bad) = counts
            .iter()
            .find(|n| !(**n >= 1.0 && **n <= LONGEST && n.fract() == 0.0))
        {
            return refuse("num_cells", bad, "numbers of cells from 1 to 100000");
        }
        let counts = counts.map(|n| n as usize);
        for axis in 0..3 {
            // The last cell may stand over the end.
            let extent = counts[axis] as f64 * width;
            if (top[axis] - corner[axis] - extent).abs() > width * 1.001 {
                let expected = format!("{extent} m, as many cells of {width} m");
                return refuse("env_max", format!("{} m along axis {axis}", top[axis] - corner[axis]), expected);
            }
        }
        let cells = layers(lines, counts, "cells", "0 (free), 1 (solid) or 2 (outlet)", |word| match word {
            "0" => Some(CellKind::Free),
            "1" => Some(CellKind::Blocked(Boundary::Closed)),
            "2" => Some(CellKind::Open(Boundary::Outflow)),
            _ => None,
        })?;
        Ok(Self {
            corner,
            counts,
            width,
            cells,
        })
    }

    /// A place of the file in the coordinates of the domain, which begin at the lowest corner, m.
    pub fn place(&self, point: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| point[axis] - self.corner[axis])
    }

    /// The domain of all layers. Solid cells and the sides are closed; air passes out at outlets on the sides in x and y. An outlet
    /// elsewhere, as in a room whose outer walls are cells, is no air: what reaches its faces has left.
    ///
    /// # Errors
    /// If no cell is free.
    pub fn domain(&self) -> Result<Domain, Error> {
        let grid = Grid::uniform(&self.counts, self.width)?;
        let is_on_a_side = |cell: usize| {
            let place = grid.place(cell);
            (0..2).any(|axis| place[axis] == 0 || place[axis] + 1 == self.counts[axis])
        };
        let cells: Vec<CellKind> = self
            .cells
            .iter()
            .enumerate()
            .map(|(at, cell)| match cell {
                CellKind::Open(boundary) if !is_on_a_side(at) => CellKind::Blocked(*boundary),
                other => *other,
            })
            .collect();
        Domain::new(grid, &cells, [[Boundary::Closed; 2]; 3])
    }

    /// The mean of a table's values in each free cell of the domain, `None` where the table has no row. Rows of other cells are left out.
    fn means<const N: usize>(
        &self,
        domain: &Domain,
        table: &Table,
        values: [&str; N],
    ) -> Result<Vec<Option<[f64; N]>>, Error> {
        let points = table.any_columns([["Points:0", "x"], ["Points:1", "y"], ["Points:2", "z"]])?;
        let values = table.columns(values)?;
        let mut numbers = vec![None; domain.grid().cells()];
        for (number, cell) in domain.free().iter().enumerate() {
            numbers[*cell] = Some(number);
        }
        let mut sums = vec![([0.0; N], 0_u32); domain.free().len()];
        for row in &table.rows {
            let point = self.place(points.map(|column| row[column]));
            let Some(number) = domain.grid().cell_at(point).and_then(|cell| numbers[cell]) else {
                continue;
            };
            let (sum, count) = &mut sums[number];
            sum.iter_mut().zip(values).for_each(|(sum, column)| *sum += row[column]);
            *count += 1;
        }
        let mean = |(sum, count): ([f64; N], u32)| (count > 0).then(|| sum.map(|x| x / f64::from(count)));
        Ok(sums.into_iter().map(mean).collect())
    }

    /// The wind of a `wind_at_cell_centers` file (columns `U:0..2` and `Points:0..2`), m/s: the mean of the rows in each free cell, still air
    /// where there is none, freed of divergence.
    ///
    /// # Errors
    /// If a column is missing, or as [`Flow::from_cells`].
    pub fn wind(&self, domain: &Domain, table: &Table) -> Result<Flow, Error> {
        let means = self.means(domain, table, ["U:0", "U:1", "U:2"])?;
        let velocities: Vec<[f64; 3]> = means.into_iter().map(|mean| mean.unwrap_or_default()).collect();
        Flow::from_cells(domain, &velocities, Divergence::Project)
    }

    /// The wind of three texts, one per component (`wind_..._U`, `_V` and `_W`), each with one number per cell in the lines and layers of
    /// the room, m/s: the values in the free cells, freed of divergence.
    ///
    /// # Errors
    /// If a text has other lines than the room or an entry that is no finite number, or as [`Flow::from_cells`].
    pub fn wind_by_components(&self, domain: &Domain, components: [&str; 3]) -> Result<Flow, Error> {
        let mut velocities = vec![[0.0; 3]; domain.free().len()];
        for (axis, (text, name)) in components.into_iter().zip(["U", "V", "W"]).enumerate() {
            let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
            let number = |word: &str| word.parse::<f64>().ok().filter(|x| x.is_finite());
            let values = layers(lines, self.counts, name, "a finite number", number)?;
            for (velocity, cell) in velocities.iter_mut().zip(domain.free()) {
                velocity[axis] = values[*cell];
            }
        }
        Flow::from_cells(domain, &velocities, Divergence::Project)
    }

    /// Time-averaged concentrations: of tables of several times, the mean of the column `value` in each free cell over the tables that
    /// have rows there. `None` where none has. Places are in the columns `x`, `y`, `z` or `Points:0..2`.
    ///
    /// # Errors
    /// If there is no table, or a column is missing.
    pub fn averaged(&self, domain: &Domain, tables: &[Table], value: &str) -> Result<Vec<Option<f64>>, Error> {
        if tables.is_empty() {
            return refuse("tables", 0, "at least one");
        }
        let mut sums = vec![(0.0, 0_u32); domain.free().len()];
        for table in tables {
            for (sum, mean) in sums.iter_mut().zip(self.means(domain, table, [value])?) {
                if let Some([mean]) = mean {
                    *sum = (sum.0 + mean, sum.1 + 1);
                }
            }
        }
        let mean = |(sum, count): (f64, u32)| (count > 0).then(|| sum / f64::from(count));
        Ok(sums.into_iter().map(mean).collect())
    }
}

/// A table of numbers with named columns, separated by commas, semicolons, tabs or blanks. Lines that begin with `#` are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// The table of a text whose first line has the names of the columns.
    ///
    /// # Errors
    /// If there is no line, a line has another number of entries than the first, or an entry is no finite number; the message names the line.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let separated = |line: &str| -> Vec<String> {
            let by = [',', ';', '\t'].into_iter().find(|by| line.contains(*by));
            let clean = |word: &str| word.trim().trim_matches('"').to_owned();
            match by {
                Some(by) => line.trim().trim_end_matches(by).split(by).map(clean).collect(),
                None => line.split_whitespace().map(clean).collect(),
            }
        };
        let lines = text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let mut lines = lines.map(|(at, line)| (at + 1, separated(line)));
        let Some((_, names)) = lines.next() else {
            return refuse("table", "no line", "a line of names");
        };
        let mut rows = Vec::new();
        for (at, words) in lines {
            let bad = |value: String, expected: String| Error::from(ArgumentError::new("table", value, expected));
            if words.len() != names.len() {
                return Err(bad(format!("{} entries in line {at}", words.len()), format!("{}", names.len())));
            }
            let number = |word: &String| match word.parse::<f64>() {
                Ok(x) => finite("entry", x).map_err(Error::from),
                Err(_) => Err(bad(format!("`{word}` in line {at}"), "a number".to_owned())),
            };
            rows.push(words.iter().map(number).collect::<Result<Vec<f64>, Error>>()?);
        }
        Ok(Self { names, rows })
    }

    fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], Error> {
        self.any_columns(names.map(|name| [name, name]))
    }

    /// The column of either name, for each pair of names.
    fn any_columns<const N: usize>(&self, names: [[&str; 2]; N]) -> Result<[usize; N], Error> {
        let mut found = [0; N];
        for (found, either) in found.iter_mut().zip(names) {
            match self.names.iter().position(|name| either.contains(&name.as_str())) {
                Some(column) => *found = column,
                None => return refuse("columns", self.names.join(", "), format!("a column `{}`", either[0])),
            }
        }
        Ok(found)
    }
}
