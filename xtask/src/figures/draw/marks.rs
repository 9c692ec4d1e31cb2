//! Layers on their axes.

use super::frame::{Frame, mark};
use super::style::{PAPER, TICK, colour, dashes, heat, marker, pen, text};
use fewbits_experiments::plot::{Layer, Shape};
use plotters::element::{PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

fn why(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Draws one layer; `shades` are the values at the ends of the colour ramp of fields.
pub(super) fn draw(frame: &Frame<'_, '_>, layer: &Layer, position: usize, shades: (f64, f64)) -> Result<(), String> {
    let ink = colour(layer, position);
    match &layer.shape {
        Shape::Line { points, stroke } => {
            frame.curve(points, dashes(layer, position, *stroke), pen(layer, position, *stroke))?;
            if layer.inline {
                inline(frame, points, &layer.label)
            } else {
                Ok(())
            }
        }
        Shape::Points {
            points,
            errors,
            marker: own,
        } => {
            let shown = || {
                points
                    .iter()
                    .filter_map(|p| Some((p, frame.place(*p).filter(|at| frame.inside(*at))?)))
            };
            for ((p, at), error) in shown().zip(errors_of(points, errors, frame)) {
                let bar = [frame.down_cut(p.1 - error), frame.down_cut(p.1 + error)];
                let line = bar.map(|y| (at.0.round() as i32, y.round() as i32)).to_vec();
                if error > 0.0 {
                    frame
                        .area
                        .draw(&PathElement::new(line, ink.stroke_width(6)))
                        .map_err(why)?;
                }
            }
            let marker = marker(layer, position, *own);
            for (_, at) in shown() {
                mark(frame.area, at, marker, ink)?;
            }
            Ok(())
        }
        Shape::Bars { points, width } => {
            let bars: Vec<_> = points
                .iter()
                .map(|p| (p.0 - width / 2.0, p.0 + width / 2.0, 0.0, p.1))
                .collect();
            boxes(frame, &bars, ink, 0.8)
        }
        Shape::Boxes { boxes: list } => boxes(frame, list, ink, 1.0),
        Shape::Heat { x, y, values } => field(frame, x, y, values, shades),
        Shape::Band { limits } => {
            let upper = limits.iter().map(|l| (l.0, l.2));
            let outline = limits
                .iter()
                .map(|l| (l.0, l.1))
                .chain(upper.rev())
                .filter(|p| frame.x.accepts(p.0));
            let outline: Vec<_> = outline
                .map(|p| (frame.across(p.0).round() as i32, frame.down_cut(p.1).round() as i32))
                .collect();
            frame.area.draw(&Polygon::new(outline, ink.mix(0.25))).map_err(why)
        }
        Shape::Texts { texts } => {
            let style = text(TICK).pos(Pos::new(HPos::Center, VPos::Center));
            for (x, y, words) in texts {
                if let Some(at) = frame.place((*x, *y)).filter(|at| frame.inside(*at)) {
                    let at = (at.0.round() as i32, at.1.round() as i32);
                    frame
                        .area
                        .draw(&Text::new(words.clone(), at, style.clone()))
                        .map_err(why)?;
                }
            }
            Ok(())
        }
    }
}

/// The error bars of those points that are shown; 0 where there is none.
fn errors_of(points: &[(f64, f64)], errors: &[f64], frame: &Frame<'_, '_>) -> Vec<f64> {
    let shown = |p: &(f64, f64)| frame.place(*p).is_some_and(|at| frame.inside(at));
    let error = |(i, _): (usize, &(f64, f64))| errors.get(i).copied().filter(|e| e.is_finite()).unwrap_or(0.0);
    points.iter().enumerate().filter(|(_, p)| shown(p)).map(error).collect()
}

/// Writes a curve's name on it, at the middle of its visible part: contours.
fn inline(frame: &Frame<'_, '_>, points: &[(f64, f64)], label: &str) -> Result<(), String> {
    let seen: Vec<_> = points
        .iter()
        .filter_map(|p| frame.place(*p))
        .filter(|at| frame.inside(*at))
        .collect();
    let Some(middle) = seen.get(seen.len() / 2) else {
        return Ok(());
    };
    let (x, y) = (middle.0.round() as i32, middle.1.round() as i32);
    let (half, high) = (label.chars().count() as i32 * TICK * 3 / 10 + 8, TICK / 2);
    let ground = Rectangle::new([(x - half, y - high), (x + half, y + high)], PAPER.mix(0.85).filled());
    frame.area.draw(&ground).map_err(why)?;
    let style = text(TICK).pos(Pos::new(HPos::Center, VPos::Center));
    frame
        .area
        .draw(&Text::new(label.to_owned(), (x, y), style))
        .map_err(why)
}

/// Filled rectangles `(left, right, bottom, top)`, cut at the frame.
fn boxes(frame: &Frame<'_, '_>, boxes: &[(f64, f64, f64, f64)], ink: RGBColor, opacity: f64) -> Result<(), String> {
    for (left, right, bottom, top) in boxes.iter().filter(|b| frame.x.accepts(b.0) && frame.x.accepts(b.1)) {
        let across = |x: f64| frame.across(x).clamp(frame.left, frame.right).round() as i32;
        let down = |y: f64| frame.down_cut(y).round() as i32;
        let corners = [(across(*left), down(*bottom)), (across(*right), down(*top))];
        frame
            .area
            .draw(&Rectangle::new(corners, ink.mix(opacity).filled()))
            .map_err(why)?;
    }
    Ok(())
}

fn field(
    frame: &Frame<'_, '_>,
    x: &[f64],
    y: &[f64],
    values: &[Vec<f64>],
    (low, high): (f64, f64),
) -> Result<(), String> {
    let (left, bottom) = (edges(x), edges(y));
    // Each cell reaches under its next neighbours, drawn later, so that no seam shines through.
    let under = |edges: &[f64], i: usize| edges[(i + 2).min(edges.len() - 1)];
    for (j, row) in values.iter().enumerate() {
        for (i, value) in row.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            let shade = heat((value - low) / (high - low).max(f64::MIN_POSITIVE));
            boxes(frame, &[(left[i], under(&left, i), bottom[j], under(&bottom, j))], shade, 1.0)?;
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
        Shape::Points { points, errors, .. } => {
            let (x, mut y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            y.extend(points.iter().zip(errors).flat_map(|(p, e)| [p.1 - e, p.1 + e]));
            (x, y)
        }
        Shape::Bars { points, width } => (
            points
                .iter()
                .flat_map(|p| [p.0 - width / 2.0, p.0 + width / 2.0])
                .collect(),
            points.iter().map(|p| p.1).chain([0.0]).collect(),
        ),
        Shape::Heat { x, y, .. } => (edges(x), edges(y)),
        Shape::Boxes { boxes } => {
            (boxes.iter().flat_map(|b| [b.0, b.1]).collect(), boxes.iter().flat_map(|b| [b.2, b.3]).collect())
        }
        Shape::Band { limits } => {
            (limits.iter().map(|l| l.0).collect(), limits.iter().flat_map(|l| [l.1, l.2]).collect())
        }
        Shape::Texts { texts } => texts.iter().map(|(x, y, _)| (*x, *y)).unzip(),
    }
}
