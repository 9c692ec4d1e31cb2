//! Sensors of a group that were told the same: what they reported at one instant is one likelihood with counts.

use super::reading::{Content, Reading};
use super::{FusionCentre, Slot};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{BitString, Likelihood};

/// The part of one slot in the likelihoods of an instant.
pub(super) enum Part<const D: usize> {
    Alone,
    /// The first of its group, with the likelihood of all.
    First(Box<dyn Likelihood<D>>),
    /// In the likelihood of the first of its group.
    Covered,
}

/// Slots of one group with the same feedback and probability of working.
struct Bundle<'a> {
    seat: usize,
    group: u32,
    feedback: &'a BitString,
    working: f64,
    places: Vec<usize>,
    counted: Vec<(&'a Slot, usize)>,
}

/// Whether two sensors work with the same probability but for rounding, by which their different histories may part them.
fn works_alike(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-12
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// The parts of these slots, each with its seat and the probability that its sensor works; empty if no sensor is in a group.
    pub(super) fn joined<'a>(
        &self,
        slots: impl Iterator<Item = (usize, &'a Slot, f64)> + Clone,
    ) -> Result<Vec<Part<D>>, Error> {
        let mut bundles: Vec<Bundle<'a>> = Vec::new();
        for (place, (seat, slot, working)) in slots.clone().enumerate() {
            let Some(group) = self.members[seat].group else {
                continue;
            };
            let is_same = |one: &Bundle<'_>| {
                one.group == group && works_alike(one.working, working) && *one.feedback == slot.feedback
            };
            let at = bundles.iter().position(is_same).unwrap_or(bundles.len());
            if at == bundles.len() {
                bundles.push(Bundle {
                    seat,
                    group,
                    feedback: &slot.feedback,
                    working,
                    places: Vec::new(),
                    counted: Vec::new(),
                });
            }
            let Bundle { places, counted, .. } = &mut bundles[at];
            places.push(place);
            match counted.iter_mut().find(|(one, _)| one.observation == slot.observation) {
                Some((_, count)) => *count += 1,
                None => counted.push((slot, 1)),
            }
        }
        let mut parts: Vec<Part<D>> = Vec::new();
        for bundle in bundles.iter().filter(|bundle| bundle.places.len() > 1) {
            let sensor = &self.members[bundle.seat].sensor;
            let Some(joint) = sensor.together(&bundle.counted, bundle.working)? else {
                continue;
            };
            if parts.is_empty() {
                parts.extend(slots.clone().map(|_| Part::Alone));
            }
            bundle.places.iter().for_each(|place| parts[*place] = Part::Covered);
            parts[bundle.places[0]] = Part::First(joint);
        }
        Ok(parts)
    }

    /// The likelihoods of slots, each with its seat and the probability that its sensor works.
    pub(super) fn all_of(&self, slots: &[(usize, &Slot, f64)]) -> Result<Vec<Box<dyn Likelihood<D>>>, Error> {
        let mut parts = self.joined(slots.iter().copied())?.into_iter();
        let mut all = Vec::with_capacity(slots.len());
        for (seat, slot, working) in slots {
            all.extend(match parts.next().unwrap_or(Part::Alone) {
                Part::Alone => Some(self.members[*seat].sensor.likelihood(slot, *working)?),
                Part::First(joint) => Some(joint),
                Part::Covered => None,
            });
        }
        Ok(all)
    }

    /// Seat and slot of a reading, and the probability that its sensor works; a report proves that.
    pub(super) fn input_of<'a>(&self, reading: &Reading<'a, D>) -> (usize, &'a Slot, f64) {
        let working = match reading.content {
            Content::Nothing => self.members[reading.seat].state.presence.working,
            Content::Lost | Content::Report => 1.0,
        };
        (reading.seat, reading.slot, working)
    }

    /// Whether two silent sensors are of one group, were told the same, and work with the same probability.
    pub(super) fn is_like(&self, one: &Reading<'_, D>, other: &Reading<'_, D>) -> bool {
        let (first, second) = (&self.members[one.seat], &self.members[other.seat]);
        first.group.is_some()
            && first.group == second.group
            && works_alike(first.state.presence.working, second.state.presence.working)
            && one.slot.feedback == other.slot.feedback
    }

    /// The likelihoods of readings: those of groups once, the others one by one.
    pub(super) fn likelihoods<'a>(
        &self,
        readings: &[&'a Reading<'_, D>],
        parts: &'a [Part<D>],
    ) -> Vec<&'a dyn Likelihood<D>> {
        let of = |(place, reading): (usize, &&'a Reading<'_, D>)| match parts.get(place) {
            Some(Part::Covered) => None,
            Some(Part::First(joint)) => Some(&**joint),
            _ => reading.known(),
        };
        readings.iter().enumerate().filter_map(of).collect()
    }
}
