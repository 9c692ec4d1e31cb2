//! Measures a censoring sensor with its own filter.

#![no_std]
#![no_main]

use fewbits_cortex_m4::measure::{own_filter, simple, truth};

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let mut own = own_filter();
    simple(|input| truth(own.speaks(input.x, &[0.5, 0.2], 8.0)))
}
