//! From a [`Plot`] to SVG.

use super::Error;
use super::scale::Scaled;
use fewbits_experiments::plot::{Layer, Legend, Marker, Panel, Plot, Shape, Stroke};
use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext, SeriesLabelPosition};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, Cross, EmptyElement, PathElement, Polygon, Rectangle, Text, TriangleMarker};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scaled, Scaled>>;
type Point = (f64, f64);

/// Size of a panel; four times what a screen shows, because positions are whole units.
const PANEL: (u32, u32) = (2480, 1720);
/// Extra width for a legend outside.
const LEGEND_WIDTH: i32 = 720;
const FONT: &str = "sans-serif";
const TEXT: i32 = 50;
const STROKE: u32 = 8;

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
const INK: RGBColor = RGBColor(40, 44, 52);
const GRID: RGBColor = RGBColor(225, 228, 232);
const PAPER: RGBColor = RGBColor(255, 255, 255);

/// Draws a plot.
///
/// # Errors
/// If the back end refuses an element.
pub fn to_svg(id: &str, plot: &Plot) -> Result<String, Error> {
    let columns = plot.columns.min(plot.panels.len()).max(1);
    let rows = plot.panels.len().div_ceil(columns).max(1);
    let mut svg = String::new();
    {
        let size = (PANEL.0 * columns as u32, PANEL.1 * rows as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root, plot, (rows, columns)).map_err(|reason| Error::Draw {
            id: id.to_owned(),
            reason,
        })?;
    }
    Ok(svg)
}

fn why(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn draw(root: &Area<'_>, plot: &Plot, layout: (usize, usize)) -> Result<(), String> {
    root.fill(&PAPER).map_err(why)?;
    for (area, panel) in root.split_evenly(layout).iter().zip(&plot.panels) {
        draw_panel(area, panel)?;
    }
    root.present().map_err(why)
}

fn text(size: i32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&INK)
}

fn draw_panel(area: &Area<'_>, panel: &Panel) -> Result<(), String> {
    let heat = panel.layers.iter().find_map(|layer| match &layer.shape {
        Shape::Heat { values, .. } => Some((layer.label.as_str(), value_range(values))),
        _ => None,
    });
    let side = match (heat.is_some(), panel.legend) {
        (true, _) => 380,
        (false, Legend::Outside) => LEGEND_WIDTH,
        (false, _) => 0,
    };
    let (width, _) = area.dim_in_pixel();
    let (main, margin) = area.split_horizontally(width as i32 - side);
    let x = Scaled::new(&panel.x, panel.layers.iter().flat_map(|layer| extent(layer).0));
    let y = Scaled::new(&panel.y, panel.layers.iter().flat_map(|layer| extent(layer).1));
    let widest = widest_label(&y);
    let mut chart = ChartBuilder::on(&main)
        .caption(&panel.title, text(TEXT + 10))
        .margin(36)
        .margin_right(60)
        .x_label_area_size(164)
        .y_label_area_size(140 + 26 * widest.max(3))
        .build_cartesian_2d(x.clone(), y.clone())
        .map_err(why)?;
    chart
        .configure_mesh()
        .light_line_style(PAPER)
        .bold_line_style(ShapeStyle::from(&GRID).stroke_width(2))
        .axis_style(ShapeStyle::from(&INK).stroke_width(4))
        .label_style(text(TEXT - 4))
        .axis_desc_style(text(TEXT))
        .x_label_formatter(&|v| x.format_ext(v))
        .y_label_formatter(&|v| y.format_ext(v))
        .x_labels(9)
        .y_labels(9)
        .x_desc(&panel.x.label)
        .y_desc(&panel.y.label)
        .draw()
        .map_err(why)?;
    for (index, layer) in panel.layers.iter().enumerate() {
        draw_layer(&mut chart, layer, colour(layer, index), &x, &y)?;
    }
    match panel.legend {
        Legend::Hidden => {}
        Legend::Outside => outside_legend(&margin, panel)?,
        inside => inside_legend(&mut chart, inside)?,
    }
    if let Some((label, range)) = heat {
        colour_bar(&margin, label, range)?;
    }
    Ok(())
}

fn colour(layer: &Layer, index: usize) -> RGBColor {
    PALETTE[layer.colour.unwrap_or(index) % PALETTE.len()]
}

fn widest_label(axis: &Scaled) -> u32 {
    use plotters::coord::ranged1d::{BoldPoints, Ranged};
    axis.key_points(BoldPoints(9))
        .iter()
        .map(|v| axis.format_ext(v).chars().count() as u32)
        .max()
        .unwrap_or(4)
        .min(16)
}

/// All horizontal and vertical positions of a layer.
fn extent(layer: &Layer) -> (Vec<f64>, Vec<f64>) {
    match &layer.shape {
        Shape::Line { points, .. } => points.iter().copied().unzip(),
        Shape::Points { points, errors, .. } => {
            let (x, mut y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            let ends = points.iter().zip(errors).flat_map(|(p, e)| [p.1 - e, p.1 + e]);
            y.extend(ends);
            (x, y)
        }
        Shape::Bars { points, width } => (
            points
                .iter()
                .flat_map(|p| [p.0 - width / 2.0, p.0 + width / 2.0])
                .collect(),
            points.iter().map(|p| p.1).chain([0.0]).collect(),
        ),
        Shape::Heat { x, y, .. } => (edges(x), edges(y)),
        Shape::Boxes { boxes } => {
            (boxes.iter().flat_map(|b| [b.0, b.1]).collect(), boxes.iter().flat_map(|b| [b.2, b.3]).collect())
        }
        Shape::Band { limits } => {
            (limits.iter().map(|l| l.0).collect(), limits.iter().flat_map(|l| [l.1, l.2]).collect())
        }
        Shape::Texts { texts } => texts.iter().map(|(x, y, _)| (*x, *y)).unzip(),
    }
}

/// Edges of cells with the given centres; outermost cells are symmetric about their centres.
fn edges(centres: &[f64]) -> Vec<f64> {
    match centres {
        [] => Vec::new(),
        [only] => vec![only - 0.5, only + 0.5],
        [first, second, ..] => {
            let last = centres[centres.len() - 1];
            let end = 0.5 * (last - centres[centres.len() - 2]);
            std::iter::once(first - 0.5 * (second - first))
                .chain(centres.windows(2).map(|c| 0.5 * (c[0] + c[1])))
                .chain([last + end])
                .collect()
        }
    }
}

fn draw_layer<'a, 'b: 'a>(
    chart: &mut Chart<'a, 'b>,
    layer: &Layer,
    colour: RGBColor,
    x: &Scaled,
    y: &Scaled,
) -> Result<(), String> {
    let on = |p: &Point| x.accepts(p.0) && y.accepts(p.1);
    match &layer.shape {
        Shape::Line { points, stroke } => {
            let points: Vec<Point> = points.iter().copied().filter(on).collect();
            let solid = *stroke == Stroke::Solid;
            let pen = colour.stroke_width(if solid { STROKE } else { STROKE - 2 });
            if solid {
                let drawn = chart.draw_series([PathElement::new(points, pen)]).map_err(why)?;
                name(drawn, &layer.label, move |(x, y)| PathElement::new(vec![(x, y), (x + 80, y)], pen));
            } else {
                let drawn = chart.draw_series(
                    dashes(chart, &points, x, y)
                        .into_iter()
                        .map(|d| PathElement::new(d, pen)),
                );
                name(drawn.map_err(why)?, &layer.label, move |(x, y)| {
                    EmptyElement::at((x, y))
                        + PathElement::new(vec![(0, 0), (30, 0)], pen)
                        + PathElement::new(vec![(48, 0), (78, 0)], pen)
                });
            }
        }
        Shape::Points { points, errors, marker } => draw_points(chart, layer, points, errors, *marker, colour, &on)?,
        Shape::Bars { points, width } => {
            let floor = if y.accepts(0.0) { 0.0 } else { y.low() };
            let bars = points.iter().filter(|p| on(p)).map(|p| {
                Rectangle::new([(p.0 - width / 2.0, floor), (p.0 + width / 2.0, p.1)], colour.mix(0.8).filled())
            });
            boxed(chart.draw_series(bars).map_err(why)?, &layer.label, colour);
        }
        Shape::Boxes { boxes } => {
            let boxes = boxes
                .iter()
                .map(|b| Rectangle::new([(b.0, b.2), (b.1, b.3)], colour.filled()));
            boxed(chart.draw_series(boxes).map_err(why)?, &layer.label, colour);
        }
        Shape::Heat { x, y, values } => {
            let (low, high) = value_range(values);
            let (left, bottom) = (edges(x), edges(y));
            let cells = values
                .iter()
                .enumerate()
                .flat_map(|(j, row)| row.iter().enumerate().map(move |(i, v)| (i, j, *v)));
            // Each cell reaches under its next neighbours, drawn later, so that no seam shines through.
            let under = |edges: &[f64], i: usize| edges[(i + 2).min(edges.len() - 1)];
            let cells = cells.map(|(i, j, v)| {
                let shade = heat_colour((v - low) / (high - low).max(f64::MIN_POSITIVE));
                let far = (under(&left, i), under(&bottom, j));
                Rectangle::new([(left[i], bottom[j]), far], shade.filled())
            });
            chart.draw_series(cells).map_err(why)?;
        }
        Shape::Band { limits } => {
            let upper = limits.iter().map(|l| (l.0, l.2));
            let outline: Vec<Point> = limits
                .iter()
                .map(|l| (l.0, l.1))
                .chain(upper.rev())
                .filter(on)
                .collect();
            boxed(
                chart
                    .draw_series([Polygon::new(outline, colour.mix(0.25))])
                    .map_err(why)?,
                &layer.label,
                colour,
            );
        }
        Shape::Texts { texts } => {
            let style = text(TEXT - 10).pos(Pos::new(HPos::Center, VPos::Center));
            let texts = texts
                .iter()
                .map(|(x, y, t)| Text::new(t.clone(), (*x, *y), style.clone()));
            chart.draw_series(texts).map_err(why)?;
        }
    }
    Ok(())
}

type Series<'a, 'b> = plotters::chart::SeriesAnno<'a, SVGBackend<'b>>;

/// Gives a layer its entry in the legend.
fn name<'a, 'b, E>(series: &mut Series<'a, 'b>, label: &str, sample: impl Fn((i32, i32)) -> E + 'a)
where
    E: plotters::element::IntoDynElement<'a, SVGBackend<'b>, (i32, i32)>,
{
    if !label.is_empty() {
        series.label(label).legend(sample);
    }
}

fn boxed(series: &mut Series<'_, '_>, label: &str, colour: RGBColor) {
    name(series, label, move |(x, y)| {
        Rectangle::new([(x + 8, y - 18), (x + 72, y + 18)], colour.mix(0.8).filled())
    });
}

fn draw_points<'a, 'b: 'a>(
    chart: &mut Chart<'a, 'b>,
    layer: &Layer,
    points: &[Point],
    errors: &[f64],
    marker: Marker,
    colour: RGBColor,
    on: &impl Fn(&Point) -> bool,
) -> Result<(), String> {
    let pen = colour.stroke_width(STROKE - 2);
    let bars = points
        .iter()
        .zip(errors)
        .filter(|(p, e)| on(p) && on(&(p.0, p.1 - **e)))
        .map(|(p, e)| PathElement::new(vec![(p.0, p.1 - e), (p.0, p.1 + e)], pen));
    chart.draw_series(bars).map_err(why)?;
    let points = points.iter().copied().filter(on);
    let fill = colour.filled();
    match marker {
        Marker::Circle => {
            let drawn = chart
                .draw_series(points.map(|p| Circle::new(p, 14, fill)))
                .map_err(why)?;
            name(drawn, &layer.label, move |(x, y)| Circle::new((x + 40, y), 14, fill));
        }
        Marker::Cross => {
            let drawn = chart.draw_series(points.map(|p| Cross::new(p, 14, pen))).map_err(why)?;
            name(drawn, &layer.label, move |(x, y)| Cross::new((x + 40, y), 14, pen));
        }
        Marker::Triangle => {
            let drawn = chart
                .draw_series(points.map(|p| TriangleMarker::new(p, 20, fill)))
                .map_err(why)?;
            name(drawn, &layer.label, move |(x, y)| TriangleMarker::new((x + 40, y), 20, fill));
        }
        Marker::Square => {
            let square = move |p| EmptyElement::at(p) + Rectangle::new([(-14, -14), (14, 14)], fill);
            let drawn = chart.draw_series(points.map(square)).map_err(why)?;
            name(drawn, &layer.label, move |(x, y)| Rectangle::new([(x + 26, y - 14), (x + 54, y + 14)], fill));
        }
    }
    Ok(())
}

/// Cuts a polyline into dashes of equal length on paper.
fn dashes(chart: &Chart<'_, '_>, points: &[Point], x: &Scaled, y: &Scaled) -> Vec<Vec<Point>> {
    const PERIOD: f64 = 52.0;
    const DASH: f64 = 32.0;
    let place = |p: &Point| {
        let (right, down) = chart.backend_coord(p);
        (f64::from(right), f64::from(down))
    };
    let (mut dashes, mut current, mut travelled) = (Vec::new(), Vec::new(), 0.0);
    for pair in points.windows(2) {
        let (a, b) = (place(&pair[0]), place(&pair[1]));
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let mut at = 0.0;
        while at < length {
            let phase: f64 = travelled % PERIOD;
            let rest = if phase < DASH { DASH - phase } else { PERIOD - phase };
            let next = (at + rest.max(1e-6)).min(length);
            let between = |t: f64| {
                let share = t / length;
                (x.between(pair[0].0, pair[1].0, share), y.between(pair[0].1, pair[1].1, share))
            };
            if phase < DASH {
                if current.is_empty() {
                    current.push(between(at));
                }
                current.push(between(next));
            } else if !current.is_empty() {
                dashes.push(std::mem::take(&mut current));
            }
            travelled += next - at;
            at = next;
        }
    }
    dashes.push(current);
    dashes.retain(|dash| dash.len() > 1);
    dashes
}

fn inside_legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>, place: Legend) -> Result<(), String> {
    let position = match place {
        Legend::TopLeft => SeriesLabelPosition::UpperLeft,
        Legend::BottomLeft => SeriesLabelPosition::LowerLeft,
        Legend::BottomRight => SeriesLabelPosition::LowerRight,
        Legend::TopRight | Legend::Outside | Legend::Hidden => SeriesLabelPosition::UpperRight,
    };
    chart
        .configure_series_labels()
        .position(position)
        .margin(28)
        .legend_area_size(100)
        .background_style(PAPER.mix(0.85))
        .border_style(GRID)
        .label_font(text(TEXT - 4))
        .draw()
        .map_err(why)
}

fn outside_legend(area: &Area<'_>, panel: &Panel) -> Result<(), String> {
    let mut top = 140;
    for (index, layer) in panel
        .layers
        .iter()
        .enumerate()
        .filter(|(_, layer)| !layer.label.is_empty())
    {
        let (pen, fill) = (colour(layer, index).stroke_width(STROKE), colour(layer, index).filled());
        match &layer.shape {
            Shape::Line {
                stroke: Stroke::Solid, ..
            } => {
                area.draw(&PathElement::new(vec![(10, top), (90, top)], pen))
                    .map_err(why)?;
            }
            Shape::Line {
                stroke: Stroke::Dashed, ..
            } => {
                area.draw(&PathElement::new(vec![(10, top), (40, top)], pen))
                    .map_err(why)?;
                area.draw(&PathElement::new(vec![(58, top), (88, top)], pen))
                    .map_err(why)?;
            }
            Shape::Points { .. } => area.draw(&Circle::new((50, top), 14, fill)).map_err(why)?,
            _ => area
                .draw(&Rectangle::new([(18, top - 18), (82, top + 18)], fill))
                .map_err(why)?,
        }
        let style = text(TEXT - 6).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(layer.label.clone(), (116, top), style))
            .map_err(why)?;
        top += 72;
    }
    Ok(())
}

fn value_range(values: &[Vec<f64>]) -> (f64, f64) {
    let finite = values.iter().flatten().copied().filter(|v| v.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

fn colour_bar(area: &Area<'_>, label: &str, (low, high): (f64, f64)) -> Result<(), String> {
    let (_, height) = area.dim_in_pixel();
    let (top, bottom) = (160, height as i32 - 220);
    let steps = 64;
    let at = |share: f64| bottom - (f64::from(bottom - top) * share).round() as i32;
    // From the top down, each piece reaching to the bottom, so that no seam shines through.
    for i in (0..steps).rev() {
        let (from, to) = (f64::from(i) / f64::from(steps), f64::from(i + 1) / f64::from(steps));
        let bar = Rectangle::new([(20, at(to)), (100, bottom)], heat_colour(0.5 * (from + to)).filled());
        area.draw(&bar).map_err(why)?;
    }
    let style = text(TEXT - 4).pos(Pos::new(HPos::Left, VPos::Center));
    let axis = Scaled::new(&fewbits_experiments::plot::Axis::linear("").between(low, high), std::iter::empty());
    for i in 0..=4 {
        let share = f64::from(i) / 4.0;
        let value = low + share * (high - low);
        let digits = format!("{value:.3}").parse::<f64>().unwrap_or(value);
        area.draw(&Text::new(axis.format_ext(&digits), (120, at(share)), style.clone()))
            .map_err(why)?;
    }
    area.draw(&Text::new(label.to_owned(), (20, top - 70), style))
        .map_err(why)
}

/// A perceptually even ramp from dark violet to yellow, for `share` in `[0, 1]`.
fn heat_colour(share: f64) -> RGBColor {
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
