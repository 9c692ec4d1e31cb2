//! Pictures of a few lines, bands, dots and boxes, as SVG.

use crate::error::Error;
use crate::numbers::widened;
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::drawing::{DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::series::LineSeries;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, RGBColor, TextStyle};
use std::path::Path;

/// Colours that readers with colour blindness can distinguish (Okabe and Ito).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
    RGBColor(240, 228, 66),
];
/// Width and height in pixels.
const SIZE: (u32, u32) = (900, 540);
/// Largest number of points of a line. Beyond it every second one is dropped.
const MAX_POINTS: usize = 4096;

/// If there are fewer dots than these, they are drawn larger.
const FEW: usize = 50;

/// A pair of coordinates.
pub(crate) type Point = (f64, f64);

/// A part of a picture. Colour numbers beyond the list start again.
pub(crate) enum Layer {
    /// The area between two lines, given from left to right.
    Band {
        lower: Vec<Point>,
        upper: Vec<Point>,
        colour: usize,
    },
    Line {
        points: Vec<Point>,
        colour: usize,
        name: String,
    },
    Dots {
        points: Vec<Point>,
        colour: usize,
        name: String,
    },
    Box {
        from: Point,
        to: Point,
        colour: usize,
        label: String,
    },
    Label {
        at: Point,
        text: String,
    },
}

/// A picture. Layers are drawn in order, later ones on top.
pub(crate) struct Picture {
    pub(crate) title: String,
    pub(crate) x: String,
    pub(crate) y: String,
    /// Whether the labels of the horizontal axis are powers of ten of its numbers.
    pub(crate) is_log: bool,
    /// Whether both axes have the same scale.
    pub(crate) is_map: bool,
    pub(crate) layers: Vec<Layer>,
}

/// Points that are thinned out as they come, so that a picture stays small for a table of any length.
pub(crate) struct Thinned<T> {
    kept: Vec<T>,
    step: usize,
    seen: usize,
}

impl<T> Thinned<T> {
    pub(crate) fn new() -> Self {
        Self {
            kept: Vec::new(),
            step: 1,
            seen: 0,
        }
    }

    pub(crate) fn push(&mut self, item: T) {
        if self.seen.is_multiple_of(self.step) {
            self.kept.push(item);
        }
        self.seen += 1;
        if self.kept.len() == MAX_POINTS {
            // Every second point goes, and from now on only every second one comes: the kept ones stay evenly spaced.
            let mut number = 0;
            self.kept.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.step *= 2;
        }
    }

    pub(crate) fn points(&self) -> &[T] {
        &self.kept
    }
}

fn number(value: &f64) -> String {
    let size = value.abs();
    if size >= 1e6 || (size < 1e-3 && size > 0.0) {
        format!("{value:.1e}")
    } else {
        format!("{}", (1e4 * value).round() / 1e4)
    }
}

fn power(value: &f64) -> String {
    number(&10_f64.powf(*value))
}

impl Layer {
    fn points(&self) -> Vec<Point> {
        match self {
            Self::Band { lower, upper, .. } => lower.iter().chain(upper).copied().collect(),
            Self::Line { points, .. } | Self::Dots { points, .. } => points.clone(),
            Self::Box { from, to, .. } => vec![*from, *to],
            Self::Label { at, .. } => vec![*at],
        }
    }
}

impl Picture {
    /// Ends of both axes, with a margin; axes of a map have one scale.
    fn ends(&self) -> [(f64, f64); 2] {
        let points: Vec<Point> = self.layers.iter().flat_map(Layer::points).collect();
        let ends = |numbers: &mut dyn Iterator<Item = f64>| {
            let ends = numbers.filter(|number| number.is_finite()).fold(None, widened);
            ends.unwrap_or((0.0, 1.0))
        };
        let mut both = [
            ends(&mut points.iter().map(|point| point.0)),
            ends(&mut points.iter().map(|point| point.1)),
        ];
        if self.is_map {
            let wide = f64::from(SIZE.0) / f64::from(SIZE.1);
            // The axis that is too short for one scale is extended at both ends.
            let height = (both[1].1 - both[1].0).max((both[0].1 - both[0].0) / wide);
            for (axis, length) in both.iter_mut().zip([wide * height, height]) {
                let middle = 0.5 * axis.0 + 0.5 * axis.1;
                *axis = (middle - 0.5 * length, middle + 0.5 * length);
            }
        }
        both.map(|(low, high)| {
            let length = high - low;
            let margin = if length > 0.0 {
                0.04 * length
            } else {
                0.5 * low.abs().max(1.0)
            };
            (low - margin, high + margin)
        })
    }

    /// Writes the picture.
    pub(crate) fn save(&self, path: &Path) -> Result<(), Error> {
        let mut svg = String::new();
        // This back end can fail only at a file, and it has none.
        let drawn = self.draw(&mut svg);
        drawn.map_err(Error::refused("the picture cannot be drawn"))?;
        // Width and height are those of the window, not of the drawing.
        std::fs::write(path, svg).map_err(Error::io(&path.display().to_string(), "create"))
    }

    fn draw(&self, svg: &mut String) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&RGBColor(255, 255, 255))?;
        let [x, y] = self.ends();
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .light_line_style(RGBColor(245, 245, 245))
            .bold_line_style(RGBColor(225, 225, 225))
            .x_label_formatter(if self.is_log { &power } else { &number })
            .y_label_formatter(&number)
            .draw()?;
        let font = || TextStyle::from(("sans-serif", 13).into_font()).pos(Pos::new(HPos::Center, VPos::Center));
        let mut has_names = false;
        for layer in &self.layers {
            match layer {
                Layer::Band { lower, upper, colour } => {
                    let outline: Vec<Point> = lower.iter().chain(upper.iter().rev()).copied().collect();
                    let area = Polygon::new(outline, COLOURS[colour % COLOURS.len()].mix(0.2).filled());
                    chart.draw_series([area])?;
                }
                Layer::Line { points, colour, name } => {
                    let colour = COLOURS[colour % COLOURS.len()];
                    let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
                    let series = chart.draw_series(line)?;
                    if !name.is_empty() {
                        has_names = true;
                        let key = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2));
                        series.label(name).legend(key);
                    }
                }
                Layer::Dots { points, colour, name } => {
                    let colour = COLOURS[colour % COLOURS.len()];
                    let radius = if points.len() < FEW { 5 } else { 2 };
                    let dots = points
                        .iter()
                        .map(|point| Circle::new(*point, radius, colour.mix(0.6).filled()));
                    let series = chart.draw_series(dots)?;
                    if !name.is_empty() {
                        has_names = true;
                        series
                            .label(name)
                            .legend(move |(x, y)| Circle::new((x + 9, y), 3, colour.filled()));
                    }
                }
                Layer::Box {
                    from,
                    to,
                    colour,
                    label,
                } => {
                    let colour = COLOURS[colour % COLOURS.len()];
                    chart.draw_series([Rectangle::new([*from, *to], colour.mix(0.35).filled())])?;
                    chart.draw_series([Rectangle::new([*from, *to], colour.stroke_width(1))])?;
                    let middle = (0.5 * from.0 + 0.5 * to.0, 0.5 * from.1 + 0.5 * to.1);
                    chart.draw_series([Text::new(label.clone(), middle, font())])?;
                }
                Layer::Label { at, text } => {
                    chart.draw_series([Text::new(text.clone(), *at, font())])?;
                }
            }
        }
        if has_names {
            chart
                .configure_series_labels()
                .background_style(RGBColor(255, 255, 255).mix(0.85))
                .border_style(RGBColor(200, 200, 200))
                .label_font(("sans-serif", 13))
                .draw()?;
        }
        area.present()
    }
}
