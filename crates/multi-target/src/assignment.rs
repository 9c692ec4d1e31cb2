//! The assignment of rows to columns of least total cost.

use fewbits_core::Error;
use fewbits_numerics::error::{all_finite, entries};

/// The column of each row, all different, such that the sum of costs is least. `costs[i][j]` is the cost of row `i` at column `j`; there are
/// at least as many columns as rows. Shortest augmenting paths (Jonker and Volgenant 1987), cubic in the number of columns.
///
/// # Errors
/// If rows differ in length, there are fewer columns than rows, or a cost is not finite.
pub fn assign(costs: &[Vec<f64>]) -> Result<Vec<usize>, Error> {
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    for row in costs {
        entries("costs", row.len(), columns)?;
        all_finite("costs", row)?;
    }
    if columns < rows {
        return fewbits_numerics::error::refuse("costs", format!("{columns} columns"), format!("{rows} or more"));
    }
    // Duals of rows and columns; `owner[j]` is the row at column `j`. Column `columns` stands for the row that is being placed.
    let (mut of_row, mut of_column) = (vec![0.0; rows], vec![0.0; columns + 1]);
    let mut owner: Vec<Option<usize>> = vec![None; columns + 1];
    for row in 0..rows {
        owner[columns] = Some(row);
        let mut at = columns;
        let (mut least, mut before) = (vec![f64::INFINITY; columns], vec![columns; columns]);
        let mut done = vec![false; columns + 1];
        while let Some(i) = owner[at] {
            done[at] = true;
            let (mut step, mut next) = (f64::INFINITY, columns);
            for j in (0..columns).filter(|j| !done[*j]) {
                let reduced = costs[i][j] - of_row[i] - of_column[j];
                if reduced < least[j] {
                    (least[j], before[j]) = (reduced, at);
                }
                if least[j] < step {
                    (step, next) = (least[j], j);
                }
            }
            for j in 0..=columns {
                match owner[j].filter(|_| done[j]) {
                    Some(i) => {
                        of_row[i] += step;
                        of_column[j] -= step;
                    }
                    None if j < columns => least[j] -= step,
                    None => {}
                }
            }
            at = next;
        }
        // The path back to the new row, each column taking the row before it.
        while at != columns {
            owner[at] = owner[before[at]];
            at = before[at];
        }
    }
    let mut found = vec![0; rows];
    for (j, row) in owner[..columns].iter().enumerate() {
        if let Some(row) = row {
            found[*row] = j;
        }
    }
    Ok(found)
}
