//! Signals: synthetic ones with the traits of recordings, or columns of a user's file.

use crate::prelude::*;

/// Samples of a synthetic signal, of the length asked for.
type Synthesis = fn(&mut rand_pcg::Pcg64Dxsm, usize) -> Vec<f64>;

/// One signal.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Recording {
    pub name: String,
    pub samples: Vec<f64>,
    /// The period of a circular one.
    pub period: Option<f64>,
}

impl Recording {
    /// One that is not circular.
    fn straight(name: &str, samples: Vec<f64>) -> Self {
        Self {
            name: name.to_owned(),
            samples,
            period: None,
        }
    }

    /// Largest minus smallest sample, or the period.
    pub fn range(&self) -> f64 {
        self.period.unwrap_or_else(|| self.straight_range())
    }

    /// Largest minus smallest sample.
    pub fn straight_range(&self) -> f64 {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = self.samples.iter().fold(ends, |(l, h), x| (l.min(*x), h.max(*x)));
        high - low
    }

    /// Root mean square of the errors of `values`, around the circle if there is one.
    pub fn rmse(&self, values: &[f64]) -> f64 {
        let straight = self.samples.iter().zip(values).map(|(x, y)| x - y);
        let squares = straight.map(|e| self.period.map_or(e, |p| e - p * (e / p).round()).powi(2));
        (squares.sum::<f64>() / self.samples.len() as f64).sqrt()
    }
}

parameters! {
    /// Which signals.
    pub(super) struct Source {
        /// A CSV file with a header line and a row a sample; empty for the synthetic set.
        pub recording: String = String::new(),
        /// Columns; empty for all of the synthetic set, or all of the file but the first.
        pub columns: Vec<String> = Vec::new(),
        pub circular: Vec<String> = vec!["direction".into()] => "Columns on a circle of 360.",
        pub samples: usize [50..=100_000] = 3800 => "Length of the synthetic signals.",
    }
}

impl Source {
    /// The signals.
    pub fn load(&self, figure: &'static str, context: &Context<'_>) -> Result<Vec<Recording>, Error> {
        let refused = |name: &str, value: &str, reason: String| Error::refused(figure, name, value, reason);
        let all = if self.recording.is_empty() {
            synthetic(&context.stream("real"), self.samples)
        } else {
            let text = context
                .read(&self.recording)
                .map_err(|error| refused("recording", &self.recording, error.to_string()))?;
            parse(&text, &self.columns).map_err(|reason| refused("recording", &self.recording, reason))?
        };
        let chosen = |r: &Recording| self.columns.is_empty() || self.columns.contains(&r.name);
        let mut kept: Vec<Recording> = all.into_iter().filter(chosen).collect();
        if let Some(missing) = self.columns.iter().find(|c| !kept.iter().any(|r| r.name == **c)) {
            return Err(refused("columns", missing, "no such column".into()));
        }
        for recording in &mut kept {
            let circular = self.circular.contains(&recording.name);
            recording.period = circular.then_some(360.0);
        }
        Ok(kept)
    }
}

/// Computes one result for every signal and number, in parallel and in order.
pub(super) fn each<T: Send>(
    recordings: &[Recording],
    numbers: &[f64],
    one: impl Fn(&Recording, f64) -> Result<T, Error> + Sync,
) -> Result<Vec<T>, Error> {
    parallel::try_map(&product(recordings, numbers), |(recording, number)| one(recording, **number))
}

/// Numeric columns of a CSV text: the named ones, or all but the first.
pub(super) fn parse(text: &str, columns: &[String]) -> Result<Vec<Recording>, String> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let headers = reader.headers().map_err(|error| error.to_string())?.clone();
    let wanted = |(i, name): &(usize, &str)| match columns {
        [] => *i > 0,
        _ => columns.iter().any(|c| c == name),
    };
    let chosen: Vec<(usize, &str)> = headers.iter().enumerate().filter(wanted).collect();
    let mut found: Vec<_> = chosen
        .iter()
        .map(|(_, name)| Recording::straight(name, Vec::new()))
        .collect();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|error| error.to_string())?;
        for ((at, name), recording) in chosen.iter().zip(&mut found) {
            let field = record.get(*at).unwrap_or_default().trim();
            match field.parse::<f64>() {
                Ok(value) if value.is_finite() => recording.samples.push(value),
                _ => return Err(format!("row {} of column {name}: `{field}` is no number", row + 2)),
            }
        }
    }
    match found.iter().find(|r| r.samples.len() < 50) {
        Some(short) => Err(format!("column {} has {} rows: expected at least 50", short.name, short.samples.len())),
        None => Ok(found),
    }
}

fn normal<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    rng.sample(StandardNormal)
}

/// As an instrument writes it, `per_unit` steps to one.
fn rounded(x: f64, per_unit: f64) -> f64 {
    (x * per_unit).round() / per_unit
}

/// Six signals of `n` samples.
fn synthetic(stream: &Stream, n: usize) -> Vec<Recording> {
    let make: [(&str, Synthesis); 6] = [
        ("bursts", bursts),
        ("drift", drift),
        ("steps", steps),
        ("spikes", spikes),
        ("direction", direction),
        ("gusts", gusts),
    ];
    let one = |(name, of): &(&str, Synthesis)| Recording::straight(name, of(&mut stream.named(name).rng(), n));
    make.iter().map(one).collect()
}

/// A gas sensor: a quiet noisy base line, and plumes that arrive suddenly and fade.
fn bursts<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let (mut level, mut gas) = (0.0, 0.0);
    let one = |_| {
        if rng.random::<f64>() < 0.01 {
            gas += 1.5 * -(1.0 - rng.random::<f64>()).ln();
        }
        gas *= 0.97;
        level += (gas - level) * 0.3 + gas * 0.1 * normal(rng);
        rounded(level + 0.02 * normal(rng), 1000.0)
    };
    (0..n).map(one).collect()
}

/// Humidity: a smooth velocity.
fn drift<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let (mut x, mut v) = (30.0, 0.0);
    let one = |_| {
        v = 0.97 * v + 0.002 * normal(rng);
        x += v;
        rounded(x + 0.001 * normal(rng), 1000.0)
    };
    (0..n).map(one).collect()
}

/// A thermometer whose converter is coarser than its noise.
fn steps<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let mut x = 22.0;
    let one = |i: usize| {
        x += 0.01 * normal(rng) + 0.004 * (i as f64 * 0.004).cos();
        rounded(x + 0.01 * normal(rng), 16.0)
    };
    (0..n).map(one).collect()
}

/// A level with rare outliers.
fn spikes<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let mut x = 5.0;
    let one = |_| {
        x += 0.02 * (5.0 - x) + 0.05 * normal(rng);
        let outlier = rng.random::<f64>() < 0.01;
        let wild = if outlier { 20.0 * normal(rng) } else { 0.0 };
        rounded(x + wild, 1000.0)
    };
    (0..n).map(one).collect()
}

/// A wind vane that turns through north.
fn direction<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let (mut x, mut v) = (350.0, 0.0);
    let one = |_| {
        v = 0.8 * v + normal(rng);
        x += v;
        rounded((x + 2.0 * normal(rng)).rem_euclid(360.0), 1.0).rem_euclid(360.0)
    };
    (0..n).map(one).collect()
}

/// Wind speed: calm for long, then gusts, in the steps of its converter.
fn gusts<R: Rng>(rng: &mut R, n: usize) -> Vec<f64> {
    let (mut x, mut blowing): (f64, bool) = (0.0, false);
    let one = |_| {
        if rng.random::<f64>() < if blowing { 0.02 } else { 0.005 } {
            blowing = !blowing;
        }
        x = 0.9 * x + if blowing { 0.1 + 0.1 * normal(rng) } else { 0.0 };
        rounded(x.max(0.0), 100.0)
    };
    (0..n).map(one).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn files_are_read_by_column() {
        let mut text = "t,a,b\n".to_owned();
        (0..60).for_each(|i| text += &format!("{i},{},{}\n", 2 * i, -i));
        let read = |path: &str| {
            assert_eq!(path, "my.csv");
            Ok(text.clone())
        };
        let mut context = Context::new(1);
        context.read = Some(&read);
        let mut source = Source {
            recording: "my.csv".into(),
            ..Source::default()
        };
        let all = source.load("demo", &context).unwrap();
        assert_eq!(all.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        assert_eq!((all[0].samples[59], all[1].range()), (118.0, 59.0));
        source.columns = vec!["b".into()];
        assert_eq!(source.load("demo", &context).unwrap().len(), 1);
        source.columns = vec!["c".into()];
        let refused = source.load("demo", &context).unwrap_err().to_string();
        assert!(refused.contains("no such column"), "{refused}");
        assert!(source.load("demo", &Context::new(1)).is_err());
        assert!(parse("t,a\n1,x\n", &[]).unwrap_err().contains("row 2"));
    }

    #[test]
    fn the_synthetic_set_has_its_traits() {
        let all = Source::default().load("demo", &Context::new(1)).unwrap();
        assert_eq!(all.len(), 6);
        for r in &all {
            assert!(
                r.samples.len() == 3800 && r.range() > 0.0 && r.samples.iter().all(|x| x.is_finite()),
                "{}",
                r.name
            );
        }
        assert_eq!(all.iter().filter(|r| r.period.is_some()).count(), 1);
        let calm = all[5].samples.iter().filter(|x| **x == 0.0).count();
        assert!(calm > 500 && calm < 3700, "{calm}");
    }
}
