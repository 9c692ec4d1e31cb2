//! The step to which a sensor rounds its values.

/// A sensor is taken to round if its noise with rounding is at most this many steps.
const COARSE: f64 = 0.75;
/// Values from which a step is found, at least, and changes from one to the next among them.
const FEWEST: usize = 50;
const FEWEST_CHANGES: usize = 4;
/// Decimals at most, behind the zeros of numbers far below one.
const MAX_DECIMALS: i32 = 9;
/// Share of the changes that are multiples of the step.
const MULTIPLES: f64 = 0.9;
/// Standard deviation of rounding to a step, in steps.
pub(crate) const DEVIATION: f64 = 0.288_675_134_594_812_9;

/// The step to which values are rounded, if there is one: not finer than their decimals. Values that hardly ever change may all be multiples of
/// a larger step by chance: theirs is that of their decimals.
pub(crate) fn step(values: &[f64]) -> Option<f64> {
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    // Of a unit that is far above all values each would be a multiple.
    let first = (-largest.log10().ceil()).clamp(0.0, 290.0) as i32;
    let mut units = (first..=first + MAX_DECIMALS).map(|decimals| 1.0 / 10_f64.powi(decimals));
    let decimals = units.find(|unit| {
        let off = |value: &f64| (value / unit - (value / unit).round()).abs();
        values.iter().all(|value| off(value) < 1e-6)
    });
    let step = fewbits_adaptive::own_steps(values).into_iter().reduce(f64::min)?;
    let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let is_known = changes >= FEWEST_CHANGES;
    // Values far from each other, as those that a sensor sends on change, are no multiples of their smallest difference.
    let slack = decimals.unwrap_or(1e-6 * step);
    let is_multiple = |pair: &&[f64]| {
        let apart = (pair[1] - pair[0]).abs();
        let count = (apart / step).round();
        (apart - count * step).abs() <= slack * (1.0 + count)
    };
    let pairs = values.windows(2);
    let is_lattice = pairs.clone().filter(is_multiple).count() as f64 >= MULTIPLES * pairs.len() as f64;
    match decimals {
        Some(unit) if is_known && is_lattice => Some(unit.max(step)),
        Some(unit) => Some(unit.min(step)),
        // A few values that never repeat have a smallest difference, and no step.
        None => (is_lattice && (is_known || changes + 1 < values.len())).then_some(step),
    }
}

/// The same if it is so coarse that a value is better taken as a cell than as a number with noise. `noise`: the standard deviation of that, rounding
/// included.
pub(crate) fn coarse_step(values: &[f64], noise: f64) -> Option<f64> {
    let step = step(values)?;
    (values.len() >= FEWEST && noise <= COARSE * step).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Defect: the smallest change of values that are sent on change, far above their rounding, was taken for a step of rounding.
    #[test]
    fn values_far_from_each_other_have_the_step_of_their_decimals() {
        let mut fraction = 0.3_f64;
        for decimals in [1e-2, 1e-3] {
            let mut value = 0.0;
            let sent = (0..20).map(|_| {
                fraction = (fraction * 997.0 + 0.137).fract();
                value += if fraction > 0.5 { 0.5 } else { -0.5 } + 0.2 * (fraction - 0.5);
                (value / decimals).round() * decimals
            });
            let sent: Vec<f64> = sent.collect();
            assert!(step(&sent).is_some_and(|step| step < 1.1 * decimals), "{decimals}: {:?}", step(&sent));
        }
        // Halves that are shown with one decimal stay halves.
        let halves: Vec<f64> = (0..60)
            .map(|k| (8.0 * (f64::from(k) * 0.37).sin()).round() / 2.0)
            .collect();
        assert!(step(&halves).is_some_and(|step| (step - 0.5).abs() < 1e-9), "{:?}", step(&halves));
    }

    /// Defect: the same of values with all their digits: beside `--silent-within`, a noise of .125 was supposed for .0005, and the change that was
    /// found was too small.
    #[test]
    fn values_with_all_digits_that_never_repeat_have_no_step() {
        let mut value = 15.0_f64;
        let sent = (0..40).map(|k| {
            value += 0.4 * (1.0 + 0.1 * f64::from(k * k).sin().abs());
            value
        });
        let sent: Vec<f64> = sent.collect();
        assert_eq!((step(&sent), step(&sent[..3])), (None, None));
        // Codes of a converter keep their step, also where few of them were seen.
        let codes = |k: u32| 3.3 / 4096.0 * f64::from(1000 + k / 30);
        let seen: Vec<f64> = (0..90).map(codes).collect();
        assert!(step(&seen).is_some_and(|step| (step * 4096.0 / 3.3 - 1.0).abs() < 1e-6), "{:?}", step(&seen));
    }

    /// Defect: all numbers below a millionth were multiples of one, and rounded to that.
    #[test]
    fn steps_do_not_depend_on_the_unit() {
        let rounded: Vec<f64> = (0..200)
            .map(|k| (3000.0 + 40.0 * (f64::from(k) * 0.37).sin()).round())
            .collect();
        for digits in [-9, -3, 0, 2, 5, 9, 15, 30] {
            let scale = 10_f64.powi(-digits);
            let values: Vec<f64> = rounded.iter().map(|value| value * scale).collect();
            let found = step(&values).map(|step| (step / scale * 1e6).round());
            assert_eq!(found, Some(1e6), "{digits}");
            let noisy: Vec<f64> = values
                .iter()
                .enumerate()
                .map(|(k, value)| value * (1.0 + 1e-3 * (k as f64).cos()))
                .collect();
            assert_eq!(step(&noisy), None, "{digits}");
        }
    }

    #[test]
    fn a_step_is_found_where_it_is_coarser_than_the_noise() {
        let values: Vec<f64> = (0..200).map(|k| (f64::from(k) * 0.37).sin() * 4.0).collect();
        let rounded: Vec<f64> = values.iter().map(|value| (2.0 * value).round() / 2.0).collect();
        assert_eq!(coarse_step(&rounded, 0.2), Some(0.5));
        assert_eq!(coarse_step(&rounded, 2.0), None);
        assert_eq!(coarse_step(&rounded[..20], 0.2), None);
        assert_eq!(coarse_step(&values, 0.2), None);
    }
}
