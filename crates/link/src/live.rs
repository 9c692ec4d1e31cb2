//! A web page that shows a running centre: estimates with their band, the last reports and the health of each sensor, bits per second,
//! refused envelopes.
//!
//! The page is one file that loads no scripts from other servers. It receives server-sent events, and shows the last 300 slots when it is
//! opened.

use crate::error::Error;
use crate::station::{Counts, Step};
use axum::Router;
use axum::extract::State;
use axum::response::Html;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::routing::get;
use fewbits_core::Observation;
use fewbits_protocol::SensorHealth;
use serde::Serialize;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::broadcast;
use tokio_stream::wrappers::BroadcastStream;
use tokio_stream::{Stream, StreamExt};

/// Number of slots that are shown when the page is opened.
const HISTORY: usize = 300;

const PAGE: &str = include_str!("live.html");

/// One slot, as it is sent to the page.
#[derive(Serialize)]
struct Shown<'a> {
    slot: u64,
    period: f64,
    estimate: &'a [(f64, f64)],
    /// Per sensor the bits of its report; -1 for nothing, -2 for lost.
    observed: Vec<i64>,
    numbers: &'a [u32],
    trouble: Option<&'a str>,
    health: &'a [SensorHealth],
    counts: Counts,
}

type Shared = Arc<(Mutex<VecDeque<String>>, broadcast::Sender<String>)>;

/// A page that a thread of its own serves.
#[derive(Debug)]
pub struct LivePage {
    shared: Shared,
    numbers: Vec<u32>,
    period: f64,
    address: SocketAddr,
}

impl LivePage {
    /// Serves the page at this address, for these sensor numbers and slots of `period` seconds. The page has no password: bind it to a
    /// trusted network.
    ///
    /// # Errors
    /// If the address is in use or not an address of this machine.
    pub fn serve(address: SocketAddr, numbers: Vec<u32>, period: f64) -> Result<Self, Error> {
        let failed = |source| Error::socket(address, source);
        let listener = std::net::TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build();
        let runtime = runtime.map_err(failed)?;
        let shared: Shared = Arc::new((Mutex::default(), broadcast::Sender::new(64)));
        let app = Router::new()
            .route("/", get(|| async { Html(PAGE) }))
            .route("/events", get(events))
            .with_state(shared.clone());
        std::thread::spawn(move || {
            runtime.block_on(async move {
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    // The thread ends with the process.
                    let _ = axum::serve(listener, app).await;
                }
            });
        });
        Ok(Self {
            shared,
            numbers,
            period,
            address,
        })
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
            numbers: &self.numbers,
            trouble: step.trouble.as_deref(),
            health: &step.health,
            counts,
        };
        let Ok(text) = serde_json::to_string(&shown) else {
            return;
        };
        let mut history = self.shared.0.lock().unwrap_or_else(PoisonError::into_inner);
        if history.len() == HISTORY {
            history.pop_front();
        }
        history.push_back(text.clone());
        // Without clients sending fails, which is no error.
        let _ = self.shared.1.send(text);
    }
}

/// The stored slots, then new ones as they come.
async fn events(State(shared): State<Shared>) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let (past, coming) = {
        // Under one lock, so that no slot is missed or sent twice.
        let history = shared.0.lock().unwrap_or_else(PoisonError::into_inner);
        (history.iter().cloned().collect::<Vec<_>>(), shared.1.subscribe())
    };
    let coming = BroadcastStream::new(coming).filter_map(Result::ok);
    let all = tokio_stream::iter(past).chain(coming);
    Sse::new(all.map(|text| Ok(Event::default().data(text)))).keep_alive(KeepAlive::default())
}
