//! Time limits of computations.

use std::hint::black_box;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Multiplications in a measurement of the speed, and number of measurements, of which the fastest counts: others may have been interrupted.
const MEASURED: usize = 1 << 18;
const MEASUREMENTS: usize = 5;

/// Multiplications per second of this machine, measured once.
fn speed() -> f64 {
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
        let (weights, values) = (vec![0.5; 1024], vec![1.5; 1024]);
        let measure = |_| {
            let start = Instant::now();
            for _ in 0..MEASURED / 1024 {
                let (weights, values) = (black_box(&weights), black_box(&values));
                black_box(weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>());
            }
            start.elapsed().as_secs_f64()
        };
        let fastest = (0..MEASUREMENTS).map(measure).fold(f64::INFINITY, f64::min);
        MEASURED as f64 / fastest.max(1e-9)
    })
}

/// The instant by which a computation must end; `None` without a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// No deadline.
    pub const NEVER: Self = Self(None);

    /// The instant `limit` after `start`. Never, if there is no limit or the sum overflows.
    pub(crate) fn after(start: Instant, limit: Option<Duration>) -> Self {
        Self(limit.and_then(|limit| start.checked_add(limit)))
    }

    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|end| Instant::now() >= end)
    }

    /// Whether this many multiplications may take longer than the remaining time.
    pub(crate) fn is_short_for(self, work: f64) -> bool {
        self.0
            .is_some_and(|end| work > speed() * end.saturating_duration_since(Instant::now()).as_secs_f64())
    }
}
