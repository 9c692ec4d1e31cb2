//! Measures nothing: what is to be subtracted.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| input.code as u32);
