//! Updates of presence, health and process noise after the observations of one instant.

use super::health::{self, Alarm, Residual, SEQUENCES};
use super::{Event, FusionCentre, Member};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::Evidence;
use rand::Rng;

/// An excluded sensor is used again after this many observations without an alarm.
const READMISSION: u32 = 100;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Updates presence, health and learnt process noise from what each slot showed.
    pub(super) fn judge(&mut self, rng: &mut dyn Rng, watched: &[(usize, Watched)]) -> Result<Vec<Event>, Error> {
        // 1. Each sensor: its presence, its own test, exclusion and readmission. At most half of the sensors are excluded.
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
                    // The centre's own test leaves out residuals: in a lost track those of different sensors have different signs.
                    // Surprises and products do not.
                    for (sum, term) in pooled.iter_mut().zip([terms[0], None, terms[2]]) {
                        if let Some(term) = term {
                            *sum = (sum.0 + term, sum.1 + 1);
                        }
                    }
                    products += product.unwrap_or(0.0).clamp(-3.0, 3.0);
                }
            }
        }
        // 2. A common failure: the evidence of all sensors together.
        let sensors = self.members.iter_mut().map(|member| &mut member.state.presence);
        self.outage.weigh(together, sensors);
        // 3. Process noise: larger if residuals repeat, smaller if they alternate.
        if let Some(learning) = &self.learning {
            let [low, high] = learning.range;
            self.noise_scale = (self.noise_scale * (learning.gain * products).exp()).clamp(low, high);
        }
        // 4. The centre's own test, with terms pooled over the sensors. A lost track restarts from the prior, if one is set.
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

/// What one slot shows about its sensor.
pub(super) enum Watched {
    Nothing,
    Silence(f64),
    /// A bit of a sensor that is never silent, and the probability that it arrives.
    Bit(Evidence, f64),
    Report(Option<Residual>),
}

impl Watched {
    /// The residual of a report; `None` if it has none. For a bit it is computed here, after the update, since no belief of the
    /// instant depends on it.
    fn residual(&self) -> Option<Residual> {
        match self {
            Self::Bit(bit, arrives) => Residual::of_bit(bit.log_likelihood.exp() / arrives, bit.correction),
            Self::Report(residual) => *residual,
            Self::Nothing | Self::Silence(_) => None,
        }
    }
}
