//! Legends stand below their panel, where they hide no data, and show the marks that are drawn; the colour bar of fields.

use super::Area;
use super::frame::{Drawn, mark, path};
use super::scale::Scaled;
use super::style::{LINE, PANEL_WIDTH, TEXT, TICK, colour, dashes, heat, marker, pen, text, wide};
use crate::{Axis, Layer, Panel, Shape};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::element::{Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of a sample of a layer: room for the longest pattern of dashes and a dash more.
const SAMPLE: i32 = 300;
const MARGIN: i32 = 60;

/// A named layer of a panel, with the marks on it.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    layer: &'a Layer,
    marks: Option<&'a Layer>,
}

/// Entries with the left edge and the width of the room they share.
pub(super) type Block<'a> = (i32, i32, Vec<Entry<'a>>);

impl<'a> Entry<'a> {
    fn of(panel: &'a Panel) -> Vec<Self> {
        let named = |layer: &Layer| {
            let shown = panel.legend && !layer.label.is_empty() && !layer.inline && !layer.is_empty();
            shown && !matches!(layer.shape, Shape::Heat { .. })
        };
        // A curve's marks are a layer of their own, without a name.
        let entry = |(i, layer)| Self {
            layer,
            marks: panel.layers.get(i + 1).filter(|next| belongs(next, layer)),
        };
        panel
            .layers
            .iter()
            .enumerate()
            .filter(|(_, layer)| named(layer))
            .map(entry)
            .collect()
    }

    /// What is seen of it.
    fn look(&self) -> impl PartialEq {
        let layer = |layer: &Layer| {
            let stroke = match layer.shape {
                Shape::Line { stroke, .. } => Some(stroke),
                _ => None,
            };
            let mark = matches!(layer.shape, Shape::Points { .. }).then(|| marker(layer));
            (layer.colour, std::mem::discriminant(&layer.shape), stroke, mark)
        };
        (layer(self.layer), self.marks.map(layer))
    }

    fn wide(&self) -> i32 {
        SAMPLE + 56 + wide(&self.layer.label, TEXT) as i32
    }
}

/// Both lists in one without what both have; none if they have nothing in common, if a name looks otherwise in the other, or if a
/// look has another name there.
fn union<'a>(one: &[Entry<'a>], other: &[Entry<'a>]) -> Option<Vec<Entry<'a>>> {
    let mut all = one.to_vec();
    for entry in other {
        let same = |known: &Entry<'_>| (known.layer.label == entry.layer.label, known.look() == entry.look());
        match one.iter().map(same).find(|(name, look)| *name || *look) {
            None => all.push(*entry),
            Some((true, true)) => {}
            Some(_) => return None,
        }
    }
    let shared = all.len() < one.len() + other.len();
    (shared || one.is_empty() || other.is_empty()).then_some(all)
}

/// The legends below rows of panels: one for a row whose panels share entries and no name or look has two meanings, and one for
/// several such rows, below the last.
pub(super) fn of_rows<'a>(rows: &[&'a [Panel]], columns: usize) -> Vec<Vec<Block<'a>>> {
    let width = PANEL_WIDTH as i32;
    let of_row = |row: &&'a [Panel]| {
        let panels: Vec<Vec<Entry<'a>>> = row.iter().map(Entry::of).collect();
        let one = panels.iter().try_fold(Vec::new(), |all, more| union(&all, more));
        one.map_or_else(
            || {
                panels
                    .into_iter()
                    .zip(0..)
                    .map(|(all, column)| (column * width, width, all))
                    .collect()
            },
            |all| vec![(0, columns as i32 * width, all)],
        )
    };
    let mut legends: Vec<Vec<Block<'a>>> = rows.iter().map(of_row).collect();
    for next in 1..legends.len() {
        let ([(.., one)], [(.., other)]) = (&legends[next - 1][..], &legends[next][..]) else {
            continue;
        };
        let both = !one.is_empty() && !other.is_empty();
        if let Some(all) = union(one, other).filter(|_| both) {
            legends[next][0].2 = all;
            legends[next - 1].clear();
        }
    }
    legends
}

/// Entries in lines that fit the width.
fn lines<'a>(entries: &[Entry<'a>], width: i32) -> Vec<Vec<(i32, Entry<'a>)>> {
    let mut lines: Vec<Vec<(i32, Entry<'a>)>> = Vec::new();
    let mut left = i32::MAX / 2;
    for entry in entries {
        if left + entry.wide() > width - MARGIN {
            lines.push(Vec::new());
            left = MARGIN;
        }
        if let Some(line) = lines.last_mut() {
            line.push((left, *entry));
        }
        left += entry.wide();
    }
    lines
}

/// Height of a row's legend.
pub(super) fn height(blocks: &[Block<'_>]) -> i32 {
    let heights = blocks
        .iter()
        .map(|(_, width, entries)| lines(entries, *width).len() as i32 * LINE);
    heights.max().unwrap_or(0)
}

/// Draws a row's legend.
pub(super) fn draw(area: &Area<'_>, blocks: &[Block<'_>], top: i32) -> Drawn {
    for (start, width, entries) in blocks {
        for (line, row) in lines(entries, *width).into_iter().zip(0..) {
            let middle = top + row * LINE + LINE / 2;
            for (left, entry) in line.into_iter().map(|(left, entry)| (start + left, entry)) {
                sample(area, entry.layer, left, middle)?;
                entry.marks.map_or(Ok(()), |marks| sample(area, marks, left, middle))?;
                let style = text(TEXT).pos(Pos::new(HPos::Left, VPos::Center));
                let words = Text::new(entry.layer.label.clone(), (left + SAMPLE, middle), style);
                area.draw(&words)?;
            }
        }
    }
    Ok(())
}

/// Whether marks without a name of their own are those of a curve.
fn belongs(marks: &Layer, curve: &Layer) -> bool {
    let kinds = matches!((&marks.shape, &curve.shape), (Shape::Points { .. }, Shape::Line { .. }));
    kinds && marks.label.is_empty() && marks.colour.is_some() && marks.colour == curve.colour
}

/// What a layer looks like.
fn sample(area: &Area<'_>, layer: &Layer, left: i32, middle: i32) -> Drawn {
    let ends = [
        (f64::from(left), f64::from(middle)),
        (f64::from(left + SAMPLE - 30), f64::from(middle)),
    ];
    match &layer.shape {
        Shape::Line { stroke, .. } => path(area, &ends, dashes(layer, *stroke), pen(layer, *stroke)),
        Shape::Points { .. } => {
            let centre = (0.5 * (ends[0].0 + ends[1].0), f64::from(middle));
            mark(area, centre, marker(layer), colour(layer))
        }
        _ => {
            let corners = [(left + 40, middle - 24), (left + SAMPLE - 70, middle + 24)];
            let opacity = if matches!(layer.shape, Shape::Band { .. }) {
                0.25
            } else {
                0.8
            };
            let filled = Rectangle::new(corners, colour(layer).mix(opacity).filled());
            area.draw(&filled)
        }
    }
}

/// Draws the ramp of a field with its values, as high as the field's frame.
pub(super) fn colour_bar(area: &Area<'_>, label: &str, (low, high): (f64, f64), (top, bottom): (i32, i32)) -> Drawn {
    let (width, _) = area.dim_in_pixel();
    let steps = 64;
    let at = |share: f64| bottom - (f64::from(bottom - top) * share).round() as i32;
    // From the top down, each piece reaching to the bottom, so that no seam shines through.
    for i in (0..steps).rev() {
        let (from, to) = (f64::from(i) / f64::from(steps), f64::from(i + 1) / f64::from(steps));
        let bar = Rectangle::new([(20, at(to)), (100, bottom)], heat(0.5 * (from + to)).filled());
        area.draw(&bar)?;
    }
    let axis = Scaled::new(&Axis::linear("").between(low, high), std::iter::empty(), false);
    for value in axis.ticks(6) {
        let words = Text::new(
            axis.format_ext(&value),
            (124, at(axis.position(value))),
            text(TICK).pos(Pos::new(HPos::Left, VPos::Center)),
        );
        area.draw(&words)?;
    }
    let style = text(TICK).pos(Pos::new(HPos::Right, VPos::Center));
    let words = Text::new(label.to_owned(), (width as i32 - 30, top - 76), style);
    area.draw(&words)
}
