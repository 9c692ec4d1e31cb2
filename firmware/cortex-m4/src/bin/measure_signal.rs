//! Measures the signal of the adaptive encoder alone: what is to be subtracted.

#![no_std]
#![no_main]

use core::hint::black_box;

#[inline(never)]
fn encode(sample: f64) -> bool {
    black_box(sample).to_bits() == 1
}

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    fewbits_cortex_m4::measure::signal(0, encode)
}
