//! Making one figure.

use super::record::Record;
use super::select::Job;
use super::write::Made;
use super::{Options, reuse};
use crate::Error;
use fewbits_experiments::{Context, Kept, Outcome};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Set by Ctrl-C.
pub(super) static STOP: AtomicBool = AtomicBool::new(false);

/// Makes figures on the threads of this process.
pub(super) struct Maker<'a> {
    options: &'a Options,
    pool: rayon::ThreadPool,
    kept: Kept,
}

impl<'a> Maker<'a> {
    pub(super) fn new(options: &'a Options) -> Result<Self, Error> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.unwrap_or(0) as usize)
            .build()
            .map_err(|error| Error(format!("cannot start threads: {error}")))?;
        Ok(Self {
            options,
            pool,
            kept: Kept::default(),
        })
    }

    pub(super) fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// One figure, telling `report` the number of trials just finished; none if the user stopped the run.
    pub(super) fn make(&self, job: &Job, report: &(dyn Fn(u64) + Sync)) -> Option<Made> {
        let (about, began) = (job.figure.about(), Instant::now());
        let has_read = AtomicBool::new(false);
        let read = |path: &str| {
            has_read.store(true, Ordering::Relaxed);
            std::fs::read_to_string(path)
        };
        let context = Context {
            seed: self.options.seed,
            progress: Some(report),
            cancel: Some(&STOP),
            read: Some(&read),
            kept: Some(&self.kept),
        };
        let result = produce(&self.pool, job, &context);
        // A user's file may change: its figure is made again.
        let fingerprint = reuse::fingerprint(job, self.options.seed).filter(|_| !has_read.load(Ordering::Relaxed));
        let record = Record::new(about, &job.run.parameters, began.elapsed(), self.options, fingerprint);
        Some(match result? {
            Ok(outcome) => Made::of(record, &outcome, !self.options.no_plots),
            Err(reason) => Made::failed(record, &reason),
        })
    }
}

/// Runs one figure: its outcome, or why it has none; nothing if the user stopped it. A panic is its own failure and nobody else's.
fn produce(pool: &rayon::ThreadPool, job: &Job, context: &Context<'_>) -> Option<Result<Outcome, String>> {
    let run = || pool.install(|| job.run.outcome(context));
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(outcome)) => Some(Ok(outcome)),
        Ok(Err(fewbits_experiments::Error::Cancelled)) => None,
        Ok(Err(error)) => Some(Err(error.to_string())),
        Err(payload) => Some(Err(format!("panicked (please report this): {}", message(payload.as_ref())))),
    }
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_experiments::{About, AnyFigure, Claim, Expected, Parameter, Run, Table, Verdict};
    use serde_json::{Map, Value as Json};
    use std::time::Duration;

    struct Panics;

    impl AnyFigure for Panics {
        fn about(&self) -> About {
            About::of("demo-fig1", "", "")
        }
        fn world(&self) -> Option<&'static str> {
            None
        }
        fn parameters(&self) -> Vec<Parameter> {
            Vec::new()
        }
        fn tables(&self) -> Vec<Table> {
            Vec::new()
        }
        fn configure(&self, _: &[(String, String)], _: bool) -> Result<Run<'_>, fewbits_experiments::Error> {
            self.with(Map::new())
        }
        fn with(&self, parameters: Map<String, Json>) -> Result<Run<'_>, fewbits_experiments::Error> {
            Ok(Run::of(parameters, |_| panic!("as a figure might")))
        }
    }

    /// A figure of ours whose claims were all left undecided, or that has none.
    #[test]
    fn a_figure_that_decides_nothing_at_full_counts_fails() {
        use clap::Parser;
        #[derive(Parser)]
        struct Line {
            #[command(flatten)]
            options: Options,
        }
        let record = |arguments: &[&str], parameters: &Map<String, Json>, verdicts: &[Verdict]| {
            let line = Line::parse_from([&["figures"], arguments].concat());
            let about = About::of("mi-table4-2", "", "");
            let mut record = Record::new(about, parameters, Duration::ZERO, &line.options, None);
            let claim = |verdict: &Verdict| Claim {
                id: String::new(),
                statement: String::new(),
                verdict: *verdict,
                value: None,
                expected: Expected::Number(0.0),
                tolerance: None,
            };
            record.claims = verdicts.iter().map(claim).collect();
            record
        };
        let figures = fewbits_experiments::all();
        let figure = figures
            .iter()
            .find(|figure| figure.about().id == "mi-table4-2")
            .unwrap();
        let own = |quick| figure.configure(&[], quick).unwrap().parameters;
        use Verdict::{Pass, Skipped};
        let full = own(false);
        assert!(!record(&[], &full, &[Skipped, Skipped]).good());
        assert!(!record(&[], &full, &[]).good());
        assert!(record(&[], &full, &[Skipped, Pass]).good());
        assert!(record(&["--quick"], &own(true), &[Skipped]).good());
        let mut other = full.clone();
        other.insert("sensors".to_owned(), 3.into());
        assert!(record(&[], &other, &[Skipped]).good());
    }

    #[test]
    fn a_panic_is_the_failure_of_its_own_figure() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let job = Job {
            figure: &Panics,
            run: Panics.with(Map::new()).unwrap(),
        };
        let failure = produce(&pool, &job, &Context::new(1)).unwrap().unwrap_err();
        assert!(failure.contains("as a figure might"));
    }
}
