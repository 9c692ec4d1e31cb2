//! What a column of accuracies states, by its name: deviations, variances, halves of bands of 95 %, or percent of the value.

use super::columns::words;

/// Words of a variance, of half of a band of 95 %, and of percent.
const VARIANCES: [&str; 2] = ["variance", "var"];
const BANDS: [&str; 2] = ["ci95", "u95"];
const PERCENT: [&str; 2] = ["pct", "percent"];
/// Words of values that are percent themselves.
const SHARES: [&str; 4] = ["humidity", "hum", "rh", "soc"];
/// Standard deviations in half of a band of 95 %.
const HALF_BAND: f64 = 1.96;

/// What a number states about the error of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Accuracy {
    /// Its standard deviation.
    Deviation,
    /// Its variance.
    Variance,
    /// Half of a band of 95 %.
    HalfBand,
    /// Its standard deviation in percent of the value.
    Percent,
}

fn is_percent(name: &str) -> bool {
    name.contains('%') || words(name).iter().any(|word| PERCENT.contains(&word.as_str()))
}

impl Accuracy {
    /// What a column states about the values of another one.
    pub(super) fn of(name: &str, value: &str) -> Self {
        let has = |those: &[&str]| words(name).iter().any(|word| those.contains(&word.as_str()));
        let is_share = is_percent(value) || words(value).iter().any(|word| SHARES.contains(&word.as_str()));
        if has(&VARIANCES) {
            Self::Variance
        } else if has(&BANDS) {
            Self::HalfBand
        } else if is_percent(name) && !is_share {
            Self::Percent
        } else {
            Self::Deviation
        }
    }

    /// The standard deviation of the error of a value. Marks of 0 and below stay.
    pub(super) fn deviation(self, stated: f64, value: f64) -> f64 {
        match self {
            _ if stated <= 0.0 => stated,
            Self::Deviation => stated,
            Self::Variance => stated.sqrt(),
            Self::HalfBand => stated / HALF_BAND,
            Self::Percent => 0.01 * stated * value.abs(),
        }
    }

    /// What is made of the numbers of a column, if they are no deviations.
    pub(super) fn hint(self, name: &str) -> Option<String> {
        let what = match self {
            Self::Deviation => return None,
            Self::Variance => "variances: their roots are taken",
            Self::HalfBand => "halves of bands of 95 %: they are divided by 1.96",
            Self::Percent => "percent of the values",
        };
        Some(format!("{name} is taken for {what}, as its name says; a column of deviations needs another name"))
    }
}

#[cfg(test)]
mod tests {
    use super::Accuracy;

    #[test]
    fn names_say_what_is_stated() {
        let of = |name, value| Accuracy::of(name, value);
        assert_eq!(of("accuracy", "x"), Accuracy::Deviation);
        assert_eq!(of("x_std", "x"), Accuracy::Deviation);
        assert_eq!(of("Variance (m^2)", "x"), Accuracy::Variance);
        assert_eq!(of("x_ci95", "x"), Accuracy::HalfBand);
        assert_eq!(of("accuracy_pct", "flow"), Accuracy::Percent);
        assert_eq!(of("error %", "flow"), Accuracy::Percent);
        // Of percent, percent are deviations.
        assert_eq!(of("accuracy %", "RH"), Accuracy::Deviation);
        assert_eq!(of("error_pct", "load_pct"), Accuracy::Deviation);
    }

    #[test]
    fn deviations_are_those_of_the_value() {
        let close = |one: f64, other: f64| assert!((one - other).abs() < 1e-12, "{one} is not {other}");
        close(Accuracy::Variance.deviation(9.0, 5.0), 3.0);
        close(Accuracy::HalfBand.deviation(1.96, 5.0), 1.0);
        close(Accuracy::Percent.deviation(2.0, -50.0), 1.0);
        close(Accuracy::Deviation.deviation(0.3, 5.0), 0.3);
        // A mark of a device that does not know it.
        close(Accuracy::Variance.deviation(-1.0, 5.0), -1.0);
    }
}
