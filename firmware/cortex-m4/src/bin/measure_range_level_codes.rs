//! Measures the level of a range of codes.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| range_level_of_codes(input.code, input.other, 10_000, 8));
