//! The filters of a bank: which speed and noise each of them supposes.

/// What one filter supposes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Member {
    /// Standard deviations of the velocity and of a range's error.
    pub(super) speed: f64,
    pub(super) noise: f64,
    pub(super) log_speed: f64,
    pub(super) log_noise: f64,
}

/// Speed by speed, for each the noises.
pub(super) fn members(speeds: &[f64], noises: &[f64]) -> Vec<Member> {
    let pairs = speeds
        .iter()
        .flat_map(|speed| noises.iter().map(move |noise| (*speed, *noise)));
    pairs
        .map(|(speed, noise)| Member {
            speed,
            noise,
            log_speed: speed.ln(),
            log_noise: noise.ln(),
        })
        .collect()
}
