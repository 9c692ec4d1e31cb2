//! The loop over rows that writer and reader share, for any coder of indices.

use crate::arithmetic::Coder;
use crate::error::{ArgumentError, Damaged, ensure};
use crate::vectors::vectorised_narrow;

/// Largest size of an index: sums of a few fit into an `i64`.
pub(crate) const LARGEST: i64 = 1 << 46;
/// Largest number of other columns that a joint block uses.
pub const JOINT_COLUMNS: usize = 3;
/// Differences of other columns from row to row, divided by their mean size. Both ends compute the same numbers.
pub(crate) struct Others<'a> {
    columns: Vec<(&'a [f64], f64)>,
}

impl<'a> Others<'a> {
    /// Of these columns, if there are any.
    ///
    /// # Errors
    /// If one has another number of rows.
    pub(crate) fn new(others: &[&'a [f64]], rows: usize) -> Result<Option<Self>, ArgumentError> {
        for other in others {
            ensure!(other.len() == rows, "others", other.len(), format!("{rows} rows"));
        }
        let columns = others.iter().take(JOINT_COLUMNS).map(|column| {
            let sizes = column.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            let (mut sum, mut count) = (0.0, 0.0);
            for size in sizes.filter(|size| *size > 0.0 && *size < 1e100) {
                sum += size;
                count += 1.0;
            }
            (*column, if sum > 0.0 { count / sum } else { 0.0 })
        });
        let columns: Vec<_> = columns.collect();
        Ok((!columns.is_empty()).then_some(Self { columns }))
    }

    fn at(&self, row: usize) -> [f64; JOINT_COLUMNS] {
        let mut found = [0.0; JOINT_COLUMNS];
        for (found, (column, scale)) in found.iter_mut().zip(&self.columns) {
            let step = (column[row] - column[row - 1]) * scale;
            // A value that is not finite counts as no difference. The clamp limits the effect of an outlier on least squares.
            *found = if step.is_finite() { step.clamp(-1e6, 1e6) } else { 0.0 };
        }
        found
    }
}

/// Largest number of rows for which memory is reserved in advance: a damaged number of rows must not exhaust memory.
const EXPECTED_ROWS: usize = 4096;

/// The state of a coder of indices, the same at writer and reader.
pub(crate) trait State {
    /// The index that was coded last.
    fn last(&self) -> i64;

    /// Codes the next index: `wanted` at the writer, `None` at the reader. `others`: differences of other columns. For loops under
    /// [`vectorised_narrow`].
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<i64>,
        others: [f64; JOINT_COLUMNS],
    ) -> Result<i64, Damaged>;

    /// Updates the state with the index that was coded, of at most [`LARGEST`] in size.
    fn learn(&mut self, index: i64);
}

/// Codes the indices after the first one: `wanted` at the writer, `None` at the reader, which stops if the bytes end too early. Returns all
/// indices. After an error the coder must not be used.
pub(crate) fn code_all<C: Coder, S: State>(
    coder: &mut C,
    state: S,
    wanted: Option<&[i64]>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, Damaged> {
    vectorised_narrow(
        #[inline(always)]
        move || {
            // A local variable that nothing else can reach stays in registers.
            let mut state = state;
            let mut own = std::mem::take(coder);
            let mut indices = Vec::with_capacity(rows.min(EXPECTED_ROWS));
            indices.push(state.last());
            for row in 1..rows {
                let steps = others.map_or([0.0; JOINT_COLUMNS], |others| others.at(row));
                let index = state.code(&mut own, wanted.map(|wanted| wanted[row]), steps)?;
                // Larger ones, which only damaged bytes contain, could overflow the sums of the state.
                ensure!(index.abs() <= LARGEST, damaged(index));
                state.learn(index);
                indices.push(index);
                if own.overran() {
                    break;
                }
            }
            *coder = own;
            Ok(indices)
        },
    )
}

pub(crate) fn damaged(value: i64) -> Damaged {
    Damaged::new("index", value, "at most 2^46 in size")
}
