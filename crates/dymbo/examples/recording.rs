//! Tracks a recorded signal with 1, 2 and 3 bits a sample.
//!
//! ```text
//! cargo run --release -p fewbits-dymbo --example recording -- FILE.csv COLUMN
//! ```
//!
//! The file has a header line and one row a sample. The plant is fitted to the column by maximum likelihood, the innovations
//! being those of the Kalman filter; then sensors with a few bits a sample follow the same column, and their estimates are
//! compared with that of the Kalman filter, which hears every sample in full.

use fewbits_core::{BitWriter, Encoder, Gaussian, Message, Observation};
use fewbits_dymbo::{CellIndex, FineSensor, Initialisation, MultibitFilter, ScalarPlant};
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
    // a from 0 to 1 - 1e-6, gamma from 1e-6 to 1e4. A smooth record runs into the last bound: it shows no sensing noise.
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
    let (a, gamma) = plant_at(best);
    let (log_likelihood, variance) = profile(&signal, a, gamma)?;
    Ok(Fit {
        mean,
        plant: ScalarPlant::new(a, gamma * variance, variance)?,
        log_likelihood,
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

/// Length of the first message in bits.
const FIRST_WORD: u32 = 16;

/// Estimates from words of `bits` bits after a fine first message, and the bits that were sent.
pub fn few_bits(fit: &Fit, samples: &[f64], bits: usize) -> Result<(Vec<f64>, usize), Box<dyn Error>> {
    let filter = MultibitFilter::new(fit.plant, bits)?;
    // As fine as the innovations that follow.
    let innovation =
        fit.plant.steady_state(filter.information())?.predicted_variance + fit.plant.measurement_variance();
    let sensor = FineSensor::new(innovation.sqrt())?;
    let mut link = BitWriter::with_capacity(FIRST_WORD as usize + bits * samples.len());

    let message = sensor.encode(&(samples[0] - fit.mean), &());
    message.encode(&FIRST_WORD, &mut link)?;
    let mut belief = Initialisation::Fine { sensor, message }.belief(&fit.plant)?;
    let mut estimates = vec![belief.mean()[0] + fit.mean];
    for sample in &samples[1..] {
        let word: CellIndex = filter.sensor().encode(&(sample - fit.mean), &filter.broadcast(&belief));
        word.encode(&filter.sensor().bits(), &mut link)?;
        belief = filter.step(&belief, Observation::Received(word))?.0;
        estimates.push(belief.mean()[0] + fit.mean);
    }
    Ok((estimates, link.bits()))
}

/// Root mean square of the difference of two signals of equal length.
pub fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum();
    (sum / a.len() as f64).sqrt()
}

/// What the example prints.
pub struct Report {
    /// The fitted plant.
    pub fit: Fit,
    /// Number of samples.
    pub samples: usize,
    /// Bits a sample, root mean square deviation from the Kalman filter's estimate, bits spent.
    pub rows: Vec<(usize, f64, usize)>,
    /// Root mean square of the samples' deviation from the Kalman filter's estimate.
    pub residual: f64,
}

/// Fits, tracks and compares.
pub fn analyse(samples: &[f64]) -> Result<Report, Box<dyn Error>> {
    let fit = fit(samples)?;
    let reference = full_precision(&fit, samples)?;
    let mut rows = Vec::new();
    for bits in 1..=3 {
        let (estimates, spent) = few_bits(&fit, samples, bits)?;
        rows.push((bits, rms_difference(&estimates, &reference), spent));
    }
    Ok(Report {
        samples: samples.len(),
        residual: rms_difference(samples, &reference),
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
            "fitted: a = {:.6}, sigma_u = {:.5}, sigma = {:.5} (gamma = {:.4}), log-likelihood {:.2}",
            plant.coefficient(),
            plant.process_variance().sqrt(),
            plant.measurement_variance().sqrt(),
            plant.noise_ratio(),
            self.fit.log_likelihood
        )?;
        writeln!(f, "the samples deviate from the full-precision estimate by {:.5} (rms)", self.residual)?;
        writeln!(f, "{:>12} {:>28} {:>12}", "bits/sample", "rms deviation from it", "bits spent")?;
        for (bits, deviation, spent) in &self.rows {
            writeln!(f, "{bits:>12} {deviation:>28.5} {spent:>12}")?;
        }
        Ok(())
    }
}
