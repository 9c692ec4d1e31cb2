//! Panels that several tables draw.

use crate::plot::{Axis, Layer, Marker, Panel, points};

/// Squared errors of designs, one a line: name, exact error, printed one.
pub(super) fn errors(title: &str, rows: impl Iterator<Item = (String, f64, Option<f64>)>) -> Panel {
    let rows: Vec<_> = rows
        .enumerate()
        .map(|(i, (name, mse, printed))| (-(i as f64), name, mse, printed))
        .collect();
    type Place = (f64, String, f64, Option<f64>);
    let place = |value: fn(&Place) -> Option<f64>| {
        let place = |row| Some((value(row)?, row.0));
        rows.iter().filter_map(place).collect::<Vec<_>>()
    };
    let names = rows.iter().map(|(at, name, ..)| (*at, name.clone()));
    let y = Axis::linear("").named(names).between(0.6 - rows.len() as f64, 0.6);
    Panel::new(title, Axis::linear("mean squared error / prior variances"), y)
        .with(Layer::points("exact", points(place(|r| Some(r.2)), |p| p)))
        .with(Layer::points("printed", points(place(|r| r.3), |p| p)).marked(Marker::Cross))
}
