//! What an event costs, against a push and a pop of a bare binary heap of as many entries.

use divan::counter::ItemsCount;
use fewbits_monte_carlo::Stream;
use fewbits_network::{Context, Error, Field, Frame, Instant, Kind, Protocol, Radio, SensorId, Setup, Simulator};
use fewbits_protocol::Payload;
use fewbits_topology::Deployment;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

const SIZES: [u64; 3] = [1_000, 100_000, 1_000_000];
const EVENTS: usize = 1_000_000;

fn main() {
    divan::main();
}

/// The next time of an entry: spread over a second.
fn next(time: u64) -> u64 {
    time + 500_000_000 + (time.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 35)
}

/// The unit: pop, and push at a later time.
#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn bare_heap_unit(bencher: divan::Bencher<'_, '_>, size: u64) {
    let mut heap: BinaryHeap<Reverse<(u64, u64)>> = (0..size).map(|i| Reverse((next(i), i))).collect();
    bencher.counter(ItemsCount::new(EVENTS)).bench_local(|| {
        for sequence in 0..EVENTS as u64 {
            if let Some(Reverse((time, _))) = heap.pop() {
                heap.push(Reverse((next(time), sequence)));
            }
        }
        heap.len()
    });
}

/// Counts its timers, and reports one bit to its neighbour in the second kind of run.
struct Ticking {
    reports: bool,
}

impl Protocol for Ticking {
    type Node = u32;

    fn on_timer(&self, node: &mut u32, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        *node += 1;
        let now = context.now();
        context.at(Instant(next(now.0)), token);
        if self.reports {
            let bit = Payload::new(&[0x80], 1).unwrap_or(Payload::EMPTY);
            context.send(SensorId(token ^ 1), &Frame::new(Kind::Report, 1.into(), 0, bit))?;
        }
        Ok(())
    }

    fn on_frame(&self, node: &mut u32, _: &mut Context<'_>, _: SensorId, _: &Frame<'_>) -> Result<(), Error> {
        *node += 1;
        Ok(())
    }

    fn on_restart(&self, _: &mut u32, _: &mut Context<'_>) -> Result<(), Error> {
        Ok(())
    }
}

fn run(bencher: divan::Bencher<'_, '_>, size: u64, reports: bool) {
    // Pairs of neighbours.
    let x = |i: u64| (i / 2) as f64 * 10.0 + (i % 2) as f64;
    let positions = (0..size).map(|i| nalgebra::Vector2::new(x(i), 0.0)).collect();
    let network = || -> Result<_, Error> {
        let field = Field::new(&Deployment::given(positions)?, 2.0)?;
        let mut radio = Radio::first_order();
        radio.battery = Some(fewbits_network::Joules::new(1e9)?);
        let setup = Setup::new(radio, Stream::new(1));
        let mut network = Simulator::new(Ticking { reports }, vec![0; size as usize], field, setup)?;
        for i in 0..size {
            network.start(SensorId(i as u32), Instant(next(i)), i as u32)?;
        }
        Ok(network)
    };
    let Ok(mut network) = network() else { return };
    bencher
        .counter(ItemsCount::new(EVENTS))
        .bench_local(|| network.run_events(EVENTS as u64));
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn timer(bencher: divan::Bencher<'_, '_>, size: u64) {
    run(bencher, size, false);
}

#[divan::bench(args = [1_000, 100_000], sample_count = 3, sample_size = 1)]
fn timer_and_frame(bencher: divan::Bencher<'_, '_>, size: u64) {
    run(bencher, size, true);
}
