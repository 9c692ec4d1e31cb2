//! Measures a word of eight cells of a code.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| index(cell_of(&CODE_THRESHOLDS, input.code)));
