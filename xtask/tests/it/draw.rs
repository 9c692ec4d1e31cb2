//! Figures as they are drawn.

use fewbits_experiments::{Context, all};

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

#[test]
fn text_is_at_least_seven_points_in_print_and_inside_the_picture() {
    for (id, panels) in [("dymbo-fig4", 1), ("handoff-fig2", 2), ("binary-fig5-6", 2)] {
        let figure = all().into_iter().find(|figure| figure.about().id == id).unwrap();
        let plot = figure
            .configure(&[], true)
            .unwrap()
            .outcome(&Context::new(1))
            .unwrap()
            .plot;
        let drawn = fewbits_plot::to_svg(&plot.typeset()).unwrap();
        let width = attribute(&drawn, "width");
        let texts = texts(&drawn);
        assert!(texts.len() > 10, "{id}");
        for (element, words) in texts {
            let size = attribute(element, "font-size");
            let points = size / width * f64::from(panels) * 3.58 * 72.0;
            assert!(points >= 7.0, "{id}: {words} in {points} pt");
            // Narrower than any font is.
            let (x, wide) = (attribute(element, "x"), 0.4 * size * words.trim().chars().count() as f64);
            let (left, right) = match element {
                e if e.contains("rotate") => (x, x),
                e if e.contains("\"end\"") => (x - wide, x),
                e if e.contains("\"middle\"") => (x - 0.5 * wide, x + 0.5 * wide),
                _ => (x, x + wide),
            };
            assert!(left >= 0.0 && right <= width, "{id}: {words} is cut");
        }
    }
}
