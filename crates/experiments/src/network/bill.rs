//! What a run costs.

use fewbits_network::{Account, Ledger, Radio};

/// What one run came to, a slot on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bill {
    /// Squared error.
    pub(super) squared: f64,
    /// Payload bits of reports, or of beliefs that travel.
    pub(super) reports: f64,
    /// Bits on air with everything.
    pub(super) air: f64,
    /// Energy of all radios, J.
    pub(super) joules: f64,
    /// Energy of the busiest sensor's radio beyond what it takes asleep, J.
    pub(super) busiest: f64,
}

impl Bill {
    pub(super) fn numbers(&self) -> [f64; 5] {
        [self.squared, self.reports, self.air, self.joules, self.busiest]
    }

    /// `first` is the first node that is a sensor.
    pub(super) fn of(ledger: &Ledger, first: usize, squared: f64, slots: usize) -> Self {
        let (n, all) = (slots as f64, ledger.messages());
        let sensors = &ledger.accounts()[first..];
        let asleep = Radio::cc2420(0.0).map_or(0.0, |radio| radio.sleep.value());
        let spent = |a: &Account| a.sending.value() + a.receiving.value() - asleep * a.awake.value();
        Self {
            squared,
            reports: sensors.iter().map(|account| account.payload.0 as f64).sum::<f64>() / n,
            air: all.air.0 as f64 / n,
            joules: (all.sending.value() + all.receiving.value()) / n,
            busiest: sensors.iter().map(spent).fold(0.0, f64::max) / n,
        }
    }
}
