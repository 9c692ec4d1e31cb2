//! What the sensors of a table reported at one time.

use fewbits_table::Side;

/// Index of each sensor, and what it reported; `None` if the cell is empty.
pub(crate) type Reports = Vec<(usize, Option<f64>)>;

/// What a row states about one of its reports.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Qualifier {
    /// Standard deviation of the value's error.
    pub accuracy: Option<f64>,
    /// Threshold of a bit.
    pub threshold: Option<f64>,
    /// It is a limit, as `<0.25`: the side on which the measurement is.
    pub limit: Option<Side>,
}

/// All reports of one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Instant {
    /// Seconds since the first row.
    pub seconds: f64,
    /// The time as messages write it.
    pub time: String,
    /// The first row of this time.
    pub row: u64,
    /// Whether it is in the table; otherwise sensors measured then and sent nothing.
    pub is_row: bool,
    /// Index of each sensor, and what it reported; `None` if the cell is empty.
    pub reports: Vec<(usize, Option<f64>)>,
    /// One per report.
    pub qualifiers: Vec<Qualifier>,
}

impl Instant {
    /// A row with a cell for each sensor in their order, `None` of one that is empty. `seconds`: since the first row.
    pub fn new(row: u64, seconds: f64, cells: &[Option<f64>]) -> Self {
        Self {
            seconds,
            time: seconds.to_string(),
            row,
            is_row: true,
            reports: cells.iter().copied().enumerate().collect(),
            qualifiers: vec![Qualifier::default(); cells.len()],
        }
    }

    /// Sensors and their values, without those that are limits.
    pub(crate) fn values(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let is_limit = |i: usize| {
            self.qualifiers
                .get(i)
                .is_some_and(|qualifier| qualifier.limit.is_some())
        };
        let cells = self.reports.iter().enumerate().filter(move |(i, _)| !is_limit(*i));
        cells.filter_map(|(_, (sensor, cell))| Some((*sensor, cell.filter(|cell| cell.is_finite())?)))
    }
}
