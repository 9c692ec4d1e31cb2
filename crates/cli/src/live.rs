//! Rows of a source that goes on: read by a thread of its own, written out before a deadline, at an error and at a signal.
//!
//! Rows that were read are never lost to what follows them. If a line is refused, or a signal asks the command to end, the rows before
//! are written out first. If they do not fit the storage, it is said how many do.

use crate::error::Error;
use crate::input::{Row, Table};
use crate::say::say;
use crate::{interrupt, target};
use fewbits_record::{Recorder, Schema, TimeBase};
use std::fs::File;
use std::io::{Seek, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Number of rows that are read ahead.
const AHEAD: usize = 1024;
/// After a signal, rows are taken until none has come for this time: what the source had written before is in a pipe still.
const QUIET: Duration = Duration::from_millis(200);
/// After a signal, rows are taken for at most this time.
const MAX_AFTER_SIGNAL: Duration = Duration::from_secs(2);

/// Where rows go.
pub(crate) trait RowSink {
    /// Takes one row in. `None`: rows are numbered.
    fn push(&mut self, tick: Option<i64>, cells: &[Option<f64>]) -> Result<(), Error>;

    /// Writes all rows out.
    fn flush(&mut self) -> Result<(), Error>;

    /// Number of rows that were not written out yet.
    fn waiting(&self) -> usize;
}

enum Event {
    Row(Row),
    /// The table has ended, or a row of it was refused.
    Ended(Option<Error>),
    /// A signal came.
    Signal,
}

/// Rows of a run, and what ended it if that was an error.
pub(crate) struct Ended {
    pub(crate) rows: u64,
    pub(crate) error: Option<Error>,
}

/// Reads all rows, in a thread: reading blocks and would delay the deadline. The thread ends with the process.
fn read(mut table: Table, time: TimeBase, sender: &SyncSender<Event>) {
    loop {
        let event = match table.next(time) {
            Ok(Some(row)) => Event::Row(row),
            Ok(None) => Event::Ended(None),
            Err(error) => Event::Ended(Some(error)),
        };
        let is_last = matches!(event, Event::Ended(_));
        if sender.send(event).is_err() || is_last {
            return;
        }
    }
}

/// The next event, or a timeout.
fn wait(events: &Receiver<Event>, until: Option<Instant>) -> Result<Event, RecvTimeoutError> {
    match until {
        Some(until) => events.recv_timeout(until.saturating_duration_since(Instant::now())),
        None => events.recv().map_err(|_| RecvTimeoutError::Disconnected),
    }
}

/// Moves rows into `sink` until the table ends, a row is refused or a signal comes. All rows before that are written out. A row waits for
/// at most `deadline`.
///
/// # Errors
/// If rows cannot be written out.
pub(crate) fn run(
    table: Table,
    time: TimeBase,
    deadline: Option<Duration>,
    sink: &mut dyn RowSink,
) -> Result<Ended, Error> {
    let (sender, events) = sync_channel(AHEAD);
    let signal = sender.clone();
    // Rows of a file can be read again: a signal ends the command, and its output is removed.
    if target::is_live() {
        interrupt::on_stop(move || drop(signal.send(Event::Signal)));
    }
    std::thread::spawn(move || read(table, time, &sender));
    // After a signal: the time at which rows are no longer taken.
    let mut last = None::<Instant>;
    let (mut rows, mut oldest) = (0, None::<Instant>);
    let error = loop {
        let until = match last {
            Some(last) => Some(last.min(Instant::now() + QUIET)),
            None => deadline.zip(oldest).map(|(deadline, oldest)| oldest + deadline),
        };
        let row = match wait(&events, until) {
            Ok(Event::Row(row)) => row,
            Ok(Event::Ended(error)) => break error,
            Ok(Event::Signal) => {
                last = Some(Instant::now() + MAX_AFTER_SIGNAL);
                continue;
            }
            Err(RecvTimeoutError::Timeout) if last.is_none() => {
                sink.flush()?;
                oldest = None;
                continue;
            }
            Err(_) => break None,
        };
        if last.is_some_and(|last| Instant::now() >= last) {
            break None;
        }
        let before = sink.waiting();
        if let Err(error) = sink.push(row.0, &row.1) {
            break Some(error);
        }
        rows += 1;
        // Behind a frame only the last rows are left, and their time is counted from here.
        if before == 0 || sink.waiting() <= before {
            oldest = (sink.waiting() > 0).then(Instant::now);
        }
    };
    let flushed = sink.flush();
    match (error, flushed) {
        (Some(error), _) => Ok(Ended {
            rows,
            error: Some(error),
        }),
        (None, flushed) => flushed.map(|()| Ended { rows, error: None }),
    }
}

/// The row of a live table: its tick, and its cells.
type Taken = (Option<i64>, Vec<Option<f64>>);

/// Rows into a recording.
struct Recording<W> {
    recorder: Recorder<W>,
    waiting: usize,
    taken: u64,
    /// Rows of those that are written.
    written: u64,
    /// Whether the rows before the first block are kept.
    keeps: bool,
    kept: Vec<Taken>,
    file: String,
}

impl<W: Write> RowSink for Recording<W> {
    fn push(&mut self, tick: Option<i64>, cells: &[Option<f64>]) -> Result<(), Error> {
        if self.keeps {
            self.kept.push((tick, cells.to_vec()));
        }
        self.taken += 1;
        let before = self.recorder.bytes();
        push(&mut self.recorder, tick, cells).map_err(Error::recording(&self.file))?;
        if self.recorder.bytes() > before {
            // The first block is written when the row behind it comes.
            self.written = self.taken - u64::from(before == 0);
            // Behind a block at most this row waits.
            self.waiting = 1;
            (self.keeps, self.kept) = (false, Vec::new());
        } else {
            self.waiting += 1;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Error> {
        self.recorder.flush().map_err(Error::recording(&self.file))?;
        (self.waiting, self.written) = (0, self.taken);
        if self.recorder.bytes() > 0 {
            (self.keeps, self.kept) = (false, Vec::new());
        }
        Ok(())
    }

    fn waiting(&self) -> usize {
        self.waiting
    }
}

fn push<W: Write>(
    recorder: &mut Recorder<W>,
    tick: Option<i64>,
    cells: &[Option<f64>],
) -> Result<(), fewbits_record::Error> {
    match tick {
        Some(tick) => recorder.push(tick, cells),
        None => recorder.push_next(cells),
    }
}

/// Packs all rows and finishes the recording. All rows before an error of the table are kept, and the error comes second. If nothing but the
/// first block did not fit the storage, as many of its rows as do are written to `spare`, a handle of the same file.
pub(crate) fn fill<W: Write>(
    table: Table,
    recorder: Recorder<W>,
    deadline: Option<Duration>,
    spare: Option<File>,
    file: &str,
) -> Result<(W, u64, Option<Error>), Error> {
    let schema = recorder.schema().clone();
    let mut recording = Recording {
        recorder,
        waiting: 0,
        taken: 0,
        written: 0,
        keeps: spare.is_some(),
        kept: Vec::new(),
        file: file.to_owned(),
    };
    let ended = run(table, schema.time(), deadline, &mut recording);
    let Recording {
        recorder,
        taken,
        written,
        kept,
        ..
    } = recording;
    let error = match ended {
        Ok(Ended {
            rows: 0,
            error: Some(error),
        }) => return Err(error),
        Ok(Ended { rows, error }) => match recorder.finish() {
            Ok(sink) => return Ok((sink, rows, error)),
            Err(second) => error.unwrap_or_else(|| Error::recording(file)(second)),
        },
        Err(error) => error,
    };
    let written = match spare {
        Some(spare) if !kept.is_empty() => salvage(spare, &schema, &kept) as u64,
        _ => written,
    };
    say!(
        "{file}: {written} of {taken} rows are in it, the others did not fit: make room; with --rows-per-block or --deadline fewer rows wait to \
         be written"
    );
    Err(error)
}

/// Writes half of the rows, or half of that and so on, until they fit. Returns how many.
fn salvage(spare: File, schema: &Schema, rows: &[Taken]) -> usize {
    let write = |count: usize| -> Result<(), Box<dyn std::error::Error>> {
        let mut file = spare.try_clone()?;
        file.set_len(0)?;
        file.rewind()?;
        let mut recorder = Recorder::new(file, schema.clone());
        for (tick, cells) in &rows[..count] {
            push(&mut recorder, *tick, cells)?;
        }
        recorder.finish()?;
        Ok(())
    };
    let mut count = rows.len() / 2;
    while count > 0 && write(count).is_err() {
        count /= 2;
    }
    count
}
