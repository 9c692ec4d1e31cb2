//! Pictures of a few lines, bands, dots and boxes, as SVG.

use crate::error::Error;
use fewbits_plot::{Axis, Panel, Plot, Shape, to_svg};
use std::path::Path;

/// Largest number of points of a line. Beyond it every second one is dropped.
const MAX_POINTS: usize = 4096;

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
    /// Whether the horizontal axis is logarithmic.
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

impl Layer {
    /// As it is drawn: the layer itself, and names beside it.
    fn drawn(&self) -> Vec<fewbits_plot::Layer> {
        use fewbits_plot::Layer as Drawn;
        match self {
            Self::Band { lower, upper, colour } => {
                let limits = lower.iter().zip(upper).map(|(low, high)| (low.0, low.1, high.1));
                vec![Drawn::band("", limits.collect()).coloured(*colour)]
            }
            Self::Line { points, colour, name } => {
                let mut line = Drawn::line(name, points.clone()).coloured(*colour);
                // A series is no scheme: colour alone tells it apart, and dashes would hide what it does.
                if let Shape::Line { stroke, .. } = &mut line.shape {
                    *stroke = fewbits_plot::Stroke::Unbroken;
                }
                vec![line]
            }
            Self::Dots { points, colour, name } => vec![Drawn::points(name, points.clone()).coloured(*colour)],
            Self::Box {
                from,
                to,
                colour,
                label,
            } => {
                let middle = (0.5 * from.0 + 0.5 * to.0, 0.5 * from.1 + 0.5 * to.1);
                vec![
                    Drawn::boxes("", vec![(from.0, to.0, from.1, to.1)]).coloured(*colour),
                    Drawn::texts(vec![(middle.0, middle.1, label.clone())]),
                ]
            }
            Self::Label { at, text } => vec![Drawn::beside(vec![(at.0, at.1, text.trim().to_owned())])],
        }
    }
}

impl Picture {
    /// Writes the picture.
    pub(crate) fn save(&self, path: &Path) -> Result<(), Error> {
        let axis = |label: &str, is_log| if is_log { Axis::log(label) } else { Axis::linear(label) };
        // Axes of these names have one scale.
        let names = if self.is_map {
            ["x / m", "y / m"]
        } else {
            [self.x.as_str(), &self.y]
        };
        let panel = Panel::new(&self.title, axis(names[0], self.is_log), axis(names[1], false));
        let panel = panel.with_all(self.layers.iter().flat_map(Layer::drawn));
        let svg = to_svg(&Plot::of(panel)).map_err(Error::refused("the picture cannot be drawn"))?;
        std::fs::write(path, svg).map_err(Error::io(&path.display().to_string(), "create"))
    }
}
