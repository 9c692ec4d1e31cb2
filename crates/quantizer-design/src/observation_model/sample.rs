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

/// Values at which bandwidths are compared, at most.
const COMPARED: usize = 300;
/// A narrower bandwidth must be likelier than Silverman's by so many nats.
const DECISIVE: f64 = 10.0;
/// Share of a wide normal density in the comparison, so that one value far from all others does not decide it.
const WIDE_SHARE: f64 = 0.01;
/// Half-octaves of narrower bandwidths that are tried.
const NARROWER: i32 = 14;

/// Silverman's bandwidth `widest`, or a narrower one of half-octaves below it under which the values are decisively likelier, each under the density
/// of the others. Silverman's rule smooths a density of several peaks far too much.
///
/// Equal values are left out together, so that a sample of rounded values is not taken for points.
fn bandwidth(sorted: &[f64], mean: f64, deviation: f64, widest: f64) -> f64 {
    let n = sorted.len();
    let chosen: Vec<f64> = sorted.iter().copied().step_by(n.div_ceil(COMPARED)).collect();
    let log_likelihood = |width: f64| -> f64 {
        let log = |x: &f64| {
            let range =
                sorted.partition_point(|y| *y < x - 6.0 * width)..sorted.partition_point(|y| *y <= x + 6.0 * width);
            let others = sorted[range].iter().filter(|y| *y != x);
            let near = others.map(|y| normal::pdf((x - y) / width)).sum::<f64>() / (n as f64 * width);
            ((1.0 - WIDE_SHARE) * near + WIDE_SHARE * normal::pdf((x - mean) / deviation) / deviation).ln()
        };
        chosen.iter().map(log).sum::<f64>() * (n as f64 / chosen.len() as f64)
    };
    let first = (widest, log_likelihood(widest));
    let narrower = (1..=NARROWER).map(|k| widest * 0.5_f64.powf(0.5 * f64::from(k)));
    let tried = narrower.map(|width| (width, log_likelihood(width)));
    let best = tried.fold(first, |best, next| if next.1 > best.1 { next } else { best });
    if best.1 > first.1 + DECISIVE { best.0 } else { widest }
}

/// Sorts a sample; returns its fit with Silverman's bandwidth `0.9 min(s, IQR / 1.34) n^(-1/5)` or a decisively likelier one, its mean and its
/// standard deviation.
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
    let bandwidth = bandwidth(values, mean, deviation, 0.9 * spread * n.powf(-0.2));
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

#[cfg(test)]
mod tests {
    use super::fitted;
    use fewbits_numerics::normal::quantile;

    /// Defect: two peaks at -3 and 3 of deviation .3 were smoothed by .8 deviations of all values; a design stated 6.6 times the error that it has.
    #[test]
    fn peaks_are_not_smoothed_away() {
        let normal = |i: usize| quantile((f64::from(i as u32) + 0.5) / 250.0);
        let mut peaks: Vec<f64> = (0..500)
            .map(|i| 0.3 * normal(i / 2) + if i % 2 == 0 { -3.0 } else { 3.0 })
            .collect();
        let (fit, ..) = fitted(&mut peaks).unwrap();
        assert!(fit.bandwidth < 0.15 && fit.smoothing_error < 0.02, "{fit:?}");
        // One peak keeps Silverman's rule, rounded or not, and with a value far away.
        let silverman = |values: &[f64]| {
            let (mut values, n) = (values.to_vec(), values.len() as f64);
            let (fit, _, deviation) = fitted(&mut values).unwrap();
            let quartile = |share: f64| values[((n - 1.0) * share).round() as usize];
            let spread = ((quartile(0.75) - quartile(0.25)) / 1.34).min(deviation);
            assert_eq!(fit.bandwidth, 0.9 * spread * n.powf(-0.2));
        };
        let one: Vec<f64> = (0..250).map(normal).collect();
        silverman(&one);
        silverman(&one.iter().map(|x| (5.0 * x).round() / 5.0).collect::<Vec<f64>>());
        silverman(&[one.as_slice(), &[40.0]].concat());
    }
}
