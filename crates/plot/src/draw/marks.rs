//! Layers on their axes.

use super::frame::{Drawn, Frame, MARK, mark, round};
use super::style::{PAPER, TICK, colour, dashes, heat, marker, pen, text, wide};
use crate::{Layer, Shape};
use plotters::element::{PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor};

/// Draws one layer; `shades` are the values at the ends of the colour ramp of fields.
pub(super) fn draw(frame: &Frame<'_, '_>, layer: &Layer, shades: (f64, f64)) -> Drawn {
    let ink = colour(layer);
    match &layer.shape {
        Shape::Line { points, stroke } => {
            // A curve of one point would be nothing.
            let alone = points.first().filter(|_| points.len() == 1);
            match alone.and_then(|p| frame.place(*p)).filter(|at| frame.inside(*at)) {
                Some(at) => mark(frame.area, at, marker(layer), ink),
                None => frame.curve(points, dashes(layer, *stroke), pen(layer, *stroke)),
            }
        }
        Shape::Points {
            points,
            errors,
            sideways,
            ..
        } => {
            let shown = || {
                points.iter().enumerate().filter_map(|(i, p)| {
                    let at = frame.place(*p).filter(|at| frame.inside(*at))?;
                    let error = errors.get(i).copied().filter(|e| e.is_finite()).unwrap_or(0.0);
                    Some((p, at, error))
                })
            };
            for (p, at, error) in shown().filter(|(.., error)| *error > 0.0) {
                let end = |sign: f64| match sideways {
                    true => round((frame.across_cut(p.0 + sign * error), at.1)),
                    false => round((at.0, frame.down_cut(p.1 + sign * error))),
                };
                let bar = PathElement::new(vec![end(-1.0), end(1.0)], ink.stroke_width(6));
                frame.area.draw(&bar)?;
            }
            for (_, at, _) in shown() {
                mark(frame.area, at, marker(layer), ink)?;
            }
            Ok(())
        }
        Shape::Boxes { boxes: list } => boxes(frame, list, ink),
        Shape::Heat { x, y, values } => field(frame, x, y, values, shades),
        Shape::Band { limits } => {
            let upper = limits.iter().map(|l| (l.0, l.2));
            let outline = limits
                .iter()
                .map(|l| (l.0, l.1))
                .chain(upper.rev())
                .filter(|p| frame.x.accepts(p.0));
            let outline: Vec<_> = outline
                .map(|p| round((frame.across(p.0), frame.down_cut(p.1))))
                .collect();
            frame.area.draw(&Polygon::new(outline, ink.mix(0.25)))
        }
        Shape::Texts { texts, beside } => {
            let style = text(TICK).pos(Pos::new(HPos::Center, VPos::Center));
            for (x, y, words) in texts {
                let Some(at) = frame.place((*x, *y)).filter(|at| frame.inside(*at)) else {
                    continue;
                };
                let (half, high) = (0.5 * wide(words, TICK) + 6.0, 0.42 * f64::from(TICK));
                let mut at = at;
                if *beside {
                    let (last, first) = (frame.right - half, frame.top + high);
                    at = ((at.0 + MARK + half).min(last), (at.1 - MARK - high).max(first));
                    let ground = [round((at.0 - half, at.1 - high)), round((at.0 + half, at.1 + high))];
                    let paper = Rectangle::new(ground, PAPER.mix(0.55).filled());
                    frame.area.draw(&paper)?;
                }
                let name = Text::new(words.clone(), round(at), style.clone());
                frame.area.draw(&name)?;
            }
            Ok(())
        }
    }
}

/// Writes the names of contours on them, along steep ones upwards: as near to the middle of what is seen as no other contour and
/// no other name allows.
pub(super) fn names(frame: &Frame<'_, '_>, layers: &[Layer]) -> Drawn {
    type Box = (f64, f64, f64, f64);
    let meet = |a: &Box, b: &Box| a.0 < b.1 && b.0 < a.1 && a.2 < b.3 && b.2 < a.3;
    let seen = |layer: &Layer| match &layer.shape {
        Shape::Line { points, .. } if layer.inline => points
            .iter()
            .filter_map(|p| frame.place(*p))
            .filter(|at| frame.inside(*at))
            .collect(),
        _ => Vec::new(),
    };
    let curves: Vec<Vec<(f64, f64)>> = layers.iter().map(seen).collect();
    let mut written: Vec<Box> = Vec::new();
    for (i, (layer, curve)) in layers.iter().zip(&curves).enumerate().filter(|(_, (_, c))| c.len() > 2) {
        let steep = |at: usize| {
            let (a, b) = (curve[at.saturating_sub(1)], curve[(at + 1).min(curve.len() - 1)]);
            (b.1 - a.1).abs() > (b.0 - a.0).abs()
        };
        let ground = |at: usize| {
            let (x, y) = curve[at];
            let (half, high) = (0.5 * wide(&layer.label, TICK) + 8.0, 0.42 * f64::from(TICK));
            let (half, high) = if steep(at) { (high, half) } else { (half, high) };
            (x - half, x + half, y - high, y + high)
        };
        let free = |at: &usize| {
            let here = ground(*at);
            let mut others = curves
                .iter()
                .enumerate()
                .filter(|(j, _)| *j != i)
                .flat_map(|(_, curve)| curve);
            let crossed = others.any(|p| meet(&here, &(p.0, p.0, p.1, p.1)));
            !crossed && !written.iter().any(|other| meet(&here, other))
        };
        let shares = [0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65, 0.3, 0.7, 0.25, 0.75, 0.2, 0.8];
        let places = shares.map(|share: f64| (share * (curve.len() - 1) as f64) as usize);
        let at = places.into_iter().find(free).unwrap_or(places[0]);
        let here = ground(at);
        let paper = Rectangle::new([round((here.0, here.2)), round((here.1, here.3))], PAPER.mix(0.9).filled());
        frame.area.draw(&paper)?;
        let style = text(TICK).pos(Pos::new(HPos::Center, VPos::Center));
        let style = if steep(at) {
            style.transform(FontTransform::Rotate270)
        } else {
            style
        };
        let name = Text::new(layer.label.clone(), round(curve[at]), style);
        frame.area.draw(&name)?;
        written.push(here);
    }
    Ok(())
}

/// Filled rectangles `(left, right, bottom, top)`, cut at the frame.
fn boxes(frame: &Frame<'_, '_>, boxes: &[(f64, f64, f64, f64)], ink: RGBColor) -> Drawn {
    for (left, right, bottom, top) in boxes.iter().filter(|b| frame.x.accepts(b.0) && frame.x.accepts(b.1)) {
        let across = |x: f64| frame.across(x).clamp(frame.left, frame.right).round() as i32;
        let down = |y: f64| frame.down_cut(y).round() as i32;
        let corners = [(across(*left), down(*bottom)), (across(*right), down(*top))];
        frame.area.draw(&Rectangle::new(corners, ink.filled()))?;
    }
    Ok(())
}

/// Shades of a field besides the lowest: more than an eye tells apart.
const SHADES: f64 = 128.0;

fn field(frame: &Frame<'_, '_>, x: &[f64], y: &[f64], values: &[Vec<f64>], (low, high): (f64, f64)) -> Drawn {
    let (left, bottom) = (edges(x), edges(y));
    // Each cell reaches under its next neighbours, drawn later, so that no seam shines through.
    let under = |edges: &[f64], i: usize| edges[(i + 2).min(edges.len() - 1)];
    // Neighbours of one shade are one rectangle: a fine field would be megabytes of cells otherwise.
    let shade = |value: f64| {
        let share = (value - low) / (high - low).max(f64::MIN_POSITIVE);
        value.is_finite().then(|| (SHADES * share.clamp(0.0, 1.0)).round())
    };
    for (j, row) in values.iter().enumerate() {
        let mut start = 0;
        for run in row.chunk_by(|a, b| shade(*a) == shade(*b)) {
            let last = start + run.len() - 1;
            if let Some(shade) = shade(run[0]) {
                let cell = (left[start], under(&left, last), bottom[j], under(&bottom, j));
                boxes(frame, &[cell], heat(shade / SHADES))?;
            }
            start = last + 1;
        }
    }
    Ok(())
}

/// Edges of cells with the given centres; outermost cells are symmetric about their centres.
pub(super) fn edges(centres: &[f64]) -> Vec<f64> {
    match centres {
        [] => Vec::new(),
        [only] => vec![only - 0.5, only + 0.5],
        [first, second, ..] => {
            let last = centres[centres.len() - 1];
            let end = 0.5 * (last - centres[centres.len() - 2]);
            std::iter::once(first - 0.5 * (second - first))
                .chain(centres.windows(2).map(|c| 0.5 * (c[0] + c[1])))
                .chain([last + end])
                .collect()
        }
    }
}

/// All horizontal and vertical positions of a layer.
pub(super) fn extent(layer: &Layer) -> (Vec<f64>, Vec<f64>) {
    match &layer.shape {
        Shape::Line { points, .. } => points.iter().copied().unzip(),
        Shape::Points {
            points,
            errors,
            sideways,
            ..
        } => {
            let (mut x, mut y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            for (p, e) in points.iter().zip(errors) {
                let (along, at) = if *sideways { (&mut x, p.0) } else { (&mut y, p.1) };
                along.extend([at - e, at + e]);
            }
            (x, y)
        }
        Shape::Heat { x, y, .. } => (edges(x), edges(y)),
        Shape::Boxes { boxes } => {
            (boxes.iter().flat_map(|b| [b.0, b.1]).collect(), boxes.iter().flat_map(|b| [b.2, b.3]).collect())
        }
        Shape::Band { limits } => {
            (limits.iter().map(|l| l.0).collect(), limits.iter().flat_map(|l| [l.1, l.2]).collect())
        }
        Shape::Texts { texts, .. } => texts.iter().map(|(x, y, _)| (*x, *y)).unzip(),
    }
}
