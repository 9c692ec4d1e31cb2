//! One run: figures side by side, longest first; gallery and summary at its end.

use super::produce::{Maker, STOP};
use super::progress::{Progress, Running};
use super::ranks::{Order, Ranks};
use super::record::Record;
use super::select::Job;
use super::times::expected_seconds;
use super::write::{Directory, Made, write_summary};
use super::{Ending, Options, ending, reuse};
use crate::Error;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often the progress is asked whether it has something to say.
const TICK: Duration = Duration::from_millis(500);

/// A run while it goes on.
struct Run<'a> {
    options: &'a Options,
    out: &'a Directory,
    maker: Maker<'a>,
    /// Threads of all ranks.
    threads: usize,
    progress: Progress,
    started: Instant,
    /// Place of each job in the order of the figures.
    finished: Mutex<Finished>,
}

#[derive(Default)]
struct Finished {
    /// The records of this run, by place in the order of the figures.
    records: BTreeMap<usize, Record>,
    /// All records of the directory, by id.
    all: BTreeMap<String, Record>,
}

/// A job with its place in the order of the figures and the seconds that it is expected to take.
struct Planned<'a> {
    job: &'a Job,
    place: usize,
    seconds: f64,
}

/// Ends the run gently at the first signal and at once at the second.
fn stop_on_signals(note: &'static str) {
    // A handler that is there already (a test in this process) is as good.
    let _ = ctrlc::set_handler(move || {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprint!("{note}");
    });
}

/// Makes what rank 0 orders; writes and prints nothing.
pub(super) fn work(ranks: &Ranks, options: &Options) -> Result<Ending, Error> {
    stop_on_signals("");
    let maker = Maker::new(options)?;
    ranks.work(maker.threads(), |order| maker.make(&order.job()?, &|_| ()));
    Ok(Ending::Good)
}

/// Makes the figures of `jobs`.
pub(super) fn run(jobs: &[Job], out: &Directory, options: &Options, ranks: &Ranks) -> Result<Ending, Error> {
    stop_on_signals("stopping: finished figures stay, running ones are given up (once more to stop at once)\n");
    let maker = Maker::new(options)?;
    let mut finished = Finished {
        all: Record::read_all(out.path())?,
        ..Finished::default()
    };
    let mut planned = Vec::new();
    for (place, job) in jobs.iter().enumerate() {
        let id = job.figure.about().id;
        let fingerprint = reuse::fingerprint(job, options.seed);
        let kept = fingerprint
            .as_ref()
            .filter(|_| !options.force)
            .and_then(|fingerprint| reuse::earlier(out.path(), job, fingerprint, !options.no_plots));
        match kept {
            Some(record) => drop(finished.records.insert(place, record)),
            None => planned.push(Planned {
                job,
                place,
                seconds: expected_seconds(id, options.quick),
            }),
        }
    }
    planned.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    let seconds = planned.iter().map(|p| p.seconds).sum();
    let threads = maker.threads() * ranks.size();
    let progress = Progress::start(planned.len(), finished.records.len(), seconds, threads);
    let run = Run {
        options,
        out,
        maker,
        threads,
        progress,
        started: Instant::now(),
        finished: Mutex::new(finished),
    };
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                std::thread::park_timeout(TICK);
                run.progress.heartbeat();
            }
        });
        run.side_by_side(&planned, ranks);
        done.store(true, Ordering::Relaxed);
    });
    run.progress.clear();
    run.close(jobs.len())
}

impl Run<'_> {
    fn finished(&self) -> std::sync::MutexGuard<'_, Finished> {
        self.finished.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes one figure and writes its files.
    fn make(&self, planned: &Planned<'_>) {
        if STOP.load(Ordering::Relaxed) {
            return;
        }
        let running = self.progress.begin(planned.job.figure.about().id);
        let made = self.maker.make(planned.job, &|trials| running.advance(trials));
        self.finish(running, planned, made);
    }

    /// Writes what was made, here or on another rank; nothing if it was given up.
    fn finish(&self, running: Running<'_>, planned: &Planned<'_>, made: Option<Made>) {
        let Some(made) = made else {
            running.finish(0.0, self.threads, None);
            return;
        };
        let record = made.write(self.out);
        running.finish(planned.seconds, self.threads, Some(&record));
        let mut finished = self.finished();
        finished.all.insert(record.id.clone(), record.clone());
        finished.records.insert(planned.place, record);
    }

    /// Runs figures on all threads of all ranks. Figures of one world follow one another, from the place of the longest.
    fn side_by_side(&self, planned: &[Planned<'_>], ranks: &Ranks) {
        let mut worlds: Vec<Vec<&Planned<'_>>> = Vec::new();
        for figure in planned {
            let world = figure.job.figure.world();
            match worlds
                .iter_mut()
                .find(|w| world.is_some() && w[0].job.figure.world() == world)
            {
                Some(shared) => shared.push(figure),
                None => worlds.push(vec![figure]),
            }
        }
        let threads = self.maker.threads().min(worlds.len());
        let left = Mutex::new(worlds.into_iter());
        let next = || match STOP.load(Ordering::Relaxed) {
            true => None,
            false => left.lock().unwrap_or_else(PoisonError::into_inner).next(),
        };
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    while let Some(world) = next() {
                        world.iter().for_each(|planned| self.make(planned));
                    }
                });
            }
            let mut elsewhere = HashMap::new();
            let orders = || next().map(|world| world.iter().map(|planned| Order::of(planned.job)).collect());
            ranks.serve(orders, |id, made| {
                let Some(planned) = planned.iter().find(|planned| planned.job.figure.about().id == id) else {
                    return;
                };
                let begun = elsewhere.remove(id);
                let running = begun.unwrap_or_else(|| self.progress.begin(planned.job.figure.about().id));
                match made {
                    Some(_) => self.finish(running, planned, made),
                    None => drop(elsewhere.insert(id.to_owned(), running)),
                }
            });
        });
    }

    /// Writes the gallery and prints the summary.
    fn close(&self, asked: usize) -> Result<Ending, Error> {
        let finished = self.finished();
        let (missing, elapsed) = (asked - finished.records.len(), self.started.elapsed());
        let note = match missing {
            0 => String::new(),
            missing => format!("Stopped by the user: {missing} of {asked} figures were not made."),
        };
        let records: Vec<Record> = finished.records.values().cloned().collect();
        let written = write_summary(self.out, &records, &finished.all, elapsed, &note);
        let ending = ending(self.out, self.options.json, &records, elapsed);
        if !note.is_empty() {
            eprintln!("{note}");
        }
        written?;
        Ok(if missing > 0 { Ending::Interrupted } else { ending })
    }
}
