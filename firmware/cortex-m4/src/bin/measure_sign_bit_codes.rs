//! Measures the sign bit of a code.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| truth(sign_bit(input.code, input.other)));
