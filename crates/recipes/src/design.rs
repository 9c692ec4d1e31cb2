//! Quantizers of few bits for one unknown that several sensors measure: from texts and numbers to a search.

use crate::error::Error;
use fewbits_core::Link;
use fewbits_quantizer_design::solve::{MAX_BITS, Watch};
use fewbits_quantizer_design::{
    Adc, AllowedCells, BitBudget, Noise, ObservationModel, Prior, Request, Solutions, WordedCells,
};
use std::time::Duration;

const PRIOR: &str =
    "`20±4`, `uniform:0..40`, or `discrete:0,10` (values, each with `@` and its probability, or with equal ones)";
const BITS: &str = "`3`, one number per sensor as `3,1`, or `total:8`";
const ADC: &str = "bits and range, as `12:0..40`";
const PROBABILITY: &str = "one probability for all sensors, or one per sensor";

/// What a design is best at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Criterion {
    /// Smallest mean squared error of the estimate.
    Error,
    /// Largest mutual information between the unknown and the received words.
    Information,
    /// Smallest probability of a wrong decision, for a discrete prior.
    Decision,
}

/// All that a search needs.
#[derive(Debug, Clone)]
pub struct Task {
    /// What is known of the unknown.
    pub prior: Prior,
    /// Standard deviation of each sensor's noise, in the unit of the unknown. 0: none, for which [`negligible`] is taken.
    pub deviations: Vec<f64>,
    /// Correlation of the noise of any two sensors.
    pub correlation: f64,
    /// Bits of the sensors.
    pub bits: BitBudget,
    /// The link of each sensor.
    pub links: Vec<Link>,
    /// What is optimised.
    pub criterion: Criterion,
    /// Which cells may share a word.
    pub cells: AllowedCells,
    /// Longest time of the search.
    pub time_limit: Option<Duration>,
}

impl Task {
    /// Searches for the best design; `progress` is called as the search goes on, and ends it with the best so far if it breaks.
    ///
    /// # Errors
    /// If prior, noise, bits, links and criterion do not go together.
    pub fn search<'a>(&self, progress: &'a mut Watch<'a>) -> Result<Solutions, Error> {
        let none = negligible(&self.prior);
        let or_negligible = |deviation: &f64| if *deviation == 0.0 { none } else { *deviation };
        let deviations: Vec<f64> = self.deviations.iter().map(or_negligible).collect();
        let noise = if self.correlation == 0.0 {
            Noise::independent_with_deviations(&deviations)
        } else {
            Noise::equicorrelated_with_deviations(&deviations, self.correlation)
        };
        let noise = noise.map_err(refused("noise and correlation"))?;
        let model = ObservationModel::new(self.prior.clone(), noise);
        let is_small = deviations.iter().any(|deviation| *deviation < none);
        let model = model.map_err(refused(if is_small {
            "the noise is too small beside the prior: 0 stands for none"
        } else {
            "prior and noise do not go together"
        }))?;
        let failed = "no design";
        let (bits, link) = (self.bits.clone(), Link::PERFECT);
        let request = match self.criterion {
            Criterion::Decision => Request::detection(model, bits, link).map_err(refused(failed))?,
            Criterion::Error => Request::estimation(model, bits, link),
            Criterion::Information => Request {
                criterion: fewbits_quantizer_design::Criterion::MutualInformation,
                ..Request::estimation(model, bits, link)
            },
        };
        let request = Request {
            links: self.links.clone(),
            cells: self.cells,
            start: self.between_points(),
            time_limit: self.time_limit,
            progress: Some(progress),
            ..request
        };
        request.run().map_err(refused(failed))
    }
}

/// A noise that changes no design: a two-hundredth of the prior's deviation, or of points a thousandth of the smallest gap between them.
/// It moves the breakpoints of a normal prior by a hundred-thousandth of its deviation.
pub fn negligible(prior: &Prior) -> f64 {
    let Some((values, _)) = prior.points() else {
        return 5e-3 * prior.deviation();
    };
    let mut points = values.to_vec();
    points.sort_by(f64::total_cmp);
    let gaps = points.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    1e-3 * gaps.fold(prior.deviation(), f64::min)
}

/// Number of different values up to which a sample is taken to be points of mass, and how often each must occur on average.
const MAX_POINTS: usize = 16;
const MIN_TIMES: usize = 8;

impl Task {
    /// Cells that part the points of a discrete prior, as a start of the search: where noise is small beside the gaps, the criterion is flat
    /// between them. `None` for other priors and budgets.
    fn between_points(&self) -> Option<Vec<WordedCells>> {
        let (values, probabilities) = self.prior.points()?;
        let bits = |sensor: usize| match &self.bits {
            BitBudget::Each(bits) => Some(*bits),
            BitBudget::PerSensor(bits) => bits.get(sensor).copied(),
            BitBudget::Total(_) => None,
        };
        let mut points: Vec<(f64, f64)> = values.iter().copied().zip(probabilities.iter().copied()).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let cells = |sensor: usize| {
            let bits = bits(sensor).filter(|bits| (1..=MAX_BITS).contains(bits))?;
            let breakpoints = parted(&points, 1 << bits);
            // Neighbours differ in one bit.
            let words = (0..=breakpoints.len()).map(|cell| cell ^ (cell >> 1)).collect();
            Some(WordedCells { breakpoints, words })
        };
        (0..self.deviations.len()).map(cells).collect()
    }
}

/// Middles between sorted `(value, weight)`, at most `cells - 1`, with the smallest weighted squares of distances from the means of the cells.
fn parted(points: &[(f64, f64)], cells: usize) -> Vec<f64> {
    let n = points.len();
    let cost = |from: usize, to: usize| {
        let (weight, sum) = points[from..to]
            .iter()
            .fold((0.0, 0.0), |(w, s), (x, p)| (w + p, s + p * x));
        let mean = if weight > 0.0 { sum / weight } else { 0.0 };
        points[from..to]
            .iter()
            .map(|(x, p)| p * (x - mean) * (x - mean))
            .sum::<f64>()
    };
    // `best[c][to]`: cost of the first `to` points in `c + 1` cells, none of them empty, and where the last cell begins.
    let mut best: Vec<Vec<(f64, usize)>> = vec![(0..=n).map(|to| (cost(0, to), 0)).collect()];
    for c in 1..cells.min(n) {
        let last = &best[c - 1];
        let least = |to: usize| {
            let all = (c..to).map(|from| (last[from].0 + cost(from, to), from));
            all.fold((f64::INFINITY, 0), |least, one| if one.0 < least.0 { one } else { least })
        };
        let row = (0..=n).map(least).collect();
        best.push(row);
    }
    let (mut edges, mut to) = (Vec::new(), n);
    for row in best.iter().skip(1).rev() {
        to = row[to].1;
        if to > 0 {
            edges.push(0.5 * (points[to - 1].0 + points[to].0));
        }
    }
    edges.reverse();
    edges
}

fn refused<E: std::error::Error + Send + Sync + 'static>(what: &'static str) -> impl Fn(E) -> Error {
    move |source| Error::Refused {
        what,
        source: Box::new(source),
    }
}

fn misread(setting: &'static str, value: &str, expected: &'static str) -> Error {
    Error::Setting {
        setting,
        value: value.to_owned(),
        expected,
    }
}

/// Two numbers with `..` between them.
fn interval(setting: &'static str, whole: &str, text: &str, expected: &'static str) -> Result<(f64, f64), Error> {
    let ends = text
        .split_once("..")
        .and_then(|(low, high)| Some((low.trim().parse().ok()?, high.trim().parse().ok()?)));
    ends.ok_or_else(|| misread(setting, whole, expected))
}

/// A prior: `20±4`, `uniform:0..40`, `discrete:0,10`, `discrete:0@0.9,10@0.1`.
///
/// # Errors
/// If the text is none of these, or its numbers are no prior.
pub fn prior(text: &str) -> Result<Prior, Error> {
    let misread = || misread("prior", text, PRIOR);
    let prior = if let Some(ends) = text.strip_prefix("uniform:") {
        let (low, high) = interval("prior", text, ends, PRIOR)?;
        Prior::uniform(low, high)
    } else if let Some(values) = text.strip_prefix("discrete:") {
        let count = values.split(',').count() as f64;
        let parse = |part: &str| {
            let (value, probability) = part.split_once('@').unwrap_or((part, ""));
            let probability = match probability {
                "" => 1.0 / count,
                text => text.trim().parse().ok()?,
            };
            Some((value.trim().parse::<f64>().ok()?, probability))
        };
        let pairs: Option<Vec<(f64, f64)>> = values.split(',').map(parse).collect();
        let (values, probabilities) = pairs.ok_or_else(misread)?.into_iter().unzip();
        Prior::discrete(values, probabilities)
    } else {
        let (mean, deviation) = text.split_once('±').or(text.split_once("+-")).ok_or_else(misread)?;
        let number = |text: &str| {
            text.trim()
                .parse::<f64>()
                .ok()
                .filter(|number| number.is_finite())
                .ok_or_else(misread)
        };
        let (mean, deviation) = (number(mean)?, number(deviation)?);
        if deviation <= 0.0 {
            return Err(misread());
        }
        Prior::normal(mean, deviation)
    };
    prior.map_err(refused("prior"))
}

/// The prior of a sample of the unknown. A sample of few different values, each of them often, is that of a discrete unknown: its values are
/// points of mass with their frequencies. Other samples are smoothed into a density.
///
/// # Errors
/// If the sample is too small, constant or not finite.
pub fn prior_of(sample: &[f64]) -> Result<Prior, Error> {
    let mut sorted = sample.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut points: Vec<(f64, usize)> = Vec::new();
    for value in sorted {
        match points.last_mut() {
            Some((known, count)) if *known == value => *count += 1,
            _ => points.push((value, 1)),
        }
        if points.len() > MAX_POINTS {
            break;
        }
    }
    let are_points = (2..=MAX_POINTS).contains(&points.len()) && sample.len() >= MIN_TIMES * points.len();
    if are_points && sample.iter().all(|value| value.is_finite()) {
        let shares = points
            .iter()
            .map(|(_, count)| *count as f64 / sample.len() as f64)
            .collect();
        let values = points.iter().map(|(value, _)| *value).collect();
        return Prior::discrete(values, shares).map_err(refused("the sample cannot be a prior"));
    }
    Prior::sample(sample).map_err(refused("the sample cannot be a prior"))
}

/// Bits: `3` of each sensor, `3,1`, `total:8`.
///
/// # Errors
/// If the text is none of these.
pub fn bits(text: &str) -> Result<BitBudget, Error> {
    let number = |part: &str| part.trim().parse::<u32>().map_err(|_| misread("bits", text, BITS));
    Ok(match text.strip_prefix("total:") {
        Some(total) => BitBudget::Total(number(total)?),
        None if text.contains(',') => BitBudget::PerSensor(text.split(',').map(number).collect::<Result<_, _>>()?),
        None => BitBudget::Each(number(text)?),
    })
}

/// A converter: bits and range, `12:0..40`.
///
/// # Errors
/// If the text is not of this form, or its numbers are no converter.
pub fn adc(text: &str) -> Result<Adc, Error> {
    let misread = || misread("adc", text, ADC);
    let (bits, range) = text.split_once(':').ok_or_else(misread)?;
    let (low, high) = interval("adc", text, range, ADC)?;
    Adc::new(bits.trim().parse().map_err(|_| misread())?, low..=high).map_err(refused("adc"))
}

/// The link of each sensor. Of each probability there are none (0), one for all, or one per sensor.
///
/// # Errors
/// If there is another number of them, or they are no probabilities.
pub fn links(sensors: usize, loss: &[f64], flips: &[f64], erasures: &[f64]) -> Result<Vec<Link>, Error> {
    let of = |setting: &'static str, all: &[f64], sensor: usize| match all {
        [] => Ok(0.0),
        [one] => Ok(*one),
        all if all.len() == sensors => Ok(all[sensor]),
        all => Err(misread(setting, &format!("{} numbers", all.len()), PROBABILITY)),
    };
    let link = |sensor: usize| {
        let (loss, flips) = (of("loss", loss, sensor)?, of("flips", flips, sensor)?);
        let erasures = of("erasures", erasures, sensor)?;
        let link = Link::new(loss, flips).and_then(|link| link.with_erasure(erasures));
        link.map_err(refused("loss, flips and erasures make no link"))
    };
    (0..sensors).map(link).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn forms_of_settings() {
        assert_eq!((prior("20±4").unwrap().mean(), prior("uniform:0..40").unwrap().mean()), (20.0, 20.0));
        assert_eq!(prior("discrete:0@0.75,10@0.25").unwrap().mean(), 2.5);
        for text in ["twenty", "20±-4", "20±0", "uniform:1", "discrete:a", "±"] {
            assert!(matches!(prior(text), Err(Error::Setting { setting: "prior", .. })), "{text}");
        }
        assert!(bits("3,x").is_err() && bits("total:8").is_ok() && bits("3,1").is_ok());
        assert!(adc("12:0..40").is_ok() && adc("12").is_err());
        assert_eq!(links(2, &[0.1], &[], &[0.0, 0.2]).unwrap().len(), 2);
        assert!(links(2, &[0.1; 3], &[], &[]).is_err() && links(1, &[2.0], &[], &[]).is_err());
    }

    #[test]
    fn one_sensor_of_one_bit_gets_the_known_quantizer() {
        let task = Task {
            prior: prior("0±1").unwrap(),
            deviations: vec![1e-3],
            correlation: 0.0,
            bits: bits("1").unwrap(),
            links: links(1, &[], &[], &[]).unwrap(),
            criterion: Criterion::Error,
            cells: AllowedCells::Intervals,
            time_limit: None,
        };
        let mut calls = 0;
        let mut count = |_| {
            calls += 1;
            std::ops::ControlFlow::Continue(())
        };
        let solutions = task.search(&mut count).unwrap();
        // One bit of a standard normal: threshold 0, mean squared error 1 - 2 / pi.
        let best = solutions.best();
        assert!(best.sensors()[0].breakpoints[0].abs() < 1e-4 && calls > 0);
        assert!((best.value - (1.0 - 2.0 / std::f64::consts::PI)).abs() < 1e-5, "{}", best.value);
    }
}
