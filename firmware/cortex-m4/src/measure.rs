//! Measuring one scheme: instructions, stack and, by the program's size, flash. To run with `-icount shift=0`.

use crate::{exit, print, print_number, stack_paint, stack_pointer, stack_used, ticks, timer_begin};
use core::hint::black_box;
use fewbits_node::censor::OwnFilter;
use fewbits_node::golden::Signal;

/// What the simple schemes take, two of each kind.
pub struct Input {
    /// Multiples of 1/64 from -32 up to 32.
    pub x: f64,
    pub y: f64,
    /// Codes of 16 bits with a sign.
    pub code: i32,
    pub other: i32,
}

const INPUTS: usize = 64;
const LOOPS: u32 = 64;

const fn inputs() -> [Input; INPUTS] {
    let mut inputs = [const {
        Input {
            x: 0.0,
            y: 0.0,
            code: 0,
            other: 0,
        }
    }; INPUTS];
    let (mut at, mut state) = (0, 1_u64);
    while at < INPUTS {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        inputs[at] = Input {
            x: ((state >> 40) & 0xfff) as f64 / 64.0 - 32.0,
            y: ((state >> 52) & 0xfff) as f64 / 64.0 - 32.0,
            code: (state >> 48) as i32 - 0x8000,
            other: (state >> 32) as u16 as i32 - 0x8000,
        };
        at += 1;
    }
    inputs
}

static SAMPLES: [Input; INPUTS] = inputs();

/// `ticks` of forty instructions over `count` samples; 0 of none.
fn per_sample(ticks: u32, count: u32) -> u32 {
    ticks
        .checked_mul(40)
        .unwrap_or(u32::MAX)
        .checked_div(count)
        .unwrap_or(0)
}

fn report(name: &str, numbers: &[u32]) {
    print(name);
    for number in numbers {
        print(" ");
        print_number(*number);
    }
    print("\n");
}

/// Measures a scheme without much memory. Prints the mean number of instructions, call included, and the bytes of stack.
pub fn simple(mut run: impl FnMut(&Input) -> u32) -> ! {
    timer_begin();
    stack_paint();
    let top = stack_pointer();
    let before = ticks();
    for _ in 0..LOOPS {
        for input in &SAMPLES {
            black_box(run(black_box(input)));
        }
    }
    let taken = (ticks() - before) & 0xff_ffff;
    report("instructions", &[per_sample(taken, LOOPS * INPUTS as u32)]);
    report("stack", &[stack_used(top)]);
    exit(true)
}

/// The filter of a censoring sensor.
pub fn own_filter() -> OwnFilter<2> {
    match OwnFilter::new(black_box([[1.0, 1.0], [0.0, 0.9]]), [1.0, 0.0], [0.0; 2]) {
        Ok(own) => own,
        Err(_) => exit(false),
    }
}

/// Samples of the adaptive encoder.
const SLOTS: u32 = 4_000;

/// Measures an encoder on the signal of the golden vectors; `run` says whether it reported. Prints mean and largest number of
/// instructions, the mean of slots with a report and their number, the bytes of stack and of `state`.
pub fn signal(state: usize, mut run: impl FnMut(f64) -> bool) -> ! {
    timer_begin();
    stack_paint();
    let top = stack_pointer();
    let mut signal = Signal::new(1);
    let (mut sum, mut most, mut told, mut reports) = (0, 0, 0, 0);
    for _ in 0..SLOTS {
        let sample = black_box(signal.sample());
        let before = ticks();
        let reported = run(sample);
        let taken = (ticks() - before) & 0xff_ffff;
        sum += taken;
        most = if taken > most { taken } else { most };
        if reported {
            told += taken;
            reports += 1;
        }
    }
    report("instructions", &[per_sample(sum, SLOTS), per_sample(most, 1)]);
    report("of-reports", &[per_sample(told, reports), reports, SLOTS]);
    report("stack", &[stack_used(top)]);
    report("state", &[state as u32]);
    exit(true)
}

/// A result as a number.
pub fn truth(value: Result<bool, fewbits_node::Error>) -> u32 {
    value.map_or(2, u32::from)
}

/// A result as a number.
pub fn index(value: Result<usize, fewbits_node::Error>) -> u32 {
    value.map_or(99, |cell| cell as u32)
}

/// Thresholds of the words.
pub static THRESHOLDS: [f64; 7] = [-20.0, -10.0, -5.0, 0.0, 5.0, 10.0, 20.0];
/// The same of codes.
pub static CODE_THRESHOLDS: [i32; 7] = [-20_000, -10_000, -5_000, 0, 5_000, 10_000, 20_000];

/// A program that measures one simple scheme.
#[macro_export]
macro_rules! measure {
    (|$input:ident| $run:expr) => {
        #[allow(unused_imports)]
        use fewbits_cortex_m4::measure::{CODE_THRESHOLDS, Input, THRESHOLDS, index, own_filter, truth};
        #[allow(unused_imports)]
        use fewbits_node::*;

        #[inline(never)]
        fn run($input: &Input) -> u32 {
            $run
        }

        #[unsafe(no_mangle)]
        extern "C" fn main() -> ! {
            fewbits_cortex_m4::measure::simple(run)
        }
    };
}
