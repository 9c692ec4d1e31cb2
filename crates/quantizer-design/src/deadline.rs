//! Time limits of computations.

use std::hint::black_box;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Multiplications in a measurement of the speed, and number of measurements, of which the fastest counts: others may have been interrupted.
const MEASURED: usize = 1 << 18;
const MEASUREMENTS: usize = 5;

/// Reads a clock that never goes back: the time since some moment, which stays the same.
pub type Clock = fn() -> Duration;

/// The monotonic clock of the standard library. WebAssembly without a system has none: there this clock stands still, so that no time limit
/// ends a computation, and the caller hands in another.
pub(crate) fn system_clock() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    if cfg!(all(target_family = "wasm", target_os = "unknown")) {
        return Duration::ZERO;
    }
    START.get_or_init(Instant::now).elapsed()
}

/// Multiplications per second of this machine, by this clock.
pub(crate) fn speed(clock: Clock) -> f64 {
    let (weights, values) = (vec![0.5; 1024], vec![1.5; 1024]);
    let measure = |_| {
        let start = clock();
        for _ in 0..MEASURED / 1024 {
            let (weights, values) = (black_box(&weights), black_box(&values));
            black_box(weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>());
        }
        clock().saturating_sub(start).as_secs_f64()
    };
    let fastest = (0..MEASUREMENTS).map(measure).fold(f64::INFINITY, f64::min);
    MEASURED as f64 / fastest.max(1e-9)
}

/// The moment of a clock by which a computation must end; `None` without a limit.
#[derive(Debug, Clone, Copy)]
pub struct Deadline {
    clock: Clock,
    end: Option<Duration>,
    /// Multiplications per second.
    speed: f64,
}

impl Deadline {
    /// No deadline.
    pub const NEVER: Self = Self {
        clock: system_clock,
        end: None,
        speed: f64::INFINITY,
    };

    /// The moment `limit` after `start`. Never, if there is no limit or the sum overflows.
    pub(crate) fn after(clock: Clock, start: Duration, limit: Option<Duration>, speed: f64) -> Self {
        let end = limit.and_then(|limit| start.checked_add(limit));
        Self { clock, end, speed }
    }

    pub(crate) fn is_over(self) -> bool {
        self.end.is_some_and(|end| (self.clock)() >= end)
    }

    /// Whether this many multiplications may take longer than the remaining time.
    pub(crate) fn is_short_for(self, work: f64) -> bool {
        self.end
            .is_some_and(|end| work > self.speed * end.saturating_sub((self.clock)()).as_secs_f64())
    }
}
