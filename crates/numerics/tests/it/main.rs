//! Numerics against high-precision values, closed forms and laws.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod kernels;
mod normal;
mod wild;

#[derive(serde::Deserialize)]
struct Fixture<E> {
    entries: Vec<E>,
}
