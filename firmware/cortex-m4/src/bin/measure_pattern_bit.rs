//! Measures the bit of a pattern of a code.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| truth(pattern_bit(&CODE_THRESHOLDS, input.code)));
