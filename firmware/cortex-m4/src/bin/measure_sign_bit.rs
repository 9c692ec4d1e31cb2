//! Measures the sign bit of a double.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| truth(sign_bit(input.x, input.y)));
