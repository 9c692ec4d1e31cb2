//! Ranges that a place must explain.

/// The latest range of an anchor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Collected {
    pub(super) anchor: usize,
    pub(super) place: [f64; 3],
    pub(super) range: f64,
    /// Seconds since it was taken.
    pub(super) age: f64,
}

/// A slice of the positions: those whose coordinate along a direction is about `middle`. Slices whose middles are a deviation apart share out
/// all positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub(super) direction: [f64; 3],
    pub(super) middle: f64,
    pub(super) deviation: f64,
}

/// Ranges with their errors' deviations.
pub(super) struct Rows<'a> {
    pub(super) ranges: &'a [Collected],
    pub(super) deviations: Vec<f64>,
    pub(super) slice: Option<Slice>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(ranges: &'a [Collected], noise: f64, speed: f64, slice: Option<Slice>) -> Self {
        Self {
            ranges,
            deviations: ranges.iter().map(|one| noise.hypot(speed * one.age)).collect(),
            slice,
        }
    }
}
