//! A stretch of time.

/// What a stretch of time does to positions and velocities of one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub(super) seconds: f64,
    /// The velocity's share that stays, and the seconds that it lasts.
    pub(super) kept: f64,
    pub(super) reach: f64,
    /// Added (co)variances for a velocity of unit deviation.
    pub(super) position: f64,
    pub(super) cross: f64,
    pub(super) velocity: f64,
    /// Added variance of the common bias.
    pub(super) drift: f64,
}

impl Step {
    /// Velocities that are forgotten within `persistence` (Ornstein-Uhlenbeck), over `seconds`.
    pub(super) fn over(seconds: f64, persistence: f64, drift: f64) -> Self {
        let (u, kept) = (seconds / persistence, (-seconds / persistence).exp());
        // `2u - 3 + 4k - k^2` cancels for short steps; its series begins with `2 u^3 / 3`.
        let position = if u < 1e-3 {
            u * u * u * (2.0 / 3.0 - 0.5 * u)
        } else {
            2.0 * u - 3.0 + 4.0 * kept - kept * kept
        };
        let lost = -(-u).exp_m1();
        Self {
            seconds,
            kept,
            reach: persistence * lost,
            position: persistence * persistence * position,
            cross: persistence * lost * lost,
            velocity: -(-2.0 * u).exp_m1(),
            drift: drift * seconds,
        }
    }
}
