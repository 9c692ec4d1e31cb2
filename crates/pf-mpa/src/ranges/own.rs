//! Which anchors have a bias of their own.

/// Which anchors have a bias of their own, and its deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Own {
    /// All anchors, or none if the deviation is zero.
    Each(f64),
    /// One anchor.
    Only { anchor: usize, deviation: f64 },
}

impl Own {
    pub(super) fn deviation(&self) -> f64 {
        match *self {
            Self::Each(deviation) | Self::Only { deviation, .. } => deviation,
        }
    }

    /// The deviation of an anchor's own bias.
    pub(super) fn of(&self, anchor: usize) -> f64 {
        let is_meant = self.only().is_none_or(|only| only == anchor);
        if is_meant { self.deviation() } else { 0.0 }
    }

    pub(super) fn only(&self) -> Option<usize> {
        match *self {
            Self::Each(_) => None,
            Self::Only { anchor, .. } => Some(anchor),
        }
    }

    /// Number of biases of single anchors.
    pub(super) fn count(&self, anchors: usize) -> usize {
        match *self {
            Self::Each(deviation) if deviation > 0.0 => anchors,
            Self::Each(_) => 0,
            Self::Only { .. } => 1,
        }
    }
}
