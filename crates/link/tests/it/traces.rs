//! What a station reports through `tracing`.

use crate::world::{Reports, key, peers, receiver, settings};
use fewbits_link::{Direction, Station};
use std::sync::{Arc, Mutex};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<(Level, String)>>>);

#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        self.0 += &format!("{}={value:?} ", field.name());
    }
}

impl Subscriber for Collector {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut text = Text::default();
        event.record(&mut text);
        self.0.lock().unwrap().push((*event.metadata().level(), text.0));
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

#[test]
fn refused_envelopes_and_slots_are_traced() {
    let collector = Collector::default();
    tracing::subscriber::with_default(collector.clone(), || {
        let mut station =
            Station::new(settings(Reports::Signs, 1000, 10), receiver(Reports::Signs, 0.0), peers(10), None).unwrap();
        let forged = key(4).seal(Direction::ToCentre, 3, 1, b"frame");
        station
            .on_datagram("127.0.0.1:1".parse().unwrap(), &forged, &mut Vec::new())
            .unwrap();
        for time in [1000, 1900] {
            station.on_time(time, &mut Vec::new()).unwrap();
        }
    });
    let found = collector.0.lock().unwrap();
    let has = |level, part: &str| found.iter().any(|(l, text)| *l == level && text.contains(part));
    assert!(has(Level::DEBUG, "refusal=Forged") && has(Level::DEBUG, "sensor=3"), "{found:?}");
    assert!(has(Level::DEBUG, "a slot was updated") && has(Level::DEBUG, "reports=0"), "{found:?}");
}
