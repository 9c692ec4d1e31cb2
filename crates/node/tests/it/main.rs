//! Tests of the sensor's halves against golden vectors, plain definitions and the encoder of before.

#![allow(clippy::unwrap_used)]

mod golden;
mod law;
mod schemes;
mod wild;
