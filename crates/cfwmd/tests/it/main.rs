//! Censoring and fusion against independent truth.

// Helpers fail loudly, as tests do.
#![allow(clippy::unwrap_used)]

mod centre;
mod fixtures;
mod fusion;
mod no_feedback;
mod node;
mod schemes;
mod silence;
mod wild;

use fewbits_cfwmd::censored::Censored;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_core::{Gaussian, Link, Tilted};
use nalgebra::{Matrix1, Vector1};

/// `count` identical silent scalar sensors: innovation within `half_width` of `centre`, noise variance, loss of the link.
#[derive(Debug, Clone, Copy)]
struct Silence {
    centre: f64,
    half_width: f64,
    noise_variance: f64,
    loss: f64,
    count: usize,
}

impl Silence {
    fn factor(&self) -> Censored<1> {
        let rule = if self.half_width > 0.0 {
            CensoringRule::scalar(self.half_width * self.half_width, 1.0).unwrap()
        } else {
            CensoringRule::scalar(1.0, 0.0).unwrap()
        };
        let (centre, noise) = (Vector1::new(self.centre), Matrix1::new(self.noise_variance));
        Censored::silence(&rule, &centre, &noise, &Link::lossy(self.loss).unwrap(), self.count).unwrap()
    }

    fn moments(&self, mean: f64, variance: f64) -> Result<Tilted<1>, fewbits_core::Error> {
        fewbits_core::Factor::tilted(&self.factor(), &Gaussian::scalar(mean, variance).unwrap())
    }
}
