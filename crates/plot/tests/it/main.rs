//! Plots become SVG: every shape leaves its elements, whatever the data.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

use fewbits_plot::{Axis, Layer, Marker, Panel, Plot, to_svg};

/// The text elements of a drawing: attributes and words.
fn texts(svg: &str) -> Vec<(&str, &str)> {
    let elements = svg.split("<text ").skip(1);
    elements
        .filter_map(|rest| rest.split_once("</text>")?.0.split_once('>'))
        .collect()
}

fn attribute(element: &str, name: &str) -> f64 {
    let value = element.split_once(&format!("{name}=\"")).unwrap().1;
    value[..value.find('"').unwrap()].parse().unwrap()
}

fn svg(panel: Panel) -> String {
    to_svg(&Plot::of(panel)).unwrap()
}

fn empty() -> Panel {
    Panel::new("Title", Axis::linear("time / s"), Axis::log("error / m"))
}

fn count(svg: &str, element: &str) -> usize {
    svg.matches(element).count()
}

#[test]
fn axes_titles_and_legends_are_written_out() {
    let curve = vec![(0.0, 1.0), (1.0, 100.0)];
    let drawn = svg(empty().with(Layer::line("a < b", curve.clone())));
    for text in ["Title", "time / s", "error / m", "a &lt; b"] {
        assert!(drawn.contains(text), "{text} is missing");
    }
    assert!(!svg(empty().with(Layer::line("name", curve)).without_legend()).contains("name"));
}

#[test]
fn every_shape_leaves_its_elements() {
    let blank = svg(empty());
    let more = |layer: Layer, element: &str| count(&svg(empty().with(layer)), element) - count(&blank, element);
    let points = vec![(0.0, 1.0), (1.0, 10.0), (2.0, 100.0)];
    assert_eq!(more(Layer::points("", points.clone()), "<circle"), 3);
    assert_eq!(more(Layer::points("", points.clone()).marked(Marker::Triangle), "<polygon"), 3);
    assert!(more(Layer::points("", points.clone()).with_errors(vec![0.5; 3]), "<polyline") >= 3);
    assert!(more(Layer::dashed("", points.clone()), "<polyline") > 10);
    assert_eq!(more(Layer::boxes("", vec![(0.0, 1.0, 1.0, 2.0)]), "<rect"), 1);
    assert_eq!(more(Layer::band("", vec![(0.0, 1.0, 2.0), (1.0, 2.0, 3.0)]), "<polygon"), 1);
    let heat = Layer::heat("", vec![0.0, 1.0], vec![1.0, 2.0, 3.0], [0.0, 1.0].repeat(3));
    assert!(more(heat, "<rect") >= 6);
    assert!(svg(empty().with(Layer::texts(vec![(1.0, 2.0, "here".into())]))).contains("here"));
}

/// Two marks a metre apart across and down, of maps that are wide, high, and beside a field.
#[test]
fn a_metre_of_a_map_is_as_long_on_both_axes() {
    let field = Layer::heat("level", vec![0.0, 30.0], vec![0.0, 10.0], [0.0, 1.0].repeat(2));
    let bare = |x: f64, y: f64| {
        Panel::new("", Axis::linear("x / m").between(0.0, x), Axis::linear("y / m").between(0.0, y))
            .with(Layer::points("", vec![(1.0, 1.0), (2.0, 1.0), (1.0, 2.0)]))
    };
    for panel in [
        bare(30.0, 10.0),
        bare(10.0, 30.0),
        bare(10.0, 10.0),
        bare(30.0, 10.0).with(field),
    ] {
        assert!(panel.is_map());
        let drawn = svg(panel);
        let at: Vec<(f64, f64)> = drawn
            .split("<circle ")
            .skip(1)
            .map(|circle| (attribute(circle, "cx"), attribute(circle, "cy")))
            .collect();
        let (across, down) = (at[1].0 - at[0].0, at[0].1 - at[2].1);
        assert!((across / down - 1.0).abs() < 0.03, "{across} {down}");
    }
}

#[test]
fn what_has_no_place_on_an_axis_is_left_out() {
    let points = vec![
        (0.0, 0.0),
        (1.0, -3.0),
        (2.0, f64::NAN),
        (3.0, f64::INFINITY),
        (4.0, 1.0),
        (5.0, 2.0),
    ];
    let drawn = svg(empty()
        .with(Layer::points("", points.clone()))
        .with(Layer::line("", points)));
    assert_eq!(count(&drawn, "<circle"), 2);
    assert!(!drawn.contains("NaN") && !drawn.contains("inf"));
    // Nothing at all to draw is a picture too.
    assert!(svg(empty().with(Layer::line("", Vec::new()))).starts_with("<svg"));
}

#[test]
fn a_legend_stands_once_unless_a_name_or_a_look_has_two_meanings() {
    let curve = |name: &str| empty().with(Layer::line(name, vec![(0.0, 1.0), (1.0, 2.0)]));
    let legends = |panels: Vec<Panel>| count(&to_svg(&Plot::grid(2, panels)).unwrap(), "scheme");
    assert_eq!(legends(vec![curve("scheme"), curve("scheme")]), 1);
    assert_eq!(legends(vec![curve("scheme"); 4]), 1);
    assert_eq!(legends(vec![curve("scheme"), curve("another scheme")]), 2);
    assert_eq!(legends(vec![curve("scheme"), curve("scheme").without_legend()]), 1);
}

#[test]
fn a_curve_of_one_point_is_a_mark() {
    let alone = svg(empty().with(Layer::line("", vec![(1.0, 1.0)])));
    assert_eq!(count(&alone, "<circle"), 1);
}

#[test]
fn names_of_contours_stand_apart() {
    let contour =
        |i: u32| Layer::line(format!("level {i}"), (0..100).map(|k| (f64::from(k), f64::from(1 << i))).collect());
    let drawn = svg(empty().with_all((0..4).map(|i| contour(i).inline())).without_legend());
    let names: Vec<_> = texts(&drawn)
        .into_iter()
        .filter(|(_, words)| words.contains("level"))
        .collect();
    let mut heights: Vec<f64> = names.iter().map(|(element, _)| attribute(element, " y")).collect();
    heights.sort_by(f64::total_cmp);
    assert!(heights.len() == 4 && heights.windows(2).all(|pair| pair[1] - pair[0] > 68.0), "{heights:?}");
}

#[test]
fn words_are_typeset_and_renamed_everywhere() {
    let panel = Panel::new("sigma^2", Axis::linear("gamma"), Axis::categories("mu", ["rho"]));
    let plot = Plot::of(panel.with(Layer::line("scheme", vec![(0.0, 0.0), (1.0, 1.0)])));
    let plot = plot.renamed(|name| name.replace("scheme", "tau")).typeset();
    let drawn = to_svg(&plot).unwrap();
    for text in ["σ²", "γ", "µ", "ρ", "τ"] {
        assert!(drawn.contains(text), "{text} is missing");
    }
}
