//! Which columns of a table are sensors, and which qualify their values.

use super::accuracies::Accuracy;
use crate::error::Error;
use fewbits_table::Side;
use fewbits_tracking::Qualifier;

/// Places of the columns.
pub(super) struct OwnColumns {
    /// Those that are sensors.
    pub(super) sensors: Vec<usize>,
    /// Of each column, the place of that of its accuracies.
    accuracies: Vec<Option<usize>>,
    /// What each of them states.
    kinds: Vec<Accuracy>,
    threshold: Option<usize>,
    /// Number of accuracies that are 0 or below, and of those that are infinite.
    pub(super) strange: [u64; 2],
}

type Cells = [Option<f64>];

fn cell(cells: &Cells, place: Option<usize>) -> Option<f64> {
    cells.get(place?).copied().flatten()
}

impl OwnColumns {
    /// `threshold`, `accuracy`: columns for all sensors; `accuracy_of`: that of a sensor.
    pub(super) fn find<'a>(
        (names, file): (&[String], &str),
        threshold: Option<&String>,
        accuracy: Option<&String>,
        accuracy_of: impl Fn(&str) -> Option<&'a String>,
    ) -> Result<Self, Error> {
        let place = |name: Option<&String>| match name {
            None => Ok(None),
            Some(name) => match names.iter().position(|known| known == name) {
                Some(place) => Ok(Some(place)),
                None => {
                    let problem = format!("no column `{name}`: there are {}", names.join(", "));
                    Err(Error::content(file, problem))
                }
            },
        };
        let threshold = place(threshold)?;
        // Also if no column is left that it would qualify.
        place(accuracy)?;
        let of = |name: &String| place(accuracy_of(name));
        let accuracies: Vec<Option<usize>> = names.iter().map(of).collect::<Result<_, _>>()?;
        let kind = |(name, place): (&String, &Option<usize>)| {
            place.map_or(Accuracy::Deviation, |place| Accuracy::of(&names[place], name))
        };
        let kinds = names.iter().zip(&accuracies).map(kind).collect();
        let is_sensor = |i: &usize| Some(*i) != threshold && !accuracies.contains(&Some(*i));
        Ok(Self {
            sensors: (0..names.len()).filter(is_sensor).collect(),
            accuracies,
            kinds,
            threshold,
            strange: [0; 2],
        })
    }

    /// The standard deviation of the value at a place, as its row states it.
    fn accuracy(&self, place: usize, cells: &Cells) -> Option<f64> {
        let stated = cell(cells, self.accuracies[place])?;
        Some(self.kinds[place].deviation(stated, cell(cells, Some(place)).unwrap_or(0.0)))
    }

    /// What is made of columns of accuracies that are no deviations, a line each. `names`: of all columns.
    pub(super) fn hints(&self, names: &[String]) -> Vec<String> {
        let mut those: Vec<(usize, Accuracy)> = Vec::new();
        for place in &self.sensors {
            let own = self.accuracies[*place].map(|accuracy| (accuracy, self.kinds[*place]));
            those.extend(own.filter(|own| !those.contains(own)));
        }
        those
            .iter()
            .filter_map(|(place, kind)| kind.hint(&names[*place]))
            .collect()
    }

    /// What a row says of the value at a place. `limit`: the side on which it is, if it is a limit.
    pub(super) fn qualifier(&self, place: usize, cells: &Cells, limit: Option<Side>) -> Qualifier {
        Qualifier {
            accuracy: self.accuracy(place, cells).filter(|accuracy| accuracy.is_finite()),
            threshold: cell(cells, self.threshold).filter(|threshold| threshold.is_finite()),
            limit,
        }
    }

    /// The values of the sensors. What an infinite accuracy says is nothing. Zero and below are marks of devices that do not know theirs.
    pub(super) fn values(&mut self, cells: &Cells) -> Vec<(usize, Option<f64>)> {
        let accuracy = |place: &usize| cell(cells, self.accuracies[*place]);
        let (mut last, mut strange) = (None, self.strange);
        // Several sensors may have one column.
        for place in self
            .sensors
            .iter()
            .filter(|place| last.replace(self.accuracies[**place]) != Some(self.accuracies[**place]))
        {
            if let Some(accuracy) = accuracy(place).filter(|accuracy| *accuracy <= 0.0 || !accuracy.is_finite()) {
                strange[usize::from(accuracy > 0.0)] += 1;
            }
        }
        self.strange = strange;
        let is_void = |place: &usize| cell(cells, self.accuracies[*place]) == Some(f64::INFINITY);
        let value = |place: &usize| (*place, cell(cells, Some(*place)).filter(|_| !is_void(place)));
        self.sensors.iter().map(value).collect()
    }
}
