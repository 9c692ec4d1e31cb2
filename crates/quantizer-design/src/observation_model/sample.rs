//! The smoothed density of a sample: a normal density at each value.

use crate::error::{Error, refuse};
use fewbits_numerics::error::all_finite;
use fewbits_numerics::normal;

/// Smallest number of values of a sample.
const MIN_SAMPLE: usize = 5;
/// Factors of Silverman's bandwidth among which the likeliest is chosen. His rule is for one mode: of two modes that are far apart the best
/// bandwidth is about a quarter of it.
const FACTORS: [f64; 7] = [1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12];
/// Number of values whose density is compared, at most.
const MAX_COMPARED: usize = 500;
/// Normal densities farther than so many bandwidths do not count.
const REACH: f64 = 6.0;
/// Smallest density that is assumed of a value, as a share of the uniform one over the range: a value far from all others must not decide.
const LEAST_SHARE: f64 = 1e-9;

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

/// Sorted values of which equal ones are spread evenly over the smallest difference of two values, as they were before rounding. Otherwise the
/// narrowest bandwidth would explain them best.
fn without_ties(values: &[f64]) -> Vec<f64> {
    let differences = values.windows(2).map(|pair| pair[1] - pair[0]);
    let step = differences
        .filter(|difference| *difference > 0.0)
        .fold(f64::INFINITY, f64::min);
    let groups = values.chunk_by(|one, other| one == other);
    let spread = |group: &[f64]| {
        let (first, count) = (group[0], group.len());
        (0..count).map(move |k| first + step * ((k as f64 + 0.5) / count as f64 - 0.5))
    };
    groups.flat_map(spread).collect()
}

/// The bandwidth, among factors of `largest`, under which values are likeliest given all others (leave-one-out likelihood; Silverman 1986, 3.4.4).
fn likeliest(values: &[f64], largest: f64) -> f64 {
    let values = without_ties(values);
    let count = values.len();
    let range = values[count - 1] - values[0];
    let log_likelihood = |bandwidth: f64| {
        let least = LEAST_SHARE * count as f64 * bandwidth / range;
        let density = |own: usize| {
            let value = values[own];
            let from = values.partition_point(|x| *x < value - REACH * bandwidth);
            let near = values[from..].iter().take_while(|x| **x <= value + REACH * bandwidth);
            let sum: f64 = near.map(|x| (-0.5 * ((x - value) / bandwidth).powi(2)).exp()).sum();
            // Less its own.
            (sum - 1.0).max(least) / bandwidth
        };
        let compared = (0..count).step_by(count.div_ceil(MAX_COMPARED));
        compared.map(|own| density(own).ln()).sum::<f64>()
    };
    let mut best = (f64::NEG_INFINITY, largest);
    for bandwidth in FACTORS.map(|factor| factor * largest) {
        let found = log_likelihood(bandwidth);
        if found > best.0 {
            best = (found, bandwidth);
        }
    }
    best.1
}

/// Sorts a sample; returns its fit, its mean and its standard deviation. The bandwidth is the likeliest one that is not above Silverman's
/// `0.9 min(s, IQR / 1.34) n^(-1/5)`.
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
    let bandwidth = likeliest(values, 0.9 * spread * n.powf(-0.2));
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
