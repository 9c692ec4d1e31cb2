//! Measures a censoring sensor of codes.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| u32::from(censor::speaks_of_codes(input.code, input.other, 9_000)));
