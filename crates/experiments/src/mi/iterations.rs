//! Figures 4.2 to 4.5: how alternating maximisation proceeds. Figures 4.2 and 4.3 (clean channel), 4.4 and 4.5 (binary symmetric
//! channels) show two columns of the same run; each judges its own.

use super::common::{MI, MSE, bsc, lloyd_system, scene};
use crate::prelude::*;
use fewbits_quantizer_design::{System, published};
use std::f64::consts::LN_2;

parameters! {
    /// Settings of Figures 4.2 to 4.5.
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

fn first_alone(both: &System) -> Result<System, Error> {
    let group = both.groups()[0].clone();
    Ok(System::new(both.model().subset(&[0])?, vec![group])?)
}

fn step(crossover: f64, [iteration, stage, iter_in_stage]: [usize; 3], both: &System) -> Result<Step, Error> {
    let (one, two) = (first_alone(both)?.value(MI)?, both.value(MI)?);
    let outer = |g: usize| {
        both.groups()[g]
            .quantizer()
            .breakpoints()
            .last()
            .copied()
            .unwrap_or_default()
    };
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
        gamma1_outer: outer(0),
        gamma2_outer: outer(1),
    })
}

/// Which column a figure shows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shows {
    Information,
    Error,
}

/// One of Figures 4.2 to 4.5.
pub struct Iterations {
    about: About,
    shows: Shows,
    crossovers: Option<&'static [f64]>,
}

/// The channels of Figures 4.4 and 4.5.
const CHANNELS: Option<&[f64]> = Some(&[0.0, 0.001, 0.01, 0.05]);

/// Figure 4.2.
pub static FIGURE42: Iterations = Iterations {
    about: About::of("mi-fig4-2", "Information over iterations, clean channel", "thesis, Figure 4.2")
        .showing("Mutual information rises in two steps, one per sensor, to a plateau each."),
    shows: Shows::Information,
    crossovers: None,
};

/// Figure 4.3.
pub static FIGURE43: Iterations = Iterations {
    about: About::of("mi-fig4-3", "Squared error over iterations, clean channel", "thesis, Figure 4.3")
        .showing("The squared error falls while the information rises, though it is not what is optimised."),
    shows: Shows::Error,
    crossovers: None,
};

/// Figure 4.4.
pub static FIGURE44: Iterations = Iterations {
    about: About::of("mi-fig4-4", "Information over iterations, noisy channels", "thesis, Figure 4.4")
        .showing("Joint information at four crossovers, natural words. It rises for the better channels; at 0.05 the first stage \
                  lowers it, and the greedy result is below its start."),
    shows: Shows::Information,
    crossovers: CHANNELS,
};

/// Figure 4.5.
pub static FIGURE45: Iterations = Iterations {
    about: About::of("mi-fig4-5", "Squared error over iterations, noisy channels", "thesis, Figure 4.5")
        .showing("Squared error at four crossovers, natural words. It falls at every step, on every channel."),
    shows: Shows::Error,
    crossovers: CHANNELS,
};

/// Neighbouring rows of one channel.
fn neighbours(rows: &[Step]) -> impl Iterator<Item = (&Step, &Step)> {
    rows.windows(2)
        .map(|w| (&w[0], &w[1]))
        .filter(|(a, b)| a.crossover == b.crossover)
}

/// Rows of the same step on two channels of which the first is the better.
fn pairs(rows: &[Step]) -> impl Iterator<Item = (&Step, &Step)> {
    rows.iter()
        .flat_map(|a| rows.iter().map(move |b| (a, b)))
        .filter(|(a, b)| a.iteration == b.iteration && a.crossover < b.crossover)
}

/// Rounding that does not count as a fall.
const ROUNDING: f64 = 1e-13;

impl Figure for Iterations {
    type Parameters = Parameters;
    type Tables = Rows;

    fn about(&self) -> About {
        self.about
    }

    fn defaults(&self) -> Parameters {
        Parameters {
            crossovers: self.crossovers.map(<[f64]>::to_vec),
            ..Parameters::default()
        }
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let (steps, crossovers, noise_sd) = (p.steps, p.crossovers(), p.noise_sd);
        let (mut chain, mut cyclic) = (Vec::new(), Vec::new());
        for &crossover in crossovers {
            context.check()?;
            let channel = bsc(&[0, 1, 2, 3], crossover)?;
            let start = lloyd_system(&scene(&[noise_sd; 2], 0.0)?, 4, |_| 1.0)?.with_channels(vec![channel; 2])?;
            let mut both = start.clone();
            chain.push(step(crossover, [0, 1, 0], &both)?);
            for k in 1..=2 * steps {
                let stage = if k <= steps { 1 } else { 2 };
                let quantizer = if stage == 1 {
                    published::alternating_step(&first_alone(&both)?, 0, MI)?
                } else {
                    published::alternating_step(&both, 1, MI)?
                };
                both = both.with_quantizer(stage - 1, quantizer)?;
                chain.push(step(crossover, [k, stage, k - (stage - 1) * steps], &both)?);
            }
            let mut both = start;
            cyclic.push(step(crossover, [0, 1, 0], &both)?);
            for k in 1..=2 * steps {
                let sensor = (k - 1) % 2;
                both = both.with_quantizer(sensor, published::alternating_step(&both, sensor, MI)?)?;
                cyclic.push(step(crossover, [k, sensor + 1, k.div_ceil(2)], &both)?);
            }
        }
        Ok(Rows { chain, cyclic })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let (steps, crossovers) = (p.steps, p.crossovers());
        let clean = || rows.chain.iter().filter(|_| crossovers == [0.0]);
        match self.shows {
            Shows::Information => {
                let what = "each stage's own information never falls";
                claims.all("stage-criterion", what, neighbours(&rows.chain), |(a, b)| {
                    let rise = if b.stage == 1 {
                        b.mi_x_z1_nats - a.mi_x_z1_nats
                    } else {
                        b.mi_x_z1z2_nats - a.mi_x_z1z2_nats
                    };
                    rise >= -ROUNDING
                });
                let what = "alternating single steps never lower the joint information";
                claims.all("cyclic", what, neighbours(&rows.cyclic), |(a, b)| {
                    b.mi_x_z1z2_nats >= a.mi_x_z1z2_nats - ROUNDING
                });
            }
            Shows::Error => {
                let what = "the squared error never rises";
                here.all("error-falls", what, neighbours(&rows.chain), |(a, b)| b.mse <= a.mse + ROUNDING);
            }
        }
        match self.about.id {
            "mi-fig4-2" => {
                claims.keyed("mi_x_z1_nats", "information of sensor 1", clean(), |r| r.mi_x_z1_nats);
                claims.keyed("mi_x_z1z2_nats", "information of both", clean(), |r| r.mi_x_z1z2_nats);
                // The prior has variance one, so that its entropy is ln(2 pi e) / 2.
                let entropy = 0.5 * (std::f64::consts::TAU * std::f64::consts::E).ln();
                let objective = rows.chain.last().map(|r| r.mi_x_z1z2_nats - entropy);
                let what = "the printed objective E ln p(x given z) is negative (erratum mi-1)";
                here.near("printed-objective", what, objective, -0.944, 5e-4);
            }
            "mi-fig4-3" => {
                claims.keyed("mse", "squared error", clean(), |r| r.mse);
            }
            "mi-fig4-4" => {
                let what = "the smaller the crossover, the higher the information, at every step";
                here.all("ordered", what, pairs(&rows.chain), |(a, b)| a.mi_x_z1z2_nats > b.mi_x_z1z2_nats);
                let worst: Vec<&Step> = rows.chain.iter().filter(|r| r.crossover == 0.05).collect();
                let information = |k: usize| worst.get(k).map(|r| r.mi_x_z1z2_nats);
                let what =
                    "at 0.05 the joint information falls in stage 1, which designs for sensor 1 alone (erratum mi-15)";
                let fall = minus(information(steps), information(0));
                here.below("not-monotone", what, fall, 0.0);
                let what = "what the greedy design gains on the Lloyd-Max start: it loses";
                let gain = minus(information(2 * steps), information(0));
                claims.references("greedy-loss", what, [gain], |gain| ("0.05".to_owned(), gain));
            }
            _ => {
                let what = "the smaller the crossover, the lower the error, at every step";
                here.all("ordered", what, pairs(&rows.chain), |(a, b)| a.mse < b.mse);
            }
        }
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let (steps, crossovers) = (p.steps, p.crossovers());
        let several = crossovers.len() > 1;
        type Column = fn(&Step) -> f64;
        let (axis, columns): (&str, &[(Column, &str)]) = match (self.shows, several) {
            (Shows::Information, true) => ("mutual information / bits", &[(|r| r.mi_x_z1z2_bits, "")]),
            (Shows::Information, false) => (
                "mutual information / bits",
                &[(|r| r.mi_x_z1_bits, "sensor 1"), (|r| r.mi_x_z1z2_bits, "both sensors")],
            ),
            (Shows::Error, _) => ("mean squared error / prior variances", &[(|r| r.mse, "both sensors")]),
        };
        let curve = |crossover: f64, column: Column| {
            points(rows.chain.iter().filter(|r| r.crossover == crossover), |r| (r.iteration as f64, column(r)))
        };
        type Curve = (String, Vec<(f64, f64)>, usize);
        let panel = |title: String, drawn: Vec<Curve>| {
            let heights = drawn.iter().flat_map(|(_, curve, _)| curve).map(|p| p.1);
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
            let edge = steps as f64;
            let divider = Layer::dashed("stage 2 begins", vec![(edge, low), (edge, high)]).coloured(6);
            let curves = drawn.into_iter().flat_map(|(label, curve, i)| {
                [
                    Layer::line("", curve.clone()).coloured(i),
                    Layer::points(label, curve).coloured(i),
                ]
            });
            Panel::linear(title, "iteration", axis).with_all(curves).with(divider)
        };
        let label = |crossover: f64, name: &str| {
            if several {
                format!("crossover {crossover}")
            } else {
                name.to_owned()
            }
        };
        let all = crossovers
            .iter()
            .flat_map(|c| columns.iter().map(move |(column, name)| (*c, *column, *name)));
        let all = all
            .enumerate()
            .map(|(i, (c, column, name))| (label(c, name), curve(c, column), i))
            .collect();
        let mut panels = vec![panel(self.about.title.to_owned(), all)];
        if let (Some(worst), true) = (crossovers.last(), several) {
            // On the common scale the worst channel's curve looks flat.
            let alone = vec![(label(*worst, ""), curve(*worst, columns[0].0), crossovers.len() - 1)];
            panels.push(panel(format!("Crossover {worst} alone"), alone));
        }
        Plot::grid(2, panels)
    }
}
