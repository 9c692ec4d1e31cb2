//! A recording against a table of which one lacks rows: rows with the same time are compared.

use super::{Rows, Verdict};
use crate::error::Error;
use crate::source::{Source, Watch, report};
use fewbits_record::{Block, Column, Playback, TimeBase};
use std::io::{Read, Seek};

/// Compares rows whose times differ by the tolerance at most, and counts the others: [`Verdict::missing_rows`] only the table has,
/// [`Verdict::extra_rows`] only the recording. Damaged blocks are left out. Where several rows have one time and one side has fewer of them,
/// those are compared whose cells agree.
///
/// Arguments as for [`verify`](super::verify). The result is `None` if one of both has no times, or times that go back.
///
/// # Errors
/// As for [`verify`](super::verify).
pub fn verify_by_time<R: Read + Seek>(
    playback: &mut Playback<R>,
    source: &mut dyn Source,
    matches: &[usize],
    watch: &mut Watch<'_>,
) -> Result<Option<Verdict>, Error> {
    let schema = playback.schema().clone();
    if schema.time() == TimeBase::Numbered {
        return Ok(None);
    }
    let (mut verdict, columns) = Verdict::new(schema.columns(), matches)?;
    verdict.times_checked = true;
    let mut merge = Merge {
        rows: Rows {
            source,
            columns: matches.len(),
            batch: crate::source::Batch::default(),
            next: 0,
        },
        columns: &columns,
        matches,
        is_held: false,
        tolerance: schema.time().tolerance().try_into().unwrap_or(i64::MAX),
        last: (i64::MIN, i64::MIN),
        counts: vec![0; matches.len()],
    };
    for block in playback.blocks() {
        match block {
            Ok(block) if merge.compare(&mut verdict, &block)?.is_none() => return Ok(None),
            Ok(_) => {}
            Err(error @ fewbits_record::Error::Block { .. }) => {
                verdict.damage.get_or_insert_with(|| error.to_string());
            }
            Err(error) => return Err(error.into()),
        }
        report(watch, verdict.rows)?;
    }
    while merge.hold()? {
        if merge.own_tick().is_none() {
            return Ok(None);
        }
        verdict.missing_rows += 1;
        merge.is_held = false;
    }
    verdict.judge();
    Ok(Some(verdict))
}

/// The table's rows beside those of the recording.
struct Merge<'a> {
    rows: Rows<'a>,
    columns: &'a [&'a Column],
    matches: &'a [usize],
    /// Whether the table's row was not compared yet.
    is_held: bool,
    tolerance: i64,
    /// Last ticks of the table and of the recording.
    last: (i64, i64),
    counts: Vec<u64>,
}

impl Merge<'_> {
    /// Moves to a row that was not compared; `false` after the last.
    fn hold(&mut self) -> Result<bool, Error> {
        self.is_held = self.is_held || self.rows.advance()?;
        Ok(self.is_held)
    }

    /// Tick of the row; `None` if there are no times, or it is before the last one.
    fn own_tick(&mut self) -> Option<i64> {
        let tick = self.rows.batch.ticks.as_ref()?[self.rows.next - 1];
        let is_ordered = tick >= self.last.0;
        self.last.0 = tick;
        is_ordered.then_some(tick)
    }

    /// Compares the rows of a block; `None` if times go back.
    fn compare(&mut self, verdict: &mut Verdict, block: &Block) -> Result<Option<()>, Error> {
        for (row, tick) in block.ticks.iter().copied().enumerate() {
            // Within the tolerance ticks may have changed places.
            if tick.saturating_add(self.tolerance).saturating_add(self.tolerance) < self.last.1 {
                return Ok(None);
            }
            self.last.1 = tick;
            loop {
                if !self.hold()? {
                    verdict.extra_rows += (block.ticks.len() - row) as u64;
                    return Ok(Some(()));
                }
                let Some(own) = self.own_tick() else {
                    return Ok(None);
                };
                if own > tick.saturating_add(self.tolerance) {
                    verdict.extra_rows += 1;
                    break;
                }
                let is_earlier = own < tick.saturating_sub(self.tolerance);
                let (of_table, of_block) = match is_earlier || self.keeps(block, row) {
                    true => (0, 0),
                    false => {
                        (self.rows.ahead(own)?, block.ticks[row..].iter().take_while(|next| **next == tick).count() - 1)
                    }
                };
                if is_earlier || of_table > of_block {
                    verdict.missing_rows += 1;
                    self.is_held = false;
                    continue;
                }
                if of_block > of_table {
                    verdict.extra_rows += 1;
                    break;
                }
                verdict.rows += 1;
                let original = (&self.rows.batch, self.rows.next - 1);
                verdict.compare_row((block, row), original, self.columns, self.matches, &mut self.counts);
                self.is_held = false;
                break;
            }
        }
        Ok(Some(()))
    }

    /// Whether all cells of the table's row agree with a row of the block.
    fn keeps(&self, block: &Block, row: usize) -> bool {
        let original = self.rows.next - 1;
        let mut columns = self.columns.iter().zip(self.matches).zip(&self.rows.batch.columns);
        columns.all(|((column, index), cells)| {
            column.keeps(cells[original], block.columns[*index][row], block.share_bounds[*index])
        })
    }
}

impl Rows<'_> {
    /// Number of rows behind the present one that have its tick.
    fn ahead(&mut self, tick: i64) -> Result<usize, Error> {
        loop {
            let ticks = self.batch.ticks.as_deref().unwrap_or_default();
            let ahead = ticks[self.next..].iter().take_while(|next| **next == tick).count();
            if self.next + ahead < ticks.len() {
                return Ok(ahead);
            }
            let Some(more) = self.source.next_batch().map_err(Error::Source)? else {
                return Ok(ahead);
            };
            more.check(self.columns)?;
            let Some(more_ticks) = more.ticks else { return Ok(ahead) };
            let gone = self.next - 1;
            let ticks = self.batch.ticks.get_or_insert_default();
            ticks.drain(..gone);
            ticks.extend(more_ticks);
            for (column, cells) in self.batch.columns.iter_mut().zip(more.columns) {
                column.drain(..gone);
                column.extend(cells);
            }
            self.next = 1;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::source::{Batch, Columns};
    use fewbits_record::{Bound, Recorder, Schema, TimeFormat};
    use std::io::Cursor;
    use std::ops::ControlFlow;

    /// Of the times `0, 0, 0, 0, 10, 10, ...`, with a value for each row, the rows for which `is_kept`.
    fn rows(number: i64, is_kept: impl Fn(i64) -> bool) -> Batch {
        let kept: Vec<i64> = (0..number).filter(|i| is_kept(*i)).collect();
        Batch {
            ticks: Some(kept.iter().map(|i| i / 4 * 10).collect()),
            columns: vec![kept.iter().map(|i| Some((i * i % 97) as f64)).collect()],
        }
    }

    fn verdict(recorded: Batch, table: Batch) -> Option<Verdict> {
        let column = Column::new("a", Bound::Absolute(0.25)).unwrap();
        let time = TimeBase::Clock {
            decimals: 0,
            tolerance: 0,
            format: TimeFormat::Seconds,
        };
        let schema = Schema::new(vec![column], time).unwrap();
        let mut recorder = Recorder::new(Vec::new(), schema.with_rows_per_block(1000).unwrap());
        let mut go = |_| ControlFlow::Continue(());
        crate::pack::fill(&mut Columns::new(recorded), &mut recorder, &mut go).unwrap();
        let mut playback = Playback::new(Cursor::new(recorder.finish().unwrap())).unwrap();
        verify_by_time(&mut playback, &mut Columns::new(table), &[0], &mut go).unwrap()
    }

    #[test]
    fn lost_rows_are_counted_and_the_others_compared() {
        let all = || rows(900, |_| true);
        let is_kept = |i| !(101..=117).contains(&i) && i % 50 != 7;
        let lost = (0..900).filter(|i| !is_kept(*i)).count() as u64;
        let found = verdict(rows(900, is_kept), all()).unwrap();
        assert_eq!((found.rows, found.missing_rows, found.extra_rows), (900 - lost, lost, 0));
        assert!(!found.holds && found.columns[0].failed == 0, "{found:?}");
        let found = verdict(all(), rows(900, is_kept)).unwrap();
        assert_eq!(
            (found.rows, found.missing_rows, found.extra_rows, found.columns[0].failed),
            (900 - lost, 0, lost, 0)
        );
        assert!(verdict(all(), all()).unwrap().holds);
    }

    #[test]
    fn wrong_cells_are_found_behind_a_lost_row() {
        let mut wrong = rows(900, |i| i != 5);
        wrong.columns[0][600] = Some(-5.0);
        let found = verdict(wrong, rows(900, |_| true)).unwrap();
        assert!(found.columns[0].failed > 0 || found.extra_rows > 0, "{found:?}");
    }

    #[test]
    fn times_that_go_back_are_not_compared() {
        let mut back = rows(900, |_| true);
        back.ticks.as_mut().unwrap()[500] = 3;
        assert_eq!(verdict(back.clone(), rows(900, |_| true)), None);
        assert_eq!(verdict(rows(900, |_| true), back), None);
    }
}
