//! What is sent, and what the fusion centre makes of it.

use fewbits_cfwmd::rule::Weighing;

/// How a fusion centre without feedback treats silence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Not at all.
    Ignored,
    /// Joint Gaussian belief about the state and the sensors' estimates.
    Joint,
    /// Withheld measurements imputed, so many particles.
    Imputed(usize),
}

/// What is sent, and what the fusion centre makes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scheme {
    /// Everything is sent.
    All,
    /// A coin decides.
    Random,
    /// Censoring, silence ignored (CFoMD), own feedback loop.
    Ignored,
    /// Censoring, silence fused by the Gaussian centre.
    Gaussian(Weighing),
    /// Censoring, silence fused by a bootstrap particle filter.
    Particles(usize, Weighing),
    /// Censoring, silence fused by the Rao-Blackwellised filter.
    RaoBlackwell(usize),
    /// Random Gaussian-preserving trigger, weighed with the sensor's own or the centre's innovation variance.
    Trigger(Weighing),
    /// As `Gaussian`, over a link that loses messages; the centre knows the loss rate or believes there is none.
    Lossy { loss: f64, modelled: bool },
    /// No feedback.
    NoFeedback(Method),
    /// No feedback, silence as if each sensor's estimate were scattered about the centre's own (a heuristic).
    Centred,
    /// No feedback, silence with the sensor's estimate given the state but not the data (the paper's law, corrected).
    Unconditional,
}

impl Scheme {
    pub(super) fn needs_scalars(self) -> bool {
        matches!(self, Self::RaoBlackwell(_) | Self::Trigger(_) | Self::Centred | Self::Unconditional)
    }

    pub(super) fn needs_schedule(self) -> bool {
        matches!(self, Self::Gaussian(Weighing::Scheduled) | Self::Particles(_, Weighing::Scheduled))
    }
}
