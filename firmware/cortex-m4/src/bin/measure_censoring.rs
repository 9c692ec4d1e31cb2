//! Measures a censoring sensor of doubles.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| truth(censor::speaks(input.x, input.y, 8.0)));
