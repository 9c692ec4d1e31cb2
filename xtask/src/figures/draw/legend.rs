//! Legends stand below their panel, where they hide no data, and show the marks that are drawn; the colour bar of fields.

use super::Area;
use super::frame::{mark, path};
use super::scale::Scaled;
use super::style::{LINE, TEXT, TICK, colour, dashes, heat, marker, pen, text};
use fewbits_experiments::plot::{Axis, Layer, Panel, Shape};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::element::{Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of a sample of a layer.
const SAMPLE: i32 = 190;
const MARGIN: i32 = 60;

/// Layers in lines of entries `(left, position of the layer)` that fit a panel's width.
fn lines(panel: &Panel, width: i32) -> Vec<Vec<(i32, usize)>> {
    let mut lines: Vec<Vec<(i32, usize)>> = Vec::new();
    let mut left = i32::MAX / 2;
    let named = |layer: &Layer| {
        let shown = !layer.label.is_empty() && !layer.inline && !layer.is_empty();
        shown && !matches!(layer.shape, Shape::Heat { .. })
    };
    for (position, layer) in panel.layers.iter().enumerate().filter(|(_, l)| named(l)) {
        let wide = SAMPLE + 50 + (f64::from(TEXT) * 0.56 * layer.label.chars().count() as f64) as i32;
        if left + wide > width - MARGIN {
            lines.push(Vec::new());
            left = MARGIN;
        }
        if let Some(line) = lines.last_mut() {
            line.push((left, position));
        }
        left += wide;
    }
    lines
}

/// Height of a panel's legend.
pub(super) fn height(panel: &Panel, width: i32) -> i32 {
    if !panel.legend {
        0
    } else {
        lines(panel, width).len() as i32 * LINE
    }
}

/// Draws the legend into an area that is as high as [`height`] says.
pub(super) fn draw(area: &Area<'_>, panel: &Panel) -> Result<(), String> {
    if !panel.legend {
        return Ok(());
    }
    let (width, _) = area.dim_in_pixel();
    for (row, line) in lines(panel, width as i32).into_iter().enumerate() {
        let middle = row as i32 * LINE + LINE / 2;
        for (left, position) in line {
            let layer = &panel.layers[position];
            sample(area, layer, position, left, middle)?;
            // A curve's marks are a layer of their own, without a name.
            if let Some(marks) = panel.layers.get(position + 1).filter(|next| belongs(next, layer)) {
                sample(area, marks, position + 1, left, middle)?;
            }
            let style = text(TEXT).pos(Pos::new(HPos::Left, VPos::Center));
            let words = Text::new(layer.label.clone(), (left + SAMPLE, middle), style);
            area.draw(&words).map_err(|e| e.to_string())?;
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
fn sample(area: &Area<'_>, layer: &Layer, position: usize, left: i32, middle: i32) -> Result<(), String> {
    let ends = [
        (f64::from(left), f64::from(middle)),
        (f64::from(left + SAMPLE - 30), f64::from(middle)),
    ];
    match &layer.shape {
        Shape::Line { stroke, .. } => {
            path(area, &ends, dashes(layer, position, *stroke), pen(layer, position, *stroke))
        }
        Shape::Points { marker: own, .. } => {
            let centre = (0.5 * (ends[0].0 + ends[1].0), f64::from(middle));
            mark(area, centre, marker(layer, position, *own), colour(layer, position))
        }
        _ => {
            let corners = [(left + 40, middle - 24), (left + SAMPLE - 70, middle + 24)];
            let opacity = if matches!(layer.shape, Shape::Band { .. }) {
                0.25
            } else {
                0.8
            };
            let filled = Rectangle::new(corners, colour(layer, position).mix(opacity).filled());
            area.draw(&filled).map_err(|e| e.to_string())
        }
    }
}

/// Draws the ramp of a field with its values.
pub(super) fn colour_bar(area: &Area<'_>, label: &str, (low, high): (f64, f64)) -> Result<(), String> {
    let (_, height) = area.dim_in_pixel();
    let (top, bottom) = (250, height as i32 - 260);
    let steps = 64;
    let at = |share: f64| bottom - (f64::from(bottom - top) * share).round() as i32;
    // From the top down, each piece reaching to the bottom, so that no seam shines through.
    for i in (0..steps).rev() {
        let (from, to) = (f64::from(i) / f64::from(steps), f64::from(i + 1) / f64::from(steps));
        let bar = Rectangle::new([(20, at(to)), (100, bottom)], heat(0.5 * (from + to)).filled());
        area.draw(&bar).map_err(|e| e.to_string())?;
    }
    let style = text(TICK).pos(Pos::new(HPos::Left, VPos::Center));
    let axis = Scaled::new(&Axis::linear("").between(low, high), std::iter::empty());
    for i in 0..=4 {
        let share = f64::from(i) / 4.0;
        let value = low + share * (high - low);
        let digits = format!("{value:.3}").parse::<f64>().unwrap_or(value);
        let words = Text::new(axis.format_ext(&digits), (124, at(share)), style.clone());
        area.draw(&words).map_err(|e| e.to_string())?;
    }
    let words = Text::new(label.to_owned(), (20, top - 80), style);
    area.draw(&words).map_err(|e| e.to_string())
}
