//! What is measured of a distance: the distance, or its logarithm where errors are in proportion to it.

/// Below this share of the unit a logarithm does not fall further.
const NEAREST: f64 = 1e-3;

/// The quantity whose error has the same deviation at all distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measured {
    Distance,
    /// `ln` of the distance in this unit.
    Logarithm {
        unit: f64,
    },
}

impl Measured {
    /// The quantity at a distance.
    pub(super) fn of(self, distance: f64) -> f64 {
        match self {
            Self::Distance => distance,
            Self::Logarithm { unit } => (distance / unit).hypot(NEAREST).ln(),
        }
    }

    /// Its derivative by the distance.
    pub(super) fn slope(self, distance: f64) -> f64 {
        match self {
            Self::Distance => 1.0,
            Self::Logarithm { unit } => {
                let share = distance / unit;
                share / (share * share + NEAREST * NEAREST) / unit
            }
        }
    }

    /// The derivative at the distance of a measured value.
    pub(super) fn slope_at(self, value: f64) -> f64 {
        match self {
            Self::Distance => 1.0,
            Self::Logarithm { unit } => (-value).exp() / unit,
        }
    }
}
