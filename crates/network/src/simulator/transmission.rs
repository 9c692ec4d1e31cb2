//! What happens to a transmission: drawn, or as a log has it.

use crate::channel::{Check, Copy};
use crate::error::Error;
use crate::frame::Frame;
use crate::kernel::Kernel;
use crate::log::{Reception, Stored, Transmission};
use crate::units::SensorId;
use fewbits_core::BitString;

/// Memory of transmissions that are over.
#[derive(Debug, Default)]
pub(crate) struct Spare {
    pub(crate) receptions: Vec<Reception>,
    pub(crate) copies: Vec<Vec<Copy>>,
}

/// What happened to a transmission.
pub(crate) struct Outcome {
    pub(crate) attempts: u32,
    pub(crate) acknowledged: bool,
    pub(crate) answers: u32,
    pub(crate) receptions: Vec<Reception>,
}

impl Kernel {
    /// What happens on air.
    pub(crate) fn draw(
        &self,
        from: SensorId,
        to: Option<SensorId>,
        frames: &[Stored],
        bits: usize,
        spare: &mut Spare,
    ) -> Outcome {
        let sent = u64::from(self.state.ledger.accounts[from.index()].frames);
        let stream = || self.air.indexed(u64::from(from.0)).indexed(sent);
        let copies = |receiver: u32, attempt: u32, copies: &mut Vec<Copy>| {
            let rng = || {
                stream()
                    .indexed(u64::from(receiver))
                    .indexed(u64::from(attempt))
                    .fast_rng()
            };
            self.setup
                .channel
                .copies(rng, self.field.distance(from.0, receiver), bits, copies);
        };
        let mut outcome = Outcome {
            attempts: 0,
            acknowledged: false,
            answers: 0,
            receptions: std::mem::take(&mut spare.receptions),
        };
        let Some(to) = to else {
            outcome.attempts = 1;
            let neighbours = self.field.graph().neighbours(from.index());
            for to in neighbours
                .iter()
                .map(|receiver| SensorId(*receiver))
                .filter(|to| self.listens(*to))
            {
                let mut arrived = spare.copies.pop().unwrap_or_default();
                copies(to.0, 0, &mut arrived);
                outcome.receptions.push(Reception { to, copies: arrived });
            }
            return outcome;
        };
        let (mut arrived, listens) = (spare.copies.pop().unwrap_or_default(), self.listens(to));
        let most = self.setup.retries.map_or(1, |retries| retries.saturating_add(1));
        while outcome.attempts < most && !outcome.acknowledged {
            let before = arrived.len();
            if listens {
                copies(to.0, 2 * outcome.attempts, &mut arrived);
            }
            outcome.attempts += 1;
            let intact = arrived[before..].iter().any(|copy| self.is_intact(frames, copy));
            if self.setup.retries.is_some() && intact {
                outcome.answers += 1;
                // The answer crosses the same air.
                let mut answer = Vec::new();
                copies(to.0, 2 * outcome.attempts - 1, &mut answer);
                outcome.acknowledged = answer.iter().any(|copy| copy.flipped.is_empty());
            }
        }
        if listens {
            outcome.receptions.push(Reception { to, copies: arrived });
        }
        outcome
    }

    fn is_intact(&self, frames: &[Stored], copy: &Copy) -> bool {
        copy.flipped.is_empty()
            || frames_of(frames, copy).all(|bits| {
                let check = Frame::kind_of(&bits).map_or(Check::Whole, |kind| self.check_of(kind));
                Frame::from_bits(&bits, check).is_ok()
            })
    }
}

/// The frames of a batch as they arrive.
pub(crate) fn frames_of<'a>(frames: &'a [Stored], copy: &'a Copy) -> impl Iterator<Item = BitString> + 'a {
    let mut start = 0;
    frames.iter().map(move |Stored(frame)| {
        let from = start;
        start += frame.bits();
        copy.flipped
            .iter()
            .filter_map(|bit| (*bit as usize).checked_sub(from))
            .filter(|bit| *bit < frame.bits())
            .fold(frame.clone(), BitString::with_flipped)
    })
}

pub(crate) fn replayed(
    recorded: Option<Transmission>,
    from: SensorId,
    to: Option<SensorId>,
    frames: &[Stored],
    transmission: usize,
) -> Result<Outcome, Error> {
    let left = |difference| Error::LeftLog {
        transmission,
        difference,
    };
    let recorded = recorded.ok_or_else(|| left("the log has ended"))?;
    if (recorded.from, recorded.to) != (from, to) {
        return Err(left("sender or receiver"));
    }
    if recorded.frames != frames {
        return Err(left("the bits"));
    }
    Ok(Outcome {
        attempts: recorded.attempts,
        acknowledged: recorded.acknowledged,
        answers: recorded.answers,
        receptions: recorded.receptions,
    })
}
