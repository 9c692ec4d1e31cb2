//! The smoothed density of a sample: a normal density at each value.

use crate::error::{Error, refuse};
use fewbits_numerics::error::all_finite;
use fewbits_numerics::normal;

/// Smallest number of values of a sample.
const MIN_SAMPLE: usize = 5;

/// Errors of a prior that was estimated from a sample: by smoothing, and because the sample is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFit {
    /// Standard deviation of the normal density at each value, in the unit of the sample.
    pub bandwidth: f64,
    /// Largest difference between the distribution functions of the smoothed density and of the sample.
    pub smoothing_error: f64,
    /// With probability 95 % the distribution function of the source differs from the sample's by no more than this
    /// (Kolmogorov). It is the error from the finite size of the sample.
    pub sampling_error: f64,
    /// Standard error of the mean, in the unit of the sample.
    pub mean_standard_error: f64,
    /// Standard error of the standard deviation, in the unit of the sample.
    pub deviation_standard_error: f64,
}

/// Centres of the normal densities: moved towards the mean so that the smoothed density has the sample's variance.
pub(super) fn drawn_together(
    values: &[f64],
    mean: f64,
    deviation: f64,
    bandwidth: f64,
) -> impl Iterator<Item = f64> + '_ {
    let shrink = (1.0 - (bandwidth / deviation).powi(2)).sqrt();
    values.iter().map(move |x| mean + shrink * (x - mean))
}

/// Sorts a sample; returns its fit with Silverman's bandwidth `0.9 min(s, IQR / 1.34) n^(-1/5)`, its mean and its standard deviation.
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
    // If half of the values are equal, the interquartile range is zero and is not used.
    let spread = if spread > 0.0 { spread.min(deviation) } else { deviation };
    let bandwidth = 0.9 * spread * n.powf(-0.2);
    let centres: Vec<f64> = drawn_together(values, mean, deviation, bandwidth).collect();
    let smooth = |y: f64| centres.iter().map(|c| normal::cdf((y - c) / bandwidth)).sum::<f64>() / n;
    // 200 points find the largest difference with an error well below the sampling error.
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
