//! Logs and snapshots: written, read, continued; the same bytes on any number of threads.

use crate::worlds::{Counted, clock, counted, scalar, setup};
use fewbits_core::Link;
use fewbits_network::{Channel, Detail, Fault, FaultKind, Field, Log, Loss, Seconds, SensorId, Setup, Simulator};
use fewbits_protocol::Feedback;
use proptest::prelude::*;
use rayon::prelude::*;

const SLOTS: u32 = 20;

fn faulty(seed: u64) -> Setup {
    let seconds = |s| Seconds::new(s).unwrap();
    Setup {
        channel: Channel {
            loss: Loss::Fixed(0.15),
            crossover: 1e-3,
            delay: seconds(0.01),
            jitter: seconds(0.2),
            duplication: 0.1,
            reordering: 0.1,
            held: seconds(1.0),
        },
        retries: Some(1),
        detail: Detail::Everything,
        faults: vec![
            Fault {
                at: seconds(5.3),
                node: SensorId(1),
                kind: FaultKind::Restart,
            },
            Fault {
                at: seconds(9.7),
                node: SensorId(0),
                kind: FaultKind::Restart,
            },
            Fault {
                at: seconds(12.1),
                node: SensorId(2),
                kind: FaultKind::Outage(seconds(3.0)),
            },
            Fault {
                at: seconds(15.5),
                node: SensorId(3),
                kind: FaultKind::Death,
            },
        ],
        ..setup(seed)
    }
}

fn star() -> Counted {
    counted(Link::lossy(0.4).unwrap(), Feedback::Echoed, scalar(3, SLOTS as usize, 1))
}

fn network(seed: u64) -> Simulator<Counted> {
    star().simulate(10.0, faulty(seed)).unwrap()
}

fn bytes(log: &Log) -> Vec<u8> {
    let mut bytes = Vec::new();
    log.write(&mut bytes).unwrap();
    bytes
}

#[test]
fn a_log_is_read_back() {
    let mut first = network(1);
    first.run_until(clock().end(SLOTS)).unwrap();
    let stored = bytes(first.log());
    let log = Log::read(stored.as_slice()).unwrap();
    assert_eq!(&log, first.log());
    assert!(log.notes().count() > 5 && log.transmissions().count() > 50);
}

#[test]
fn a_run_stored_anywhere_goes_on_as_if_it_had_not_been() {
    let mut whole = network(3);
    whole.run_until(clock().end(SLOTS)).unwrap();
    for nanoseconds in [0, 1, 3_000_000_001, 7_500_000_000, 15_900_000_000] {
        let mut part = network(3);
        part.run_until(fewbits_network::Instant(nanoseconds)).unwrap();
        let mut stored = Vec::new();
        part.snapshot(&mut stored).unwrap();
        let field = Field::star(3, 10.0).unwrap();
        let mut rest = Simulator::restore(star(), field, faulty(3), stored.as_slice()).unwrap();
        rest.run_until(clock().end(SLOTS)).unwrap();
        assert_eq!(bytes(rest.log()), bytes(whole.log()));
        assert_eq!(rest.ledger(), whole.ledger());
        // Of another network it is none.
        let field = Field::star(4, 10.0).unwrap();
        assert!(Simulator::restore(star(), field, setup(3), stored.as_slice()).is_err());
    }
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let all = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let run = |seed: u64| {
                let mut network = network(seed);
                network.run_until(clock().end(SLOTS)).unwrap();
                bytes(network.log())
            };
            (0..16_u64).into_par_iter().map(run).collect::<Vec<_>>()
        })
    };
    let one = all(1);
    assert_eq!(one, all(2));
    assert_eq!(one, all(7));
    assert_ne!(one[0], one[1]);
}

proptest! {
    #[test]
    fn any_bytes_are_a_log_or_an_error(noise in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = Log::read(noise.as_slice());
        let field = Field::star(3, 10.0).unwrap();
        let _ = Simulator::restore(star(), field, setup(1), noise.as_slice());
    }
}
