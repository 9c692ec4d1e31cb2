//! `diffusive-ranks`: a leak found by sensors whose response is not known, from ranks and from three bits.

use super::building::{Building, Case, NEAR, Placement, RATES};
use super::common::{fraction, median};
use super::plan_belief::{Instrument, PlanBelief, Report, of_words};
use crate::prelude::*;

/// A response shows `gain m (c / m)^exponent` for the concentration `c`, with the typical concentration `m`.
const EXPONENTS: [f64; 2] = [0.4, 1.0];
/// Gains are between this and its inverse.
const GAIN: f64 = 2.0;
/// Exponents and gains over which an unknown response is averaged.
const NODES: [usize; 2] = [5, 3];
/// Logarithm of more than the number of rates and responses that are summed.
const SUMMED: f64 = 10.0;
const CASE: Case = Case {
    windy: false,
    noise: 0.05,
    report: Report::Value,
    readings: 1,
};

parameters! {
    pub struct Parameters {
        sensors: Vec<usize> [4..=200; 1..] = vec![20, 40, 80] => "Sensors.",
        trials: u64 [2..=10_000] = 60 => quick 4 => "Random placements, responses and sources at each point.",
    }
    cost |p| Cost::new(0.02 * (p.trials as f64) * p.sensors.iter().sum::<usize>() as f64, 1e8);
}

rows! {
    pub struct Row by "{sensors}" {
        sensors: usize as x("sensors") => "Sensors.",
        /// Share of the placements whose most probable cell is within two cells of the source.
        known_values: Measured as dashed("values, response known") => "Readings, the response known.",
        known_words: Measured as points("three bits, response known") => "Words of three bits, the response known.",
        averaged: Measured as points("three bits, averaged over responses") => "The same words, averaged over exponent and gain.",
        linear: Measured as points("three bits, taken as linear") => "The same words, the response taken as linear with gain 1.",
        ranks: Measured as points("ranks of values") => "Ranks of the readings against ranks of the concentrations of each cell.",
        word_ranks: Measured as points("ranks of three bits") => "Ranks of the words.",
        python_ranks: Option<f64> => "Ranks of the readings, another program on its own worlds.",
        error_averaged: Measured ["m"] => "Median distance of the most probable cell from the source: words averaged over responses.",
        error_ranks: Measured ["m"] => "The same for ranks of the readings.",
        error_word_ranks: Measured ["m"] => "The same for ranks of the words.",
        coverage_averaged: Measured => "Share of the 90 per cent credible regions that hold the source: words averaged over responses.",
        coverage_linear: Measured => "The same with the response taken as linear.",
    }
}

pub struct Ranks;

/// What a sensor shows.
#[derive(Clone, Copy)]
struct Response {
    exponent: f64,
    gain: f64,
}

impl Response {
    /// The words of a sensor with these thresholds, as words of the concentration: `gain m (c / m)^exponent > threshold`.
    fn instrument(self, of: &Instrument, typical: f64, largest: f64) -> Instrument {
        let back = |shown: f64| typical * (shown / (self.gain * typical)).powf(1.0 / self.exponent);
        Instrument::new(of.noise, of.thresholds.map(back), largest)
    }
}

/// Ranks from 0 to 1; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let (mut ranks, mut from) = (vec![0.0; values.len()], 0);
    while from < order.len() {
        let to = (from..order.len())
            .find(|k| values[order[*k]] != values[order[from]])
            .unwrap_or(order.len());
        for k in &order[from..to] {
            ranks[*k] = (from + to) as f64 / (2 * order.len()) as f64;
        }
        from = to;
    }
    ranks
}

/// The belief of ranks: their differences from those of each cell are Gaussian, of a deviation with the density `1 / deviation`.
fn of_ranks(responses: &[Vec<f64>], shown: &[f64]) -> PlanBelief {
    let (seen, count) = (ranks(shown), shown.len() as f64);
    let log = |cell: usize| {
        let modelled: Vec<f64> = responses.iter().map(|row| row[cell]).collect();
        let squares = seen.iter().zip(ranks(&modelled)).map(|(a, b)| (a - b).powi(2));
        // A rank is not told to better than half of one.
        -0.5 * count * (squares.sum::<f64>() + 0.25 / count).ln()
    };
    let logs: Vec<f64> = (0..responses[0].len()).map(log).collect();
    PlanBelief::of_logs(&logs, 0.0)
}

/// The beliefs of one placement, in the order of the columns.
fn beliefs(placement: &Placement<'_>, truth: Response) -> Result<[PlanBelief; 6], Error> {
    let ([responses, _], readings) = (&placement.responses, &placement.readings);
    let told = &placement.instrument;
    let typical = told.thresholds[told.thresholds.len() / 2];
    let largest = RATES[1] * responses.iter().flatten().copied().fold(0.0, f64::max);
    let words_by = |response: Response| response.instrument(told, typical, largest);
    let known = words_by(truth);
    let words: Vec<Vec<usize>> = readings.iter().map(|y| vec![known.word(y[0])]).collect();
    let of = |instrument: &Instrument, known: f64| of_words(instrument, RATES, (responses, &words), known).0;
    let mut averaged = vec![f64::NEG_INFINITY; responses[0].len()];
    for exponent in 0..NODES[0] {
        for gain in 0..NODES[1] {
            let [exponent, gain] = [(exponent, NODES[0]), (gain, NODES[1])].map(|(k, n)| (k as f64 + 0.5) / n as f64);
            let node = Response {
                exponent: EXPONENTS[0] + exponent * (EXPONENTS[1] - EXPONENTS[0]),
                gain: GAIN.powf(2.0 * gain - 1.0),
            };
            // The logarithm of a sum over rates is at most this much above that of its largest term.
            let known = averaged.iter().copied().fold(f64::NEG_INFINITY, f64::max) - SUMMED;
            for (sum, log) in averaged.iter_mut().zip(of(&words_by(node), known)) {
                *sum = fewbits_numerics::kernels::log_sum_exp(&[*sum, log]);
            }
        }
    }
    let shown: Vec<f64> = readings.iter().map(|y| y[0]).collect();
    let indices: Vec<f64> = words.iter().map(|word| word[0] as f64).collect();
    Ok([
        placement.belief(0, responses.len())?,
        PlanBelief::of_logs(&of(&known, f64::NEG_INFINITY), 0.0),
        PlanBelief::of_logs(&averaged, 0.0),
        PlanBelief::of_logs(&of(told, f64::NEG_INFINITY), 0.0),
        of_ranks(responses, &shown),
        of_ranks(responses, &indices),
    ])
}

/// The distance of the most probable cell from the source, and whether the credible region holds it.
fn one(building: &Building, sensors: usize, stream: Stream) -> Result<[(f64, bool); 6], Error> {
    let placement = Placement::draw(building, &CASE, sensors, None, stream)?;
    let mut rng = stream.named("response").rng();
    let truth = Response {
        exponent: rng.random_range(EXPONENTS[0]..EXPONENTS[1]),
        gain: GAIN.powf(rng.random_range(-1.0..1.0)),
    };
    let chance: f64 = rng.random();
    let judge = |belief: PlanBelief| (placement.error(&belief), belief.covers(placement.source, chance));
    Ok(beliefs(&placement, truth)?.map(judge))
}

impl Figure for Ranks {
    figure!(Parameters => Vec<Row>, "diffusive-ranks", "A leak, by sensors that nobody calibrated", "our own comparison",
        "The building of `diffusive-rooms`, still air. Sensors of one make show a power of the concentration, of unknown exponent (0.4 to 1) \
         and gain (0.5 to 2). The ranks of the readings do not depend on that (the idea of arXiv 2605.13208); words of three bits can be \
         averaged over it. A rank among n readings is log2(n) bits, and needs the readings to be compared."; linear("share within two cells of the source"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let building = Building::new(CASE.windy)?;
        let row = |sensors: &usize| {
            let stream = context.stream("diffusive-ranks").named(&sensors.to_string());
            let all = context.trials(stream, p.trials, |trial| one(&building, *sensors, trial.stream))?;
            let near = |k: usize| fraction(all.iter().filter(|found| found[k].0 <= NEAR).count(), all.len());
            let held = |k: usize| fraction(all.iter().filter(|found| found[k].1).count(), all.len());
            let error = |k: usize| median(all.iter().map(|found| found[k].0)).unwrap_or(Measured::new(f64::NAN, None));
            Ok(Row {
                sensors: *sensors,
                known_values: near(0),
                known_words: near(1),
                averaged: near(2),
                linear: near(3),
                ranks: near(4),
                word_ranks: near(5),
                python_ranks: reference::value(&format!("diffusive-ranks/ranks/{sensors}")),
                error_averaged: error(2),
                error_ranks: error(4),
                error_word_ranks: error(5),
                coverage_averaged: held(2),
                coverage_linear: held(3),
            })
        };
        p.sensors.iter().map(row).collect()
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_defaults().at_full_trials();
        let what = "three bits averaged over the response find the source more often than ranks of the same bits";
        full.all("same-bits", what, select(rows, |r| r.sensors >= 40), |r| r.averaged.value > r.word_ranks.value);
        let what = "they are as near as ranks of whole readings, within three standard errors";
        let apart = |r: &Row| (r.averaged.value - r.ranks.value) / r.averaged.error().hypot(r.ranks.error());
        full.all("whole-readings", what, rows, |r| apart(r) >= -3.0);
        let what = "a response that is taken as linear costs more than one that is averaged over";
        full.all("linear", what, select(rows, |r| r.sensors >= 40), |r| r.linear.value < r.averaged.value);
        full.all("linear-coverage", "its regions promise too much", rows, |r| r.coverage_linear.value < 0.6);
        let what = "regions of nine tenths hold the source in three of four or more if the response is averaged over";
        full.all("coverage", what, rows, |r| r.coverage_averaged.value >= 0.75);
    }
}
