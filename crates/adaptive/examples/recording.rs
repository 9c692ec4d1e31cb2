//! Tracks any column of a CSV file, within a chosen error or at a chosen rate.
//!
//! ```text
//! cargo run --release -p fewbits-adaptive --example recording -- FILE.csv COLUMN delta=0.05 [period=360]
//! cargo run --release -p fewbits-adaptive --example recording -- FILE.csv COLUMN rate=0.5
//! cargo run --release -p fewbits-adaptive --example recording -- FILE.csv COLUMN words=2
//! ```
//!
//! The file has a header line and one row a sample. With `rate` (bits per sample) the error is chosen on the first half of the
//! column; the second half, which that choice has not seen, is judged apart. With `words` every sample takes that many bits. Errors
//! are those of the receiver's reconstruction, beside holding the last of as many evenly spaced 12-bit samples.

use fewbits_adaptive::{Config, FixedRate, Receiver, Replay, Sensor, Silence, StreamWriter, best_within, replay};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.as_slice() {
        [file, column, settings @ ..] => Task::parse(settings)
            .and_then(|task| read_column(Path::new(file), column).and_then(|samples| report(&samples, &task))),
        _ => Err("usage: recording FILE.csv COLUMN delta=D|rate=R|words=1..3 [period=P]".into()),
    };
    match outcome {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// The largest error.
    Delta(f64),
    /// Bits per sample, at most.
    Rate(f64),
    /// Bits in every slot.
    Words(u32),
}

/// The command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// What is asked for.
    pub goal: Goal,
    /// The period of a circular signal.
    pub period: Option<f64>,
}

impl Task {
    /// Reads `name=value` settings.
    pub fn parse(settings: &[String]) -> Result<Self, Box<dyn Error>> {
        let (mut goal, mut period) = (None, None);
        for setting in settings {
            let (name, value) = setting
                .split_once('=')
                .ok_or_else(|| format!("`{setting}`: expected name=value"))?;
            let number: f64 = value
                .parse()
                .map_err(|_| format!("`{setting}`: `{value}` is no number"))?;
            match name {
                "delta" => goal = Some(Goal::Delta(number)),
                "rate" if number > 0.0 => goal = Some(Goal::Rate(number)),
                "words" => goal = Some(Goal::Words(value.parse()?)),
                "period" => period = Some(number),
                _ => return Err(format!("`{setting}`: expected delta, rate above 0, words or period").into()),
            }
        }
        let goal = goal.ok_or("one of delta=, rate=, words= is needed")?;
        Ok(Self { goal, period })
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

/// Root mean square.
pub fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The largest error over a recording as the receiver sees it, and the bits of one stream that also tells the silences.
fn received(samples: &[f64], config: Config) -> Result<(f64, usize), Box<dyn Error>> {
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    let (mut writer, mut stream) = (Sensor::new(config), StreamWriter::new(Silence::Coded));
    let mut worst = 0.0_f64;
    for sample in samples {
        let report = sensor.encode(*sample)?;
        let tracked = receiver.receive(&report.map(|report| report.packet).into())?;
        let straight = (tracked.value.ok_or("nothing received")? - sample).abs();
        let turn = |period: f64| (straight - period * (straight / period).round()).abs();
        worst = worst.max(config.period().map_or(straight, turn));
        writer.write_after(1, *sample, &mut stream)?;
    }
    Ok((worst, 32 * stream.finish().len()))
}

fn configured(delta: f64, period: Option<f64>) -> Result<Config, Box<dyn Error>> {
    let config = Config::new(delta)?;
    Ok(match period {
        Some(period) => config.circular(period)?,
        None => config,
    })
}

/// Runs the task and describes what came out.
pub fn report(samples: &[f64], task: &Task) -> Result<String, Box<dyn Error>> {
    if samples.len() < 4 {
        return Err(format!("{} samples: at least 4 are needed", samples.len()).into());
    }
    let half = samples.len() / 2;
    let mut text = String::new();
    let config = match task.goal {
        Goal::Words(bits) => return words(samples, bits),
        Goal::Delta(delta) => configured(delta, task.period)?,
        Goal::Rate(rate) => {
            let price = |replay: &Replay| Ok::<_, fewbits_adaptive::Error>(replay.rate());
            best_within(configured(1.0, task.period)?, &samples[..half], rate, price)?.0
        }
    };
    let run = replay(config, samples)?;
    let (worst, stream_bits) = received(samples, config)?;
    let delta = config.delta();
    writeln!(text, "{} samples, every error at most {delta:.6}; at the receiver {worst:.6}", samples.len())?;
    writeln!(text, "{:>12} {:>12} {:>12} {:>12}", "", "bits/sample", "rms error", "worst error")?;
    for (name, part) in [("first half", 0..half), ("second half", half..samples.len())] {
        let worst = run.errors[part.clone()].iter().fold(0.0_f64, |w, e| w.max(e.abs()));
        let (bits, error) = (mean(&run.information[part.clone()]), rms(&run.errors[part]));
        writeln!(text, "{name:>12} {bits:>12.4} {error:>12.6} {worst:>12.6}")?;
    }
    let n = samples.len() as f64;
    writeln!(
        text,
        "{} packets; per sample {:.4} bits ideal, {:.4} in whole packets, {:.4} as one stream with its silences",
        run.packets,
        run.rate(),
        run.packet_bits as f64 / n,
        stream_bits as f64 / n
    )?;
    let every = ((12.0 / run.rate().max(1e-9)).round() as usize).clamp(1, samples.len());
    writeln!(text, "one 12-bit sample in {every}, held: rms error {:.6}", rms(&held(samples, every, task.period)))?;
    Ok(text)
}

fn held(samples: &[f64], every: usize, period: Option<f64>) -> Vec<f64> {
    let error = |straight: f64| period.map_or(straight, |p| straight - p * (straight / p).round());
    samples
        .chunks(every)
        .flat_map(|chunk| chunk.iter().map(|x| error(x - chunk[0])))
        .collect()
}

fn words(samples: &[f64], bits: u32) -> Result<String, Box<dyn Error>> {
    let half = samples.len() / 2;
    // The unit is taken from the first half's increments, as an engineer would from a look at the signal.
    let increments: Vec<f64> = samples[..half].windows(2).map(|pair| pair[1] - pair[0]).collect();
    let unit = rms(&increments);
    let (mut sensor, mut receiver) = (FixedRate::new(bits, unit, samples[0])?, FixedRate::new(bits, unit, samples[0])?);
    let mut errors = Vec::new();
    for sample in samples {
        errors.push(receiver.receive(sensor.encode(*sample)?)? - sample);
    }
    Ok(format!(
        "{} samples, {bits} bits each\n  first half: rms error {:.6}\n second half: rms error {:.6}\n",
        samples.len(),
        rms(&errors[..half]),
        rms(&errors[half..])
    ))
}
