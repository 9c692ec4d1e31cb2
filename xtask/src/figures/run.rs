//! One run: figures side by side, longest first, with the gallery and the summary up to date all the time.

use super::produce::{Failure, produce};
use super::progress::Progress;
use super::record::Record;
use super::select::Job;
use super::times::expected_seconds;
use super::write::{Directory, Summary};
use super::{Ending, Error, Options, reuse, serve, write};
use fewbits_experiments::{Context, Kept};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Set by Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);

/// How often the progress is asked whether it has something to say.
const TICK: Duration = Duration::from_millis(500);

/// A run while it goes on.
struct Run<'a> {
    options: &'a Options,
    out: &'a Directory,
    pool: rayon::ThreadPool,
    progress: Progress,
    started: Instant,
    kept: Kept,
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

/// A job with its place in the order of the figures, its fingerprint and the seconds that it is expected to take.
struct Planned<'a> {
    job: &'a Job,
    place: usize,
    fingerprint: Option<String>,
    seconds: f64,
}

/// Makes the figures of `jobs`.
pub(super) fn run(jobs: &[Job], out: &Directory, options: &Options) -> Result<Ending, Error> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads.unwrap_or(0) as usize)
        .build()?;
    // A handler that is there already (a test in this process) is as good.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("stopping: finished figures stay, running ones are given up (once more to stop at once)");
    });
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
                fingerprint,
                seconds: expected_seconds(id, options.quick),
            }),
        }
    }
    planned.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    let seconds = planned.iter().map(|p| p.seconds).sum();
    let progress = Progress::start(planned.len(), finished.records.len(), seconds, pool.current_num_threads());
    let run = Run {
        options,
        out,
        pool,
        progress,
        started: Instant::now(),
        kept: Kept::default(),
        finished: Mutex::new(finished),
    };
    let server = options.serve.then(|| serve::Server::start(out.path())).transpose()?;
    run.write("In progress: this page shows what is finished.")?;

    // Figures that measure time run alone, after all others.
    let (alone, shared): (Vec<_>, Vec<_>) = planned.iter().partition(|p| p.job.figure.measures_time());
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                std::thread::park_timeout(TICK);
                run.progress.heartbeat();
            }
        });
        run.side_by_side(&shared);
        alone.iter().for_each(|planned| run.make(planned));
        done.store(true, Ordering::Relaxed);
    });
    run.progress.clear();
    let ending = run.close(jobs.len())?;
    if let Some(server) = server {
        server.wait();
    }
    Ok(ending)
}

impl Run<'_> {
    fn finished(&self) -> std::sync::MutexGuard<'_, Finished> {
        self.finished.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes one figure and writes its files, the gallery and the summary.
    fn make(&self, planned: &Planned<'_>) {
        if STOP.load(Ordering::Relaxed) {
            return;
        }
        let (about, began) = (planned.job.figure.about(), Instant::now());
        let running = self.progress.begin(about.id);
        let report = |trials: u64| running.advance(trials);
        let has_read = AtomicBool::new(false);
        let read = |path: &str| {
            has_read.store(true, Ordering::Relaxed);
            std::fs::read_to_string(path)
        };
        let context = Context {
            seed: self.options.seed,
            progress: Some(&report),
            cancel: Some(&STOP),
            read: Some(&read),
            kept: Some(&self.kept),
        };
        let result = produce(&self.pool, planned.job, &context);
        let threads = self.pool.current_num_threads();
        if matches!(&result, Err(Failure::Cancelled)) {
            running.finish(0.0, threads, None);
            return;
        }
        // A user's file may change: its figure is made again.
        let fingerprint = planned
            .fingerprint
            .clone()
            .filter(|_| !has_read.load(Ordering::Relaxed));
        let record = Record::new(about, &planned.job.parameters, began.elapsed(), self.options, fingerprint);
        let written = match &result {
            Ok(outcome) => write::figure(self.out, record.clone().with(outcome), Some(outcome), !self.options.no_plots),
            Err(failure) => write::figure(self.out, record.clone().failed(failure.to_string()), None, false),
        };
        let record = written.unwrap_or_else(|error| record.failed(error.to_string()));
        running.finish(planned.seconds, threads, Some(&record));
        let mut finished = self.finished();
        finished.all.insert(record.id.clone(), record.clone());
        finished.records.insert(planned.place, record);
        drop(finished);
        // The end of the run says so if the page cannot be written.
        let _ = self.write("In progress: this page shows what is finished.");
    }

    /// Runs figures on as many threads as the pool has.
    fn side_by_side(&self, planned: &[&Planned<'_>]) {
        // Figures of one world follow one another, from the place of the longest.
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
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.pool.current_num_threads().min(worlds.len()) {
                scope.spawn(|| {
                    while let Some(world) = worlds.get(next.fetch_add(1, Ordering::Relaxed)) {
                        world.iter().for_each(|planned| self.make(planned));
                    }
                });
            }
        });
    }

    /// Writes gallery and summary as they stand.
    fn write(&self, note: &str) -> Result<Vec<Record>, Error> {
        let finished = self.finished();
        let records: Vec<Record> = finished.records.values().cloned().collect();
        let summary = Summary {
            out: self.out,
            json: self.options.json,
            note,
        };
        summary.write(&records, &finished.all, self.started.elapsed())?;
        Ok(records)
    }

    /// Writes the gallery for the last time and prints the summary.
    fn close(&self, asked: usize) -> Result<Ending, Error> {
        let missing = asked - self.finished().records.len();
        let note = if missing > 0 {
            format!("Stopped by the user: {missing} of {asked} figures were not made.")
        } else {
            String::new()
        };
        let written = self.write(&note);
        let summary = Summary {
            out: self.out,
            json: self.options.json,
            note: &note,
        };
        let records: Vec<Record> = self.finished().records.values().cloned().collect();
        let ending = summary.print(&records, self.started.elapsed());
        written?;
        Ok(if missing > 0 { Ending::Interrupted } else { ending })
    }
}
