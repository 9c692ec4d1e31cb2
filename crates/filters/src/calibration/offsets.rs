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

/// Pairs of neighbouring stretches of the instants. Of each pair a half sample has one stretch.
const PAIRS: usize = 8;
/// Half samples: rows of a Hadamard matrix, so that each pair of stretches is halved as often one way as the other, whatever happens to another pair.
const HALVES: usize = 16;

/// Standard deviation of what errors of the [`offsets`] shift a level, of which each sensor tells a share in proportion to its weight (one over the
/// variance of its noise): found from balanced half samples of the instants (McCarthy 1969), since a jackknife is wrong for medians. It is the same in
/// all rows, so it belongs to the band of each. 0 of one sensor.
pub fn shift_deviation(instants: &[Instant], weights: &[f64], period: Option<f64>) -> f64 {
    let sum: f64 = weights.iter().sum();
    if instants.len() < 2 * PAIRS || weights.len() < 2 || sum <= 0.0 || !sum.is_finite() {
        return 0.0;
    }
    let shift = |instants: &[Instant]| {
        let found = offsets(instants, weights.len(), period);
        let shares = found.iter().zip(weights).map(|(offset, weight)| offset * weight / sum);
        shares.sum::<f64>()
    };
    let stretch = |number: usize| {
        let [begin, end] = [number, number + 1].map(|edge| edge * instants.len() / (2 * PAIRS));
        &instants[begin..end]
    };
    let half = |row: usize| {
        let chosen = |pair: usize| stretch(2 * pair + (row & (pair + 1)).count_ones() as usize % 2);
        (0..PAIRS).map(chosen).collect::<Vec<_>>().concat()
    };
    let all = shift(instants);
    let squares = (0..HALVES).map(|row| (shift(&half(row)) - all).powi(2));
    (squares.sum::<f64>() / HALVES as f64).sqrt()
}

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
