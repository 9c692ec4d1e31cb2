//! Progress: bars on a terminal, a line for each finished figure elsewhere.

use super::record::Record;
use fewbits_experiments::Verdict;
use indicatif::{HumanDuration, MultiProgress, ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Without a terminal, what is running is named at least this often.
const HEARTBEAT: Duration = Duration::from_secs(30);

/// What is known of a run while it goes on.
pub(super) struct Progress {
    started: Instant,
    figures: usize,
    /// Seconds that all figures are expected to take, side by side.
    expected: f64,
    state: Mutex<State>,
    bars: Option<Bars>,
}

struct State {
    finished: usize,
    /// Expected seconds of the finished figures.
    done: f64,
    running: Vec<(&'static str, Instant)>,
    last_line: Instant,
}

/// One bar over all figures, and a line for each that is running.
struct Bars {
    all: MultiProgress,
    figures: ProgressBar,
}

/// One running figure.
pub(super) struct Running<'a> {
    id: &'static str,
    line: Option<ProgressBar>,
    progress: &'a Progress,
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Progress {
    /// A run of `figures` figures on `threads` threads, expected to take `seconds` on one; `reused` more need no work.
    pub(super) fn start(figures: usize, reused: usize, seconds: f64, threads: usize) -> Self {
        let expected = seconds / threads.max(1) as f64;
        let bars = std::io::stderr().is_terminal().then(|| {
            let all = MultiProgress::new();
            let bar = all.add(ProgressBar::new(figures as u64));
            bar.set_style(style("{bar:30} {pos}/{len} figures, {elapsed}{msg}"));
            Bars { all, figures: bar }
        });
        let progress = Self {
            started: Instant::now(),
            figures,
            expected,
            state: Mutex::new(State {
                finished: 0,
                done: 0.0,
                running: Vec::new(),
                last_line: Instant::now(),
            }),
            bars,
        };
        let kept = if reused > 0 {
            format!("{reused} unchanged figures are kept (--force makes them again); ")
        } else {
            String::new()
        };
        if figures > 0 {
            let time = HumanDuration(Duration::from_secs_f64(expected));
            progress.say(&format!("{kept}{figures} figures to make on {threads} threads, about {time}, longest first"));
        } else if reused > 0 {
            progress.say(kept.trim_end_matches("; "));
        }
        progress
    }

    /// A line above the bars, or by itself.
    fn say(&self, line: &str) {
        match &self.bars {
            // A terminal that is gone is no reason to stop.
            Some(bars) => drop(bars.all.println(line)),
            None => eprintln!("{line}"),
        }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn begin(&self, id: &'static str) -> Running<'_> {
        self.state().running.push((id, Instant::now()));
        let line = self.bars.as_ref().map(|bars| {
            let line = bars.all.add(ProgressBar::new_spinner());
            line.set_style(style("  {spinner} {msg} {pos} trials, {elapsed}"));
            line.set_message(id);
            line.enable_steady_tick(Duration::from_millis(200));
            line
        });
        Running {
            id,
            line,
            progress: self,
        }
    }

    /// Seconds left, once enough is finished to tell how this machine compares with the one of record.
    fn left(&self, done: f64) -> Option<Duration> {
        let share = done / self.expected.max(f64::MIN_POSITIVE);
        let elapsed = self.started.elapsed().as_secs_f64();
        (share > 0.05 && share < 1.0).then(|| Duration::from_secs_f64(elapsed * (1.0 - share) / share))
    }

    /// Names what is running if nothing was written for long. To be called about once a second.
    pub(super) fn heartbeat(&self) {
        let mut state = self.state();
        if self.bars.is_some() || state.running.is_empty() || state.last_line.elapsed() < HEARTBEAT {
            return;
        }
        state.last_line = Instant::now();
        let running: Vec<_> = state
            .running
            .iter()
            .map(|(id, since)| format!("{id} ({})", HumanDuration(since.elapsed())))
            .collect();
        eprintln!("      running: {}", running.join(", "));
    }

    pub(super) fn clear(&self) {
        if let Some(bars) = &self.bars {
            bars.figures.finish_and_clear();
        }
    }
}

impl Running<'_> {
    /// So many trials more are done.
    pub(super) fn advance(&self, trials: u64) {
        if let Some(line) = &self.line {
            line.inc(trials);
        }
    }

    /// The figure is finished; `expected` are the seconds that it was expected to take, none if it was given up.
    pub(super) fn finish(self, expected: f64, threads: usize, record: Option<&Record>) {
        let progress = self.progress;
        let mut state = progress.state();
        state.running.retain(|(id, _)| *id != self.id);
        state.finished += 1;
        state.done += expected / threads.max(1) as f64;
        state.last_line = Instant::now();
        let left = progress.left(state.done);
        if let (Some(line), Some(bars)) = (&self.line, &progress.bars) {
            line.finish_and_clear();
            bars.figures.inc(1);
            bars.figures
                .set_message(left.map_or_else(String::new, |left| format!(", about {} left", HumanDuration(left))));
        }
        if let (Some(record), None) = (record, &progress.bars) {
            let left = left.map_or_else(String::new, |left| format!("  ({} left)", HumanDuration(left)));
            let width = progress.figures.to_string().len();
            eprintln!("[{:>width$}/{}] {}{left}", state.finished, progress.figures, outcome(record));
        }
    }
}

/// Id, claims and time of a finished figure.
fn outcome(record: &Record) -> String {
    let time = HumanDuration(Duration::from_secs_f64(record.wall_time_s));
    let claims = match (&record.error, record.count(Verdict::Fail)) {
        (Some(error), _) => format!("NOT MADE: {error}"),
        (None, 0) => format!("{} claims hold", record.count(Verdict::Pass)),
        (None, failing) => format!("{failing} of {} claims FAIL", failing + record.count(Verdict::Pass)),
    };
    format!("{:<22} {claims:<18} {time}", record.id)
}
