//! Where values stand on paper: the inside of a panel's axes.

use super::Area;
use super::scale::Scaled;
use crate::Marker;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::element::{Circle, PathElement, Polygon};
use plotters::style::{RGBColor, ShapeStyle};

/// Whether the back end drew it.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// A place on paper, in units from the top left.
pub(super) type Place = (f64, f64);

/// Half the size of a mark.
pub(super) const MARK: f64 = 18.0;

/// Two axes and the rectangle they span on paper.
pub(super) struct Frame<'a, 'b> {
    pub(super) area: &'a Area<'b>,
    pub(super) x: Scaled,
    pub(super) y: Scaled,
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) top: f64,
    pub(super) bottom: f64,
}

pub(super) fn round(place: Place) -> (i32, i32) {
    (place.0.round() as i32, place.1.round() as i32)
}

impl Frame<'_, '_> {
    /// The place of a point, if both axes can show it; it may be outside the frame.
    pub(super) fn place(&self, (x, y): (f64, f64)) -> Option<Place> {
        let ok = self.x.accepts(x) && self.y.accepts(y);
        ok.then(|| (self.across(x), self.down(y)))
    }

    pub(super) fn across(&self, x: f64) -> f64 {
        self.left + (self.right - self.left) * self.x.position(x)
    }

    pub(super) fn down(&self, y: f64) -> f64 {
        self.bottom + (self.top - self.bottom) * self.y.position(y)
    }

    /// The vertical place of a value, cut at the frame; what an axis cannot show lies below.
    pub(super) fn down_cut(&self, y: f64) -> f64 {
        if self.y.accepts(y) {
            self.down(y).clamp(self.top, self.bottom)
        } else {
            self.bottom
        }
    }

    /// The horizontal place of a value, cut at the frame; what an axis cannot show lies left.
    pub(super) fn across_cut(&self, x: f64) -> f64 {
        if self.x.accepts(x) {
            self.across(x).clamp(self.left, self.right)
        } else {
            self.left
        }
    }

    pub(super) fn inside(&self, (x, y): Place) -> bool {
        const EDGE: f64 = 2.0;
        x >= self.left - EDGE && x <= self.right + EDGE && y >= self.top - EDGE && y <= self.bottom + EDGE
    }

    /// The part of a segment inside the frame (Liang and Barsky).
    fn cut(&self, a: Place, b: Place) -> Option<(Place, Place)> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for (step, room) in [
            (-dx, a.0 - self.left),
            (dx, self.right - a.0),
            (-dy, a.1 - self.top),
            (dy, self.bottom - a.1),
        ] {
            if step == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if step < 0.0 {
                from = from.max(room / step);
            } else {
                to = to.min(room / step);
            }
        }
        let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
        (from <= to).then(|| (at(from), at(to)))
    }

    /// Draws the curve through values, cut at the frame and broken where an axis cannot show it.
    pub(super) fn curve(&self, points: &[(f64, f64)], pattern: &[f64], pen: ShapeStyle) -> Drawn {
        let mut pieces: Vec<Vec<Place>> = Vec::new();
        for pair in points.windows(2) {
            let ends = self.place(pair[0]).zip(self.place(pair[1]));
            let Some((a, b)) = ends.and_then(|(a, b)| self.cut(a, b)) else {
                continue;
            };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&a) => piece.push(b),
                _ => pieces.push(vec![a, b]),
            }
        }
        pieces.iter().try_for_each(|piece| path(self.area, piece, pattern, pen))
    }
}

/// Draws a line on paper in dashes; no pattern is solid.
pub(super) fn path(area: &Area<'_>, line: &[Place], pattern: &[f64], pen: ShapeStyle) -> Drawn {
    let lines = if pattern.is_empty() {
        vec![line.to_vec()]
    } else {
        dashed(line, pattern)
    };
    for line in lines {
        let line: Vec<_> = line.into_iter().map(round).collect();
        area.draw(&PathElement::new(line, pen))?;
    }
    Ok(())
}

/// Cuts a line into dashes: `pattern` holds the lengths of dashes and gaps in turn.
fn dashed(line: &[Place], pattern: &[f64]) -> Vec<Vec<Place>> {
    let (mut dashes, mut current) = (Vec::new(), Vec::new());
    let (mut step, mut rest) = (0, pattern[0]);
    for pair in line.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let at = |t: f64| (a.0 + (b.0 - a.0) * t / length, a.1 + (b.1 - a.1) * t / length);
        let mut gone = 0.0;
        while length - gone > 1e-9 {
            let next = (gone + rest).min(length);
            if step % 2 == 0 {
                if current.is_empty() {
                    current.push(at(gone));
                }
                current.push(at(next));
            }
            rest -= next - gone;
            gone = next;
            if rest <= 1e-9 {
                if !current.is_empty() {
                    dashes.push(std::mem::take(&mut current));
                }
                step = (step + 1) % pattern.len();
                rest = pattern[step];
            }
        }
    }
    if !current.is_empty() {
        dashes.push(current);
    }
    dashes
}

/// Draws one mark on paper.
pub(super) fn mark(area: &Area<'_>, place: Place, marker: Marker, colour: RGBColor) -> Drawn {
    use plotters::style::Color;
    let (fill, pen) = (colour.filled(), colour.stroke_width(7));
    let (x, y) = place;
    let at = |dx: f64, dy: f64| round((x + dx * MARK, y + dy * MARK));
    let cross = |d: &[(f64, f64)]| {
        let mut strokes = d.chunks_exact(2).map(|d| vec![at(d[0].0, d[0].1), at(d[1].0, d[1].1)]);
        strokes.try_for_each(|stroke| area.draw(&PathElement::new(stroke, pen)))
    };
    let filled = |d: &[(f64, f64)]| area.draw(&Polygon::new(d.iter().map(|d| at(d.0, d.1)).collect::<Vec<_>>(), fill));
    // A path that goes on over its first side: the SVG back end gives a rectangle's outline no width.
    let outline = |d: &[(f64, f64)]| {
        let round = d.iter().chain(&d[..2]).map(|d| at(d.0, d.1)).collect::<Vec<_>>();
        area.draw(&PathElement::new(round, pen))
    };
    let up = [(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)];
    let down = up.map(|(x, y)| (x, -y));
    let square = [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)];
    let diamond = [(0.0, -1.3), (1.1, 0.0), (0.0, 1.3), (-1.1, 0.0)];
    match marker {
        Marker::Circle => area.draw(&Circle::new(round(place), MARK as i32, fill)),
        Marker::OpenCircle => area.draw(&Circle::new(round(place), MARK as i32, pen)),
        Marker::Ring => area
            .draw(&Circle::new(round(place), MARK as i32, pen))
            .and_then(|()| area.draw(&Circle::new(round(place), 7, fill))),
        Marker::Square => filled(&square),
        Marker::OpenSquare => outline(&square),
        Marker::Triangle => filled(&up),
        Marker::OpenTriangle => outline(&up),
        Marker::Wedge => filled(&down),
        Marker::OpenWedge => outline(&down),
        Marker::Diamond => filled(&diamond),
        Marker::OpenDiamond => outline(&diamond),
        Marker::Cross => cross(&[(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)]),
        Marker::Plus => cross(&[(-1.2, 0.0), (1.2, 0.0), (0.0, -1.2), (0.0, 1.2)]),
        Marker::Star => cross(&[
            (0.0, -1.3),
            (0.0, 1.3),
            (-1.1, -0.65),
            (1.1, 0.65),
            (-1.1, 0.65),
            (1.1, -0.65),
        ]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_have_the_lengths_of_the_pattern_across_corners() {
        let dashes = dashed(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], &[6.0, 2.0]);
        assert_eq!(dashes.len(), 3);
        assert_eq!(dashes[0], [(0.0, 0.0), (6.0, 0.0)]);
        assert_eq!(dashes[1], [(8.0, 0.0), (10.0, 0.0), (10.0, 4.0)]);
        assert_eq!(dashes[2], [(10.0, 6.0), (10.0, 10.0)]);
    }
}
