//! What the first rows leave open of the change and the noises that are found from them.
//!
//! A noise far below the change per row is found from how much more the values scatter than the level moves. Few rows tell that badly, and nothing else
//! tells how far the level is from such values. Bands are widened by it, and the summary says so.

use crate::level::later::Unknown;
use crate::level::settings::Settings;
use crate::rows::instant::Instant;
use crate::text;
use crate::text::short;
use fewbits_filters::calibration::Openness;

/// Standard deviation of the logarithm of the estimate's deviation from which it is told.
const TOLD: f64 = 0.25;
/// More sensors are not looked at.
const MOST: usize = 20;

/// Factor of the estimate's deviation: a mixture of deviations has wider bands than one of them, and their ends are farther out.
pub(crate) fn factor(open: &Openness) -> f64 {
    1.0 + open.of_level * open.of_level
}

impl Settings {
    /// Finds what the rows from which numbers were found leave open.
    pub(crate) fn find_openness(&mut self, rows: &[Instant], names: &[String], unknown: &Unknown) {
        self.world.open = None;
        if names.len() <= MOST && !self.world.is_on_change {
            let (change, noises) = self.numbers(names, Some(unknown));
            let open = self.world.openness(&self.readings(rows, names), change, &noises);
            self.world.open = open.ok().flatten();
        }
    }

    /// Finds numbers again from `more` rows, the first ones among them, or those of errors that last. Whether they are others.
    pub(crate) fn find_again(
        &mut self,
        (first, more): (&[Instant], &[Instant]),
        names: &[String],
        unknown: &Unknown,
    ) -> bool {
        let was_lasting = self.lasting.is_some();
        if unknown.noise && unknown.change && self.find_lasting(more, names) {
            return true;
        }
        // Under errors that last the likelihood of those that do not says nothing.
        let is_refined = !was_lasting && self.refine((first, more), names, unknown);
        if is_refined {
            self.find_openness(more, names, unknown);
        }
        is_refined
    }

    /// What is to be said of the numbers that were found last.
    pub(crate) fn lines_of_found(&self, names: &[String]) -> Vec<String> {
        let mut lines = self.lasting_lines(names);
        lines.extend(self.openness_line(names));
        lines
    }

    /// A line, if the rows leave much open.
    fn openness_line(&self, names: &[String]) -> Option<String> {
        let open = self.world.open.as_ref().filter(|open| open.of_level > TOLD)?;
        let (what, option) = match open.number.and_then(|sensor| names.get(sensor)) {
            Some(name) => (format!("the noise of {}", text::name(name)), "--noise"),
            None => ("the change of the level".to_owned(), "--change"),
        };
        Some(format!(
            "{what} is known only within a factor of {}: bands rest on it, and are wider by {} for it; if it is known, {option} says it",
            short((2.0 * open.of_number).exp()),
            short(factor(open))
        ))
    }
}
