//! Index after index: the loop that both ends run, whatever codes an index.

use super::coder::Coder;
use fewbits_core::CodecError;
use fewbits_numerics::kernels::vectorised_narrow;

/// Largest index, either sign: sums of a few stay whole in an `i64` with room.
pub(super) const LARGEST: i64 = 1 << 46;
/// Other columns that a joint block uses.
pub const JOINT_COLUMNS: usize = 3;
/// Differences of other columns from row to row, in units of their mean size: the same numbers at both ends.
pub(super) struct Others<'a> {
    columns: Vec<(&'a [f64], f64)>,
}

impl<'a> Others<'a> {
    pub(super) fn new(others: &[&'a [f64]]) -> Self {
        let columns = others.iter().take(JOINT_COLUMNS).map(|column| {
            let sizes = column.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            let (mut sum, mut count) = (0.0, 0.0);
            for size in sizes.filter(|size| *size > 0.0 && *size < 1e100) {
                sum += size;
                count += 1.0;
            }
            (*column, if sum > 0.0 { count / sum } else { 0.0 })
        });
        Self {
            columns: columns.collect(),
        }
    }

    fn at(&self, row: usize) -> [f64; JOINT_COLUMNS] {
        let mut found = [0.0; JOINT_COLUMNS];
        for (found, (column, scale)) in found.iter_mut().zip(&self.columns) {
            let step = (column[row] - column[row - 1]) * scale;
            // What is not finite says nothing; the clamp bounds what a wild value does to least squares.
            *found = if step.is_finite() { step.clamp(-1e6, 1e6) } else { 0.0 };
        }
        found
    }
}

/// Room is made for so many rows before any is read: a damaged number of rows must not exhaust the memory.
const EXPECTED_ROWS: usize = 4096;

/// The state that both ends hold, which codes index after index.
pub(super) trait State {
    /// The index that was coded last.
    fn last(&self) -> i64;

    /// Codes the next index: `wanted` at the writer, `None` at the reader. `others`: differences of other columns. For loops under
    /// [`vectorised_narrow`].
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        wanted: Option<i64>,
        others: [f64; JOINT_COLUMNS],
    ) -> Result<i64, CodecError>;
}

/// The indices behind the first one: `wanted` at the writer, `None` at the reader, which stops where the bytes end too early. Returns all.
/// After an error nothing more can be coded.
pub(super) fn code_all<C: Coder, S: State>(
    coder: &mut C,
    state: S,
    wanted: Option<&[i64]>,
    rows: usize,
    others: Option<&Others<'_>>,
) -> Result<Vec<i64>, CodecError> {
    vectorised_narrow(
        #[inline(always)]
        move || {
            // Variables of the loop's own: what nobody else can reach stays in registers.
            let mut state = state;
            let mut own = std::mem::take(coder);
            let mut indices = Vec::with_capacity(rows.min(EXPECTED_ROWS));
            indices.push(state.last());
            for row in 1..rows {
                let steps = others.map_or([0.0; JOINT_COLUMNS], |others| others.at(row));
                indices.push(state.code(&mut own, wanted.map(|wanted| wanted[row]), steps)?);
                if own.overran() {
                    break;
                }
            }
            *coder = own;
            Ok(indices)
        },
    )
}

pub(super) fn damaged(value: i64) -> CodecError {
    CodecError::Invalid {
        what: "index",
        value: value.to_string(),
        expected: "at most 2^46 in size",
    }
}
