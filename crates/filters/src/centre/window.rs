//! What the window of stored instants is good for beside late reports: the past, improved by what came after; and moves by a known input, which
//! end it.

use super::FusionCentre;
use crate::Error;
use crate::contract::StateFilter;
use crate::smoother::smooth_step;
use fewbits_core::{Belief, Gaussian, GaussianDynamics, ScaledNoise};
use fewbits_numerics::error::{finite, refuse};
use rand::Rng;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Fixed-lag smoothing: the belief at each stored instant of the [window](Self::with_window), given all reports until now, with its time; the
    /// last is the present. The first is the estimate with the longest lag. By the moments of the beliefs, so it is exact for Gaussian beliefs and linear
    /// dynamics (Rauch, Tung and Striebel 1965). It does not go back beyond an instant at which the belief was started anew.
    ///
    /// # Errors
    /// If the world's dynamics over a step are refused, or a moment is not finite.
    pub fn smoothed(&mut self, rng: &mut dyn Rng) -> Result<Vec<(f64, Gaussian<D>)>, Error> {
        let history = self.history.clone();
        let mut filtered: Vec<(f64, Gaussian<D>)> = Vec::with_capacity(history.len() + 1);
        for mut checkpoint in history {
            let mut belief = checkpoint.belief;
            self.replay(rng, &mut belief, &mut checkpoint.slots)?;
            let moments = Gaussian::from_trusted_parts(belief.mean(), belief.covariance());
            filtered.push((checkpoint.time, moments));
        }
        // The present belief is the last of them, perhaps moved on since.
        filtered.retain(|one| one.0 < self.now);
        filtered.push((self.now, self.estimate()));
        for k in (0..filtered.len().saturating_sub(1)).rev() {
            let dynamics = self.world.over(filtered[k + 1].0 - filtered[k].0)?;
            let dynamics = ScaledNoise::new(&*dynamics, self.noise_scale);
            filtered[k].1 = smooth_step(&dynamics, &filtered[k].1, &filtered[k + 1].1)?;
        }
        Ok(filtered)
    }

    /// Predicts the belief to `time` by dynamics that hold for this stretch alone, in place of the world's: a known input, odometry between two
    /// reports, an event. The window ends here: late reports from before cannot be taken in.
    ///
    /// # Errors
    /// If the time is not later than the present time, or the filter cannot predict by these dynamics. The centre is then unchanged.
    pub fn advance_by(
        &mut self,
        rng: &mut dyn Rng,
        time: f64,
        dynamics: &dyn GaussianDynamics<D>,
    ) -> Result<&mut Self, Error> {
        let seconds = finite("time", time)? - self.now;
        if seconds <= 0.0 {
            return refuse("time", time, format!("later than {}", self.now));
        }
        let mut belief = self.belief.clone();
        self.filter.predict(rng, dynamics, &mut belief)?;
        self.belief = belief;
        self.alternative = None;
        let sensors = self.members.iter_mut().map(|member| &mut member.state.presence);
        self.outage.advance(seconds, &self.failures, sensors);
        self.now = time;
        self.history.clear();
        Ok(self)
    }
}
