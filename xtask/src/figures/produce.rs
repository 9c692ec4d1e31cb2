//! Running one figure.

use super::select::Job;
use fewbits_experiments::{Context, Outcome};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use thiserror::Error;

/// Why a figure has no outcome.
#[derive(Debug, Error)]
pub(super) enum Failure {
    #[error("stopped")]
    Cancelled,
    #[error("{0}")]
    Refused(fewbits_experiments::Error),
    #[error("panicked (please report this): {0}")]
    Panicked(String),
}

/// Runs one figure; a panic in it is its own failure and nobody else's.
pub(super) fn produce(pool: &rayon::ThreadPool, job: &Job, context: &Context<'_>) -> Result<Outcome, Failure> {
    let run = || pool.install(|| job.figure.produce(&job.parameters, context));
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(outcome)) => Ok(outcome),
        Ok(Err(fewbits_experiments::Error::Cancelled)) => Err(Failure::Cancelled),
        Ok(Err(error)) => Err(Failure::Refused(error)),
        Err(payload) => Err(Failure::Panicked(message(payload.as_ref()))),
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
    use fewbits_experiments::{About, AnyFigure, Fields, Parameter};
    use serde_json::{Map, Value as Json};

    struct Panics;

    impl AnyFigure for Panics {
        fn about(&self) -> About {
            About::of("demo-fig1", "", "")
        }
        fn measures_time(&self) -> bool {
            false
        }
        fn world(&self) -> Option<&'static str> {
            None
        }
        fn parameters(&self) -> Vec<Parameter> {
            Vec::new()
        }
        fn tables(&self) -> Vec<Fields> {
            Vec::new()
        }
        fn configure(&self, _: &[(String, String)], _: bool) -> Result<Map<String, Json>, fewbits_experiments::Error> {
            Ok(Map::new())
        }
        fn produce(&self, _: &Map<String, Json>, _: &Context<'_>) -> Result<Outcome, fewbits_experiments::Error> {
            panic!("as a figure might")
        }
    }

    #[test]
    fn a_panic_is_the_failure_of_its_own_figure() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let job = Job {
            figure: &Panics,
            parameters: Map::new(),
        };
        let failure = produce(&pool, &job, &Context::new(1)).unwrap_err();
        assert!(failure.to_string().contains("as a figure might"));
    }
}
