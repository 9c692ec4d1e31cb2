//! Measures the level of a range.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| range_level(input.x, input.y, 20.0, 8).unwrap_or(9));
