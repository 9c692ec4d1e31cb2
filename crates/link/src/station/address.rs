//! Where a sensor is: the address that its questions are sent to, and how it changes.

/// Largest number of addresses that wait for confirmation.
const MAX_CANDIDATES: usize = 4;

/// The addresses of one sensor.
///
/// Who copies an authentic datagram and sends the copy ahead of it makes it come from his own address. So a new address only joins the
/// confirmed one: questions go to both. It takes its place when an answer to the question of a slot came from it, and that slot's answer did
/// not come from the confirmed address too, nor from any other: a second copy of an answer counts here, although it is no observation.
#[derive(Debug, Clone)]
pub(super) struct Addresses<A> {
    confirmed: Option<A>,
    candidates: Vec<Candidate<A>>,
    /// Counter of the envelope that answered this slot's question.
    answer: Option<u64>,
    confirmed_answered: bool,
}

#[derive(Debug, Clone)]
struct Candidate<A> {
    address: A,
    answered: bool,
}

impl<A: PartialEq + Clone> Addresses<A> {
    pub(super) fn new(confirmed: Option<A>) -> Self {
        Self {
            confirmed,
            candidates: Vec::new(),
            answer: None,
            confirmed_answered: false,
        }
    }

    pub(super) fn confirmed(&self) -> Option<&A> {
        self.confirmed.as_ref()
    }

    /// All addresses to which the sensor's frames are sent.
    pub(super) fn all(&self) -> impl Iterator<Item = &A> {
        let candidates = self.candidates.iter().map(|candidate| &candidate.address);
        self.confirmed.iter().chain(candidates)
    }

    pub(super) fn is_known(&self) -> bool {
        self.all().next().is_some()
    }

    /// An accepted envelope came from here; `answers` says whether it answers the question of this slot.
    pub(super) fn on_accepted(&mut self, from: A, counter: u64, answers: bool) {
        if answers {
            self.answer = Some(counter);
        }
        self.note(from, answers);
    }

    /// An authentic envelope that was accepted before came from here.
    pub(super) fn on_copy(&mut self, from: A, counter: u64) {
        if self.answer == Some(counter) {
            self.note(from, true);
        }
    }

    fn note(&mut self, from: A, answered: bool) {
        if self.confirmed.as_ref() == Some(&from) {
            self.confirmed_answered |= answered;
            return;
        }
        if let Some(known) = self.candidates.iter_mut().find(|known| known.address == from) {
            known.answered |= answered;
            return;
        }
        if self.candidates.len() == MAX_CANDIDATES {
            self.candidates.remove(0);
        }
        let address = from;
        self.candidates.push(Candidate { address, answered });
    }

    /// The next slot begins: decides by the answers of the last one.
    pub(super) fn on_slot_begins(&mut self) {
        let mut answered = self.candidates.iter().filter(|candidate| candidate.answered);
        let only = match (answered.next(), answered.next()) {
            (Some(only), None) => Some(only.address.clone()),
            _ => None,
        };
        if self.confirmed_answered {
            self.candidates.clear();
        } else if only.is_some() {
            self.confirmed = only;
            self.candidates.clear();
        }
        self.candidates
            .iter_mut()
            .for_each(|candidate| candidate.answered = false);
        (self.answer, self.confirmed_answered) = (None, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copy_that_arrives_first_takes_no_questions() {
        let mut addresses = Addresses::new(Some("sensor"));
        for counter in 1..=5 {
            addresses.on_accepted("thief", counter, true);
            assert_eq!(addresses.all().collect::<Vec<_>>(), [&"sensor", &"thief"]);
            addresses.on_copy("sensor", counter);
            addresses.on_slot_begins();
            assert_eq!(addresses.all().collect::<Vec<_>>(), [&"sensor"]);
        }
    }

    #[test]
    fn sensor_that_moved_is_confirmed_by_its_answer() {
        let mut addresses = Addresses::new(Some("old"));
        addresses.on_accepted("new", 1, false);
        addresses.on_slot_begins();
        assert_eq!((addresses.confirmed(), addresses.all().count()), (Some(&"old"), 2));
        addresses.on_accepted("new", 2, true);
        addresses.on_slot_begins();
        assert_eq!((addresses.confirmed(), addresses.all().count()), (Some(&"new"), 1));
    }

    #[test]
    fn two_that_answer_are_both_asked() {
        let mut addresses = Addresses::new(None);
        assert!(!addresses.is_known());
        addresses.on_accepted("thief", 1, true);
        addresses.on_copy("sensor", 1);
        // An older copy says nothing about this slot.
        addresses.on_copy("third", 0);
        addresses.on_slot_begins();
        assert_eq!((addresses.confirmed(), addresses.all().count()), (None, 2));
        for i in 0..100 {
            addresses.on_accepted(["a", "b", "c", "d", "e", "f"][i % 6], 2, false);
        }
        assert_eq!(addresses.all().count(), MAX_CANDIDATES);
    }
}
