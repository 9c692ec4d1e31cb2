//! A level that may jump: beside the belief of one that has not, that of one that has, while the readings do not decide.

/// Probability that the level jumps at an instant.
const JUMP: f64 = 1e-3;
/// A belief of a smaller share than this is left out.
const NEGLIGIBLE: f64 = 1e-3;
/// After so many instants the likelier of the two beliefs is taken, since both become alike.
const UNDECIDED: u32 = 10;
/// A jump is considered where a reading is wild with at least this probability.
const DOUBTED: f64 = 0.05;

/// What the readings of an instant say under a belief.
pub(crate) struct InstantLikelihood {
    /// Logarithm of their density.
    pub(crate) log_density: f64,
    /// How far the farthest of the readings is from the prediction.
    pub(crate) farthest: f64,
    /// The largest probability with which one of them is wild.
    pub(crate) doubt: f64,
}

/// A belief, and that after a jump.
pub(crate) struct Beliefs<B> {
    main: B,
    before: B,
    other: Option<Other<B>>,
}

struct Other<B> {
    belief: B,
    share: f64,
    since: f64,
    instants: u32,
}

impl<B> Other<B> {
    /// Takes in readings; the logarithm of share and density.
    fn update<E>(&mut self, update: &mut impl FnMut(&mut B) -> Result<InstantLikelihood, E>) -> Result<f64, E> {
        self.instants += 1;
        Ok(self.share.ln() + update(&mut self.belief)?.log_density)
    }
}

impl<B: Clone> Beliefs<B> {
    pub(crate) fn new(belief: B) -> Self {
        Self {
            before: belief.clone(),
            main: belief,
            other: None,
        }
    }

    /// The belief of a level that has not jumped.
    pub(crate) fn main(&self) -> &B {
        &self.main
    }

    /// Predicts each.
    pub(crate) fn predict<E>(&mut self, predict: impl Fn(&mut B) -> Result<(), E>) -> Result<(), E> {
        predict(&mut self.main)?;
        self.other.as_mut().map_or(Ok(()), |other| predict(&mut other.belief))
    }

    /// Updates each by the readings of an instant, of the belief without a jump first. `wider`: adds the square of a distance to the variance of the
    /// level. Returns the logarithm of the density of the readings, and when the level jumped, if that is decided.
    pub(crate) fn update<E>(
        &mut self,
        seconds: f64,
        mut update: impl FnMut(&mut B) -> Result<InstantLikelihood, E>,
        wider: impl FnOnce(&mut B, f64) -> Result<(), E>,
    ) -> Result<(f64, Option<f64>), E> {
        self.before.clone_from(&self.main);
        let said = update(&mut self.main)?;
        let stays = 1.0 - self.other.as_ref().map_or(0.0, |other| other.share);
        let stayed = stays.ln() + said.log_density;
        let mut jumped = f64::NEG_INFINITY;
        if let Some(other) = &mut self.other {
            jumped = other.update(&mut update)?;
        }
        if said.doubt > DOUBTED {
            let mut new = Other {
                belief: self.before.clone(),
                // Without the doubt the likelihood would have a step where a jump begins to be considered.
                share: stays * JUMP * said.doubt,
                since: seconds,
                instants: 0,
            };
            wider(&mut new.belief, said.farthest)?;
            let newly = new.update(&mut update)?;
            if newly > jumped {
                (self.other, jumped) = (Some(new), newly);
            }
        }
        let Some(other) = &mut self.other else {
            return Ok((stayed, None));
        };
        let largest = stayed.max(jumped);
        let sum = (stayed - largest).exp() + (jumped - largest).exp();
        other.share = (jumped - largest).exp() / sum;
        let is_decided = other.instants >= UNDECIDED || !(NEGLIGIBLE..=1.0 - NEGLIGIBLE).contains(&other.share);
        let decided = if is_decided { self.other.take() } else { None };
        let jump = decided.filter(|other| other.share > 0.5).map(|other| {
            self.main = other.belief;
            other.since
        });
        Ok((largest + sum.ln(), jump))
    }
}
