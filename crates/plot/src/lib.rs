//! Plots as data, and as SVG: what to draw is a value, how it is drawn is decided here alone.
//!
//! A [`Plot`] is a grid of [`Panel`]s, a panel a pair of axes and a stack of [`Layer`]s. [`to_svg`] draws it: ticks, dashes, marks,
//! error bars, heat maps with their colour bars, legends below the panels. Colours are indices into one palette that stays readable
//! in print and for colour-blind readers; give the same scheme the same index in every panel. Schemes differ by mark or dash as well
//! as by colour, and no two share a mark while there are any of the fourteen left.
//!
//! Text is at least 7 pt where a row of two panels is 7.16 inches wide. Axes `x / m` and `y / m` make a map: a metre is as long on both.
//!
//! Not here: data, files, a window. The axes' ticks and the SVG elements come from `plotters`.
//!
//! ```
//! use fewbits_plot::{Axis, Layer, Panel, Plot};
//! let curve = vec![(0.001, 1.0), (1.0, 2.0)];
//! let plot = Plot::of(
//!     Panel::new("Loss", Axis::log("gamma = sigma_u^2 / sigma^2"), Axis::linear("loss"))
//!         .with(Layer::line("closed form", curve.clone()).coloured(0))
//!         .with(Layer::points("simulated", curve).with_errors(vec![0.1, 0.1]).coloured(1)),
//! );
//! let svg = fewbits_plot::to_svg(&plot)?;
//! assert!(svg.starts_with("<svg") && svg.contains("closed form"));
//! # Ok::<(), fewbits_plot::Error>(())
//! ```

#![forbid(unsafe_code)]

mod draw;
mod layer;
mod typeset;

pub use draw::to_svg;
pub use layer::{Layer, Mark, Marker, Shape, Stroke, points};
pub use typeset::typeset;

/// Why a plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The back end refused an element.
    #[error("the plot cannot be drawn: {reason}")]
    Refused {
        /// What the back end said.
        reason: String,
    },
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
        Self::grid(1, vec![panel])
    }

    /// Panels in rows of `columns`.
    pub fn grid(columns: usize, panels: Vec<Panel>) -> Self {
        Self {
            panels,
            columns: columns.max(1),
        }
    }

    /// With other names of layers and of places on axes.
    #[must_use]
    pub fn renamed(mut self, name: impl Fn(&str) -> String) -> Self {
        for panel in &mut self.panels {
            let places = panel.x.names.iter_mut().chain(&mut panel.y.names).map(|(_, own)| own);
            let layers = panel.layers.iter_mut().map(|layer| &mut layer.label);
            places.chain(layers).for_each(|own| *own = name(own));
        }
        self
    }

    /// With all words in print ([`typeset()`]): `sigma^2` is `σ²`.
    #[must_use]
    pub fn typeset(mut self) -> Self {
        for panel in &mut self.panels {
            let titles = [&mut panel.title, &mut panel.x.label, &mut panel.y.label];
            titles.into_iter().for_each(|text| *text = typeset(text));
        }
        self.renamed(typeset)
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
        let mut axis = Self::linear(label);
        axis.scale = Scale::Log;
        axis
    }

    /// Fixes the limits.
    #[must_use]
    pub fn between(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Categories at 0, 1, 2, ...
    pub fn categories<N: Into<String>>(label: impl Into<String>, names: impl IntoIterator<Item = N>) -> Self {
        let named: Vec<_> = (0..).map(f64::from).zip(names.into_iter().map(Into::into)).collect();
        let end = named.len() as f64 - 0.4;
        Self::linear(label).named(named).between(-0.6, end)
    }

    /// Categories from the top downwards, at 0, -1, -2, ...
    pub fn ladder<N: Into<String>>(names: impl IntoIterator<Item = N>) -> Self {
        let places = (0..).map(|i: i32| f64::from(-i));
        let named: Vec<_> = places.zip(names.into_iter().map(Into::into)).collect();
        let end = 0.6 - named.len() as f64;
        Self::linear("").named(named).between(end, 0.6)
    }

    /// Names places: category axes.
    #[must_use]
    pub fn named(mut self, names: impl IntoIterator<Item = (f64, String)>) -> Self {
        self.names = names.into_iter().collect();
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
    pub fn semilogx(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
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

    /// Whether it is a map: its axes are the coordinates `x` and `y` in one unit. A metre is then as long on both.
    pub fn is_map(&self) -> bool {
        let linear = |axis: &Axis| axis.scale == Scale::Linear && axis.names.is_empty();
        let unit = |axis: &'_ Axis, name| axis.label.strip_prefix(name).map(str::to_owned);
        linear(&self.x) && linear(&self.y) && unit(&self.x, "x / ").is_some_and(|u| Some(u) == unit(&self.y, "y / "))
    }

    /// Leaves the legend out.
    #[must_use]
    pub fn without_legend(self) -> Self {
        Self { legend: false, ..self }
    }
}
