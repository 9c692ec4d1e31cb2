//! What roles draw.

use super::*;
use crate::Measured;
use fewbits_plot::Shape;

rows! {
    struct Row {
        world: &'static str as panel("world {}") => "World.",
        scheme: &'static str as key => "Scheme.",
        time: f64 ["s"] as x => "Time.",
        error: Measured ["m"] as points("simulated") => "Error.",
        bound: Option<f64> ["m"] as dashed => "Bound.",
        trials: u64 => "Trials.",
    }

    struct Named {
        method: &'static str as x("") => "How.",
        cost: f64 as points => "Cost.",
    }
}

parameters! {
    #[derive(Clone, Copy)]
    point struct Plant {
        a: f64 => "Coefficient.",
        q: f64 => "Variance.",
    }
}

rows! {
    struct Both {
        plant: Plant as panel("a = {}, q = {}"),
        time: f64 as x("time") => "Time.",
        rate: f64 as line("rate") in rates => "Rate.",
        error: f64 as points("error") in errors => "Error.",
        bound: f64 as dashed("bound") in errors rates => "Bound.",
        each: [f64; 2] as line("sensor {}") in rates => "Of each.",
    }
}

#[test]
fn columns_name_their_panels_and_a_row_within_has_one_role() {
    let row = |time: f64| Both {
        plant: Plant { a: 0.5, q: 2.0 },
        time,
        rate: 1.0,
        error: 2.0,
        bound: 3.0,
        each: [4.0, 5.0],
    };
    let rates = |title, x| Panel::linear(title, x, "rate");
    let errors = |title, x| Panel::semilog(title, x, "error");
    let plot = plotted(&vec![row(1.0), row(2.0)], "title", &[("errors", "Errors", &errors), ("rates", "", &rates)]);
    let said = plot.panels.iter().map(|panel| {
        let labels = panel.layers.iter().map(|layer| layer.label.as_str());
        (panel.title.as_str(), labels.collect::<Vec<_>>())
    });
    let expected = [
        ("Errors, a = 0.5, q = 2", vec!["error", "bound"]),
        ("a = 0.5, q = 2", vec!["rate", "bound", "sensor 1", "sensor 2"]),
    ];
    assert_eq!(said.collect::<Vec<_>>(), expected);
}

rows! {
    struct Curves {
        errors: Vec<Both> => "Errors.",
        levels: Vec<Level> => "Levels.",
    }

    struct Level {
        a: f64 as panel("a = {}, q = 2") => "Coefficient.",
        time: f64 as x("time") => "Time.",
        level: f64 as dashed("level") in errors => "Level.",
    }
}

#[test]
fn tables_meet_in_the_panel_of_one_name_and_value() {
    let plant = Plant { a: 0.5, q: 2.0 };
    let errors = [1.0, 2.0].map(|time| Both {
        plant,
        time,
        rate: 1.0,
        error: 2.0,
        bound: 3.0,
        each: [4.0, 5.0],
    });
    let levels = [0.5, 0.7].map(|a| Level {
        a,
        time: 1.0,
        level: 1.0,
    });
    let (errors, levels) = (errors.into(), levels.into());
    let axes = |title, x| Panel::semilog(title, x, "error");
    let plot = plotted(&Curves { errors, levels }, "title", &[("errors", "", &axes)]);
    let said = plot.panels.iter().map(|panel| {
        let layers = panel.layers.iter().map(|layer| (layer.label.as_str(), layer.colour));
        (panel.title.as_str(), layers.collect::<Vec<_>>())
    });
    let both = vec![("error", Some(0)), ("bound", Some(1)), ("level", Some(2))];
    assert_eq!(said.collect::<Vec<_>>(), [("a = 0.5, q = 2", both), ("a = 0.7, q = 2", vec![("level", Some(0))])]);
}

fn rows(worlds: &[&'static str], schemes: &[&'static str]) -> Vec<Row> {
    let mut rows = Vec::new();
    for &world in worlds {
        for &scheme in schemes {
            for time in [1.0, 2.0] {
                let bound = (scheme == "a").then_some(0.5);
                rows.push(Row {
                    world,
                    scheme,
                    time,
                    error: Measured::new(1.0, 0.25),
                    bound,
                    trials: 9,
                });
            }
        }
    }
    rows
}

#[test]
fn roles_say_panels_curves_and_axes() {
    let plot = plotted(
        &rows(&["one", "two"], &["a", "b"]),
        "title",
        &[("", "", &|title, x| Panel::semilog(title, x, "error / m"))],
    );
    let titles: Vec<&str> = plot.panels.iter().map(|panel| panel.title.as_str()).collect();
    assert_eq!(titles, ["world one", "world two"]);
    assert_eq!(plot.panels[0].x.label, "Time / s");
    let layers = &plot.panels[1].layers;
    let said: Vec<_> = layers
        .iter()
        .map(|layer| (layer.label.as_str(), layer.colour))
        .collect();
    assert_eq!(
        said,
        [
            ("simulated, a", Some(0)),
            ("Bound / m, a", Some(0)),
            ("simulated, b", Some(1))
        ]
    );
    let Shape::Points { points, errors, .. } = &layers[0].shape else {
        panic!("{layers:?}")
    };
    assert_eq!((points, errors), (&vec![(1.0, 1.0), (2.0, 1.0)], &vec![0.25, 0.25]));
    assert!(matches!(&layers[1].shape, Shape::Line { points, .. } if *points == [(1.0, 0.5), (2.0, 0.5)]));
}

#[test]
fn without_keys_each_column_has_its_colour_and_words_are_places() {
    let rows = vec![Named { method: "x", cost: 1.0 }, Named { method: "y", cost: 2.0 }];
    let plot = plotted(&rows, "Costs", &[("", "", &|title, x| Panel::linear(title, x, ""))]);
    assert_eq!(plot.panels[0].title, "Costs");
    let names: Vec<&str> = plot.panels[0].x.names.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["x", "y"]);
    let layers = &plot.panels[0].layers;
    assert!(matches!(&layers[0].shape, Shape::Points { points, .. } if *points == [(0.0, 1.0), (1.0, 2.0)]));
    assert_eq!((layers.len(), layers[0].label.as_str()), (1, "Cost"));
}

rows! {
    struct Rung {
        kind: &'static str as ladder("{}-{}") => "Kind.",
        size: u32 as ladder => "Size.",
        error: Measured as points("error") => "Error.",
    }
}

#[test]
fn names_of_a_ladder_stand_below_one_another_and_values_lie_across() {
    let rung = |kind, size, error| Rung {
        kind,
        size,
        error: Measured::new(error, 0.5),
    };
    let rows = vec![rung("mi", 4, 2.0), rung("mi", 8, 3.0)];
    let plot = plotted(&rows, "Title", &[("", "", &|title, x| Panel::semilog(title, x, "error"))]);
    let panel = &plot.panels[0];
    assert_eq!((panel.x.label.as_str(), panel.x.scale), ("error", fewbits_plot::Scale::Log));
    assert_eq!(panel.y.names, [(0.0, "mi-4".to_owned()), (-1.0, "mi-8".to_owned())]);
    let Shape::Points {
        points,
        errors,
        sideways,
        ..
    } = &panel.layers[0].shape
    else {
        panic!("no points")
    };
    assert_eq!(
        (points.as_slice(), errors.as_slice(), *sideways),
        (&[(2.0, 0.0), (3.0, -1.0)][..], &[0.5; 2][..], true)
    );
}
