//! Sizes, colours, dashes and marks. Schemes differ by dash and mark as well as by colour, so that grey prints can be read.

use crate::{Layer, Marker, Plot, Shape, Stroke};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle};

/// Width of a panel. Positions are whole units; a row of two panels is 7.16 inches in print, so that 7 points are 68 units.
pub(super) const PANEL_WIDTH: u32 = 2480;
/// Height of a panel without its legend.
pub(super) const PANEL_HEIGHT: i32 = 1720;
/// Height of a line of text.
pub(super) const LINE: i32 = 94;
/// Size of axis labels and legends.
pub(super) const TEXT: i32 = 72;
/// Size of numbers at the ticks.
pub(super) const TICK: i32 = 68;
pub(super) const TITLE: i32 = 80;
const FONT: &str = "sans-serif";

pub(super) const INK: RGBColor = RGBColor(40, 44, 52);
pub(super) const GRID: RGBColor = RGBColor(225, 228, 232);
pub(super) const PAPER: RGBColor = RGBColor(255, 255, 255);

/// Colours that stay apart in print and for colour-blind readers (Okabe and Ito), black and grey last.
const PALETTE: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(130, 130, 130),
];

/// Lengths of dashes and gaps of curves, by place; empty is solid. One more than colours, so that the second round differs.
const CURVES: [&[f64]; 9] = [
    &[],
    &[84.0, 30.0],
    &[40.0, 26.0],
    &[84.0, 26.0, 14.0, 26.0],
    &[150.0, 36.0],
    &[40.0, 20.0, 14.0, 20.0, 14.0, 20.0],
    &[24.0, 20.0],
    &[110.0, 24.0, 40.0, 24.0],
    &[60.0, 24.0, 14.0, 24.0, 14.0, 24.0, 14.0, 24.0],
];

/// The same for bounds and references, which are thinner.
const BOUNDS: [&[f64]; 4] = [&[14.0, 22.0], &[50.0, 22.0], &[50.0, 22.0, 14.0, 22.0], &[90.0, 40.0]];

const MARKERS: [Marker; 14] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::OpenCircle,
    Marker::OpenSquare,
    Marker::Cross,
    Marker::Plus,
    Marker::OpenTriangle,
    Marker::OpenDiamond,
    Marker::Wedge,
    Marker::OpenWedge,
    Marker::Star,
    Marker::Ring,
];

/// Letters of this height in units; the back end writes sizes divided by 1.24.
pub(super) fn text(size: i32) -> TextStyle<'static> {
    (FONT, 1.24 * f64::from(size)).into_font().color(&INK)
}

/// Width of a text, as wide fonts draw it.
pub(super) fn wide(text: &str, size: i32) -> f64 {
    let letter = |c: char| match c {
        'i' | 'j' | 'l' | 'I' | 'f' | 't' | 'r' | ' ' | '.' | ',' | ':' | ';' | '\'' | '!' | '|' | '/' | '-' | '('
        | ')' => 0.37,
        'm' | 'w' | 'M' | 'W' | '%' | '=' | '+' | '<' | '>' => 0.88,
        'A'..='Z' | '0'..='9' => 0.66,
        '⁰'..='₎' | '²' | '³' | '¹' => 0.42,
        _ => 0.61,
    };
    f64::from(size) * text.chars().map(letter).sum::<f64>()
}

/// The plot with a place in the palette for every layer and a mark for every layer of points. Two places share no mark, in
/// whatever panels they are, while there are marks left.
pub(super) fn numbered(mut plot: Plot) -> Plot {
    let mut taken: Vec<(usize, Marker)> = Vec::new();
    for panel in &mut plot.panels {
        for (position, layer) in panel.layers.iter_mut().enumerate() {
            let index = *layer.colour.get_or_insert(position);
            if let Shape::Points { marker: Some(own), .. } = layer.shape {
                taken.push((index, own));
            }
        }
    }
    let mut given: Vec<(usize, Marker)> = Vec::new();
    for layer in plot.panels.iter_mut().flat_map(|panel| &mut panel.layers) {
        let index = place(layer);
        if let Shape::Points {
            marker: marker @ None, ..
        } = &mut layer.shape
        {
            let known = given.iter().find(|(i, _)| *i == index).map(|(_, own)| *own);
            let usual = MARKERS[index % MARKERS.len()];
            let free = |own: &Marker| !taken.iter().any(|(i, other)| other == own && *i != index);
            let own = known.unwrap_or_else(|| {
                let mut choice = std::iter::once(usual).chain(MARKERS.into_iter().rev());
                choice.find(free).unwrap_or(usual)
            });
            *marker = Some(own);
            given.push((index, own));
            taken.push((index, own));
        }
    }
    plot
}

/// Place of a layer in palette, dashes and marks.
fn place(layer: &Layer) -> usize {
    layer.colour.unwrap_or(0)
}

pub(super) fn colour(layer: &Layer) -> RGBColor {
    PALETTE[place(layer) % PALETTE.len()]
}

pub(super) fn pen(layer: &Layer, stroke: Stroke) -> ShapeStyle {
    colour(layer).stroke_width(if stroke == Stroke::Dashed { 6 } else { 9 })
}

pub(super) fn dashes(layer: &Layer, stroke: Stroke) -> &'static [f64] {
    match stroke {
        Stroke::Solid => CURVES[place(layer) % CURVES.len()],
        Stroke::Dashed => BOUNDS[place(layer) % BOUNDS.len()],
        Stroke::Unbroken => &[],
    }
}

/// The mark of a layer of points, or of a curve of a single point.
pub(super) fn marker(layer: &Layer) -> Marker {
    match layer.shape {
        Shape::Points { marker: Some(own), .. } => own,
        _ => MARKERS[place(layer) % MARKERS.len()],
    }
}

/// A perceptually even ramp from dark violet to yellow, which is also one from dark to light, for `share` in `[0, 1]`.
pub(super) fn heat(share: f64) -> RGBColor {
    const RAMP: [(f64, f64, f64); 6] = [
        (68.0, 1.0, 84.0),
        (65.0, 68.0, 135.0),
        (42.0, 120.0, 142.0),
        (34.0, 168.0, 132.0),
        (122.0, 209.0, 81.0),
        (253.0, 231.0, 37.0),
    ];
    let at = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let left = (at.floor() as usize).min(RAMP.len() - 2);
    let t = at - left as f64;
    let (a, b) = (RAMP[left], RAMP[left + 1]);
    let mix = |a: f64, b: f64| (a + t * (b - a)).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Panel;

    #[test]
    fn schemes_have_marks_of_their_own_across_panels() {
        let points = |i: usize| Layer::points("", vec![(i as f64, 1.0)]).coloured(i);
        let first = Panel::linear("", "", "")
            .with_all((0..7).map(points))
            .with(points(20).marked(Marker::Square));
        let second = Panel::linear("", "", "").with_all((5..13).map(points));
        let plot = numbered(Plot::grid(2, vec![first, second]));
        let layers = plot.panels.iter().flat_map(|panel| &panel.layers);
        let mut seen: Vec<(usize, Marker)> = layers.map(|layer| (place(layer), marker(layer))).collect();
        assert_eq!(seen[5..7], seen[8..10]);
        seen.sort_by_key(|(place, _)| *place);
        seen.dedup();
        assert_eq!(seen.len(), 14);
        assert!(seen.iter().all(|a| seen.iter().filter(|b| a.1 == b.1).count() == 1), "{seen:?}");
    }
}
