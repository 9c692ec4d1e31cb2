//! A hundred random models: the design on request against multi-start Nelder-Mead of the same processor time, with limits of it.
//!
//! `cargo run --release -p fewbits-quantizer-design --example random_models -- models.log 100 500 3000`: log file, number of
//! models, limits in milliseconds. A model with a line in the log is not run again. At the end the whole log is summed up.

#[path = "../tests/it/models.rs"]
mod models;
#[path = "../tests/it/nelder_mead.rs"]
mod nelder_mead;

use fewbits_quantizer_design::{Request, Solutions};
use std::io::Write;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A ratio above this is worse than Nelder-Mead.
const WORSE: f64 = 1.0 + 1e-9;
/// Relative difference of the values in two units that counts as one.
const SAME: f64 = 1e-6;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or("models.log".into());
    let count: u64 = arguments.next().map_or(Ok(100), |a| a.parse())?;
    let mut limits = arguments.map(|a| a.parse::<u64>()).collect::<Result<Vec<_>, _>>()?;
    if limits.is_empty() {
        limits = vec![500, 3000];
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    let mut log = std::fs::OpenOptions::new().create(true).append(true).open(&path)?;
    for limit in limits {
        for i in 0..count {
            let key = format!("{limit} {i} ");
            if !known.lines().any(|line| line.starts_with(&key)) {
                let line = compare(i, Duration::from_millis(limit)).unwrap_or_else(|e| format!("failed {e}"));
                writeln!(log, "{key}{line}")?;
            }
        }
    }
    let all = std::fs::read_to_string(&path)?;
    let number = |line: &str, at: usize| line.split(' ').nth(at).and_then(|n| n.parse::<f64>().ok());
    let with = |at: usize, test: &dyn Fn(f64) -> bool| all.lines().filter(|l| number(l, at).is_some_and(test)).count();
    println!(
        "{} runs: {} failed, {} worse than Nelder-Mead of the same time, {} depend on the unit",
        all.lines().count(),
        with(2, &|_| true).abs_diff(all.lines().count()),
        with(2, &|ratio| ratio > WORSE),
        with(4, &|change| change.abs() > SAME),
    );
    Ok(())
}

/// Ratio of the squared errors, seconds, relative change in another unit (a dash where a limit was met), and what it was.
fn compare(i: u64, limit: Duration) -> Result<String, Box<dyn std::error::Error>> {
    let scale = |at: u64| [1.0, 1e-4, 1e4][at as usize % 3];
    let solve = |task: &models::Task, limit| -> Result<Solutions, Box<dyn std::error::Error>> {
        let request = Request {
            clock: on_processor,
            time_limit: Some(limit),
            ..task.request()?
        };
        Ok(request.run()?)
    };
    let task = models::task(i, scale(i), 5, 4)?;
    let start = on_processor();
    let found = solve(&task, limit)?;
    let time = on_processor() - start;
    let error = task.exact(found.best())?;
    let start = on_processor();
    let reference = task.nelder_mead(&|_| on_processor() - start >= time)?;
    let unit = if found.is_cut_short {
        "-".into()
    } else {
        let (other, ratio) = (models::task(i, scale(i + 1), 5, 4)?, scale(i) / scale(i + 1));
        let again = other.exact(solve(&other, 10 * limit)?.best())?;
        format!("{:.1e}", again * ratio * ratio / error - 1.0)
    };
    let certificate = found.best().certificate;
    Ok(format!("{:.9} {:.3} {unit} {certificate:?} {}", error / reference, time.as_secs_f64(), task.what))
}

/// Time that this thread has spent on the processor, so that a busy machine changes nothing; the usual clock where the system does not tell.
fn on_processor() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let spent = told.and_then(|text| text.split(' ').next()?.parse().ok());
    spent.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}
