//! Panels that several tables draw.

use crate::plot::{Axis, Layer, Marker, Panel};

/// Squared errors of designs, one a line: name, exact error, printed one.
pub(super) fn errors(title: &str, rows: impl Iterator<Item = (String, f64, Option<f64>)>) -> Panel {
    let rows: Vec<_> = rows.collect();
    let criteria = [
        ("mi ", "information, "),
        ("mse ", "squared error, "),
        ("lloyd ", "Lloyd-Max, for "),
    ];
    let in_words = |name: &String| {
        let name = name.replace('-', " ");
        let found = criteria
            .iter()
            .find_map(|(short, long)| Some(format!("{long}{}", name.strip_prefix(short)?)));
        found.unwrap_or(name)
    };
    let y = Axis::ladder(rows.iter().map(|row| in_words(&row.0)));
    let numbered = || (0..).map(|i: i32| f64::from(-i)).zip(&rows);
    let exact = numbered().map(|(at, row)| (row.1, at)).collect();
    let printed = numbered().filter_map(|(at, row)| Some((row.2?, at))).collect();
    Panel::new(title, Axis::linear("mean squared error / prior variances"), y)
        .with(Layer::points("exact", exact))
        .with(Layer::points("printed", printed).marked(Marker::Cross))
}
