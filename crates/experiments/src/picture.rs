//! The default plot of a table: its columns' roles say what is drawn.

use crate::schema::{Column, Field, Role, Table, Value};
use crate::words::in_words;
use fewbits_plot::{Axis, Layer, Panel, Plot};

/// A panel by the name that its columns give it (none for the only one), its heading, and its axes from a title and the name of the
/// horizontal one.
pub type Named<'a> = (&'a str, &'a str, &'a dyn Fn(String, String) -> Panel);

/// The first table that draws one of these panels: each of them for each value of its panel column (the figure's title without heading
/// and value), a curve for each drawn column and each value of its key columns. Then the next table, in the same panel where name and value
/// are the same. Curves of one key have one colour; without keys each column has its own, but a line and the marks that are called the
/// same up to a comma.
pub fn plotted<T: Field>(tables: &T, title: &str, named: &[Named<'_>]) -> Plot {
    // A cell that is not finite is refused where the tables are written.
    let tables = Table::of(tables).unwrap_or_default();
    let mut panels: Vec<(&str, String, Panel)> = Vec::new();
    for table in &tables {
        let pictures = named.iter().map(|named| Picture::of(table, named));
        let pictures: Vec<Picture<'_>> = pictures.filter(Picture::is_drawn).collect();
        for value in pictures
            .first()
            .map_or_else(Vec::new, |first| first.values_of(Role::panel, &table.rows))
        {
            for picture in &pictures {
                let name = picture.named.0;
                let known = panels
                    .iter_mut()
                    .find(|(own, of, _)| !own.is_empty() && *own == name && *of == value);
                match known {
                    Some((.., panel)) => picture.draw(panel, &value),
                    None => panels.push((name, value.clone(), picture.panel(title, &value))),
                }
            }
        }
    }
    Plot::grid(2, panels.into_iter().map(|(.., panel)| panel).collect())
}

/// A table, the panel of it that is drawn, and the places of its words on the horizontal axis.
struct Picture<'a> {
    table: &'a Table,
    named: Named<'a>,
    /// What its columns are drawn over: [`Role::x`] or [`Role::ladder`].
    over: Role,
    /// What stands on an axis of words, in order; empty for numbers.
    places: Vec<String>,
}

impl<'a> Picture<'a> {
    fn of(table: &'a Table, named: &Named<'a>) -> Self {
        let has = |role: Role| table.columns.iter().any(|column| column.role == role);
        let mut picture = Self {
            table,
            named: *named,
            over: if has(Role::ladder) { Role::ladder } else { Role::x },
            places: Vec::new(),
        };
        // Words stand in their order, and so do the values of several columns together.
        let named = |row: &Vec<Value>| {
            let mut cells = picture.cells(picture.over, row);
            matches!(cells.next(), Some((_, Value::Text(_)))) || cells.next().is_some()
        };
        if table.rows.iter().any(named) {
            picture.places = picture.values_of(picture.over, &table.rows);
        }
        picture
    }

    /// The columns that this panel draws.
    fn drawn(&self) -> Vec<usize> {
        let is_drawn = |column: &Column| {
            let here = match column.panels {
                [] => self.named.0.is_empty(),
                panels => panels.contains(&self.named.0),
            };
            here && matches!(column.role, Role::line | Role::dashed | Role::points | Role::curve)
        };
        let columns = self.table.columns.iter().enumerate();
        columns.filter(|(_, column)| is_drawn(column)).map(|(i, _)| i).collect()
    }

    /// Whether there is something to draw, and over what.
    fn is_drawn(&self) -> bool {
        self.table.columns.iter().any(|column| column.role == self.over) && !self.drawn().is_empty()
    }

    /// The panel of one value of the panel columns.
    fn panel(&self, title: &str, value: &str) -> Panel {
        let (_, heading, panel) = self.named;
        let (heading, of) = (heading.to_owned(), in_words(value));
        let words: Vec<String> = [heading, of].into_iter().filter(|word| !word.is_empty()).collect();
        let title = match (words.as_slice(), self.named.0) {
            ([], "") => title.to_owned(),
            (words, _) => words.join(", "),
        };
        let mut panel = panel(title, self.named(self.over));
        if self.over == Role::ladder {
            panel.x = std::mem::replace(&mut panel.y, Axis::ladder(&self.places));
        } else if !self.places.is_empty() {
            panel.x = Axis::categories(panel.x.label, &self.places);
        }
        self.draw(&mut panel, value);
        panel
    }

    /// Draws the rows of one value of the panel columns over what a panel has, in other colours.
    fn draw(&self, panel: &mut Panel, value: &str) {
        let rows = self.table.rows.iter();
        let rows: Vec<_> = rows.filter(|row| self.value(Role::panel, row) == *value).collect();
        let colours = panel.layers.iter().filter_map(|layer| layer.colour);
        let first = colours.max().map_or(0, |last| last + 1);
        let layers = self.layers(&rows).into_iter();
        panel.layers.extend(layers.map(|layer| {
            let own = first + layer.colour.unwrap_or(0);
            layer.coloured(own)
        }));
    }

    /// The columns of this role and a row's cells in them.
    fn cells<'r>(&'r self, role: Role, row: &'r [Value]) -> impl Iterator<Item = (&'r Column, &'r Value)> {
        self.table
            .columns
            .iter()
            .zip(row)
            .filter(move |(column, _)| column.role == role)
    }

    /// What the columns of this role say of a row, in words: each `{}` of a name is a value.
    fn value(&self, role: Role, row: &[Value]) -> String {
        let mut cells = self.cells(role, row);
        let mut words = Vec::new();
        while let Some((column, cell)) = cells.next() {
            let label = match (role, column.label.as_str()) {
                (Role::x, _) | (_, "") => "{}",
                (_, label) => label,
            };
            let mut word = label.replacen("{}", &cell.to_string(), 1);
            while word.contains("{}")
                && let Some((_, cell)) = cells.next()
            {
                word = word.replacen("{}", &cell.to_string(), 1);
            }
            words.push(word);
        }
        words.join(", ")
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
        let (columns, drawn) = (&self.table.columns, self.drawn());
        let keys = crate::sweep::distinct(rows, |row| self.value(Role::key, row));
        // The line `Kalman, exact` and the marks `Kalman, simulated` have one colour.
        let mut kinds: Vec<(String, Vec<Role>)> = Vec::new();
        let colours = drawn.iter().map(|i| {
            let kind = name(&columns[*i]).split(',').next().unwrap_or_default().to_owned();
            let role = columns[*i].role;
            let place = kinds
                .iter()
                .position(|(known, roles)| *known == kind && !roles.contains(&role));
            let place = place.unwrap_or(kinds.len());
            if place == kinds.len() {
                kinds.push((kind, Vec::new()));
            }
            kinds[place].1.push(role);
            place
        });
        let colours: Vec<usize> = colours.collect();
        let mut layers = Vec::new();
        for (place, key) in keys.iter().enumerate() {
            let own: Vec<&[Value]> = rows
                .iter()
                .filter(|row| self.value(Role::key, row) == *key)
                .map(|row| &row[..])
                .collect();
            for (&i, &kind) in drawn.iter().zip(&colours) {
                let label = match (key.as_str(), drawn.len()) {
                    ("", _) => name(&columns[i]),
                    (key, 1) => key.to_owned(),
                    (key, _) => format!("{}, {key}", name(&columns[i])),
                };
                let colour = if keys.len() > 1 { place } else { kind };
                let drawn = self.layer(label, i, &own);
                layers.extend(drawn.into_iter().map(|layer| layer.coloured(colour)));
            }
        }
        layers
    }

    /// The column `i` of rows as layers; none where it has no value.
    fn layer(&self, label: String, i: usize, rows: &[&[Value]]) -> Vec<Layer> {
        let (columns, lies) = (&self.table.columns, self.over == Role::ladder);
        let mark = |row: &&[Value]| {
            let cell = self.table.measured(row, i)?;
            let (place, value) = (self.place(row)?, cell.value);
            let at = if lies { (value, -place) } else { (place, value) };
            Some((at, cell.error()))
        };
        let (points, errors): (Vec<_>, Vec<_>) = rows.iter().filter_map(mark).unzip();
        let layers = match columns[i].role {
            Role::line => vec![Layer::line(label, points)],
            Role::dashed => vec![Layer::dashed(label, points)],
            Role::curve => vec![
                Layer::line("", points.clone()),
                Layer::points(label, points).with_errors(errors),
            ],
            _ if lies => vec![Layer::points(label, points).with_errors(errors).lying()],
            _ => vec![Layer::points(label, points).with_errors(errors)],
        };
        layers.into_iter().filter(|layer| !layer.is_empty()).collect()
    }

    fn place(&self, row: &[Value]) -> Option<f64> {
        if self.places.is_empty() {
            return self.cells(self.over, row).next()?.1.number();
        }
        let own = self.value(self.over, row);
        let place = self.places.iter().position(|place| *place == own);
        place.map(|place| place as f64)
    }
}

/// The label, or the meaning without its full stop and with the unit.
fn name(column: &Column) -> String {
    let meaning = column.meaning.trim_end_matches('.');
    match (column.label.as_str(), column.unit) {
        ("", "") => meaning.to_owned(),
        ("", unit) => format!("{meaning} / {unit}"),
        (label, _) => label.to_owned(),
    }
}

#[cfg(test)]
mod tests;
