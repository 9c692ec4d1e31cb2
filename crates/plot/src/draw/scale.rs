//! One coordinate type for linear, logarithmic and named axes.

use super::style::{TICK, wide};
use crate::{Axis, Scale};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// An axis with its limits settled.
#[derive(Debug, Clone)]
pub(super) struct Scaled {
    scale: Scale,
    low: f64,
    high: f64,
    names: Vec<(f64, String)>,
    /// Written in powers of ten whatever the limits.
    powers: bool,
}

impl Scaled {
    /// The axis over the data, with a margin, unless it fixes its own limits; `marks` do not lie on the other axis.
    pub(super) fn new(axis: &Axis, values: impl Iterator<Item = f64>, marks: bool) -> Self {
        let drawable = |v: &f64| v.is_finite() && (axis.scale == Scale::Linear || *v > 0.0);
        let (low, high) = axis.range.unwrap_or_else(|| {
            let (low, high) = values
                .chain(axis.names.iter().map(|(at, _)| *at))
                .filter(drawable)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            with_margin(axis.scale, low, high, marks)
        });
        Self {
            scale: axis.scale,
            low,
            high,
            names: axis.names.clone(),
            powers: false,
        }
    }

    /// Powers of ten if the other axis of the panel has them and this one shows nothing between its decades.
    pub(super) fn in_the_style_of(mut self, other: &Self) -> Self {
        let decades = self
            .ticks(9)
            .iter()
            .all(|tick| (tick.log10() - tick.log10().round()).abs() < 1e-9);
        self.powers = other.scale == Scale::Log && other.in_powers() && self.scale == Scale::Log && decades;
        self
    }

    /// From the lower to the upper limit.
    pub(super) fn span(&self) -> f64 {
        self.high - self.low
    }

    /// Whether a value can be placed on the axis at all.
    pub(super) fn accepts(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == Scale::Linear || value > 0.0)
    }

    /// Share of the way from the lower to the upper limit; beyond them outside `[0, 1]`.
    pub(super) fn position(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        }
    }

    /// Values of the small ticks of a logarithmic axis: 2 to 9 times each power of ten, if the powers stand far enough apart.
    pub(super) fn small_ticks(&self) -> Vec<f64> {
        const MOST_DECADES: f64 = 8.0;
        if self.scale == Scale::Linear || (self.high / self.low).log10() > MOST_DECADES {
            return Vec::new();
        }
        let exponents = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        exponents
            .flat_map(|exponent| (2..=9).map(move |digit| f64::from(digit) * 10_f64.powi(exponent)))
            .filter(|value| (self.low..=self.high).contains(value))
            .collect()
    }

    /// Whether the numbers of this axis are written as powers of ten: all of them, or none.
    fn in_powers(&self) -> bool {
        match self.scale {
            Scale::Log => self.powers || self.low < 1e-3 || self.high > 1e5,
            Scale::Linear => !(1e-3..=1e5).contains(&self.low.abs().max(self.high.abs())),
        }
    }

    pub(super) fn names(&self) -> &[(f64, String)] {
        &self.names
    }

    /// The largest number of ticks, at most seven, whose numbers stand apart along an axis of this length.
    pub(super) fn most_that_fit(&self, length: f64) -> usize {
        let fit = |most: &usize| {
            let half = |v: f64| 0.5 * wide(&self.format_ext(&v), TICK) + 14.0;
            let ends = |v: &f64| (length * self.position(*v) - half(*v), length * self.position(*v) + half(*v));
            let ticks: Vec<_> = self.ticks(*most).iter().map(ends).collect();
            ticks.windows(2).all(|pair| pair[0].1 <= pair[1].0)
        };
        (2..=7).rev().find(fit).unwrap_or(2)
    }

    pub(super) fn ticks(&self, most: usize) -> Vec<f64> {
        if !self.names.is_empty() {
            return self.names.iter().map(|(at, _)| *at).collect();
        }
        match self.scale {
            Scale::Linear => linear_ticks(self.low, self.high, most),
            Scale::Log => log_ticks(self.low, self.high, most),
        }
    }
}

fn with_margin(scale: Scale, low: f64, high: f64, marks: bool) -> (f64, f64) {
    if low > high {
        return if scale == Scale::Log { (0.1, 10.0) } else { (0.0, 1.0) };
    }
    match scale {
        Scale::Linear if low == high => (low - 0.5, high + 0.5),
        Scale::Linear => {
            let margin = 0.04 * (high - low);
            // Quantities that cannot be negative should not look as if they were.
            let clear = !marks || low >= margin;
            let low = if clear && low >= 0.0 && low < 0.3 * high {
                0.0
            } else {
                low - margin
            };
            (low, high + margin)
        }
        Scale::Log if low == high => (low / 2.0, high * 2.0),
        Scale::Log => {
            let margin = (high / low).powf(0.03);
            (low / margin, high * margin)
        }
    }
}

/// Multiples of 1, 2 or 5 times a power of ten, at most `most` of them.
fn linear_ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    let raw = (high - low) / most.max(2) as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|step| *step >= raw)
        .unwrap_or(raw);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Powers of ten, thinned if there are many, with 2 and 5 between them if there are few.
fn log_ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    let decades = (high / low).log10();
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let inside = |v: &f64| *v >= low * (1.0 - 1e-9) && *v <= high * (1.0 + 1e-9);
    if decades < 0.7 {
        return linear_ticks(low, high, most);
    }
    let within: &[f64] = if decades < 3.0 && most >= 6 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let every = (decades / most.max(2) as f64).ceil().max(1.0) as i32;
    (first..=last)
        .filter(|exponent| exponent.rem_euclid(every) == 0)
        .flat_map(|exponent| within.iter().map(move |m| m * 10_f64.powi(exponent)))
        .filter(inside)
        .collect()
}

impl Ranged for Scaled {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        // Far outside is as good as just outside, and does not overflow.
        let at = self.position(*value).clamp(-4.0, 5.0);
        limit.0 + (f64::from(limit.1 - limit.0) * at).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.max_num_points().min(9))
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Scaled {
    fn format_ext(&self, value: &f64) -> String {
        if let Some((_, name)) = self.names.iter().find(|(at, _)| at == value) {
            return name.clone();
        }
        if *value == 0.0 {
            return "0".to_owned();
        }
        if self.in_powers() {
            return power(*value);
        }
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

/// A number as digits times a power of ten: `2·10⁻⁴`.
fn power(value: f64) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let text = format!("{value:.1e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let raised = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    let exponent: String = exponent.chars().map(raised).collect();
    match mantissa.trim_end_matches(".0") {
        "1" => format!("10{exponent}"),
        "-1" => format!("-10{exponent}"),
        mantissa => format!("{mantissa}·10{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_raised() {
        assert_eq!([1e-4, 2.5e-4, -1e6, 3e12].map(power), ["10⁻⁴", "2.5·10⁻⁴", "-10⁶", "3·10¹²"]);
    }

    #[test]
    fn numbers_of_an_axis_share_a_style() {
        let wide = Scaled::new(&Axis::log("").between(1e-6, 10.0), std::iter::empty(), false);
        assert_eq!([1e-6, 0.1, 1.0].map(|v| wide.format_ext(&v)), ["10⁻⁶", "10⁻¹", "10⁰"]);
        let near = Scaled::new(&Axis::log("").between(0.01, 100.0), std::iter::empty(), false);
        assert_eq!([0.01, 1.0, 100.0].map(|v| near.format_ext(&v)), ["0.01", "1", "100"]);
        let as_wide = near.in_the_style_of(&wide);
        assert_eq!([0.01, 1.0, 100.0].map(|v| as_wide.format_ext(&v)), ["10⁻²", "10⁰", "10²"]);
        let large = Scaled::new(&Axis::linear("").between(0.0, 2e5), std::iter::empty(), false);
        assert_eq!([0.0, 5e4, 1e5].map(|v| large.format_ext(&v)), ["0", "5·10⁴", "10⁵"]);
    }

    #[test]
    fn small_ticks_divide_decades_of_logarithmic_axes_only() {
        let near = Scaled::new(&Axis::log("").between(0.5, 12.0), std::iter::empty(), false);
        let small = near.small_ticks();
        assert_eq!(small.len(), 13);
        assert!(small.contains(&9.0) && !small.contains(&10.0));
        let linear = Scaled::new(&Axis::linear("").between(0.5, 12.0), std::iter::empty(), false);
        assert!(linear.small_ticks().is_empty());
    }
}
