//! Measures the adaptive encoder.

#![no_std]
#![no_main]

use core::hint::black_box;
use core::mem::MaybeUninit;
use fewbits_cortex_m4::exit;
use fewbits_node::adaptive::{Config, Encoder};

static mut ENCODER: MaybeUninit<Encoder> = MaybeUninit::uninit();

#[inline(never)]
fn begin() {
    let Ok(config) = Config::new(black_box(0.01)) else {
        exit(false)
    };
    // SAFETY: nothing else touches it.
    unsafe { (&raw mut ENCODER).cast::<Encoder>().write(Encoder::new(config)) };
}

#[inline(never)]
fn encode(sample: f64) -> bool {
    // SAFETY: nothing else touches it, and it was written.
    let encoder = unsafe { &mut *(&raw mut ENCODER).cast::<Encoder>() };
    encoder.encode(sample).is_ok_and(|report| black_box(report).is_some())
}

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    begin();
    fewbits_cortex_m4::measure::signal(size_of::<Encoder>(), encode)
}
