//! `fewbits repack`: recordings under wider bounds.
//!
//! The new recording is written beside the old one and takes its name when it is complete. A kill, a full disk or a recording that is
//! damaged leaves the old one as it was.

use crate::arguments::RepackOptions;
use crate::error::Error;
use crate::many::described;
use crate::say::say;
use crate::target::Target;
use crate::{Ending, bounds, files};
use fewbits_recipes::words;
use fewbits_record::{Bound, Effort, Playback, Schema, TimeBase};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::Path;
use std::time::SystemTime;

/// What was done.
enum Done {
    Packed {
        before: u64,
        after: u64,
        bounds: String,
    },
    /// Nothing was written, for this reason.
    Kept(&'static str),
}

/// Whether the last row is older than the age. Times without a zone are taken as UTC, times in seconds as counted from 1970.
fn is_older(options: &RepackOptions, playback: &Playback<File>, file: &str) -> Result<bool, Error> {
    let Some(age) = options.older_than else { return Ok(true) };
    let TimeBase::Clock { decimals, .. } = playback.schema().time() else {
        return Err(Error::content(file, "its rows have no times: leave out --older-than"));
    };
    let Some((_, last)) = playback.ticks().map_err(Error::recording(file))? else {
        return Ok(false);
    };
    let now = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    let limit = now.as_secs_f64() - age.as_secs_f64();
    Ok((last as f64) / 10_f64.powi(decimals.into()) < limit)
}

/// The bounds that are asked for; those of words stay.
fn asked(options: &RepackOptions, schema: &Schema, file: &str) -> Result<Vec<Option<Bound>>, Error> {
    let names: Vec<String> = schema.columns().iter().map(|column| column.name().to_owned()).collect();
    let specs = bounds::parse(&options.bound, &names, file)?;
    let pairs = specs.iter().zip(schema.columns());
    pairs
        .map(|(spec, column)| {
            if spec.period.is_some() && spec.period != column.period() {
                let problem =
                    format!("column `{}` is on no such circle: leave out `@`", crate::say::name(column.name()));
                return Err(Error::content(file, problem));
            }
            let is_number = words::of(column.unit()).is_none();
            Ok(Some(spec.bound).filter(|bound| is_number && *bound != Bound::Lossless))
        })
        .collect()
}

/// A sink that counts.
struct Counted(Target, u64);

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.0.write(bytes)?;
        self.1 += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// Locks a file that is to be replaced, as long as the result lives.
fn lock(path: &Path) -> Result<File, Error> {
    let name = path.display().to_string();
    loop {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .open(path)
            .map_err(Error::io(&name, "open"))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Error::content(&name, "another command writes to it: try again when it has ended"));
        }
        // Between opening and locking another command may have replaced the file: the lock is then that of the old one.
        if files::is_at(&file, path) {
            return Ok(file);
        }
    }
}

/// Writes the recording as it is to another file.
fn copy(path: &Path, output: &Path) -> Result<(), Error> {
    let name = path.display().to_string();
    let mut source = File::open(path).map_err(Error::io(&name, "open"))?;
    let mut sink = Target::open(Some(output))?;
    std::io::copy(&mut source, &mut sink).map_err(Error::io(&name, "copy"))?;
    sink.finish()
}

fn one(options: &RepackOptions, file: &str) -> Result<Done, Error> {
    let path = Path::new(file);
    // A command that appends meanwhile would lose its rows.
    let lock = options.output.is_none().then(|| lock(path)).transpose()?;
    let failed = Error::recording(file);
    let mut playback = Playback::open(path).map_err(&failed)?;
    if !is_older(options, &playback, file)? {
        return Ok(Done::Kept("its last row is not older"));
    }
    let bounds = asked(options, playback.schema(), file)?;
    let Some(schema) = playback.widened(&bounds).map_err(&failed)? else {
        if let Some(output) = &options.output {
            copy(path, output)?;
        }
        return Ok(Done::Kept("no bound would be wider"));
    };
    let schema = schema.with_rows_per_block(options.rows_per_block).map_err(&failed)?;
    let summary = bounds::summary(schema.columns());
    let before = playback.bytes();
    let effort = if options.fast { Effort::Fast } else { Effort::Thorough };
    let target = match &options.output {
        Some(output) => Target::open(Some(output))?,
        None => Target::replacing(path)?,
    };
    let name = target.name().to_owned();
    let repacked = playback.repack(schema, Counted(target, 0), effort);
    let Counted(sink, after) = repacked.map_err(|error| match error {
        fewbits_record::Error::Io { action: "write", .. } => Error::recording(&name)(error),
        error => failed(error),
    })?;
    if options.output.is_none() && after >= before {
        return Ok(Done::Kept("it would not be smaller"));
    }
    sink.finish()?;
    drop(lock);
    Ok(Done::Packed {
        before,
        after,
        bounds: summary,
    })
}

/// Runs the task. A recording that fails does not stop the others.
pub(crate) fn run(options: &RepackOptions) -> Result<Ending, Error> {
    if options.output.is_some() && options.files.len() > 1 {
        return Err(Error::content("--output", "several recordings are replaced in their places: leave it out"));
    }
    let mut ending = Ending::Good;
    for file in &options.files {
        match one(options, file) {
            Ok(Done::Packed { before, after, bounds }) => {
                say!("{file}: {after} bytes, before {before}; bounds: {bounds}");
            }
            Ok(Done::Kept(reason)) => say!("{file}: left as it is: {reason}"),
            Err(error) if options.files.len() == 1 => return Err(error),
            Err(error) => {
                say!("{file}: error: {}", described(&error));
                ending = Ending::Refused;
            }
        }
    }
    Ok(ending)
}
