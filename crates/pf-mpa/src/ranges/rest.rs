//! Whether the target rests.

use super::gaussian::Normal;

/// Ranges after which a target that stays where it is is taken to rest.
const SETTLED: u32 = 40;

/// The place at which a target was seen, and how many ranges it has stayed there.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Rest {
    place: Option<[f64; 3]>,
    ranges: u32,
}

impl Rest {
    /// Takes in the state behind a range. Returns whether the target rests: for many ranges its place is within three deviations of where it was,
    /// and its velocity is within three of zero.
    pub(super) fn observe(&mut self, state: &Normal) -> bool {
        let axes = state.axes;
        let is_within = |i: usize, centre: f64, deviations: f64| {
            let off = state.mean[i] - centre;
            off * off <= deviations * deviations * state.variance(i)
        };
        match self.place {
            Some(place) if (0..axes).all(|i| is_within(i, place[i], 3.0)) => {
                self.ranges = self.ranges.saturating_add(1)
            }
            _ => {
                let mut place = [0.0; 3];
                place[..axes].copy_from_slice(&state.mean[..axes]);
                self.place = Some(place);
                self.ranges = 0;
            }
        }
        self.ranges >= SETTLED && (axes..2 * axes).all(|i| is_within(i, 0.0, 3.0))
    }
}
