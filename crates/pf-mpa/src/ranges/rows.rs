//! Ranges that a place must explain.

use super::measured::Measured;
use super::own::Own;
use smallvec::SmallVec;

/// The latest range of an anchor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Collected {
    pub(super) anchor: usize,
    pub(super) place: [f64; 3],
    pub(super) range: f64,
    /// Seconds since it was taken.
    pub(super) age: f64,
    /// Its noise, as a share of the bank's.
    pub(super) share: f64,
    /// What the range changes by for a change of the distance of one.
    pub(super) slope: f64,
}

/// The latest range in full of an anchor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Latest {
    pub(super) time: f64,
    pub(super) range: f64,
    /// Its noise, as a share of the bank's.
    pub(super) share: f64,
    /// What the target moved since.
    pub(super) moved: [f64; 3],
}

impl Latest {
    pub(super) fn new(time: f64, range: f64, share: f64) -> Self {
        Self {
            time,
            range,
            share,
            moved: [0.0; 3],
        }
    }

    /// The range as one that a place at `time` must explain. The target was where it is less what it moved: so the anchor is moved instead.
    pub(super) fn seen_at(&self, time: f64, anchor: usize, place: &[f64; 3], measured: Measured) -> Collected {
        let mut place = *place;
        place.iter_mut().zip(&self.moved).for_each(|(x, by)| *x += by);
        Collected {
            anchor,
            place,
            range: self.range,
            share: self.share,
            age: time - self.time,
            slope: measured.slope_at(self.range),
        }
    }
}

/// A slice of the positions: those whose coordinate along a direction is about `middle`. Slices whose middles are a deviation apart share out
/// all positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub(super) direction: [f64; 3],
    pub(super) middle: f64,
    pub(super) deviation: f64,
}

/// Of so many ranges the variances need no allocation.
const FEW: usize = 8;

/// Ranges with their errors' variances, the biases of their anchors included.
pub(super) struct Rows<'a> {
    pub(super) ranges: &'a [Collected],
    pub(super) variances: SmallVec<[f64; FEW]>,
    pub(super) slice: Option<Slice>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(ranges: &'a [Collected], noise: f64, speed: f64, own: Own, slice: Option<Slice>) -> Self {
        Self {
            ranges,
            variances: ranges
                .iter()
                .map(|one| {
                    (one.share * noise).powi(2) + (speed * one.age * one.slope).powi(2) + own.of(one.anchor).powi(2)
                })
                .collect(),
            slice,
        }
    }
}
