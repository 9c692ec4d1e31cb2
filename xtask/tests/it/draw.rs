//! Plots become SVG: every shape leaves its elements, whatever the data.

use fewbits_experiments::plot::{Axis, Layer, Marker, Panel, Plot};
use xtask::figures::to_svg;

fn svg(panel: Panel) -> String {
    to_svg("test", &Plot::of(panel)).unwrap()
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
    assert_eq!(more(Layer::bars("", points.clone(), 0.5), "<rect"), 3);
    assert_eq!(more(Layer::boxes("", vec![(0.0, 1.0, 1.0, 2.0)]), "<rect"), 1);
    assert_eq!(more(Layer::band("", vec![(0.0, 1.0, 2.0), (1.0, 2.0, 3.0)]), "<polygon"), 1);
    let heat = Layer::heat("", vec![0.0, 1.0], vec![1.0, 2.0, 3.0], vec![vec![0.0, 1.0]; 3]);
    assert!(more(heat, "<rect") >= 6);
    assert!(svg(empty().with(Layer::texts(vec![(1.0, 2.0, "here".into())]))).contains("here"));
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
