//! Figures 4.2 to 4.5: how alternating maximisation proceeds. Figures 4.2 and 4.3 (clean channel), 4.4 and 4.5 (binary symmetric
//! channels) show two columns of the same run; each judges its own.

use super::common::{MI, MSE, lloyd_system, outer, over_bsc, scene};
use crate::prelude::*;
use fewbits_baselines::quantizer_design as baselines;
use fewbits_quantizer_design::System;
use std::f64::consts::LN_2;

parameters! {
    pub struct Parameters {
        steps: usize [1..=1000] = 15 => "Steps of each stage.",
        #[serde(default, skip_serializing_if = "Option::is_none")]
        crossovers: Option<Vec<f64>> [0.0..=0.06; 1..=8] = None => "Crossover probabilities of the words' bits, natural words, increasing.",
        noise_sd: f64 [1e-2..=1e2] = 1.0 => "Noise standard deviation of both sensors, in prior standard deviations.",
    }
}

impl Parameters {
    /// Those of a clean channel, unless there are others.
    fn crossovers(&self) -> &[f64] {
        self.crossovers.as_deref().unwrap_or(&[0.0])
    }
}

rows! {
    #[derive(Default)]
    pub struct Rows {
        chain: Vec<Step> => "Sensor by sensor.",
        cyclic: Vec<Step> => "One step of each sensor in turn.",
    }

    struct Step by "step {iteration}" {
        crossover: f64 => "Crossover probability.",
        iteration: usize => "Steps so far.",
        stage: usize => "Sensor being designed.",
        iter_in_stage: usize => "Steps in this stage.",
        mi_x_z1_nats: f64 ["nat"] => "Information in sensor 1's symbol.",
        mi_x_z1z2_nats: f64 ["nat"] => "Information in both symbols.",
        mi_x_z1_bits: f64 ["bit"] => "Information in sensor 1's symbol.",
        mi_x_z1z2_bits: f64 ["bit"] => "Information in both symbols.",
        mse: f64 => "Squared error from both symbols, in prior variances.",
        gamma1_outer: f64 => "Outer breakpoint of sensor 1.",
        gamma2_outer: f64 => "Outer breakpoint of sensor 2.",
    }
}

fn step(crossover: f64, [iteration, stage, iter_in_stage]: [usize; 3], both: &System) -> Result<Step, Error> {
    let (one, two) = (both.subset(&[0])?.value(MI)?, both.value(MI)?);
    Ok(Step {
        crossover,
        iteration,
        stage,
        iter_in_stage,
        mi_x_z1_nats: one,
        mi_x_z1z2_nats: two,
        mi_x_z1_bits: one / LN_2,
        mi_x_z1z2_bits: two / LN_2,
        mse: both.value(MSE)?,
        gamma1_outer: outer(both, 0),
        gamma2_outer: outer(both, 1),
    })
}

/// A column as a figure draws it, and its name there.
type Column = (fn(&Step) -> f64, &'static str);

/// Label and points of a curve.
type Curve = (String, Vec<(f64, f64)>);

/// One of Figures 4.2 to 4.5: its columns, and what it claims of them.
pub struct Iterations {
    about: About,
    crossovers: Option<&'static [f64]>,
    axis: &'static str,
    columns: &'static [Column],
    /// Claims that hold everywhere, and those about the publication's setting.
    judge: fn(&Parameters, &Rows, &Claims, &Claims),
}

const INFORMATION: &str = "mutual information / bits";
const ERROR: &str = "mean squared error / prior variances";
/// The channels of Figures 4.4 and 4.5.
const CHANNELS: Option<&[f64]> = Some(&[0.0, 0.001, 0.01, 0.05]);

pub static FIGURE42: Iterations = Iterations {
    about: About::of("mi-fig4-2", "Information over iterations, clean channel", "thesis, Figure 4.2")
        .showing("Mutual information rises in two steps, one per sensor, to a plateau each."),
    crossovers: None,
    axis: INFORMATION,
    columns: &[(|r| r.mi_x_z1_bits, "sensor 1"), (|r| r.mi_x_z1z2_bits, "both sensors")],
    judge: |_, rows, claims, here| {
        information_rises(rows, claims);
        // The prior has variance one, so that its entropy is ln(2 pi e) / 2.
        let entropy = 0.5 * (std::f64::consts::TAU * std::f64::consts::E).ln();
        let objective = rows.chain.last().map(|r| r.mi_x_z1z2_nats - entropy);
        let what = "the printed objective E ln p(x given z) is negative (erratum mi-1)";
        here.near("printed-objective", what, objective, -0.944, 5e-4);
    },
};

pub static FIGURE43: Iterations = Iterations {
    about: About::of("mi-fig4-3", "Squared error over iterations, clean channel", "thesis, Figure 4.3")
        .showing("The squared error falls while the information rises, though it is not what is optimised."),
    crossovers: None,
    axis: ERROR,
    columns: &[(|r| r.mse, "both sensors")],
    judge: |_, rows, _, here| error_falls(rows, here),
};

pub static FIGURE44: Iterations = Iterations {
    about: About::of("mi-fig4-4", "Information over iterations, noisy channels", "thesis, Figure 4.4")
        .showing("Joint information at four crossovers, natural words. It rises for the better channels; at 0.05 the first stage \
                  lowers it, and the greedy result is below its start."),
    crossovers: CHANNELS,
    axis: INFORMATION,
    columns: &[(|r| r.mi_x_z1z2_bits, "")],
    judge: |p, rows, claims, here| {
        information_rises(rows, claims);
        let what = "the smaller the crossover, the higher the information, at every step";
        here.all("ordered", what, pairs(&rows.chain), |(a, b)| a.mi_x_z1z2_nats > b.mi_x_z1z2_nats);
        let worst: Vec<&Step> = select(&rows.chain, |r| r.crossover == 0.05).collect();
        let gain = |k: usize| minus(worst.get(k).map(|r| r.mi_x_z1z2_nats), worst.first().map(|r| r.mi_x_z1z2_nats));
        let what = "at 0.05 the joint information falls in stage 1, which designs for sensor 1 alone (erratum mi-15)";
        here.below("not-monotone", what, gain(p.steps), 0.0);
        let what = "what the greedy design gains on the Lloyd-Max start: it loses";
        claims.references("greedy-loss", what, [gain(2 * p.steps)], |gain| ("0.05".to_owned(), gain));
    },
};

pub static FIGURE45: Iterations = Iterations {
    about: About::of("mi-fig4-5", "Squared error over iterations, noisy channels", "thesis, Figure 4.5")
        .showing("Squared error at four crossovers, natural words. It falls at every step, on every channel."),
    crossovers: CHANNELS,
    axis: ERROR,
    columns: &[(|r| r.mse, "")],
    judge: |_, rows, _, here| {
        error_falls(rows, here);
        let what = "the smaller the crossover, the lower the error, at every step";
        here.all("ordered", what, pairs(&rows.chain), |(a, b)| a.mse < b.mse);
    },
};

/// Neighbouring rows of one channel.
fn neighbours(rows: &[Step]) -> impl Iterator<Item = (&Step, &Step)> {
    let pairs = rows.windows(2).map(|w| (&w[0], &w[1]));
    pairs.filter(|(a, b)| a.crossover == b.crossover)
}

/// Rows of the same step on two channels of which the first is the better.
fn pairs(rows: &[Step]) -> impl Iterator<Item = (&Step, &Step)> {
    let pairs = rows.iter().flat_map(|a| rows.iter().map(move |b| (a, b)));
    pairs.filter(|(a, b)| a.iteration == b.iteration && a.crossover < b.crossover)
}

/// Rounding that does not count as a fall.
const ROUNDING: f64 = 1e-13;

fn information_rises(rows: &Rows, claims: &Claims) {
    claims.all("stage-criterion", "each stage's own information never falls", neighbours(&rows.chain), |(a, b)| {
        let own = |r: &Step| if b.stage == 1 { r.mi_x_z1_nats } else { r.mi_x_z1z2_nats };
        own(b) >= own(a) - ROUNDING
    });
    let what = "alternating single steps never lower the joint information";
    claims.all("cyclic", what, neighbours(&rows.cyclic), |(a, b)| b.mi_x_z1z2_nats >= a.mi_x_z1z2_nats - ROUNDING);
}

fn error_falls(rows: &Rows, here: &Claims) {
    let what = "the squared error never rises";
    here.all("error-falls", what, neighbours(&rows.chain), |(a, b)| b.mse <= a.mse + ROUNDING);
}

impl Figure for Iterations {
    figure!(Parameters => Rows, about);

    fn defaults(&self) -> Parameters {
        Parameters {
            crossovers: self.crossovers.map(<[f64]>::to_vec),
            ..Parameters::default()
        }
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let steps = p.steps;
        let mut rows = Rows::default();
        for &crossover in p.crossovers() {
            context.check()?;
            let start = lloyd_system(&scene(&[p.noise_sd; 2], 0.0)?, 4, |_| 1.0)?;
            let start = over_bsc(&start, &[0, 1, 2, 3], crossover)?;
            let (mut chain, mut cyclic) = (start.clone(), start);
            rows.chain.push(step(crossover, [0, 1, 0], &chain)?);
            rows.cyclic.push(step(crossover, [0, 1, 0], &cyclic)?);
            for k in 1..=2 * steps {
                let sensor = usize::from(k > steps);
                let quantizer = match sensor {
                    0 => baselines::alternating_step(&chain.subset(&[0])?, 0, MI)?,
                    _ => baselines::alternating_step(&chain, sensor, MI)?,
                };
                chain = chain.with_quantizer(sensor, quantizer)?;
                let row = step(crossover, [k, sensor + 1, k - sensor * steps], &chain)?;
                rows.chain.push(row);
                let sensor = (k - 1) % 2;
                cyclic = cyclic.with_quantizer(sensor, baselines::alternating_step(&cyclic, sensor, MI)?)?;
                let row = step(crossover, [k, sensor + 1, k.div_ceil(2)], &cyclic)?;
                rows.cyclic.push(row);
            }
        }
        Ok(rows)
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        (self.judge)(p, rows, claims, &claims.at_defaults());
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let (several, edge) = (p.crossovers().len() > 1, p.steps as f64);
        // Label, points and place in the palette of each curve.
        let all = p.crossovers().iter().flat_map(|crossover| {
            self.columns.iter().map(move |(column, name)| {
                let own = select(&rows.chain, |r| r.crossover == *crossover);
                let label = if several {
                    format!("crossover {crossover}")
                } else {
                    (*name).to_owned()
                };
                (label, points(own, |r| (r.iteration as f64, column(r))))
            })
        });
        let all: Vec<_> = all.enumerate().collect();
        let panel = |title: String, drawn: &[(usize, Curve)]| {
            let heights = drawn.iter().flat_map(|(_, (_, curve))| curve).map(|p| p.1);
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
            let divider = Layer::dashed("stage 2 begins", vec![(edge, low), (edge, high)]).coloured(6);
            let curve = |(i, (label, curve)): &(usize, Curve)| Layer::marked_line(label, *i, curve.clone());
            Panel::linear(title, "iteration", self.axis)
                .with_all(drawn.iter().flat_map(curve))
                .with(divider)
        };
        let mut panels = vec![panel(self.about.title.to_owned(), &all)];
        if let (Some(worst), true) = (p.crossovers().last(), several) {
            // On the common scale the worst channel's curve looks flat.
            panels.push(panel(format!("Crossover {worst} alone"), &all[all.len() - 1..]));
        }
        Plot::grid(2, panels)
    }
}
