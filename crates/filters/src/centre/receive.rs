//! The update at one instant: the new belief, and what each slot shows about its sensor.

use super::health::Residual;
use super::judge::Watched;
use super::{FusionCentre, Member, Received, Slot};
use crate::Error;
use crate::contract::{Info, StateFilter};
use fewbits_core::{BitString, Evidence, Gaussian, Likelihood, Observation};
use rand::Rng;

/// Reports of at most this many bits are treated as words; the residual then sums over all possible words.
const WORD_BITS: usize = 4;

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// Updates with the observations of the present instant.
    ///
    /// # Errors
    /// If a sensor is unknown or bits do not decode; [`Error::Impossible`] if the observations have probability zero
    /// together. The caller may then drop them or start again.
    pub fn receive(&mut self, rng: &mut dyn Rng, slots: &[Slot]) -> Result<Received, Error> {
        let predicted = self.estimate();
        // A report is tested given those before it; otherwise sensors that share the error of the prediction would be treated as
        // independent. Silence is tested given the prediction alone; otherwise, after several sensors died together, the silence of each
        // would confirm that of the others.
        let mut given = predicted;
        let mut posterior = self.filter.of_moments(&predicted).map(|_| Posterior::default());
        let mut used = Vec::new();
        let mut watched = Vec::with_capacity(slots.len());
        let mut next_seat = 0;
        for slot in slots {
            let seat = self.seated(slot.sensor, next_seat)?;
            next_seat = seat + 1;
            let member = &self.members[seat];
            let (working, is_used) = (member.state.presence.working, !member.state.excluded);
            let likelihood = || member.sensor.likelihood(slot, working);
            let Observation::Received(bits) = &slot.observation else {
                let missing = likelihood()?;
                watched.push((seat, member.silence(slot, &*missing, &predicted)?));
                match &mut posterior {
                    Some(posterior) if is_used => posterior.missing(&*missing, &given)?,
                    None if is_used => used.push(missing),
                    _ => {}
                }
                continue;
            };
            let report = if posterior.is_none() { Some(likelihood()?) } else { None };
            let condition = |belief: &mut Gaussian<D>| match &report {
                Some(report) => report.condition(belief),
                None => member.sensor.condition(slot, working, belief),
            };
            let is_bit = bits.bits() == 1 && member.always_speaks;
            let before = (!is_bit).then_some(given);
            let conditioned = if is_used {
                condition(&mut given)
            } else {
                condition(&mut given.clone())
            };
            let evidence = match conditioned {
                Ok(evidence) => Some(evidence),
                Err(error) if posterior.is_some() && is_used => return Err(error),
                // An observation that cannot update the belief may still have a probability.
                Err(_) => member.evidence(slot, working, &given)?,
            };
            let report_says = match (evidence, before) {
                (None, _) => Watched::Report(None),
                (Some(evidence), None) => Watched::Bit(evidence, member.arrival * working),
                (Some(evidence), Some(before)) => Watched::Report(member.residual(slot, bits, &before, evidence)?),
            };
            watched.push((seat, report_says));
            if !is_used {
                continue;
            }
            match &mut posterior {
                Some(Posterior {
                    apart: Some(apart),
                    log_likelihood,
                }) => *log_likelihood += condition(apart)?.log_likelihood,
                Some(posterior) => posterior.log_likelihood += evidence.map_or(0.0, |one| one.log_likelihood),
                None => {}
            }
            used.extend(report);
        }
        // All slots were read: form the posterior, either from the moments above or by the filter's joint update.
        let mut belief = self.belief.clone();
        let mut info = Info::default();
        if let Some(Posterior { apart, log_likelihood }) = posterior {
            info.log_likelihood = log_likelihood;
            belief = self.filter.of_moments(&apart.unwrap_or(given)).unwrap_or(belief);
        } else {
            let used: Vec<&dyn Likelihood<D>> = used.iter().map(|one| &**one).collect();
            info = self.filter.update(rng, &mut belief, &used)?;
        }
        let before = (self.window > 0.0).then(|| self.belief.clone());
        self.belief = belief;
        if let Some(before) = before {
            self.remember(before, slots);
        }
        let events = self.judge(rng, &watched)?;
        Ok(Received { info, events })
    }
}

/// The posterior of a filter of moments while the observations are processed one by one.
#[derive(Default)]
struct Posterior<const D: usize> {
    /// Moments given reports and silence. `None` until the first silence; until then they equal the moments given the reports.
    apart: Option<Gaussian<D>>,
    log_likelihood: f64,
}

impl<const D: usize> Posterior<D> {
    /// Updates with a silence or a loss.
    fn missing(&mut self, missing: &dyn Likelihood<D>, given: &Gaussian<D>) -> Result<(), Error> {
        // A constant likelihood changes no moments.
        if let Some(log) = missing.as_constant().filter(|log| log.is_finite()) {
            self.log_likelihood += log;
            return Ok(());
        }
        self.log_likelihood += missing.condition(self.apart.get_or_insert(*given))?.log_likelihood;
        Ok(())
    }
}

impl<const D: usize> Member<D> {
    /// Log likelihood and correction of the observation in this slot; `None` if its probability is zero.
    fn evidence(&self, slot: &Slot, working: f64, belief: &Gaussian<D>) -> Result<Option<Evidence>, Error> {
        match self.sensor.evidence(slot, working, belief) {
            Ok(found) => Ok(Some(found)),
            Err(Error::Impossible) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Probability that a working sensor is silent, given the belief before the slot.
    fn silence(&self, slot: &Slot, likelihood: &dyn Likelihood<D>, predicted: &Gaussian<D>) -> Result<Watched, Error> {
        if slot.observation == Observation::Lost {
            return Ok(Watched::Nothing);
        }
        // `likelihood` holds for a sensor that works with the present probability. Unless that is one, it is formed again.
        let found = match likelihood.as_constant() {
            Some(log) if self.state.presence.working == 1.0 => log.exp(),
            _ => self
                .evidence(slot, 1.0, predicted)?
                .map_or(0.0, |one| one.log_likelihood.exp()),
        };
        Ok(Watched::Silence(found.min(1.0)))
    }

    /// The residual of a report; `None` if it has none.
    fn residual(
        &self,
        slot: &Slot,
        bits: &BitString,
        predicted: &Gaussian<D>,
        received: Evidence,
    ) -> Result<Option<Residual>, Error> {
        let place = |found: Evidence| (found.log_likelihood, found.correction);
        let working = self.state.presence.working;
        if let Some(variance) = self.sensor.value_variance(predicted) {
            // The likelihood includes the probability that the value arrives; only the value itself is tested.
            let log_density = received.log_likelihood - (self.arrival * working).ln();
            return Ok(Residual::of_value(log_density, variance, received.correction));
        }
        if bits.bits() == 0 || bits.bits() > WORD_BITS {
            return Ok(None);
        }
        let mut words = Vec::with_capacity(1 << bits.bits());
        let (mut at, mut alternative) = (0, slot.clone());
        for word in 0..1_u8 << bits.bits() {
            // A bit string begins at the highest bit of its first byte.
            let other = BitString::from_bytes(vec![word << (8 - bits.bits())], bits.bits())?;
            if other == *bits {
                at = words.len();
                words.push(place(received));
                continue;
            }
            // Words that the scheme never sends are left out.
            alternative.observation = Observation::Received(other);
            words.extend(
                self.evidence(&alternative, working, predicted)
                    .ok()
                    .flatten()
                    .map(place),
            );
        }
        Ok(Residual::of_word(&words, at))
    }
}
