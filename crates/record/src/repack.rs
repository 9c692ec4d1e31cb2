//! A recording under wider bounds, for older data that may be less exact.
//!
//! The rows of the new recording are the restored ones of the old, so their distance from the original samples is at most the sum of both
//! bounds. The new header states both ([`Column::earlier_bound`]).

use crate::bound::{Bound, half_unit};
use crate::column::Column;
use crate::error::Error;
use crate::playback::Playback;
use crate::ranges::{self, Ends};
use crate::recorder::Recorder;
use crate::schema::Schema;
use fewbits_block_codec::{Effort, ensure};
use std::io::{Read, Seek, Write};

/// What a pass over a recording finds for a column.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    ends: Ends,
    /// The largest bound of a share.
    share_bound: f64,
}

/// The distance that a bound allows, in units of the column. `None` if it depends on the value.
fn size(bound: Bound, found: Found, range: Option<f64>) -> Option<f64> {
    match bound {
        Bound::Lossless => Some(0.0),
        Bound::Absolute(delta) => Some(delta),
        Bound::Decimals(places) => Some(half_unit(places)),
        Bound::ShareOfRange(share) => {
            let range = range.or_else(|| found.ends.map(|(low, high)| high - low));
            Some(share * range.unwrap_or(0.0))
        }
        Bound::Relative { .. } => None,
    }
}

/// The distance of this recording's values from the samples it was made of, without earlier recordings.
fn held(column: &Column, found: Found) -> Option<f64> {
    match column.bound {
        Bound::ShareOfRange(_) => Some(found.share_bound),
        bound => size(bound, found, None),
    }
}

fn is_share(bound: Bound) -> bool {
    matches!(bound, Bound::ShareOfRange(_))
}

/// A column under another bound, and whether that is wider than its present one. If it is not, the values return without loss.
fn widened(column: &Column, asked: Option<Bound>, found: Found) -> Result<(Column, bool), Error> {
    // Between two whole numbers there is nothing that a code could stand for.
    let asked = asked.filter(|_| column.integers.is_none());
    let own = held(column, found);
    let is_wider = match (asked, own) {
        (None | Some(Bound::Lossless), _) => false,
        // Nothing can be added to it: it is refused below unless the values are those of the original samples.
        (Some(Bound::Relative { .. }), _) => true,
        // The range of restored values differs from that of the original ones.
        (Some(Bound::ShareOfRange(share)), _) if is_share(column.bound) => {
            size(Bound::ShareOfRange(share), found, Some(1.0)) > size(column.bound, found, Some(1.0))
        }
        (Some(bound), Some(own)) => size(bound, found, column.period).is_some_and(|size| size > own),
        (Some(_), None) => false,
    };
    let Some(own) = own else {
        // Nothing can be added to a bound that depends on the value.
        let is_kept = asked.is_none_or(|bound| bound == Bound::Lossless || bound == column.bound);
        let expected = "no bound for a column whose bound is relative to each value";
        ensure!(is_kept, "bound", format!("{asked:?} of `{}`", column.name), expected);
        return Ok((column.clone(), false));
    };
    // Both terms may be rounded down.
    let earlier = match own + column.earlier {
        0.0 => 0.0,
        _ if own == 0.0 => column.earlier,
        _ if column.earlier == 0.0 => own,
        sum => sum.next_up(),
    };
    let bound = match asked.filter(|_| is_wider) {
        None => Bound::Lossless,
        // Restored values are not the decimals of the original ones.
        Some(Bound::Decimals(places)) if earlier > 0.0 => Bound::Absolute(half_unit(places)),
        Some(bound) => bound,
    };
    let mut new = Column {
        bound: bound.checked()?,
        range: None,
        earlier: 0.0,
        ..column.clone()
    };
    if let (Bound::ShareOfRange(_), Some((low, high))) = (bound, found.ends) {
        new = new.with_range(low, high)?;
    }
    if let Some(period) = column.period.filter(|_| bound != Bound::Lossless) {
        new = new.with_period(period)?;
    }
    Ok((new.with_earlier_bound(earlier)?, is_wider))
}

impl<R: Read + Seek> Playback<R> {
    /// The schema of this recording under other bounds, one per column; `None` leaves a column as it is. The new bounds refer to the
    /// restored values; those of this recording are added to them ([`Column::earlier_bound`]). A bound that is not wider than the
    /// column's present one leaves the column as it is, so that a second call with the same bounds changes nothing: the result is `None`
    /// if no column changes. Blocks have the default number of rows.
    ///
    /// # Errors
    /// If there is not one bound per column, one is out of range or cannot be added to the present one (of a [`Bound::Relative`]), or a
    /// part of the recording is damaged.
    pub fn widened(&mut self, bounds: &[Option<Bound>]) -> Result<Option<Schema>, Error> {
        let schema = self.header.schema.clone();
        let columns = schema.columns.len();
        ensure!(bounds.len() == columns, "bounds", bounds.len(), format!("{columns} bounds, one per column"));
        let mut found = vec![Found::default(); columns];
        if bounds.iter().flatten().any(|bound| is_share(*bound))
            || schema.columns.iter().any(|column| is_share(column.bound))
        {
            let chosen = std::mem::replace(&mut self.chosen, (0..columns).collect());
            let all: Result<(), Error> = self.blocks().try_for_each(|block| {
                let block = block?;
                for (i, found) in found.iter_mut().enumerate() {
                    found.ends = ranges::with(found.ends, &block.columns[i]);
                    found.share_bound = found.share_bound.max(block.share_bounds[i].unwrap_or(0.0));
                }
                Ok(())
            });
            self.chosen = chosen;
            all?;
        }
        let asked = schema.columns.iter().zip(bounds).zip(&found);
        let new: Vec<(Column, bool)> = asked
            .map(|((column, bound), found)| widened(column, *bound, *found))
            .collect::<Result<_, Error>>()?;
        if !new.iter().any(|(_, is_wider)| *is_wider) {
            return Ok(None);
        }
        let columns = new.into_iter().map(|(column, _)| column).collect();
        let wider = Schema::new(columns, schema.time)?.with_time_name(schema.time_name())?;
        Ok(Some(wider.with_restored_ticks()))
    }

    /// Writes all rows as a new recording with the schema of [`widened`](Self::widened), and returns the sink. Only a whole recording is
    /// repacked: what is damaged would be lost for good.
    ///
    /// # Errors
    /// If a part of the recording is damaged or missing, or reading or writing fails. The sink then has the beginning of a recording.
    pub fn repack<W: Write>(&mut self, schema: Schema, writer: W, effort: Effort) -> Result<W, Error> {
        let columns = self.header.schema.columns.len();
        self.chosen = (0..columns).collect();
        let mut recorder = Recorder::new(writer, schema).with_effort(effort);
        for block in self.blocks() {
            let block = block?;
            recorder.push_columns(&block.ticks, &block.columns)?;
        }
        recorder.finish()
    }
}
