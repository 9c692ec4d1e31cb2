//! Measures a word of the innovation of a double.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| index(innovation_cell(&THRESHOLDS, input.x, input.y, 2.0)));
