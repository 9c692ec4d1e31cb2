//! The smooth density of a sample: bells at its values.

use crate::error::{Error, refuse};
use fewbits_numerics::error::all_finite;
use fewbits_numerics::normal;

/// Fewest values of a sample.
const MIN_SAMPLE: usize = 5;

/// Errors of a prior that was estimated from a sample: by smoothing, and because the sample is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFit {
    /// Standard deviation of the bell at each value, in the unit of the sample.
    pub bandwidth: f64,
    /// Largest difference of the distribution functions of the smooth density and of the sample: what smoothing changes.
    pub smoothing_error: f64,
    /// With a probability of 95 % no distribution function of the source differs from the sample's by more than this
    /// (Kolmogorov): what is not known because the sample is finite.
    pub sampling_error: f64,
    /// Standard error of the mean, in the unit of the sample.
    pub mean_standard_error: f64,
    /// Standard error of the standard deviation, in the unit of the sample.
    pub deviation_standard_error: f64,
}

/// Where the bells of a sample stand: so close to the mean that the density has the sample's variance.
pub(super) fn drawn_together(
    values: &[f64],
    mean: f64,
    deviation: f64,
    bandwidth: f64,
) -> impl Iterator<Item = f64> + '_ {
    let shrink = (1.0 - (bandwidth / deviation).powi(2)).sqrt();
    values.iter().map(move |x| mean + shrink * (x - mean))
}

/// Sorts a sample; its fit by bells of Silverman's width `0.9 min(s, IQR / 1.34) n^(-1/5)`, its mean and its standard deviation.
pub(super) fn fitted(values: &mut [f64]) -> Result<(SampleFit, f64, f64), Error> {
    all_finite("values", values)?;
    let count = values.len();
    if count < MIN_SAMPLE {
        return refuse("values", format!("{count} values"), format!("at least {MIN_SAMPLE} values"));
    }
    values.sort_by(f64::total_cmp);
    let n = count as f64;
    let mean = values[0] + values.iter().map(|x| x - values[0]).sum::<f64>() / n;
    let moment = |power: i32| values.iter().map(|x| (x - mean).powi(power)).sum::<f64>() / n;
    let variance = moment(2);
    if !(variance > 0.0 && variance.is_finite()) {
        return refuse("values", format!("a sample of variance {variance}"), "values that differ");
    }
    let deviation = variance.sqrt();
    let quartile = |share: f64| values[((n - 1.0) * share).round() as usize];
    let spread = (quartile(0.75) - quartile(0.25)) / 1.34;
    // Where half of the values are equal the quartiles say nothing.
    let spread = if spread > 0.0 { spread.min(deviation) } else { deviation };
    let bandwidth = 0.9 * spread * n.powf(-0.2);
    let centres: Vec<f64> = drawn_together(values, mean, deviation, bandwidth).collect();
    let smooth = |y: f64| centres.iter().map(|c| normal::cdf((y - c) / bandwidth)).sum::<f64>() / n;
    // 200 places find the largest difference to well below the sampling error.
    let smoothing_error = values.iter().step_by(count.div_ceil(200)).fold(0.0, |worst: f64, y| {
        let here = smooth(*y);
        let first = values.partition_point(|x| x < y) as f64;
        let last = values.partition_point(|x| x <= y) as f64;
        worst.max((here - first / n).abs()).max((here - last / n).abs())
    });
    let kurtosis = moment(4) / (variance * variance);
    let fit = SampleFit {
        bandwidth,
        smoothing_error,
        sampling_error: 1.358 / n.sqrt(),
        mean_standard_error: deviation / n.sqrt(),
        deviation_standard_error: deviation * ((kurtosis - 1.0).max(0.0) / (4.0 * n)).sqrt(),
    };
    Ok((fit, mean, deviation))
}
