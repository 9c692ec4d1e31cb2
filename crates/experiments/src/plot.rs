//! Pictures as data: what to draw, not how.
//!
//! A [`Plot`] is a grid of [`Panel`]s, a panel a pair of axes and a stack of [`Layer`]s. `xtask figures` turns it into SVG.
//! Colours are indices into one palette that stays readable in print and for colour-blind readers; give the same scheme
//! the same index in every panel of a figure.
//!
//! ```
//! use fewbits_experiments::plot::{Axis, Layer, Panel, Plot};
//! let curve = vec![(0.001, 1.0), (1.0, 2.0)];
//! let plot = Plot::of(
//!     Panel::new("Loss", Axis::log("gamma = sigma_u^2 / sigma^2"), Axis::linear("loss"))
//!         .with(Layer::line("closed form", curve.clone()).coloured(0))
//!         .with(Layer::points("simulated", curve).with_errors(vec![0.1, 0.1]).coloured(1)),
//! );
//! assert_eq!(plot.panels.len(), 1);
//! ```

use crate::Measured;
use crate::words::in_words;

/// The points of a curve, a row each; rows without a value are left out.
pub fn points<R, Y: Into<Option<f64>>>(
    rows: impl IntoIterator<Item = R>,
    point: impl Fn(R) -> (f64, Y),
) -> Vec<(f64, f64)> {
    let place = |row| {
        let (x, y) = point(row);
        Some((x, y.into()?))
    };
    rows.into_iter().filter_map(place).collect()
}

/// A grid of panels, filled row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// The panels.
    pub panels: Vec<Panel>,
    /// Panels a row.
    pub columns: usize,
}

impl Plot {
    /// A single panel.
    pub fn of(panel: Panel) -> Self {
        Self {
            panels: vec![panel],
            columns: 1,
        }
    }

    /// Panels in rows of `columns`.
    pub fn grid(columns: usize, panels: Vec<Panel>) -> Self {
        Self {
            panels,
            columns: columns.max(1),
        }
    }
}

/// How values map to positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Proportional.
    Linear,
    /// By decimal logarithm; values of 0 and below are not drawn.
    Log,
}

/// One axis of a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// Linear or logarithmic.
    pub scale: Scale,
    /// Limits; from the data where absent.
    pub range: Option<(f64, f64)>,
    /// Places with names of their own instead of numbers, for categories.
    pub names: Vec<(f64, String)>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Linear,
            range: None,
            names: Vec::new(),
        }
    }

    /// A logarithmic axis.
    pub fn log(label: impl Into<String>) -> Self {
        Self {
            scale: Scale::Log,
            ..Self::linear(label)
        }
    }

    /// Fixes the limits.
    #[must_use]
    pub fn between(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }

    /// Categories at 0, 1, 2, ...
    pub fn categories<N: Into<String>>(label: impl Into<String>, names: impl IntoIterator<Item = N>) -> Self {
        let named: Vec<_> = (0..).map(f64::from).zip(names.into_iter().map(Into::into)).collect();
        let end = named.len() as f64 - 0.4;
        Self::linear(label).named(named).between(-0.6, end)
    }

    /// Categories from the top downwards, at 0, -1, -2, ...
    pub fn ladder<N: Into<String>>(names: impl IntoIterator<Item = N>) -> Self {
        let named: Vec<_> = (0..)
            .map(|i: i32| f64::from(-i))
            .zip(names.into_iter().map(Into::into))
            .collect();
        let end = 0.6 - named.len() as f64;
        Self::linear("").named(named).between(end, 0.6)
    }

    /// Names places: category axes.
    #[must_use]
    pub fn named(self, names: impl IntoIterator<Item = (f64, String)>) -> Self {
        Self {
            names: names.into_iter().map(|(at, name)| (at, in_words(name))).collect(),
            ..self
        }
    }
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Solid, or in the broad dashes of its place in the palette.
    Solid,
    /// Dashed: bounds, references, asymptotes.
    Dashed,
    /// Without the dashes that tell schemes apart: the truth.
    Unbroken,
}

/// The shape of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A filled circle.
    Circle,
    /// A cross.
    Cross,
    /// A filled triangle.
    Triangle,
    /// A filled square.
    Square,
    /// A filled diamond.
    Diamond,
    /// An open circle.
    OpenCircle,
    /// An open square.
    OpenSquare,
    /// An upright cross.
    Plus,
    /// An open triangle.
    OpenTriangle,
    /// An open diamond.
    OpenDiamond,
    /// A filled triangle that points down.
    Wedge,
    /// An open triangle that points down.
    OpenWedge,
    /// Three strokes.
    Star,
    /// An open circle with a dot.
    Ring,
}

/// What a layer draws.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Straight pieces between points.
    Line {
        /// The points in drawing order.
        points: Vec<(f64, f64)>,
        /// Solid or dashed.
        stroke: Stroke,
    },
    /// Markers, with error bars of one standard error (half lengths) where given.
    Points {
        /// The points.
        points: Vec<(f64, f64)>,
        /// Half lengths of the error bars; empty for none.
        errors: Vec<f64>,
        /// The marker; by colour where absent.
        marker: Option<Marker>,
        /// Whether error bars lie horizontally.
        sideways: bool,
    },
    /// Vertical bars from zero (from the lower limit on a log axis), `width` wide in units of the horizontal axis.
    Bars {
        /// Centre and height.
        points: Vec<(f64, f64)>,
        /// Width.
        width: f64,
    },
    /// A coloured field over a rectangular grid, with a colour bar: `values[j][i]` at `(x[i], y[j])`.
    Heat {
        /// Cell centres, increasing.
        x: Vec<f64>,
        /// Cell centres, increasing.
        y: Vec<f64>,
        /// Values, one row for each `y`.
        values: Vec<Vec<f64>>,
    },
    /// Filled rectangles `(left, right, bottom, top)`: bit patterns, cells, intervals.
    Boxes {
        /// The rectangles.
        boxes: Vec<(f64, f64, f64, f64)>,
    },
    /// A filled band between two curves `(x, low, high)`.
    Band {
        /// Position and limits.
        limits: Vec<(f64, f64, f64)>,
    },
    /// Short texts, centred at their points.
    Texts {
        /// Position and text.
        texts: Vec<(f64, f64, String)>,
    },
}

/// One drawn thing and its entry in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Entry in the legend; none if empty.
    pub label: String,
    /// Index into the palette; by order of layers where absent.
    pub colour: Option<usize>,
    /// Whether the label stands at the curve and not in the legend.
    pub inline: bool,
    /// What is drawn.
    pub shape: Shape,
}

impl Layer {
    fn new(label: impl Into<String>, shape: Shape) -> Self {
        Self {
            label: in_words(label.into()),
            colour: None,
            inline: false,
            shape,
        }
    }

    /// A solid line: theory.
    pub fn line(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(
            label,
            Shape::Line {
                points,
                stroke: Stroke::Solid,
            },
        )
    }

    /// A black line without the dashes that tell schemes apart: the truth that is estimated, edges.
    pub fn unbroken(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        let stroke = Stroke::Unbroken;
        Self::new(label, Shape::Line { points, stroke }).coloured(6)
    }

    /// A dashed line: a bound or a reference.
    pub fn dashed(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(
            label,
            Shape::Line {
                points,
                stroke: Stroke::Dashed,
            },
        )
    }

    /// Markers: measurements.
    pub fn points(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(
            label,
            Shape::Points {
                points,
                errors: Vec::new(),
                marker: None,
                sideways: false,
            },
        )
    }

    /// Markers with error bars of one standard error: simulated points, a row each.
    pub fn measured<R, Y: Into<Option<Measured>>>(
        label: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
        point: impl Fn(R) -> (f64, Y),
    ) -> Self {
        let place = |row| {
            let (x, y) = point(row);
            let y: Measured = y.into()?;
            Some(((x, y.value), y.standard_error.unwrap_or(0.0)))
        };
        let (points, errors) = rows.into_iter().filter_map(place).unzip();
        Self::points(label, points).with_errors(errors)
    }

    /// A line through markers with error bars, in one colour.
    pub fn curve(label: impl Into<String>, colour: usize, marks: Vec<(f64, Measured)>) -> [Self; 2] {
        let line = Self::line(label, points(&marks, |(x, y)| (*x, y.value)));
        [line, Self::measured("", marks, |mark| mark)].map(|layer| layer.coloured(colour))
    }

    /// Vertical bars.
    pub fn bars(label: impl Into<String>, points: Vec<(f64, f64)>, width: f64) -> Self {
        Self::new(label, Shape::Bars { points, width })
    }

    /// A coloured field; the label stands at its colour bar.
    pub fn heat(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, values: Vec<Vec<f64>>) -> Self {
        Self::new(label, Shape::Heat { x, y, values })
    }

    /// Filled rectangles.
    pub fn boxes(label: impl Into<String>, boxes: Vec<(f64, f64, f64, f64)>) -> Self {
        Self::new(label, Shape::Boxes { boxes })
    }

    /// A filled band.
    pub fn band(label: impl Into<String>, limits: Vec<(f64, f64, f64)>) -> Self {
        Self::new(label, Shape::Band { limits })
    }

    /// Short texts.
    pub fn texts(texts: Vec<(f64, f64, String)>) -> Self {
        Self::new("", Shape::Texts { texts })
    }

    /// Whether it has no points.
    pub fn is_empty(&self) -> bool {
        match &self.shape {
            Shape::Line { points, .. } | Shape::Points { points, .. } | Shape::Bars { points, .. } => points.is_empty(),
            Shape::Heat { values, .. } => values.is_empty(),
            Shape::Boxes { boxes } => boxes.is_empty(),
            Shape::Band { limits } => limits.is_empty(),
            Shape::Texts { texts } => texts.is_empty(),
        }
    }

    /// Fixes the colour.
    #[must_use]
    pub fn coloured(self, colour: usize) -> Self {
        Self {
            colour: Some(colour),
            ..self
        }
    }

    /// Fixes colour and marker.
    #[must_use]
    pub fn styled(self, colour: usize, with: Marker) -> Self {
        self.coloured(colour).marked(with)
    }

    /// Writes the label at the curve and not in the legend: contours.
    #[must_use]
    pub fn inline(self) -> Self {
        Self { inline: true, ..self }
    }

    /// Adds error bars of one standard error to markers; ignored by other shapes.
    #[must_use]
    pub fn with_errors(mut self, half_lengths: Vec<f64>) -> Self {
        if let Shape::Points { errors, .. } = &mut self.shape {
            *errors = half_lengths;
        }
        self
    }

    /// Lays error bars along the horizontal axis; ignored by other shapes.
    #[must_use]
    pub fn lying(mut self) -> Self {
        if let Shape::Points { sideways, .. } = &mut self.shape {
            *sideways = true;
        }
        self
    }

    /// Chooses the marker; ignored by other shapes.
    #[must_use]
    pub fn marked(mut self, with: Marker) -> Self {
        if let Shape::Points { marker, .. } = &mut self.shape {
            *marker = Some(with);
        }
        self
    }
}

/// A pair of axes with layers on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Layers, drawn in order.
    pub layers: Vec<Layer>,
    /// Whether there is a legend. It stands below the panel, where it hides no data.
    pub legend: bool,
}

impl Panel {
    /// An empty panel.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            layers: Vec::new(),
            legend: true,
        }
    }

    /// An empty panel of two linear axes.
    pub fn linear(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self::new(title, Axis::linear(x), Axis::linear(y))
    }

    /// An empty panel, its vertical axis logarithmic.
    pub fn semilog(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self::new(title, Axis::linear(x), Axis::log(y))
    }

    /// An empty panel, its horizontal axis logarithmic.
    pub fn log_x(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self::new(title, Axis::log(x), Axis::linear(y))
    }

    /// An empty panel, both axes logarithmic.
    pub fn loglog(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self::new(title, Axis::log(x), Axis::log(y))
    }

    /// Adds a layer.
    #[must_use]
    pub fn with(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// Adds layers.
    #[must_use]
    pub fn with_all(mut self, layers: impl IntoIterator<Item = Layer>) -> Self {
        self.layers.extend(layers);
        self
    }

    /// Leaves the legend out.
    #[must_use]
    pub fn without_legend(self) -> Self {
        Self { legend: false, ..self }
    }
}
