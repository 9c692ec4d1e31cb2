//! What the sensors of a table reported at one time.

use fewbits_table::Side;

/// Index of each sensor, and what it reported; `None` if the cell is empty.
pub(super) type Reports = Vec<(usize, Option<f64>)>;

/// What a row states about one of its reports.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Qualifier {
    pub(super) accuracy: Option<f64>,
    pub(super) threshold: Option<f64>,
    /// It is a limit, as `<0.25`: the side on which the measurement is.
    pub(super) limit: Option<Side>,
}

/// All reports of one time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Instant {
    /// Seconds since the first row.
    pub(super) seconds: f64,
    /// The time as the table writes it.
    pub(super) time: String,
    /// The first row of this time.
    pub(super) row: u64,
    /// Whether it is in the table; otherwise sensors measured then and sent nothing.
    pub(super) is_row: bool,
    /// Index of each sensor, and what it reported; `None` if the cell is empty.
    pub(super) reports: Reports,
    /// One per report.
    pub(super) qualifiers: Vec<Qualifier>,
}
