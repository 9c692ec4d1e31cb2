//! Categories at an axis: names in lines that fit their room.

use super::frame::{Drawn, Frame};
use super::scale::Scaled;
use super::style::{TICK, text, wide};
use plotters::element::Text;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// From the axis to its numbers and names.
pub(super) const GAP: i32 = 26;
/// Widest name left of an axis.
const WIDEST: f64 = 1500.0;
/// Height of a line of names.
const NAME: i32 = 84;

/// The names of an axis in their lines; none on an axis of numbers.
pub(super) struct Names {
    lines: Vec<(f64, Vec<String>)>,
    /// Whether every other name stands lower, where words are wider than the room.
    staggered: bool,
}

impl Names {
    /// Below an axis of this length: no name reaches into its neighbours' room.
    pub(super) fn below(axis: &Scaled, length: f64) -> Self {
        let mut places: Vec<f64> = axis.names().iter().map(|(at, _)| axis.position(*at)).collect();
        places.sort_by(f64::total_cmp);
        let gaps = places.windows(2).map(|pair| pair[1] - pair[0]);
        let room = 0.94 * length * gaps.fold(1.0, f64::min);
        let level = Self::within(axis, room);
        let staggered = level.width() > room;
        let lines = if staggered {
            Self::within(axis, 2.0 * room).lines
        } else {
            level.lines
        };
        Self { lines, staggered }
    }

    pub(super) fn left(axis: &Scaled) -> Self {
        Self::within(axis, WIDEST)
    }

    fn within(axis: &Scaled, room: f64) -> Self {
        let lines = axis.names().iter().map(|(at, name)| (*at, lines(name, room))).collect();
        Self {
            lines,
            staggered: false,
        }
    }

    /// Lines of the name that has most.
    fn most(&self) -> i32 {
        self.lines
            .iter()
            .map(|(_, lines)| lines.len() as i32)
            .max()
            .unwrap_or(1)
    }

    /// Lines below an axis.
    pub(super) fn depth(&self) -> i32 {
        self.most() * if self.staggered { 2 } else { 1 }
    }

    /// Lines of all names when each has as many as the deepest.
    pub(super) fn height(&self) -> i32 {
        self.lines.len() as i32 * self.most() * NAME
    }

    pub(super) fn width(&self) -> f64 {
        let lines = self.lines.iter().flat_map(|(_, lines)| lines);
        lines.map(|line| wide(line, TICK)).fold(0.0, f64::max)
    }

    /// Writes them below the frame.
    pub(super) fn draw_below(&self, frame: &Frame<'_, '_>) -> Drawn {
        for ((at, lines), place) in self.lines.iter().zip(0..) {
            let x = frame.across(*at).round() as i32;
            let lower = if self.staggered {
                place % 2 * self.most() * NAME
            } else {
                0
            };
            column(frame, lines, (x, frame.bottom as i32 + GAP + lower), Pos::new(HPos::Center, VPos::Top))?;
        }
        Ok(())
    }

    /// Writes them left of the frame.
    pub(super) fn draw_left(&self, frame: &Frame<'_, '_>) -> Drawn {
        for (at, lines) in &self.lines {
            let y = frame.down(*at).round() as i32 - (lines.len() as i32 - 1) * NAME / 2;
            column(frame, lines, (frame.left as i32 - GAP, y), Pos::new(HPos::Right, VPos::Center))?;
        }
        Ok(())
    }
}

fn column(frame: &Frame<'_, '_>, lines: &[String], (x, y): (i32, i32), anchor: Pos) -> Drawn {
    for (line, down) in lines.iter().zip(0..) {
        let words = Text::new(line.clone(), (x, y + down * NAME), text(TICK).pos(anchor));
        frame.area.draw(&words)?;
    }
    Ok(())
}

/// A name cut after commas, or between words where that leaves too much, so that lines fit the room if their words do.
fn lines(name: &str, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let parts = || name.split_inclusive(", ").map(str::trim);
    let fit = parts().all(|part| wide(part, TICK) <= room);
    let words: Vec<&str> = if fit {
        parts().collect()
    } else {
        name.split_whitespace().collect()
    };
    for word in words {
        match lines.last_mut() {
            Some(line) if wide(&format!("{line} {word}"), TICK) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cut_between_words() {
        assert_eq!(lines("a = 0.9, γ = 0.5", 400.0), ["a = 0.9,", "γ = 0.5"]);
        assert_eq!(lines("one two, three", 250.0), ["one", "two,", "three"]);
        assert_eq!(lines("unbreakable", 1.0), ["unbreakable"]);
        assert!(lines("", 100.0).is_empty());
    }
}
