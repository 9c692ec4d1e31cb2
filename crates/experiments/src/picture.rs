//! The default plot of a table: its columns' roles say what is drawn.

use crate::schema::{Column, Field, Role, Table, Value};
use fewbits_plot::{Axis, Layer, Panel, Plot};

/// The first table that has a horizontal axis: a panel for each value of its panel column (the title without one), a curve for each drawn
/// column and each value of its key columns. Curves of one key have one colour; without keys each column has its own.
pub fn plotted<T: Field>(tables: &T, title: &str, panel: impl Fn(String, String) -> Panel) -> Plot {
    // A cell that is not finite is refused where the tables are written.
    let tables = Table::of(tables).unwrap_or_default();
    let with_axis = |table: &&Table| table.columns.iter().any(|column| column.role == Role::X);
    let Some(table) = tables.iter().find(with_axis) else {
        return Plot::grid(1, Vec::new());
    };
    let picture = Picture::of(table);
    let panels: Vec<String> = picture.values_of(Role::Panel, &table.rows);
    let drawn = |value: &String| {
        let rows: Vec<&Vec<Value>> = table
            .rows
            .iter()
            .filter(|row| picture.value(Role::Panel, row) == *value)
            .collect();
        let title = if value.is_empty() { title } else { value };
        let mut panel = panel(title.to_owned(), picture.named(Role::X));
        if !picture.places.is_empty() {
            panel.x = Axis::categories(panel.x.label, &picture.places);
        }
        panel.with_all(picture.layers(&rows))
    };
    Plot::grid(2, panels.iter().map(drawn).collect())
}

/// A table and the places of its words on the horizontal axis.
struct Picture<'a> {
    table: &'a Table,
    /// What stands on a horizontal axis of words, in order; empty for numbers.
    places: Vec<String>,
}

impl<'a> Picture<'a> {
    fn of(table: &'a Table) -> Self {
        let mut picture = Self {
            table,
            places: Vec::new(),
        };
        let words = |row: &Vec<Value>| {
            picture
                .cells(Role::X, row)
                .any(|(_, cell)| matches!(cell, Value::Text(_)))
        };
        if table.rows.iter().any(words) {
            picture.places = picture.values_of(Role::X, &table.rows);
        }
        picture
    }

    /// The columns of this role and a row's cells in them.
    fn cells<'r>(&'r self, role: Role, row: &'r [Value]) -> impl Iterator<Item = (&'r Column, &'r Value)> {
        self.table
            .columns
            .iter()
            .zip(row)
            .filter(move |(column, _)| column.role == role)
    }

    /// What the columns of this role say of a row, in words: `{}` of their names is the value.
    fn value(&self, role: Role, row: &[Value]) -> String {
        let words = self.cells(role, row).map(|(column, cell)| match (role, column.label) {
            (Role::X, _) | (_, "") => cell.to_string(),
            (_, label) => label.replace("{}", &cell.to_string()),
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// The different values of the columns of this role, in order of appearance.
    fn values_of(&self, role: Role, rows: &[Vec<Value>]) -> Vec<String> {
        crate::sweep::distinct(rows, |row| self.value(role, row))
    }

    /// What the column of this role is called.
    fn named(&self, role: Role) -> String {
        let column = self.table.columns.iter().find(|column| column.role == role);
        column.map(name).unwrap_or_default()
    }

    fn layers(&self, rows: &[&Vec<Value>]) -> Vec<Layer> {
        let is_drawn = |role| matches!(role, Role::Line | Role::Dashed | Role::Points | Role::Curve);
        let columns = &self.table.columns;
        let drawn: Vec<usize> = (0..columns.len()).filter(|i| is_drawn(columns[*i].role)).collect();
        let keys = crate::sweep::distinct(rows, |row| self.value(Role::Key, row));
        let mut layers = Vec::new();
        for (place, key) in keys.iter().enumerate() {
            let own: Vec<&[Value]> = rows
                .iter()
                .filter(|row| self.value(Role::Key, row) == *key)
                .map(|row| &row[..])
                .collect();
            for (order, &i) in drawn.iter().enumerate() {
                let label = match (key.as_str(), drawn.len()) {
                    ("", _) => name(&columns[i]),
                    (key, 1) => key.to_owned(),
                    (key, _) => format!("{}, {key}", name(&columns[i])),
                };
                let colour = if keys.len() > 1 { place } else { order };
                let drawn = self.layer(label, i, &own);
                layers.extend(drawn.into_iter().map(|layer| layer.coloured(colour)));
            }
        }
        layers
    }

    /// The column `i` of rows as layers; none where it has no value.
    fn layer(&self, label: String, i: usize, rows: &[&[Value]]) -> Vec<Layer> {
        let columns = &self.table.columns;
        let error = columns
            .get(i + 1)
            .filter(|next| next.name == format!("{}_se", columns[i].name));
        let mark = |row: &&[Value]| {
            let (_, x) = self.cells(Role::X, row).next()?;
            let error = error.and_then(|_| number(&row[i + 1])).unwrap_or(0.0);
            Some(((self.place(x)?, number(&row[i])?), error))
        };
        let (points, errors): (Vec<_>, Vec<_>) = rows.iter().filter_map(mark).unzip();
        let layers = match columns[i].role {
            Role::Line => vec![Layer::line(label, points)],
            Role::Dashed => vec![Layer::dashed(label, points)],
            Role::Curve => vec![
                Layer::line("", points.clone()),
                Layer::points(label, points).with_errors(errors),
            ],
            _ => vec![Layer::points(label, points).with_errors(errors)],
        };
        layers.into_iter().filter(|layer| !layer.is_empty()).collect()
    }

    fn place(&self, x: &Value) -> Option<f64> {
        match x {
            Value::Text(text) => self
                .places
                .iter()
                .position(|place| place == text)
                .map(|place| place as f64),
            other => number(other),
        }
    }
}

/// The label, or the meaning without its full stop and with the unit.
fn name(column: &Column) -> String {
    let meaning = column.meaning.trim_end_matches('.');
    match (column.label, column.unit) {
        ("", "") => meaning.to_owned(),
        ("", unit) => format!("{meaning} / {unit}"),
        (label, _) => label.to_owned(),
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => Some(*number),
        Value::Integer(count) => Some(*count as f64),
        Value::Text(_) | Value::Missing => None,
    }
}

#[cfg(test)]
mod tests {
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
        let plot =
            plotted(&rows(&["one", "two"], &["a", "b"]), "title", |title, x| Panel::semilog(title, x, "error / m"));
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
        let plot = plotted(&rows, "Costs", |title, x| Panel::linear(title, x, ""));
        assert_eq!(plot.panels[0].title, "Costs");
        let names: Vec<&str> = plot.panels[0].x.names.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["x", "y"]);
        let layers = &plot.panels[0].layers;
        assert!(matches!(&layers[0].shape, Shape::Points { points, .. } if *points == [(0.0, 1.0), (1.0, 2.0)]));
        assert_eq!((layers.len(), layers[0].label.as_str()), (1, "Cost"));
    }
}
