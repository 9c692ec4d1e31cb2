//! Tracks a recorded signal with 1, 2 and 3 bits a sample.
//!
//! ```text
//! cargo run --release -p fewbits-dymbo --example recording -- FILE.csv COLUMN
//! ```
//!
//! The file has a header line and one row a sample. The plant is fitted to the first half of the column by maximum
//! likelihood, the innovations being those of the Kalman filter; then sensors with a few bits a sample follow the whole column.
//! Each filter is judged by how well it predicts the next sample in the second half, which the fit has not seen, beside the
//! Kalman filter (every sample in full), the last sample, and the mean.

use fewbits_core::{BitWriter, Gaussian, Message, Observation, Scheme};
use fewbits_dymbo::{Initialisation, MultibitFilter, RoundedSample, ScalarFilter, ScalarPlant};
use fewbits_filters::kalman;
use fewbits_models::{Ar1, LinearSensor};
use nalgebra::Vector1;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.as_slice() {
        [file, column] => read_column(Path::new(file), column).and_then(|samples| analyse(&samples)),
        _ => Err("usage: recording FILE.csv COLUMN".into()),
    };
    match outcome {
        Ok(report) => {
            print!("{report}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// One column of a CSV file with a header.
pub fn read_column(file: &Path, column: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(file)?;
    let headers = reader.headers()?.clone();
    let at = headers.iter().position(|name| name == column).ok_or_else(|| {
        let known: Vec<&str> = headers.iter().collect();
        format!("no column `{column}`; there are {}", known.join(", "))
    })?;
    let mut samples = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record?;
        let text = record.get(at).unwrap_or_default();
        match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => samples.push(value),
            _ => return Err(format!("row {}: `{text}` is no number", i + 2).into()),
        }
    }
    Ok(samples)
}

/// A plant fitted to a signal.
pub struct Fit {
    /// Mean of the signal; the plant describes what is left.
    pub mean: f64,
    /// The plant.
    pub plant: ScalarPlant,
    /// Log-likelihood of the samples after the first.
    pub log_likelihood: f64,
    /// The bounds of the search on which the fit ended. Such a fit describes the bound and not the signal.
    pub on_bounds: Vec<&'static str>,
}

/// Log-likelihood of a signal of zero mean, and the measurement variance that maximises it at the given coefficient and
/// noise ratio: the variance is a scale and needs no search.
pub fn profile(signal: &[f64], a: f64, gamma: f64) -> Result<(f64, f64), Box<dyn Error>> {
    let (dynamics, sensor) = (Ar1::new(a, gamma)?, LinearSensor::direct(1.0)?);
    let mut belief = Gaussian::scalar(signal[0], 1.0)?;
    let (mut squares, mut log_scales) = (0.0, 0.0);
    for sample in &signal[1..] {
        let (next, info) = kalman::step(&dynamics, &sensor, &belief, &Vector1::new(*sample))?;
        belief = next;
        squares += info.normalised_innovation_squared;
        log_scales += 0.5 * info.innovation_covariance[0].ln();
    }
    let n = (signal.len() - 1) as f64;
    let variance = squares / n;
    let log_likelihood = -0.5 * n * ((2.0 * std::f64::consts::PI * variance).ln() + 1.0) - log_scales;
    Ok((log_likelihood, variance))
}

/// Fits coefficient, process and measurement variance by maximum likelihood.
///
/// A compass search over `x = -ln(1 - a)` and `ln gamma`: it tries a step along each axis, keeps what is better, and halves
/// the step when nothing is.
pub fn fit(samples: &[f64]) -> Result<Fit, Box<dyn Error>> {
    if samples.len() < 10 {
        return Err(format!("{} samples: at least 10 are needed for a fit", samples.len()).into());
    }
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let signal: Vec<f64> = samples.iter().map(|x| x - mean).collect();
    if signal.iter().all(|x| *x == 0.0) {
        return Err("the signal is constant: there is nothing to fit".into());
    }
    // a from 0 to 1 - 1e-6, gamma from 1e-6 to 1e4.
    let bounds = [(0.0, 1e6_f64.ln()), (-1e6_f64.ln(), 1e4_f64.ln())];
    let plant_at = |at: [f64; 2]| (1.0 - (-at[0]).exp(), at[1].exp());
    let value = |at: [f64; 2]| {
        let (a, gamma) = plant_at(at);
        profile(&signal, a, gamma).map(|(log_likelihood, _)| log_likelihood)
    };
    let mut best = [3.0, 0.0];
    let mut peak = value(best)?;
    let mut step = 2.0;
    while step > 1e-4 {
        let mut moved = false;
        for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
            let mut trial = best;
            trial[axis] = (trial[axis] + sign * step).clamp(bounds[axis].0, bounds[axis].1);
            let here = value(trial)?;
            if here > peak {
                (best, peak, moved) = (trial, here, true);
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    let names = [
        [
            "a = 0: the samples look independent",
            "a = 1 - 1e-6: the signal wanders or drifts; take differences",
        ],
        [
            "gamma = 1e-6: the signal hardly moves",
            "gamma = 1e4: a smooth record shows no sensing noise",
        ],
    ];
    let ends = (0..2).flat_map(|axis| [(axis, 0, bounds[axis].0), (axis, 1, bounds[axis].1)]);
    let on_bounds = ends
        .filter(|(axis, _, end)| best[*axis] == *end)
        .map(|(axis, side, _)| names[axis][side]);
    let on_bounds = on_bounds.collect();
    let (a, gamma) = plant_at(best);
    let (log_likelihood, variance) = profile(&signal, a, gamma)?;
    Ok(Fit {
        mean,
        plant: ScalarPlant::new(a, gamma * variance, variance)?,
        log_likelihood,
        on_bounds,
    })
}

/// Estimates of the Kalman filter, which starts from the first sample.
pub fn full_precision(fit: &Fit, samples: &[f64]) -> Result<Vec<f64>, Box<dyn Error>> {
    let plant = &fit.plant;
    let mut belief = Gaussian::scalar(samples[0] - fit.mean, plant.measurement_variance())?;
    let mut estimates = vec![samples[0]];
    for sample in &samples[1..] {
        let innovation = Vector1::new(sample - fit.mean);
        belief = kalman::step(plant.dynamics(), plant.sensor(), &belief, &innovation)?.0;
        estimates.push(belief.mean()[0] + fit.mean);
    }
    Ok(estimates)
}

/// Estimates from words of `bits` bits after a fine first message, and the bits that were sent.
pub fn few_bits(fit: &Fit, samples: &[f64], bits: usize) -> Result<(Vec<f64>, usize), Box<dyn Error>> {
    let filter = MultibitFilter::new(fit.plant, bits)?;
    // As fine as the innovations that follow.
    let noise = fit.plant.measurement_variance();
    let innovation = fit.plant.steady_state(filter.information())?.predicted_variance + noise;
    let scheme = RoundedSample::new(noise, innovation.sqrt())?;
    let mut link = BitWriter::with_capacity(scheme.bits() as usize + bits * samples.len());

    let message = scheme.round(samples[0] - fit.mean)?;
    message.encode(&scheme.bits(), &mut link)?;
    let mut belief = Initialisation::Fine { scheme, message }.belief()?;
    let mut estimates = vec![belief.mean()[0] + fit.mean];
    for sample in &samples[1..] {
        let word = filter.scheme().word(sample - fit.mean, &filter.broadcast(&belief))?;
        word.encode(&filter.scheme().report_format(), &mut link)?;
        belief = filter.step(&belief, &Observation::Received(word))?.0;
        estimates.push(belief.mean()[0] + fit.mean);
    }
    Ok((estimates, link.bits()))
}

/// Root mean square of the errors of one-step predictions from `estimates`, over the samples from `first` on.
pub fn prediction_error(fit: &Fit, samples: &[f64], estimates: &[f64], first: usize) -> f64 {
    let ahead = |estimate: &f64| fit.mean + fit.plant.coefficient() * (estimate - fit.mean);
    let predictions: Vec<f64> = estimates[first - 1..samples.len() - 1].iter().map(ahead).collect();
    rms_difference(&predictions, &samples[first..])
}

/// Root mean square of the difference of two signals of equal length.
pub fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum();
    (sum / a.len() as f64).sqrt()
}

/// What the example prints.
pub struct Report {
    /// The plant, fitted to the first half.
    pub fit: Fit,
    /// Number of samples.
    pub samples: usize,
    /// Bits per sample, root mean square deviation from the Kalman filter's estimate, root mean square error of held-out
    /// one-step predictions, bits spent.
    pub rows: Vec<(usize, f64, f64, usize)>,
    /// Held-out one-step prediction errors of the Kalman filter, of the last sample, and of the mean of the first half.
    pub reference_errors: [f64; 3],
}

/// Fits, tracks and compares.
pub fn analyse(samples: &[f64]) -> Result<Report, Box<dyn Error>> {
    let half = samples.len() / 2;
    let fit = fit(&samples[..half])?;
    let reference = full_precision(&fit, samples)?;
    let mut rows = Vec::new();
    for bits in 1..=3 {
        let (estimates, spent) = few_bits(&fit, samples, bits)?;
        let held_out = prediction_error(&fit, samples, &estimates, half);
        rows.push((bits, rms_difference(&estimates, &reference), held_out, spent));
    }
    let (last, unseen) = (&samples[half - 1..samples.len() - 1], &samples[half..]);
    Ok(Report {
        samples: samples.len(),
        reference_errors: [
            prediction_error(&fit, samples, &reference, half),
            rms_difference(last, unseen),
            rms_difference(&vec![fit.mean; unseen.len()], unseen),
        ],
        fit,
        rows,
    })
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let plant = &self.fit.plant;
        writeln!(f, "{} samples, mean {:.4}", self.samples, self.fit.mean)?;
        writeln!(
            f,
            "fitted to the first half: a = {:.6}, sigma_u = {:.5}, sigma = {:.5} (gamma = {:.4}), log-likelihood {:.2}",
            plant.coefficient(),
            plant.process_variance().sqrt(),
            plant.measurement_variance().sqrt(),
            plant.noise_ratio(),
            self.fit.log_likelihood
        )?;
        for bound in &self.fit.on_bounds {
            writeln!(f, "warning: the fit ended on the bound {bound}")?;
        }
        writeln!(f, "root mean square error of one-step predictions in the second half:")?;
        for (who, error) in ["Kalman filter", "last sample", "mean"]
            .into_iter()
            .zip(self.reference_errors)
        {
            writeln!(f, "{who:>14} {error:>12.5}")?;
        }
        writeln!(
            f,
            "{:>14} {:>12} {:>28} {:>12}",
            "bits/sample", "prediction", "rms deviation from Kalman", "bits spent"
        )?;
        for (bits, deviation, held_out, spent) in &self.rows {
            writeln!(f, "{bits:>14} {held_out:>12.5} {deviation:>28.5} {spent:>12}")?;
        }
        Ok(())
    }
}
