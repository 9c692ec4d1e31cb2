//! A web page that shows a running centre: estimates with their band, the last reports and the health of each sensor, bits per second,
//! refused envelopes; and the same as metrics for Prometheus.
//!
//! The page is one file that loads no scripts from other servers. It receives server-sent events, and shows the last 300 slots when it is
//! opened. `/metrics` has the text format of Prometheus.

use crate::doors::Metrics;
use crate::error::Error;
use crate::http::{Answer, Server};
use crate::station::{Counts, Step};
use fewbits_core::Observation;
use fewbits_protocol::SensorHealth;
use serde::Serialize;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Number of slots that are shown when the page is opened.
const HISTORY: usize = 300;
/// Without a slot for so long, a comment is sent: a client that has gone is noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

const PAGE: &str = include_str!("live.html");

/// One slot, as it is sent to the page.
#[derive(Serialize)]
struct Shown<'a> {
    slot: u64,
    period: f64,
    estimate: &'a [(f64, f64)],
    /// Per sensor the bits of its report; -1 for nothing, -2 for lost.
    observed: Vec<i64>,
    asked: &'a [bool],
    names: &'a [String],
    numbers: &'a [u32],
    trouble: Option<&'a str>,
    health: &'a [SensorHealth],
    counts: Counts,
}

#[derive(Debug, Default)]
struct History {
    /// The last slots, as text.
    slots: VecDeque<Arc<str>>,
    /// Number of slots that were ever shown.
    shown: u64,
    metrics: Metrics,
}

#[derive(Debug, Default)]
struct Shared {
    history: Mutex<History>,
    changed: Condvar,
}

impl Shared {
    fn history(&self) -> std::sync::MutexGuard<'_, History> {
        self.history.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The slots after the first `seen`, and how many there were ever. Waits for one if there is none.
    fn after(&self, seen: u64) -> (Vec<Arc<str>>, u64) {
        let history = self.history();
        let waited = self
            .changed
            .wait_timeout_while(history, KEEP_ALIVE, |history| history.shown == seen);
        let history = waited.unwrap_or_else(PoisonError::into_inner).0;
        let new = usize::try_from(history.shown - seen)
            .unwrap_or(usize::MAX)
            .min(history.slots.len());
        let slots = history.slots.iter().skip(history.slots.len() - new).cloned();
        (slots.collect(), history.shown)
    }
}

/// A page that threads of its own serve.
#[derive(Debug)]
pub struct LivePage {
    shared: Arc<Shared>,
    numbers: Vec<u32>,
    names: Vec<String>,
    period: f64,
    address: SocketAddr,
}

impl LivePage {
    /// Serves the page at this address, for these sensor numbers and slots of `period` seconds. The page has no password: bind it to a
    /// trusted network. At most 64 connections are served at a time, and one that sends no request is closed after five seconds.
    ///
    /// # Errors
    /// If the address is in use or not an address of this machine.
    pub fn serve(address: SocketAddr, numbers: Vec<u32>, period: f64) -> Result<Self, Error> {
        let shared = Arc::<Shared>::default();
        let source = shared.clone();
        let server = Server::start(address, move |path| match path {
            "/" => Answer::whole("text/html; charset=utf-8", PAGE),
            "/metrics" => {
                let text = source.history().metrics.to_string();
                Answer::whole("text/plain; version=0.0.4; charset=utf-8", text)
            }
            "/events" => {
                let (source, mut seen) = (source.clone(), 0);
                Answer::Events(Box::new(move || {
                    let (slots, shown) = source.after(seen);
                    seen = shown;
                    slots
                }))
            }
            _ => Answer::Missing,
        })?;
        Ok(Self {
            shared,
            numbers,
            names: Vec::new(),
            period,
            address: server.address(),
        })
    }

    /// The same page with a name for each coordinate of the state, perhaps with its unit.
    #[must_use]
    pub fn with_names(self, names: Vec<String>) -> Self {
        Self { names, ..self }
    }

    /// Address of the page.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows a step. It never waits; a client that reads too slowly misses slots.
    pub fn show(&self, step: &Step, counts: Counts) {
        let observed = step.observed.iter().map(|observation| match observation {
            Observation::Received(report) => report.bits() as i64,
            Observation::Nothing => -1,
            Observation::Lost => -2,
        });
        let shown = Shown {
            slot: step.slot,
            period: self.period,
            estimate: &step.estimate,
            observed: observed.collect(),
            asked: &step.asked,
            names: &self.names,
            numbers: &self.numbers,
            trouble: step.trouble.as_deref(),
            health: &step.health,
            counts,
        };
        let Ok(text) = serde_json::to_string(&shown) else {
            return;
        };
        let mut history = self.shared.history();
        if history.slots.len() == HISTORY {
            history.slots.pop_front();
        }
        history.slots.push_back(text.into());
        history.shown += 1;
        history.metrics.take(step, counts, &self.numbers);
        drop(history);
        self.shared.changed.notify_all();
    }
}
