//! Measures a word of eight cells of a double.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| index(cell_of(&THRESHOLDS, input.x)));
