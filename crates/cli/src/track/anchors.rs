//! The table of anchors of `ranges`.

use crate::arguments::TableOptions;
use crate::error::Error;
use crate::input::Table;
use fewbits_record::TimeBase;
use nalgebra::Vector3;

/// Name and place of an anchor.
pub(super) type Anchor = (String, Vector3<f64>);

/// Names of coordinates: alone, or before a unit.
const COORDINATES: [&[&str]; 3] = [
    &["x", "east", "easting"],
    &["y", "north", "northing"],
    &["z", "up", "height", "altitude"],
];
/// Names of columns of degrees.
const DEGREES: [&str; 6] = ["lat", "latitude", "lon", "long", "lng", "longitude"];
/// Names of the column of names.
const NAMES: [&str; 9] = [
    "anchor", "name", "id", "node", "beacon", "sensor", "station", "tag", "label",
];

/// The first word of a name, in small letters: `x` of `X [m]`.
fn word(name: &str) -> String {
    let name = name.trim().to_lowercase();
    name.chars().take_while(|letter| letter.is_alphabetic()).collect()
}

/// The columns of name, x, y and perhaps z: those that are called so, or else the first and the two or three after it.
fn columns(file: &str, names: &[String]) -> Result<(usize, Vec<usize>), Error> {
    let words: Vec<String> = names.iter().map(|name| word(name)).collect();
    let places = COORDINATES.map(|known| words.iter().position(|word| known.contains(&word.as_str())));
    if let [Some(x), Some(y), z] = places {
        let axes: Vec<usize> = [x, y].into_iter().chain(z).collect();
        let rest = || (0..names.len()).filter(|i| !axes.contains(i));
        let label = rest()
            .find(|i| NAMES.contains(&words[*i].as_str()))
            .or_else(|| rest().next());
        return match label {
            Some(label) => Ok((label, axes)),
            None => Err(Error::content(file, "no column has the names of the anchors")),
        };
    }
    if let Some(degrees) = words.iter().position(|word| DEGREES.contains(&word.as_str())) {
        let problem =
            format!("column {}: places in the unit of the ranges are expected, and no degrees", names[degrees]);
        return Err(Error::content(file, problem));
    }
    if !(3..=4).contains(&names.len()) {
        let problem = format!("columns {}: three or four are expected, name, x, y and perhaps z", names.join(", "));
        return Err(Error::content(file, problem));
    }
    Ok((0, (1..names.len()).collect()))
}

/// Reads names and places. A table without a line of names is read as name, x, y and perhaps z.
pub(super) fn read_anchors(file: &str) -> Result<Vec<Anchor>, Error> {
    let options = |columns: Vec<String>, no_header: bool| {
        let mut options = TableOptions {
            file: file.to_owned(),
            columns,
            ..TableOptions::default()
        };
        options.dialect.no_header = no_header;
        options
    };
    let (names, has_none) = match Table::open(&options(Vec::new(), false)) {
        Ok(table) => (table.names, false),
        Err(error) => match Table::open(&options(Vec::new(), true)) {
            Ok(table) if (3..=4).contains(&table.names.len()) => (table.names, true),
            _ => return Err(error),
        },
    };
    let (label, axes) = columns(file, &names)?;
    let places: Vec<String> = axes.iter().map(|i| names[*i].clone()).collect();
    let mut table = Table::open(&options(places.clone(), has_none))?.with_labels(&names[label])?;
    table.require_numbers(|_| true)?;
    // Columns come in the order of the table.
    let order: Vec<usize> = places
        .iter()
        .filter_map(|name| table.names.iter().position(|other| other == name))
        .collect();
    let mut anchors: Vec<Anchor> = Vec::new();
    while let Some((_, cells)) = table.next(TimeBase::Numbered)? {
        let at = |axis: usize| order.get(axis).and_then(|i| cells.get(*i).copied().flatten());
        let place: Vec<f64> = (0..places.len()).filter_map(at).filter(|x| x.is_finite()).collect();
        let (is_whole, of) = (place.len() == places.len(), |axis: usize| place.get(axis).copied().unwrap_or(0.0));
        let place = Vector3::new(of(0), of(1), of(2));
        let (label, row) = (table.label().to_owned(), table.row());
        let problem = if anchors.iter().any(|(known, _)| *known == label) {
            format!("anchor `{label}` stands here twice")
        } else if is_whole {
            anchors.push((label, place));
            continue;
        } else {
            format!("anchor `{label}` has no place: write {}", places.join(", "))
        };
        return Err(Error::content(file, format_args!("row {row}: {problem}")));
    }
    Ok(anchors)
}
