//! Constant offsets of sensors.

use super::{Instant, wrapped};

/// The median; of an even number the middle of the two in the middle. 0 without numbers.
pub fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    match (numbers.len(), numbers.len() / 2) {
        (0, _) => 0.0,
        (count, half) if count % 2 == 0 => 0.5 * (numbers[half - 1] + numbers[half]),
        (_, half) => numbers[half],
    }
}

/// Rounds of the search for offsets.
const ALIGNMENTS: usize = 20;
/// Values that are farther from the mean than this many of their median distances are left out.
const FARTHEST: f64 = 6.0;

/// The constant offset of each sensor among `sensors`, from the instants at which several measured. Their median is zero: nothing says what
/// all have in common. A wild value does not move them. A sensor that never measured together with others has offset zero.
pub fn offsets(instants: &[Instant], sensors: usize, period: Option<f64>) -> Vec<f64> {
    let mut found = vec![0.0; sensors];
    for round in 0..ALIGNMENTS {
        let mut differences = vec![Vec::new(); sensors];
        for instant in instants.iter().filter(|instant| instant.values.len() > 1) {
            let known: Vec<(usize, f64)> = instant
                .values
                .iter()
                .filter_map(|(sensor, reading)| Some((*sensor, reading.value()?)))
                .filter(|(sensor, value)| *sensor < sensors && value.is_finite())
                .collect();
            let Some(&(_, origin)) = known.first() else { continue };
            let aligned = |(sensor, value): &(usize, f64)| wrapped(value - origin, period) - found[*sensor];
            let middle = median(known.iter().map(aligned).collect());
            known
                .iter()
                .for_each(|one| differences[one.0].push(wrapped(aligned(one) - middle, period)));
        }
        let shift = |differences: &Vec<f64>| {
            let middle = median(differences.clone());
            let width = FARTHEST * median(differences.iter().map(|one| (one - middle).abs()).collect());
            let near = || differences.iter().filter(|one| (**one - middle).abs() <= width);
            near().sum::<f64>() / (near().count() as f64).max(1.0)
        };
        let shifts: Vec<f64> = differences.iter().map(shift).collect();
        found
            .iter_mut()
            .zip(&shifts)
            .for_each(|(offset, shift)| *offset += shift);
        let common = median(
            found
                .iter()
                .zip(&differences)
                .filter(|(_, own)| !own.is_empty())
                .map(|(one, _)| *one)
                .collect(),
        );
        let with_others = differences.iter().map(|own| !own.is_empty());
        found
            .iter_mut()
            .zip(with_others)
            .for_each(|(offset, moves)| *offset = if moves { *offset - common } else { 0.0 });
        let largest = shifts.iter().fold(0.0_f64, |most, shift| most.max(shift.abs()));
        let size = found.iter().fold(0.0_f64, |most, offset| most.max(offset.abs()));
        if round > 0 && largest <= 1e-6 * size {
            break;
        }
    }
    found
}
