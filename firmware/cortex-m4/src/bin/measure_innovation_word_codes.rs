//! Measures a word of the innovation of codes.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| innovation_cell_of_codes(&CODE_THRESHOLDS, input.code, input.other, 300) as u32);
