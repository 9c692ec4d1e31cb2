//! Panels that several tables draw.

use crate::plot::{Axis, Layer, Legend, Marker, Panel};
use crate::{Error, Table};

/// Squared errors of designs, one a line, with the printed values beside them.
pub(super) fn error_bars(title: &str, rows: &Table, labels: &[String]) -> Result<Panel, Error> {
    let points = |column: &str| -> Result<Vec<(f64, f64)>, Error> {
        let at = rows.columns().iter().position(|c| c.name == column);
        let at = at.ok_or_else(|| Error::Table(format!("no column `{column}`")))?;
        let values = rows.rows().iter().enumerate();
        Ok(values
            .filter_map(|(i, row)| Some((row[at].as_number()?, -(i as f64))))
            .collect())
    };
    let names = labels.iter().enumerate().map(|(i, label)| (-(i as f64), label.clone()));
    let y = Axis::linear("").named(names).between(0.6 - labels.len() as f64, 0.6);
    Ok(Panel::new(title, Axis::linear("mean squared error"), y)
        .with(Layer::points("exact", points("mse")?))
        .with(Layer::points("printed", points("printed_mse")?).marked(Marker::Cross))
        .legend(Legend::Outside))
}
