//! Cost of a sample, in multiples of one standard normal draw.

#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use divan::{AllocProfiler, Bencher, black_box};
use fewbits_adaptive::{Config, Packet, Receiver, Sensor};
use fewbits_core::Observation;
use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;

const COUNT: usize = 4000;
const TIMED: usize = 500;

#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

fn main() {
    divan::main();
}

/// A random walk whose steps have standard deviation one.
fn signal() -> Vec<f64> {
    let mut rng = Stream::new(1).rng();
    let mut x = 0.0;
    (0..COUNT)
        .map(|_| {
            x += rng.sample::<f64, _>(StandardNormal);
            x
        })
        .collect()
}

#[divan::bench]
fn standard_normal_unit(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher
        .counter(ItemsCount::new(TIMED))
        .bench_local(|| (0..TIMED).map(|_| rng.sample::<f64, _>(StandardNormal)).sum::<f64>());
}

/// Samples of which about 5, 40 and 85 in a hundred are reported, after 3500 others.
#[divan::bench(args = [3.0, 1.0, 0.2])]
fn sensor(bencher: Bencher, delta: f64) {
    let samples = signal();
    let (before, timed) = samples.split_at(COUNT - TIMED);
    let mut sensor = Sensor::new(Config::new(delta).unwrap());
    before.iter().for_each(|x| drop(black_box(sensor.encode(*x))));
    bencher
        .counter(ItemsCount::new(TIMED))
        .with_inputs(|| sensor.clone())
        .bench_local_values(|mut sensor| {
            for x in timed {
                black_box(sensor.encode(*x).unwrap());
            }
            sensor
        });
}

#[divan::bench(args = [3.0, 1.0, 0.2])]
fn receiver(bencher: Bencher, delta: f64) {
    let config = Config::new(delta).unwrap();
    let mut sensor = Sensor::new(config);
    let observed: Vec<Observation<Packet>> = signal()
        .iter()
        .map(|x| sensor.encode(*x).unwrap().map(|report| report.packet).into())
        .collect();
    let (before, timed) = observed.split_at(COUNT - TIMED);
    let mut receiver = Receiver::new(config);
    before.iter().for_each(|o| drop(black_box(receiver.receive(o))));
    bencher
        .counter(ItemsCount::new(TIMED))
        .with_inputs(|| receiver.clone())
        .bench_local_values(|mut receiver| {
            for observation in timed {
                black_box(receiver.receive(observation).unwrap());
            }
            receiver
        });
}
