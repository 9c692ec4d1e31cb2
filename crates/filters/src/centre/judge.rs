//! What each slot says about its sensor, and what follows from it.

use super::health::{self, Alarm, Residual, SEQUENCES, limit};
use super::{Event, FusionCentre, Member, Slot};
use crate::Error;
use crate::contract::{StateFilter, StateLikelihood};
use fewbits_core::{BitString, Gaussian, Observation};
use rand::Rng;

/// Reports of at most this many bits are words, whose alternatives are enumerated.
const WORD_BITS: usize = 4;
/// Observations without an alarm after which an excluded sensor is believed again.
const READMISSION: u32 = 100;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// What one slot says about its sensor, from the belief before it.
    pub(super) fn watch(
        &self,
        member: &Member<D>,
        slot: &Slot,
        predicted: &Gaussian<D>,
        likelihood: &dyn StateLikelihood<D>,
    ) -> Result<Watched, Error> {
        let evidence = |observation: &Observation<BitString>, working: f64| -> Result<Option<(f64, f64)>, Error> {
            let likelihood = member.sensor.likelihood(&slot.feedback, observation, working)?;
            possible(likelihood.evidence(predicted))
        };
        match &slot.observation {
            Observation::Lost => Ok(Watched::Nothing),
            Observation::Nothing => {
                let silence = evidence(&slot.observation, 1.0)?.map_or(0.0, |(log, _)| log.exp());
                Ok(Watched::Silence(silence.min(1.0)))
            }
            Observation::Received(bits) => {
                let Some((log, correction)) = possible(likelihood.evidence(predicted))? else {
                    return Ok(Watched::Report(None));
                };
                if let Some(variance) = member.sensor.value_variance(predicted) {
                    let arrives = (member.sensor.arrival() * member.state.presence.working).ln();
                    return Ok(Watched::Report(Residual::of_value(log - arrives, variance, correction)));
                }
                if bits.bits() == 0 || bits.bits() > WORD_BITS {
                    return Ok(Watched::Report(None));
                }
                if bits.bits() == 1 && member.always_speaks {
                    let arrives = member.sensor.arrival() * member.state.presence.working;
                    return Ok(Watched::Report(Residual::of_bit(log.exp() / arrives, correction)));
                }
                let mut words = Vec::with_capacity(1 << bits.bits());
                let mut at = 0;
                for word in 0..1_u8 << bits.bits() {
                    let other = BitString::from_bytes(vec![word << (8 - bits.bits())], bits.bits())?;
                    if other == *bits {
                        at = words.len();
                        words.push((log, correction));
                        continue;
                    }
                    let observation = Observation::Received(other);
                    // A word that the scheme never sends is no alternative.
                    if let Ok(Some(found)) = evidence(&observation, member.state.presence.working) {
                        words.push(found);
                    }
                }
                Ok(Watched::Report(Residual::of_word(&words, at)))
            }
        }
    }

    /// Presence, health and noise from what was watched.
    pub(super) fn judge(
        &mut self,
        rng: &mut dyn Rng,
        slots: &[Slot],
        watched: &[Watched],
    ) -> Result<Vec<Event>, Error> {
        let mut events = Vec::new();
        let (sensor_limit, centre_limit) = (
            limit(self.false_alarms.sensor / SEQUENCES as f64),
            limit(self.false_alarms.centre / SEQUENCES as f64),
        );
        let mut pooled = [(0.0, 0_u32); SEQUENCES];
        let (mut products, mut together) = (0.0, 0.0);
        let allowed = self.members.len() / 2;
        let mut excluded = self.members.values().filter(|m| m.state.excluded).count();
        for (slot, watched) in slots.iter().zip(watched) {
            let Some(member) = self.members.get_mut(&slot.sensor) else {
                continue;
            };
            let state = &mut member.state;
            match watched {
                Watched::Nothing => {}
                Watched::Silence(silence) => {
                    let (ratio, dead) = state.presence.silent(*silence, &self.failures);
                    together += ratio;
                    if dead {
                        events.push(Event::Dead(slot.sensor));
                    }
                }
                Watched::Report(found) => {
                    let (ratio, alive) = state.presence.heard();
                    together += ratio;
                    if alive {
                        events.push(Event::Alive(slot.sensor));
                    }
                    let Some(found) = found else { continue };
                    let product = state.last_residual.map(|last| last * found.residual);
                    state.last_residual = Some(found.residual);
                    let terms = [Some(found.surprise), Some(found.residual), product];
                    let alarm = state.monitor.add(terms, sensor_limit) == Some(Alarm::Contradiction);
                    state.quiet = if alarm { 0 } else { state.quiet.saturating_add(1) };
                    if state.excluded {
                        if state.quiet >= READMISSION {
                            state.excluded = false;
                            excluded -= 1;
                            events.push(Event::Readmitted(slot.sensor));
                        }
                        continue;
                    }
                    if alarm && excluded < allowed {
                        state.excluded = true;
                        excluded += 1;
                        self.monitor = health::Monitor::default();
                        events.push(Event::Excluded(slot.sensor));
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
        let sensors = self.members.values_mut().map(|member| &mut member.state.presence);
        self.outage.weigh(together, sensors);
        if let Some(learning) = &self.learning {
            let [low, high] = learning.range;
            self.noise_scale = (self.noise_scale * (learning.gain * products).exp()).clamp(low, high);
        }
        let terms = pooled.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count).sqrt()));
        let alarm = self.monitor.add(terms, centre_limit);
        if alarm == Some(Alarm::Overstatement) {
            events.push(Event::NoiseOverstated);
        }
        if alarm == Some(Alarm::Contradiction) {
            events.push(Event::Lost);
            if let Some(prior) = self.acquisition {
                self.belief = self.filter.restart(rng, &prior, &self.belief)?;
                self.history.clear();
                for member in self.members.values_mut() {
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
    Report(Option<Residual>),
}

/// Evidence and correction, `None` if the observation is impossible.
fn possible(found: Result<crate::contract::Evidence, Error>) -> Result<Option<(f64, f64)>, Error> {
    match found {
        Ok(found) => Ok(Some((found.log_likelihood, found.correction))),
        Err(Error::Core(fewbits_core::Error::Impossible)) => Ok(None),
        Err(error) => Err(error),
    }
}
