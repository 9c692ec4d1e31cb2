//! From a [`Plot`] to SVG: at most two panels a row, legends below them.

mod frame;
mod legend;
mod marks;
mod names;
mod scale;
mod style;

use crate::{Error, Panel, Plot, Shape};
use frame::{Drawn, Frame, Place, path};
use names::{GAP, Names};
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::Text;
use plotters::style::ShapeStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use scale::Scaled;
use style::{GRID, INK, LINE, PANEL_HEIGHT, PANEL_WIDTH, PAPER, TEXT, TICK, TITLE, text, wide};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Width of a colour bar with its numbers.
const COLOUR_BAR: i32 = 440;
/// Most panels a row.
const COLUMNS: usize = 2;
/// Above a frame, with the title.
const ABOVE: i32 = 150;
/// Right of a frame: half a number at the end of its axis.
const RIGHT: i32 = 100;
const MARGIN: i32 = 20;

/// Draws a plot as SVG, as wide as its window allows. Same plot, same bytes.
///
/// Values that have no place on an axis (not finite, or 0 and below on a logarithmic one) are left out.
///
/// # Errors
/// If the back end refuses an element.
pub fn to_svg(plot: &Plot) -> Result<String, Error> {
    let plot = &style::numbered(plot.clone());
    let columns = plot.columns.min(plot.panels.len()).clamp(1, COLUMNS);
    let rows: Vec<&[Panel]> = plot.panels.chunks(columns).collect();
    let legends = legend::of_rows(&rows, columns);
    let panels = |row: &[Panel]| row.iter().map(height).max().unwrap_or(PANEL_HEIGHT);
    let heights: Vec<(i32, i32)> = rows
        .iter()
        .zip(&legends)
        .map(|(row, legend)| (panels(row), legend::height(legend) + 70))
        .collect();
    let mut svg = String::new();
    {
        let total = heights.iter().map(|(panels, legend)| panels + legend).sum::<i32>();
        let size = (PANEL_WIDTH * columns as u32, total.max(1) as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let all = || {
            root.fill(&PAPER)?;
            let mut top = 0;
            for ((row, legend), (panels, below)) in rows.iter().zip(&legends).zip(&heights) {
                for (column, panel) in row.iter().enumerate() {
                    let left = PANEL_WIDTH as i32 * column as i32;
                    let place = root.clone().shrink((left, top), (PANEL_WIDTH, *panels as u32));
                    draw_panel(&root, &place, panel, plot)?;
                }
                legend::draw(&root, legend, top + panels + 24)?;
                top += panels + below;
            }
            root.present()
        };
        all().map_err(|error: DrawingAreaErrorKind<std::io::Error>| Error::Refused {
            reason: error.to_string(),
        })?;
    }
    Ok(scaled(&svg))
}

/// The picture as large as its window allows, instead of one pixel per unit.
fn scaled(svg: &str) -> String {
    let fixed = svg
        .find("<svg ")
        .and_then(|start| Some((start, start + svg[start..].find('>')?)));
    let Some((start, end)) = fixed else {
        return svg.to_owned();
    };
    let kept = svg[start..end]
        .split(' ')
        .filter(|word| !word.starts_with("width=") && !word.starts_with("height="));
    let head = kept.collect::<Vec<_>>().join(" ");
    format!("{}{head} style=\"width:100%;height:auto;max-height:100vh\"{}", &svg[..start], &svg[end..])
}

/// Height of a panel: names left of it have room, and maps that are wider than high leave none below.
fn height(panel: &Panel) -> i32 {
    let layout = Layout::of(panel);
    match layout.spare(panel, PANEL_HEIGHT) {
        Some(spare) if spare > 0.0 => PANEL_HEIGHT - spare as i32,
        _ => PANEL_HEIGHT.max(layout.left_names.height() + ABOVE + 260),
    }
}

/// Axes of a panel and the room of what stands beside them.
struct Layout {
    x: Scaled,
    y: Scaled,
    left_names: Names,
    below_names: Names,
    /// Left of the frame.
    left: i32,
    /// Below the frame.
    below: i32,
    /// Width of the frame.
    length: f64,
}

impl Layout {
    fn of(panel: &Panel) -> Self {
        let layers = &panel.layers;
        let marks = layers.iter().any(|layer| matches!(layer.shape, Shape::Points { .. }));
        let x = Scaled::new(&panel.x, layers.iter().flat_map(|layer| marks::extent(layer).0), marks);
        let y = Scaled::new(&panel.y, layers.iter().flat_map(|layer| marks::extent(layer).1), marks);
        let x = x.in_the_style_of(&y);
        let y = y.in_the_style_of(&x);
        let described = |label: &str| if label.is_empty() { 0 } else { LINE + 8 };
        let left_names = Names::left(&y);
        let numbers = y.ticks(9).into_iter().map(|v| wide(&tick(&y, v), TICK));
        let left = GAP + 20 + described(&panel.y.label) + numbers.fold(left_names.width(), f64::max) as i32;
        let bar = if field_of(panel).is_some() { COLOUR_BAR } else { 0 };
        let length = f64::from(PANEL_WIDTH as i32 - bar - left - MARGIN - RIGHT);
        let below_names = Names::below(&x, length);
        let below = GAP + below_names.depth() * LINE + described(&panel.x.label);
        Self {
            x,
            y,
            left_names,
            below_names,
            left,
            below,
            length,
        }
    }

    /// Height that a map of this panel's width leaves free in a panel of this height, negative where it is too high; none if the
    /// panel is no map.
    fn spare(&self, panel: &Panel, height: i32) -> Option<f64> {
        let room = f64::from(height - ABOVE - MARGIN - self.below);
        panel
            .is_map()
            .then(|| room - self.length * self.y.span() / self.x.span())
    }
}

/// The name of a panel's field.
fn field_of(panel: &Panel) -> Option<&str> {
    let field = |layer: &&crate::Layer| matches!(layer.shape, Shape::Heat { .. });
    panel.layers.iter().find(field).map(|layer| layer.label.as_str())
}

/// Least and largest value of all fields of a plot with this label: what is compared has one scale.
fn shades(plot: &Plot, label: &str) -> (f64, f64) {
    let layers = plot
        .panels
        .iter()
        .flat_map(|panel| &panel.layers)
        .filter(|layer| layer.label == label);
    let values = layers.flat_map(|layer| match &layer.shape {
        Shape::Heat { values, .. } => values.iter().flatten().copied().filter(|v| v.is_finite()).collect(),
        _ => Vec::new(),
    });
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// Numbers and names in print; names are written by [`Names`].
fn tick(axis: &Scaled, value: f64) -> String {
    if axis.names().is_empty() {
        axis.format_ext(&value)
    } else {
        String::new()
    }
}

/// Draws the small ticks of logarithmic axes, inside the frame.
fn small_ticks(frame: &Frame<'_, '_>) -> Drawn {
    const LENGTH: f64 = 16.0;
    let pen = ShapeStyle::from(&INK).stroke_width(3);
    let draw = |from: Place, to: Place| path(frame.area, &[from, to], &[], pen);
    for value in frame.x.small_ticks() {
        let across = frame.across(value);
        draw((across, frame.bottom), (across, frame.bottom - LENGTH))?;
    }
    for value in frame.y.small_ticks() {
        let down = frame.down(value);
        draw((frame.left, down), (frame.left + LENGTH, down))?;
    }
    Ok(())
}

fn draw_panel(root: &Area<'_>, area: &Area<'_>, panel: &Panel, plot: &Plot) -> Drawn {
    let heat = field_of(panel);
    let (width, height) = area.dim_in_pixel();
    let (main, margin) = area.split_horizontally(width as i32 - if heat.is_some() { COLOUR_BAR } else { 0 });
    let layout = Layout::of(panel);
    // A map keeps its scale: what it does not need stays free below, or on both sides.
    let spare = layout.spare(panel, height as i32).unwrap_or(0.0);
    let beside = 0.5 * (-spare).max(0.0) * layout.x.span() / layout.y.span();
    let length = layout.length - 2.0 * beside;
    let Layout {
        x,
        y,
        left_names,
        below_names,
        left,
        below,
        ..
    } = layout;
    let mut chart = ChartBuilder::on(&main)
        .margin(MARGIN)
        .margin_top(ABOVE)
        .margin_left(MARGIN + beside as i32)
        .margin_right(RIGHT + beside as i32)
        .margin_bottom(MARGIN + spare.max(0.0) as i32)
        .x_label_area_size(below)
        .y_label_area_size(left)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .light_line_style(PAPER)
        .bold_line_style(ShapeStyle::from(&GRID).stroke_width(3))
        .axis_style(ShapeStyle::from(&INK).stroke_width(4))
        .label_style(text(TICK))
        .axis_desc_style(text(TEXT))
        .set_all_tick_mark_size(GAP / 2)
        .x_label_formatter(&|v| tick(&x, *v))
        .y_label_formatter(&|v| tick(&y, *v))
        .x_labels(x.most_that_fit(length))
        .y_labels(9)
        .x_desc(&panel.x.label)
        .y_desc(&panel.y.label)
        .draw()?;
    let (across, down) = chart.plotting_area().get_pixel_range();
    let (left, right) = (f64::from(across.start), f64::from(across.end));
    let (top, bottom) = (f64::from(down.start), f64::from(down.end));
    let frame = Frame {
        area: root,
        x: x.clone(),
        y: y.clone(),
        left,
        right,
        top,
        bottom,
    };
    small_ticks(&frame)?;
    below_names.draw_below(&frame)?;
    left_names.draw_left(&frame)?;
    let (start, _) = area.get_base_pixel();
    let half = (0.5 * wide(&panel.title, TITLE) + 40.0).min(0.5 * f64::from(width));
    let (first, last) = (f64::from(start) + half, f64::from(start + width as i32) - half);
    let middle = (0.5 * (left + right)).clamp(first, last.max(first)) as i32;
    let style = text(TITLE).pos(Pos::new(HPos::Center, VPos::Center));
    let title = Text::new(panel.title.clone(), (middle, down.start - 76), style);
    root.draw(&title)?;
    let range = heat.map_or((0.0, 1.0), |label| shades(plot, label));
    for layer in &panel.layers {
        marks::draw(&frame, layer, range)?;
    }
    marks::names(&frame, &panel.layers)?;
    let (_, above) = margin.get_base_pixel();
    heat.map_or(Ok(()), |label| legend::colour_bar(&margin, label, range, (down.start - above, down.end - above)))
}
