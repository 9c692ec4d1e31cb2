//! Cells of columns that have a type.

use super::{Profile, SAMPLE};
use crate::missing::Spellings;

impl Profile {
    /// Adds a cell that is a double.
    pub(crate) fn add_double(&mut self, value: Option<f64>, gaps: &Spellings) {
        match value.filter(|value| !gaps.has_number(*value)) {
            None => self.gap(""),
            Some(value) => {
                let text = if self.sample.len() < SAMPLE {
                    format!("{value}")
                } else {
                    String::new()
                };
                self.keep(&text);
                self.number(value, 0, &text);
            }
        }
    }

    /// Adds a cell that is a whole number.
    pub(crate) fn add_integer(&mut self, value: Option<i64>, gaps: &Spellings) {
        match value {
            Some(whole) if (whole as f64) as i128 != i128::from(whole) => {
                self.keep(&whole.to_string());
                self.integers += 1;
                self.extend(whole as f64);
                self.extend_whole(whole);
            }
            value => self.add_double(value.map(|whole| whole as f64), gaps),
        }
    }

    /// Adds a cell that is a time, in seconds.
    pub(crate) fn add_time(&mut self, seconds: Option<f64>) {
        match seconds {
            None => self.gap(""),
            Some(_) => self.times += 1,
        }
    }

    /// Adds a cell that is a boolean.
    pub(crate) fn add_boolean(&mut self, value: Option<bool>) {
        match value {
            None => self.gap(""),
            Some(_) => self.booleans += 1,
        }
    }
}
