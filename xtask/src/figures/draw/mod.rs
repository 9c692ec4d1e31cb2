//! From a [`Plot`] to SVG: at most two panels a row, legends below them.

mod frame;
mod legend;
mod marks;
mod scale;
mod style;
mod typeset;

use super::Error;
use fewbits_experiments::plot::{Panel, Plot, Shape};
use frame::Frame;
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{BoldPoints, Ranged, ValueFormatter};
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::style::ShapeStyle;
use scale::Scaled;
use style::{GRID, INK, PANEL_HEIGHT, PANEL_WIDTH, PAPER, TEXT, TICK, text, title};
pub(super) use typeset::typeset;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Width of a colour bar with its numbers.
const COLOUR_BAR: i32 = 440;
/// Most panels a row.
const COLUMNS: usize = 2;

/// Draws a plot.
///
/// # Errors
/// If the back end refuses an element.
pub fn to_svg(id: &str, plot: &Plot) -> Result<String, Error> {
    let plot = &typeset::words(plot.clone());
    let columns = plot.columns.min(plot.panels.len()).clamp(1, COLUMNS);
    let rows: Vec<&[Panel]> = plot.panels.chunks(columns).collect();
    let width = PANEL_WIDTH as i32;
    let height = |row: &&[Panel]| {
        let legends = row.iter().map(|panel| legend::height(panel, width));
        PANEL_HEIGHT as i32 + legends.max().unwrap_or(0) + 40
    };
    let heights: Vec<i32> = rows.iter().map(height).collect();
    let mut svg = String::new();
    {
        let size = (PANEL_WIDTH * columns as u32, heights.iter().sum::<i32>().max(1) as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root, plot, &rows, &heights).map_err(|reason| Error::Draw {
            id: id.to_owned(),
            reason,
        })?;
    }
    Ok(svg)
}

fn why(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn draw(root: &Area<'_>, plot: &Plot, rows: &[&[Panel]], heights: &[i32]) -> Result<(), String> {
    root.fill(&PAPER).map_err(why)?;
    let mut top = 0;
    for (row, height) in rows.iter().zip(heights) {
        for (column, panel) in row.iter().enumerate() {
            let left = PANEL_WIDTH as i32 * column as i32;
            let place = root.clone().shrink((left, top), (PANEL_WIDTH, *height as u32));
            draw_panel(root, &place, panel, plot)?;
        }
        top += height;
    }
    root.present().map_err(why)
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

fn draw_panel(root: &Area<'_>, area: &Area<'_>, panel: &Panel, plot: &Plot) -> Result<(), String> {
    let is_heat = |shape: &Shape| matches!(shape, Shape::Heat { .. });
    let heat = panel
        .layers
        .iter()
        .find(|layer| is_heat(&layer.shape))
        .map(|layer| layer.label.as_str());
    let (width, _) = area.dim_in_pixel();
    let (upper, below) = area.split_vertically(PANEL_HEIGHT as i32);
    legend::draw(&below, panel)?;
    let (main, margin) = upper.split_horizontally(width as i32 - if heat.is_some() { COLOUR_BAR } else { 0 });
    let x = Scaled::new(&panel.x, panel.layers.iter().flat_map(|layer| marks::extent(layer).0));
    let y = Scaled::new(&panel.y, panel.layers.iter().flat_map(|layer| marks::extent(layer).1));
    let described = u32::from(!panel.y.label.is_empty()) * 100;
    let mut chart = ChartBuilder::on(&main)
        .caption(&panel.title, title())
        .margin(36)
        .margin_right(90)
        .x_label_area_size(210)
        .y_label_area_size(60 + described + widest_label(&y))
        .build_cartesian_2d(x.clone(), y.clone())
        .map_err(why)?;
    chart
        .configure_mesh()
        .light_line_style(PAPER)
        .bold_line_style(ShapeStyle::from(&GRID).stroke_width(3))
        .axis_style(ShapeStyle::from(&INK).stroke_width(4))
        .label_style(text(TICK))
        .axis_desc_style(text(TEXT))
        .x_label_formatter(&|v| x.format_ext(v))
        .y_label_formatter(&|v| y.format_ext(v))
        .x_labels(7)
        .y_labels(9)
        .x_desc(&panel.x.label)
        .y_desc(&panel.y.label)
        .draw()
        .map_err(why)?;
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
    let range = heat.map_or((0.0, 1.0), |label| shades(plot, label));
    for (position, layer) in panel.layers.iter().enumerate() {
        marks::draw(&frame, layer, position, range)?;
    }
    heat.map_or(Ok(()), |label| legend::colour_bar(&margin, label, range))
}

/// Room for the widest number or name at the ticks of a vertical axis.
fn widest_label(axis: &Scaled) -> u32 {
    let ticks = axis.key_points(BoldPoints(9));
    let widest = ticks
        .iter()
        .map(|v| axis.format_ext(v).chars().count() as u32)
        .max()
        .unwrap_or(4);
    (f64::from(widest.clamp(3, 26)) * 0.56 * f64::from(TICK)) as u32
}
