//! What is drawn in a panel: lines, points, fields, boxes, bands and texts, each with its entry in the legend.

/// A value that is drawn as a mark, perhaps with an error bar.
pub trait Mark {
    /// The value and half the length of its error bar (0 for none), where there is a value.
    fn mark(&self) -> Option<(f64, f64)>;
}

impl Mark for f64 {
    fn mark(&self) -> Option<(f64, f64)> {
        Some((*self, 0.0))
    }
}

impl<M: Mark> Mark for Option<M> {
    fn mark(&self) -> Option<(f64, f64)> {
        self.as_ref()?.mark()
    }
}

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
    /// Short texts.
    Texts {
        /// Position and text.
        texts: Vec<(f64, f64, String)>,
        /// Whether they stand right above their points, which have marks, and not centred on them.
        beside: bool,
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
            label: label.into(),
            colour: None,
            inline: false,
            shape,
        }
    }

    fn stroked(label: impl Into<String>, points: Vec<(f64, f64)>, stroke: Stroke) -> Self {
        Self::new(label, Shape::Line { points, stroke })
    }

    /// A solid line: theory.
    pub fn line(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::stroked(label, points, Stroke::Solid)
    }

    /// A black line without the dashes that tell schemes apart: the truth that is estimated, edges.
    pub fn unbroken(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::stroked(label, points, Stroke::Unbroken).coloured(6)
    }

    /// A dashed line: a bound or a reference.
    pub fn dashed(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::stroked(label, points, Stroke::Dashed)
    }

    /// A dashed horizontal line over this stretch of the horizontal axis; nothing without a level.
    pub fn level(label: impl Into<String>, [from, to]: [f64; 2], level: impl Into<Option<f64>>) -> Self {
        let level = level.into();
        Self::dashed(label, level.into_iter().flat_map(|y| [(from, y), (to, y)]).collect())
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
    pub fn measured<R, Y: Mark>(
        label: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
        point: impl Fn(R) -> (f64, Y),
    ) -> Self {
        let place = |row| {
            let (x, y) = point(row);
            let (y, error) = y.mark()?;
            Some(((x, y), error))
        };
        let (points, errors) = rows.into_iter().filter_map(place).unzip();
        Self::points(label, points).with_errors(errors)
    }

    /// A line through markers, in one colour: values at given settings.
    pub fn marked_line(label: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> [Self; 2] {
        [Self::line("", points.clone()), Self::points(label, points)].map(|layer| layer.coloured(colour))
    }

    /// A line through markers with error bars, in one colour.
    pub fn curve<Y: Mark>(label: impl Into<String>, colour: usize, marks: Vec<(f64, Y)>) -> [Self; 2] {
        let line = Self::line(label, points(&marks, |(x, y)| (*x, y.mark().map(|(y, _)| y))));
        [line, Self::measured("", marks, |mark| mark)].map(|layer| layer.coloured(colour))
    }

    /// A coloured field of values, line by line; the label stands at its colour bar.
    pub fn heat(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, values: impl IntoIterator<Item = f64>) -> Self {
        let mut values = values.into_iter();
        let values = y.iter().map(|_| values.by_ref().take(x.len()).collect()).collect();
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

    /// Short texts, centred at their points.
    pub fn texts(texts: Vec<(f64, f64, String)>) -> Self {
        Self::new("", Shape::Texts { texts, beside: false })
    }

    /// Short texts right above their points, which have marks.
    pub fn beside(texts: Vec<(f64, f64, String)>) -> Self {
        Self::new("", Shape::Texts { texts, beside: true })
    }

    /// Whether it has no points.
    pub fn is_empty(&self) -> bool {
        match &self.shape {
            Shape::Line { points, .. } | Shape::Points { points, .. } => points.is_empty(),
            Shape::Heat { values, .. } => values.is_empty(),
            Shape::Boxes { boxes } => boxes.is_empty(),
            Shape::Band { limits } => limits.is_empty(),
            Shape::Texts { texts, .. } => texts.is_empty(),
        }
    }

    /// Fixes the colour.
    #[must_use]
    pub fn coloured(mut self, colour: usize) -> Self {
        self.colour = Some(colour);
        self
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
