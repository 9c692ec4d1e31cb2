//! Shares of several files, one for each of several machines.

use std::str::FromStr;

/// One of several equal shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shard {
    pub(crate) index: usize,
    pub(crate) count: usize,
}

impl Shard {
    /// The number of the share, from 1.
    pub(crate) fn number(self) -> usize {
        self.index + 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, count) = text.split_once('/').ok_or("expected I/N, as 2/3")?;
        let parse = |text: &str| {
            text.trim()
                .parse::<usize>()
                .map_err(|_| format!("`{text}`: expected a whole number"))
        };
        let (number, count) = (parse(number)?, parse(count)?);
        if number == 0 || number > count {
            return Err(format!("share {number} of {count}: expected 1 to {count}"));
        }
        Ok(Self {
            index: number - 1,
            count,
        })
    }
}
