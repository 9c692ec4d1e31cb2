//! Measures a random trigger.

#![no_std]
#![no_main]

fewbits_cortex_m4::measure!(|input| truth(trigger::speaks(input.x, input.y, 0.01, 0.3)));
