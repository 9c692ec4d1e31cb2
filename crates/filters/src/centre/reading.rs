//! The slots of one instant, as the centre reads them: their likelihoods, and how likely each report is.

use super::health::Residual;
use super::remote::ReportTest;
use super::{FusionCentre, Member, Slot};
use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{BitString, Evidence, Gaussian, Likelihood, Observation};
use fewbits_numerics::normal::log_interval;
use smallvec::SmallVec;

/// Reports of at most this many bits are treated as words; the residual then sums over all possible words.
const WORD_BITS: usize = 4;

/// A list with one entry a slot of an instant. Most instants have few slots: then nothing is allocated.
pub(super) type BySlot<T> = SmallVec<[T; 2]>;

/// A slot of a sensor that has joined.
pub(super) struct Reading<'a, const D: usize> {
    pub seat: usize,
    pub slot: &'a Slot,
    /// Of a report under the supposition that its sensor works, which it proves. `None` if the scheme accepts no such report.
    pub likelihood: Option<Box<dyn Likelihood<D>>>,
    pub content: Content,
}

/// What came in a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// Nothing: the sensor was silent, or its report was lost without a trace.
    Nothing,
    /// A report was sent, but it is lost, or its bits are no report of the scheme.
    Lost,
    Report,
}

impl<'a, const D: usize> Reading<'a, D> {
    /// Whether bits came that are no report of the scheme.
    pub(crate) fn is_unreadable(&self) -> bool {
        self.content == Content::Lost && self.slot.observation.received().is_some()
    }

    /// The likelihood of a reading that is known to have one.
    pub(crate) fn known(&self) -> Option<&dyn Likelihood<D>> {
        self.likelihood.as_deref()
    }
}

/// How well a report agrees with a belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tested {
    /// Whether the report has a probability above zero.
    pub is_possible: bool,
    pub residual: Option<Residual>,
}

impl Tested {
    pub(crate) fn without_residual(is_possible: bool) -> Self {
        Self {
            is_possible,
            residual: None,
        }
    }

    /// Probability of a report that is at most as likely.
    pub(crate) fn tail(&self) -> f64 {
        match self.residual {
            _ if !self.is_possible => 0.0,
            Some(residual) => residual.tail,
            None => 1.0,
        }
    }

    /// How far the report is below the likeliest one, in nats; infinite if it is impossible.
    pub(crate) fn depth(&self) -> f64 {
        match self.residual {
            _ if !self.is_possible => f64::INFINITY,
            Some(residual) => residual.depth,
            None => 0.0,
        }
    }
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// The slots of this time in the order of the sensors' numbers, without copies of reports; and the seats whose reports were copied.
    pub(super) fn read<'a>(&self, slots: &'a [Slot], time: f64) -> Result<(BySlot<Reading<'a, D>>, Vec<usize>), Error> {
        let mut seated: BySlot<(usize, &'a Slot)> = BySlot::new();
        let mut next_seat = 0;
        for slot in slots {
            let seat = self.seated(slot.sensor, next_seat)?;
            next_seat = seat + 1;
            seated.push((seat, slot));
        }
        sort(&mut seated);
        let mut copied = Vec::new();
        seated.dedup_by(|next, one| {
            let is_copy = next.0 == one.0 && next.1 == one.1 && one.1.observation.received().is_some();
            if is_copy {
                copied.push(one.0);
            }
            is_copy
        });
        seated.retain(|(seat, slot)| {
            let is_copy = self.is_copy(*seat, slot, time);
            if is_copy {
                copied.push(*seat);
            }
            !is_copy
        });
        let readings = seated
            .into_iter()
            .map(|(seat, slot)| self.members[seat].reading(seat, slot));
        Ok((readings.collect::<Result<_, _>>()?, copied))
    }

    /// Whether this is the last report of the sensor once more: of the same instant.
    pub(super) fn is_copy(&self, seat: usize, slot: &Slot, time: f64) -> bool {
        let latest = self.members[seat].state.latest;
        latest.is_some_and(|(at, digest)| at == time && digest == slot.digest())
            && slot.observation.received().is_some()
    }

    /// Each of these reports tested by the Gaussian `given` and all the others, into `found`.
    ///
    /// Conditions on one half of the reports to test the other, and so on: `n log n` updates in place of `n^2`.
    pub(super) fn test_apart(&self, given: &Gaussian<D>, reports: &[&Reading<'_, D>], found: &mut Vec<Tested>) {
        match reports {
            [] => {}
            [one] => found.push(self.members[one.seat].test(one, given)),
            _ => {
                let (left, right) = reports.split_at(reports.len() / 2);
                self.test_apart(&conditioned(given, right), left, found);
                self.test_apart(&conditioned(given, left), right, found);
            }
        }
    }
}

/// Sorts slots by their seats. A sensor may have several slots, whose order must not matter either.
fn sort(seated: &mut [(usize, &Slot)]) {
    fn key<'a>((seat, slot): &(usize, &'a Slot)) -> impl Ord + use<'a> {
        let bits = slot.observation.received().map(|bits| (bits.bits(), bits.bytes()));
        (*seat, bits, slot.observation == Observation::Lost, slot.feedback.bytes())
    }
    if !seated.is_sorted_by(|one, next| key(one) < key(next)) {
        seated.sort_by(|one, next| key(one).cmp(&key(next)));
    }
}

/// A Gaussian conditioned on reports, one after the other. Those that cannot update it are left out.
pub(super) fn conditioned<const D: usize>(given: &Gaussian<D>, reports: &[&Reading<'_, D>]) -> Gaussian<D> {
    let mut next = *given;
    for one in reports.iter().filter_map(|report| report.known()) {
        let before = next;
        if one.condition(&mut next).is_err() || !next.is_finite() {
            next = before;
        }
    }
    next
}

/// All words of at most [`WORD_BITS`] bits.
fn words(bits: usize) -> impl Iterator<Item = BitString> {
    // A bit string begins at the highest bit of its first byte.
    (0..1_u8 << bits).filter_map(move |word| BitString::from_bytes(vec![word << (8 - bits)], bits).ok())
}

impl<const D: usize> Member<D> {
    fn reading<'a>(&self, seat: usize, slot: &'a Slot) -> Result<Reading<'a, D>, Error> {
        let content = match &slot.observation {
            Observation::Nothing => Content::Nothing,
            Observation::Received(bits) if self.sensor.decodes(bits) => Content::Report,
            Observation::Received(_) | Observation::Lost => Content::Lost,
        };
        let working = if content == Content::Nothing {
            self.state.presence.working
        } else {
            1.0
        };
        let likelihood = match self.sensor.likelihood(slot, working) {
            Ok(likelihood) => Some(likelihood),
            Err(error) => {
                // If silence is refused too, the feedback or the sensor's settings are wrong, not its report.
                let silent = Slot::new(slot.sensor, slot.feedback.clone(), Observation::Nothing);
                if content == Content::Nothing
                    || matches!(self.sensor.likelihood(&silent, 1.0), Err(Error::Argument(_)))
                {
                    return Err(error);
                }
                None
            }
        };
        Ok(Reading {
            seat,
            slot,
            likelihood,
            content,
        })
    }

    /// Tests a report by a Gaussian.
    #[inline]
    pub(super) fn test(&self, reading: &Reading<'_, D>, given: &Gaussian<D>) -> Tested {
        let evidence = reading.known().map(|known| known.evidence(given));
        match evidence {
            Some(Ok(evidence)) => self.judged(reading, given, evidence),
            // An observation that cannot update a belief may still have a probability.
            Some(Err(error)) => {
                Tested::without_residual(!matches!(error, Error::Impossible | Error::NotANumber { .. }))
            }
            None => Tested::without_residual(false),
        }
    }

    /// The test of a report whose evidence under `given` is known.
    pub(super) fn judged(&self, reading: &Reading<'_, D>, given: &Gaussian<D>, evidence: Evidence) -> Tested {
        let is_possible = evidence.log_likelihood > f64::NEG_INFINITY;
        let residual = match &reading.slot.observation {
            Observation::Received(bits) if is_possible && reading.content == Content::Report => {
                self.residual(reading.slot, bits, given, evidence)
            }
            _ => None,
        };
        Tested { is_possible, residual }
    }

    /// Probability that a working sensor is silent, given the belief before the slot.
    pub(super) fn silence(&self, reading: &Reading<'_, D>, predicted: &Gaussian<D>) -> Result<f64, Error> {
        // The reading's likelihood holds for a sensor that works with the present probability. Unless that is one, it is formed again.
        let found = match reading.known().and_then(|known| known.as_constant()) {
            Some(log) if self.state.presence.working == 1.0 => log.exp(),
            _ => self
                .evidence(reading.slot, predicted)?
                .map_or(0.0, |one| one.log_likelihood.exp()),
        };
        Ok(found.min(1.0))
    }

    /// Log likelihood and correction of the observation of a working sensor; `None` if its probability is zero.
    fn evidence(&self, slot: &Slot, belief: &Gaussian<D>) -> Result<Option<Evidence>, Error> {
        match self.sensor.evidence(slot, 1.0, belief) {
            Ok(found) => Ok(Some(found)),
            Err(Error::Impossible) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The residual of a report; `None` if it has none.
    fn residual(&self, slot: &Slot, bits: &BitString, predicted: &Gaussian<D>, received: Evidence) -> Option<Residual> {
        let place = |found: Evidence| (found.log_likelihood, found.correction);
        if bits.bits() == 1 && self.always_speaks {
            return Residual::of_bit((received.log_likelihood.exp() / self.arrival).min(1.0), received.correction);
        }
        if let Some(test) = self.sensor.test_of(slot, predicted) {
            // The likelihood includes the probability that the value arrives; only the value itself is tested.
            let log_density = received.log_likelihood - self.arrival.ln();
            return match test {
                ReportTest::Value(variance) => Residual::of_value(log_density, variance, received.correction),
                ReportTest::Cell(width) => {
                    let (own, likeliest) = if width.is_finite() {
                        // Compared with a cell of this width about the prediction.
                        let half = 0.5 * width / self.sensor.value_variance(predicted)?.sqrt();
                        (log_density + width.ln(), log_interval(-half, half))
                    } else {
                        (log_density, 0.0)
                    };
                    Residual::of_cell(own - likeliest, received.correction)
                }
            };
        }
        self.residual_of_word(slot, bits, |other| {
            let is_received = other.observation == slot.observation;
            let evidence = || self.evidence(other, predicted).ok().flatten();
            if is_received { Some(received) } else { evidence() }.map(place)
        })
    }

    /// The residual of a short word among all words that the sensor may send, each placed by its log likelihood and correction.
    pub(super) fn residual_of_word(
        &self,
        slot: &Slot,
        received: &BitString,
        place: impl Fn(&Slot) -> Option<(f64, f64)>,
    ) -> Option<Residual> {
        if !(1..=WORD_BITS).contains(&received.bits()) {
            return None;
        }
        let (mut found, mut at, mut other) = (Vec::with_capacity(1 << received.bits()), 0, slot.clone());
        // Bits that are no word of the scheme, and words that it never sends, are left out.
        for word in words(received.bits()).filter(|word| self.sensor.decodes(word)) {
            if word == *received {
                at = found.len();
            }
            other.observation = Observation::Received(word);
            found.extend(place(&other));
        }
        Residual::of_word(&found, at)
    }
}
