//! Process noise learnt from single bits.

use crate::prelude::*;
use fewbits_core::{BitString, SchemeNode, SensorNode};
use fewbits_dymbo::SignBit;
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, NoiseLearning, Reporting, Slot};
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor};

/// Plants of the specification: coefficient, process variance, measurement variance.
const PLANTS: [[f64; 3]; 5] = [
    [0.9, 0.5, 1.0],
    [0.95, 0.2, 1.0],
    [0.99, 0.01, 1.0],
    [0.95, 2.0, 0.1],
    [0.999, 0.001, 0.01],
];
/// Factor of the process variance at the jump, and of a wrong supposition.
const FACTOR: f64 = 9.0;
/// Ends of the windows after the jump.
const WINDOWS: [u64; 5] = [50, 100, 200, 400, 1000];
/// Factor of the step of adaptive delta modulation on a repeated sign; its inverse on an alternation (Jayant 1970).
const JAYANT: f64 = 1.5;

parameters! {
    pub struct Parameters {
        gain: f64 [0.0..=1.0] = 0.03 => "Step of the logarithm of the process variance per bit.",
        flips: f64 [0.0..=0.4] = 0.05 => "Probability that a bit is inverted, where bits are.",
        trials: u64 [2..=100_000] = 100 => quick 8 => "Simulated runs of 2000 steps.",
    }
}

/// A plant, and whether its process variance jumps after half of a run.
#[derive(Clone, Copy)]
struct Scene([f64; 3], bool);

impl Scene {
    fn name(&self) -> String {
        let [a, q, r] = self.0;
        format!("{a} {q} {r}{}", if self.1 { " jump" } else { "" })
    }
}

/// What receives the bits.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// A centre that keeps to the variances it supposes.
    Fixed,
    /// One that learns the process variance.
    Learning,
    /// One that is told of the jump.
    Informed,
    /// Adaptive delta modulation of the samples.
    Delta,
}

/// Name and kind, the supposed process variance and noise variance in parts of the right ones, whether bits are inverted.
type Receiver = (&'static str, Kind, f64, f64, bool);

const RECEIVERS: [Receiver; 11] = {
    use Kind::{Delta, Fixed, Informed, Learning};
    [
        ("knows Q", Informed, 1.0, 1.0, false),
        ("Q / 9", Fixed, 1.0 / FACTOR, 1.0, false),
        ("9 Q", Fixed, FACTOR, 1.0, false),
        ("Q learnt from Q / 9", Learning, 1.0 / FACTOR, 1.0, false),
        ("Q learnt from 9 Q", Learning, FACTOR, 1.0, false),
        ("Q right, not learnt", Fixed, 1.0, 1.0, false),
        ("Q learnt, r / 4", Learning, 1.0, 0.25, false),
        ("Q learnt, 4 r", Learning, 1.0, 4.0, false),
        ("knows Q, inverted bits", Informed, 1.0, 1.0, true),
        ("Q learnt from Q / 9, inverted bits", Learning, 1.0 / FACTOR, 1.0, true),
        ("adaptive delta modulation", Delta, 1.0, 1.0, false),
    ]
};

type Centre = FusionCentre<1, MomentFilter>;

/// A centre of one sign-bit sensor over a link that inverts.
fn seated(rng: &mut dyn Rng, [a, q, r]: [f64; 3], flips: f64, prior: &Gaussian<1>) -> Result<Centre, Error> {
    let world = ContinuousLinear::ornstein_uhlenbeck(0.0, -1.0 / a.ln(), q / (1.0 - a * a))?;
    let mut centre = FusionCentre::new(rng, world, MomentFilter, prior)?;
    let scheme = SignBit::new(r)?;
    let threshold = |_: &Gaussian<1>, m: &Gaussian<1>| m.mean()[0];
    centre.join(0, Reporting::new(LinearSensor::direct(r)?, scheme, Link::flipping(flips)?, threshold))?;
    Ok(centre)
}

/// Mean squared errors over the second half, over the windows after its beginning, and `ln` of the learnt factor.
fn one_run(scene: &Scene, receiver: &Receiver, p: &Parameters, stream: Stream) -> Result<[f64; 7], Error> {
    let mut world = stream.named("world").fast_rng();
    let (mut rng, mut air) = (stream.named("filter").fast_rng(), stream.named("air").fast_rng());
    let Scene([a, q, r], jumps) = *scene;
    let (before, after) = (Ar1::new(a, q)?, Ar1::new(a, if jumps { FACTOR * q } else { q })?);
    let sensor = LinearSensor::<1, 1>::direct(r)?;
    let prior = Gaussian::scalar(0.0, before.stationary_variance()?)?;
    let mut state: Vector1<f64> = prior.sample(&mut world);
    let (_, kind, process, noise, inverted) = *receiver;
    let flips = if inverted { p.flips } else { 0.0 };
    let mut centre = seated(&mut rng, [a, process * q, noise * r], flips, &prior)?;
    if kind == Kind::Learning {
        centre = centre.learning_noise(NoiseLearning {
            gain: p.gain,
            ..NoiseLearning::DEFAULT
        })?;
    }
    let mut node = SchemeNode::new(SignBit::new(r)?);
    let (mut estimate, mut step, mut last) = (0.0, r.sqrt(), 0.0);
    let half = WINDOWS[4];
    let (mut sums, mut window) = ([0.0; 7], 0);
    for k in 0..2 * half {
        if k == half && jumps && kind == Kind::Informed {
            centre = seated(&mut rng, [a, FACTOR * q, r], flips, &centre.estimate())?;
        }
        state = if k < half { &before } else { &after }.propagate(&mut world, &state);
        let sample = sensor.sample(&mut world, &state);
        if kind == Kind::Delta {
            let sign = (sample[0] - a * estimate).signum();
            step *= if sign == last { JAYANT } else { 1.0 / JAYANT };
            (estimate, last) = (a * estimate + sign * step, sign);
        } else {
            let time = centre.time() + 1.0;
            let feedback = centre.advance(&mut rng, time)?.feedback(0)?;
            let flip = air.random_bool(flips);
            let report = node.report(&mut air, &sample, &feedback)?;
            let report = report.map(|bits: BitString| if flip { bits.with_flipped(0) } else { bits });
            centre.receive(&mut rng, &[Slot::new(0, feedback, Observation::from(report))])?;
            estimate = centre.estimate().mean()[0];
        }
        if k >= half {
            let square = (estimate - state[0]) * (estimate - state[0]);
            sums[0] += square / half as f64;
            if k - half == WINDOWS[window] {
                window += 1;
            }
            let start = if window == 0 { 0 } else { WINDOWS[window - 1] };
            sums[1 + window] += square / (WINDOWS[window] - start) as f64;
        }
    }
    sums[6] = (centre.noise_scale() * process).ln();
    Ok(sums)
}

rows! {
    pub struct Row by "{plant} {receiver} to {to}" {
        /// Coefficient, process variance, measurement variance; "jump" if the process variance becomes nine times as large at step 1000.
        plant: String,
        receiver: &'static str => "What is known of the process variance, and what receives.",
        from: u64 => "First step of the window, counted from step 1000.",
        to: u64 => "End of the window.",
        trials: u64 => "Simulated runs.",
        error: Measured => "Root mean squared error.",
        /// Error in parts of that of the receiver that knows the process variance, over the same link.
        ratio: Measured,
        learnt: f64 => "Process variance at the end in parts of that before the jump, geometric mean.",
    }
}

pub struct SelfTuning;

impl Figure for SelfTuning {
    figure!(Parameters => Vec<Row>, "dymbo-selftuning", "Process noise from single bits", "",
        "Error of one-bit tracking in parts of the filter that knows the process variance Q: with Q nine times too small or large, with Q \
         learnt from products of neighbouring signs, with a wrong measurement variance, with inverted bits, and of adaptive delta \
         modulation (left, five plants); after Q has become nine times as large (right).");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let still = PLANTS.map(|plant| Scene(plant, false));
        let scenes: Vec<Scene> = still.into_iter().chain([Scene(PLANTS[1], true)]).collect();
        let mut rows = Vec::new();
        for scene in &scenes {
            let stream = context.stream(self.about().id).named(&scene.name());
            let every = |it: Trial| RECEIVERS.iter().map(|of| one_run(scene, of, p, it.stream)).collect();
            let runs: Vec<Vec<[f64; 7]>> = context.trials(stream, p.trials, every)?;
            let moments = |receiver: usize, of: usize| runs.iter().map(|run| run[receiver][of]).collect::<Moments>();
            for (i, (receiver, .., inverted)) in RECEIVERS.iter().enumerate() {
                let windows = if scene.1 { 1..6 } else { 0..1 };
                let knows = if *inverted { 8 } else { 0 };
                for of in windows {
                    let (own, known) = (moments(i, of), moments(knows, of).mean());
                    // Runs are paired: the error of the ratio is that of the difference.
                    let differences = runs.iter().map(|run| run[i][of] - run[knows][of]);
                    let spread = differences.collect::<Moments>().standard_error();
                    let ratio = (own.mean() / known).sqrt();
                    rows.push(Row {
                        plant: scene.name(),
                        receiver,
                        from: if of < 2 { 0 } else { WINDOWS[of - 2] },
                        to: WINDOWS[of.wrapping_sub(1).min(4)],
                        trials: p.trials,
                        error: Measured::root_mean(&own),
                        ratio: Measured::new(ratio, spread / (2.0 * known * ratio)),
                        learnt: moments(i, 6).mean().exp(),
                    });
                }
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let ratio = |plant: &str, receiver: &str| find(rows, &format!("{plant} {receiver} to 1000")).map(|r| r.ratio);
        let what =
            "learning Q costs what the specification found from either side, to .02, and after a jump less than 10 %";
        here.no_more().keyed("ratio-most", what, rows, |r| r.ratio);
        for plant in PLANTS {
            let plant = Scene(plant, false).name();
            let what = format!("{plant}: learning beats the filter whose Q is nine times too small");
            let gain = minus(ratio(&plant, "Q / 9"), ratio(&plant, "Q learnt from Q / 9"));
            here.above(format!("pays-{plant}"), what, gain, 0.0);
        }
        let fixed = ratio(&Scene(PLANTS[1], true).name(), "Q right, not learnt").map(|r| r.value);
        here.above("jump-fixed", "a jump is not followed without learning", fixed, 1.3);
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        // All but those that need not learn.
        let shown = RECEIVERS.iter().filter(|(_, kind, process, ..)| match kind {
            Kind::Fixed => *process != 1.0,
            kind => *kind != Kind::Informed,
        });
        let names = PLANTS.map(|plant| Scene(plant, false).name());
        let place = |r: &Row| names.iter().position(|name| *name == r.plant).unwrap_or(0) as f64;
        let y = || Axis::log("error over that of knowing Q");
        let mut still = Panel::new("a, Q, r", Axis::categories("", names.clone()), y());
        for (i, (name, ..)) in shown.enumerate() {
            let marks = rows.iter().filter(|r| r.receiver == *name && names.contains(&r.plant));
            let shift = 0.09 * (i as f64 - 3.5);
            let marker = [Marker::Cross, Marker::Circle][usize::from(name.contains("learnt"))];
            still = still.with(Layer::measured(*name, marks, |r| (place(r) + shift, r.ratio)).styled(i, marker));
        }
        let mut jump = Panel::new("Q jumps to 9 Q", Axis::log("steps since the jump"), y());
        for (i, name) in [
            "Q right, not learnt",
            "Q learnt from Q / 9",
            "Q learnt from 9 Q",
            "adaptive delta modulation",
        ]
        .iter()
        .enumerate()
        {
            let marks = rows.iter().filter(|r| r.receiver == *name && r.plant.ends_with("jump"));
            let marks: Vec<_> = marks.map(|r| (r.to as f64, r.ratio)).collect();
            jump = jump.with_all(Layer::curve(*name, i, marks));
        }
        Plot::grid(2, vec![still, jump])
    }
}
