//! Hypotheses that are over, whose buffers the next ones take.

use super::bank::Hypothesis;

/// So many are kept at most.
const KEPT: usize = 32;

/// Buffers of hypotheses.
#[derive(Debug, Clone, Default)]
pub(super) struct Spare(Vec<Hypothesis>);

impl Spare {
    /// A copy of a hypothesis.
    pub(super) fn copy(&mut self, of: &Hypothesis) -> Hypothesis {
        match self.0.pop() {
            Some(mut one) => {
                one.clone_from(of);
                one
            }
            None => of.clone(),
        }
    }

    /// Keeps the hypotheses of a list for which this holds.
    pub(super) fn retain(&mut self, list: &mut Vec<Hypothesis>, mut is_kept: impl FnMut(&mut Hypothesis) -> bool) {
        for over in list.extract_if(.., |one| !is_kept(one)) {
            if self.0.len() < KEPT {
                self.0.push(over);
            }
        }
    }
}
