//! Sizes, colours, dashes and marks. Schemes differ by dash and mark as well as by colour, so that grey prints can be read.

use fewbits_experiments::plot::{Layer, Marker, Stroke};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle};

/// Width of a panel. Positions are whole units; a row of two panels is 7.16 inches in print, so that 7 points are 68 units.
pub(super) const PANEL_WIDTH: u32 = 2480;
/// Height of a panel without its legend.
pub(super) const PANEL_HEIGHT: u32 = 1720;
/// Height of a line of text.
pub(super) const LINE: i32 = 92;
/// Size of axis labels and legends.
pub(super) const TEXT: i32 = 72;
/// Size of numbers at the ticks.
pub(super) const TICK: i32 = 68;
const TITLE: i32 = 80;
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

/// Lengths of dashes and gaps of curves, by place; empty is solid. One fewer than colours, so that the second round differs.
const CURVES: [&[f64]; 7] = [
    &[],
    &[84.0, 30.0],
    &[40.0, 26.0],
    &[84.0, 26.0, 14.0, 26.0],
    &[150.0, 36.0],
    &[40.0, 20.0, 14.0, 20.0, 14.0, 20.0],
    &[24.0, 20.0],
];

/// The same for bounds and references, which are thinner.
const BOUNDS: [&[f64]; 4] = [&[14.0, 22.0], &[50.0, 22.0], &[50.0, 22.0, 14.0, 22.0], &[90.0, 40.0]];

const MARKERS: [Marker; 7] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::OpenCircle,
    Marker::OpenSquare,
    Marker::Cross,
];

pub(super) fn text(size: i32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&INK)
}

pub(super) fn title() -> TextStyle<'static> {
    text(TITLE)
}

/// Place of a layer in palette, dashes and marks.
fn index(layer: &Layer, position: usize) -> usize {
    layer.colour.unwrap_or(position)
}

pub(super) fn colour(layer: &Layer, position: usize) -> RGBColor {
    PALETTE[index(layer, position) % PALETTE.len()]
}

pub(super) fn pen(layer: &Layer, position: usize, stroke: Stroke) -> ShapeStyle {
    colour(layer, position).stroke_width(if stroke == Stroke::Solid { 9 } else { 6 })
}

pub(super) fn dashes(layer: &Layer, position: usize, stroke: Stroke) -> &'static [f64] {
    let index = index(layer, position);
    match stroke {
        Stroke::Solid => CURVES[index % CURVES.len()],
        Stroke::Dashed => BOUNDS[index % BOUNDS.len()],
    }
}

pub(super) fn marker(layer: &Layer, position: usize, own: Option<Marker>) -> Marker {
    own.unwrap_or(MARKERS[index(layer, position) % MARKERS.len()])
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
