//! Groups of sensors that measure different levels: differences within a group are noise, those between groups wander.
//!
//! ```text
//! of a difference   means of 16 stretches of the rows vary by no more than its noise lets them: the same level, else another
//! groups            sensors that are joined by differences of the first kind
//! ```

use crate::first::values::values_of;
use crate::rows::instant::Instant;
use crate::text;
use crate::text::short;
use fewbits_filters::calibration::median;
use fewbits_table::names::as_argument;

/// Stretches, and the fewest rows that have values of all sensors.
const STRETCHES: usize = 16;
const FEWEST: usize = 160;
/// More sensors are not compared.
const MOST: usize = 32;
/// Variance of the means of stretches, in that which independent noise makes: 1 on average, and above this hardly ever.
const WANDERS: f64 = 6.0;
/// Differences count at most so many deviations.
const CLIP: f64 = 4.0;

/// The sensors that have a value in any row.
pub(crate) fn present(rows: &[Instant], sensors: usize) -> Vec<usize> {
    let mut has = vec![false; sensors];
    for (sensor, cell) in rows.iter().flat_map(|row| &row.reports) {
        has[*sensor] |= cell.is_some_and(f64::is_finite);
    }
    (0..sensors).filter(|sensor| has[*sensor]).collect()
}

/// The rows that have a finite value of each of these sensors.
pub(crate) fn whole(rows: &[Instant], present: &[usize]) -> Vec<Instant> {
    let is_whole = |row: &&Instant| {
        let finite = row.reports.iter().filter(|(_, cell)| cell.is_some_and(f64::is_finite));
        finite.count() == present.len()
    };
    rows.iter().filter(is_whole).cloned().collect()
}

/// Numbers about their median, cut where they are wild.
pub(crate) fn centred(numbers: &[f64]) -> Vec<f64> {
    let middle = median(numbers.to_vec());
    let size = 1.4826 * median(numbers.iter().map(|number| (number - middle).abs()).collect());
    let cut = |number: &f64| (number - middle).clamp(-CLIP * size, CLIP * size);
    numbers.iter().map(cut).collect()
}

fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len() as f64
}

fn variance(numbers: &[f64]) -> f64 {
    let mean = mean(numbers);
    numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / (numbers.len() as f64 - 1.0)
}

fn wanders(difference: &[f64]) -> bool {
    let length = difference.len() / STRETCHES;
    let cut = centred(difference);
    let stretches = || cut.chunks_exact(length);
    let means: Vec<f64> = stretches().map(mean).collect();
    let within = stretches().map(variance).sum::<f64>() / STRETCHES as f64;
    variance(&means) > WANDERS * within / length as f64
}

/// A line if there are groups of two and more.
pub(crate) fn groups(rows: &[Instant], names: &[String]) -> Option<String> {
    let present = present(rows, names.len());
    let (sensors, whole) = (present.len(), whole(rows, &present));
    if !(3..=MOST).contains(&sensors) || whole.len() < FEWEST {
        return None;
    }
    let columns: Vec<Vec<f64>> = present.iter().map(|sensor| values_of(&whole, *sensor)).collect();
    let difference = |one: usize, other: usize| -> Vec<f64> {
        let pairs = columns[one].iter().zip(&columns[other]);
        pairs.map(|(one, other)| one - other).collect()
    };
    let mut group: Vec<usize> = (0..sensors).collect();
    for one in 0..sensors {
        for other in 0..one {
            if group[one] != group[other] && !wanders(&difference(one, other)) {
                let (from, to) = (group[one], group[other]);
                group
                    .iter_mut()
                    .filter(|group| **group == from)
                    .for_each(|group| *group = to);
            }
        }
    }
    let members = |number: usize| -> Vec<usize> { (0..sensors).filter(|sensor| group[*sensor] == number).collect() };
    let found: Vec<Vec<usize>> = (0..sensors).map(members).filter(|members| members.len() > 1).collect();
    let [first, second, ..] = found.as_slice() else {
        return None;
    };
    let apart = difference(second[0], first[0]);
    let (begin, end) = apart.split_at(apart.len() / 2);
    let listed = |members: &Vec<usize>| {
        let all: Vec<String> = members
            .iter()
            .map(|sensor| text::name(&names[present[*sensor]]).into_owned())
            .collect();
        all.join(", ")
    };
    let groups: Vec<String> = found.iter().map(listed).collect();
    Some(format!(
        "{} agree with each other, but not with the other group: {} is above {} by {} in the first half of the rows and by {} in the second; they measure \
         different levels, and the estimate is of neither: choose one group, as --columns {}",
        groups.join(" agree with each other, and so do "),
        text::name(&names[present[second[0]]]),
        text::name(&names[present[first[0]]]),
        short(median(begin.to_vec())),
        short(median(end.to_vec())),
        as_argument(
            first
                .iter()
                .map(|sensor| names[present[*sensor]].as_str())
                .collect::<Vec<_>>()
        )
    ))
}
