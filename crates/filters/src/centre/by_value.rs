//! The residual of a sensor that sends values, or cells in which they lie, under a law of several components.

use super::Member;
use super::health::Residual;
use super::one_wrong::log_sum;
use super::reading::Reading;
use super::remote::ReportTest;
use fewbits_core::Gaussian;
use fewbits_numerics::normal::{cdf, log_interval, quantile};

/// Smallest probability of a tail whose residual is still told from others.
const TAIL: f64 = 1e-300;

impl<const D: usize> Member<D> {
    /// The residual of a report of a sensor that sends values. `beliefs`: the components of the law, with their weights and what each
    /// measures; `logs` and `after`: `ln p` of the report, and the mean of what is measured after it.
    pub(super) fn residual_of_report(
        &self,
        reading: &Reading<'_, D>,
        beliefs: &[Gaussian<D>],
        weights: &[f64],
        measured: &[f64],
        (logs, after): (&[f64], &[f64]),
    ) -> Option<Residual> {
        let tests = beliefs.iter().map(|belief| self.sensor.test_of(reading.slot, belief));
        let tests: Vec<ReportTest> = tests.collect::<Option<_>>()?;
        let Some(ReportTest::Cell(width)) = tests.first() else {
            let variance = |test: &ReportTest| match test {
                ReportTest::Value(variance) => Some(*variance),
                ReportTest::Cell(_) => None,
            };
            let variances: Vec<f64> = tests.iter().map(variance).collect::<Option<_>>()?;
            return self.residual_of_value(&variances, weights, measured, logs);
        };
        let variances = beliefs.iter().map(|belief| self.sensor.value_variance(belief));
        let variances: Vec<f64> = variances.collect::<Option<_>>()?;
        let likeliest = likeliest_cell(*width, &variances, weights, measured);
        let joint: Vec<f64> = weights
            .iter()
            .zip(logs)
            .map(|(weight, log)| weight.ln() + log)
            .collect();
        let total = log_sum(joint.iter().copied());
        let own = total - self.arrival.ln() + if width.is_finite() { width.ln() } else { 0.0 };
        let mean = |of: &[f64], share: &dyn Fn(usize) -> f64| (0..of.len()).map(|i| share(i) * of[i]).sum::<f64>();
        let correction = mean(after, &|i| (joint[i] - total).exp()) - mean(measured, &|i| weights[i]);
        Residual::of_cell(own - likeliest, correction)
    }

    /// The residual of a value by its probability integral: `P(value <= received)` is uniform if the law is right.
    fn residual_of_value(
        &self,
        variances: &[f64],
        weights: &[f64],
        measured: &[f64],
        logs: &[f64],
    ) -> Option<Residual> {
        let arrival = self.arrival.ln();
        let distance = |i: usize| {
            let nis = -2.0 * (logs[i] - arrival) - (std::f64::consts::TAU * variances[i]).ln();
            (nis.max(0.0) * variances[i]).sqrt()
        };
        // The value is this far above or below what one point expects; a second point tells which.
        let near = (0..logs.len()).max_by(|i, j| logs[*i].total_cmp(&logs[*j]))?;
        let far = (0..logs.len()).max_by(|i, j| {
            let off = |i: &usize| (measured[*i] - measured[near]).abs() / variances[*i].sqrt();
            off(i).total_cmp(&off(j))
        })?;
        let misfit = |value: f64| ((value - measured[far]).abs() - distance(far)).abs();
        let (above, below) = (measured[near] + distance(near), measured[near] - distance(near));
        let value = if misfit(above) <= misfit(below) { above } else { below };
        let (mut lower, mut upper) = (0.0, 0.0);
        for ((weight, mean), variance) in weights.iter().zip(measured).zip(variances) {
            let standard = (value - mean) / variance.sqrt();
            lower += weight * cdf(standard);
            upper += weight * cdf(-standard);
        }
        Residual::of_normal(if lower < upper {
            quantile(lower.max(TAIL))
        } else {
            -quantile(upper.max(TAIL))
        })
    }
}

/// `ln p` of the likeliest cell of a width, about the mean or the heaviest component; 0 of a half-line.
fn likeliest_cell(width: f64, variances: &[f64], weights: &[f64], measured: &[f64]) -> f64 {
    if !width.is_finite() {
        return 0.0;
    }
    let mean = weights.iter().zip(measured).map(|(weight, h)| weight * h).sum::<f64>();
    let heaviest = (0..weights.len()).max_by(|i, j| weights[*i].total_cmp(&weights[*j]));
    let about = |centre: f64| {
        let all = weights.iter().zip(measured).zip(variances);
        let terms = all.map(|((weight, h), variance)| {
            let (lower, upper) = (centre - 0.5 * width - h, centre + 0.5 * width - h);
            weight.ln() + log_interval(lower / variance.sqrt(), upper / variance.sqrt())
        });
        log_sum(terms.collect::<Vec<_>>().into_iter())
    };
    about(mean).max(heaviest.map_or(f64::NEG_INFINITY, |i| about(measured[i])))
}
