//! What follows from what was observed: presence, health, process noise.

use super::health::{self, Alarm, Residual, SEQUENCES};
use super::{Event, FusionCentre, Member};
use crate::Error;
use crate::contract::{Evidence, StateFilter};
use rand::Rng;

/// Observations without an alarm after which an excluded sensor is believed again.
const READMISSION: u32 = 100;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Presence, health and noise from what was watched.
    pub(super) fn judge(&mut self, rng: &mut dyn Rng, watched: &[(usize, Watched)]) -> Result<Vec<Event>, Error> {
        let mut events = Vec::new();
        let mut pooled = [(0.0, 0_u32); SEQUENCES];
        let (mut products, mut together) = (0.0, 0.0);
        let allowed = self.members.len() / 2;
        let mut excluded = self.members.iter().filter(|m| m.state.excluded).count();
        for (seat, watched) in watched {
            let Member { number, state, .. } = &mut self.members[*seat];
            match watched {
                Watched::Nothing => {}
                Watched::Silence(silence) => {
                    let (ratio, dead) = state.presence.silent(*silence, &self.failures);
                    together += ratio;
                    if dead {
                        events.push(Event::Dead(*number));
                    }
                }
                Watched::Bit(..) | Watched::Report(_) => {
                    let (ratio, alive) = state.presence.heard();
                    together += ratio;
                    if alive {
                        events.push(Event::Alive(*number));
                    }
                    let Some(found) = watched.residual() else { continue };
                    let product = state.last_residual.map(|last| last * found.residual);
                    state.last_residual = Some(found.residual);
                    let terms = [Some(found.surprise), Some(found.residual), product];
                    let alarm = state.monitor.add(terms, self.limits.sensor) == Some(Alarm::Contradiction);
                    state.quiet = if alarm { 0 } else { state.quiet.saturating_add(1) };
                    if state.excluded {
                        if state.quiet >= READMISSION {
                            state.excluded = false;
                            excluded -= 1;
                            events.push(Event::Readmitted(*number));
                        }
                        continue;
                    }
                    if alarm && excluded < allowed {
                        state.excluded = true;
                        excluded += 1;
                        self.monitor = health::Monitor::default();
                        events.push(Event::Excluded(*number));
                        continue;
                    }
                    // Residuals of different sensors have different signs when a track is lost; surprises and products do not.
                    for (sum, term) in pooled.iter_mut().zip([terms[0], None, terms[2]]) {
                        if let Some(term) = term {
                            *sum = (sum.0 + term, sum.1 + 1);
                        }
                    }
                    products += product.unwrap_or(0.0).clamp(-3.0, 3.0);
                }
            }
        }
        let sensors = self.members.iter_mut().map(|member| &mut member.state.presence);
        self.outage.weigh(together, sensors);
        if let Some(learning) = &self.learning {
            let [low, high] = learning.range;
            self.noise_scale = (self.noise_scale * (learning.gain * products).exp()).clamp(low, high);
        }
        let terms = pooled.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count).sqrt()));
        let alarm = self.monitor.add(terms, self.limits.centre);
        if alarm == Some(Alarm::Overstatement) {
            events.push(Event::NoiseOverstated);
        }
        if alarm == Some(Alarm::Contradiction) {
            events.push(Event::Lost);
            if let Some(prior) = self.acquisition {
                self.belief = self.filter.restart(rng, &prior, &self.belief)?;
                self.history.clear();
                for member in self.members.iter_mut() {
                    member.state.last_residual = None;
                    member.state.monitor = health::Monitor::default();
                }
                events.push(Event::Reacquired);
            }
        }
        Ok(events)
    }
}

/// What one slot says about its sensor.
pub(super) enum Watched {
    Nothing,
    Silence(f64),
    /// A bit of a sensor that always speaks, and the probability of its arrival.
    Bit(Evidence, f64),
    Report(Option<Residual>),
}

impl Watched {
    /// A report's place in its predicted law, `None` if it has none. The place of a bit is computed here, after the update, since no belief of the
    /// instant depends on it.
    fn residual(&self) -> Option<Residual> {
        match self {
            Self::Bit(bit, arrives) => Residual::of_bit(bit.log_likelihood.exp() / arrives, bit.correction),
            Self::Report(residual) => *residual,
            Self::Nothing | Self::Silence(_) => None,
        }
    }
}
