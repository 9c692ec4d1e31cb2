//! Figures 4.2 to 4.5: how alternating maximisation proceeds.

use super::common::{MI, MSE, bsc, exact, lloyd_system, scene};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, claim, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_quantizer_design::{System, design};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_2;

/// Settings of Figures 4.2 and 4.3 (clean channel) and 4.4 and 4.5 (binary symmetric channels).
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Steps of each stage.
    pub steps: usize,
    /// Crossover probabilities of the words' bits, natural words, increasing.
    pub crossovers: Vec<f64>,
    /// Noise standard deviation of both sensors, in prior standard deviations.
    pub noise_sd: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            steps: 15,
            crossovers: vec![0.0],
            noise_sd: 1.0,
        }
    }
}

/// Parameters of the figures over several channels.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Channels(Parameters);

impl Default for Channels {
    fn default() -> Self {
        Self(Parameters {
            crossovers: vec![0.0, 0.001, 0.01, 0.05],
            ..Parameters::default()
        })
    }
}

/// Start, end of stage 1 and end of stage 2 at a crossover: I(X;T1), I(X;T1,T2), squared error.
const CLEAN: [[f64; 3]; 3] = [
    [0.284_908_87, 0.464_520_38, 0.398_485_11],
    [0.291_968_37, 0.469_737_02, 0.393_262_63],
    [0.291_968_37, 0.474_686_62, 0.388_497_05],
];

fn first_alone(both: &System) -> Result<System, Error> {
    let group = both.groups()[0].clone();
    Ok(System::new(both.scene().subset(&[0])?, vec![group])?)
}

fn push(table: &mut Table, crossover: f64, at: [usize; 3], both: &System) -> Result<(), Error> {
    let (one, two) = (first_alone(both)?.value(MI)?, both.value(MI)?);
    let outer = |g: usize| both.groups()[g].quantizer().breakpoints().last().copied();
    table.push(row![
        crossover,
        at[0],
        at[1],
        at[2],
        one,
        two,
        one / LN_2,
        two / LN_2,
        both.value(MSE)?,
        outer(0),
        outer(1)
    ])
}

fn table() -> Table {
    Table::new([
        column("crossover", "", "crossover probability"),
        column("iteration", "", "steps so far"),
        column("stage", "", "sensor being designed"),
        column("iter_in_stage", "", "steps in this stage"),
        column("mi_x_z1_nats", "nat", "information in sensor 1's symbol"),
        column("mi_x_z1z2_nats", "nat", "information in both symbols"),
        column("mi_x_z1_bits", "bit", "the same in bits"),
        column("mi_x_z1z2_bits", "bit", "the same in bits"),
        column("mse", "", "squared error from both symbols, in prior variances"),
        column("gamma1_outer", "", "outer breakpoint of sensor 1"),
        column("gamma2_outer", "", "outer breakpoint of sensor 2"),
    ])
}

fn series(p: &Parameters) -> Result<Tables, Error> {
    let (mut chain, mut cyclic) = (table(), table());
    for &crossover in &p.crossovers {
        let channel = bsc(&[0, 1, 2, 3], crossover)?;
        let start = lloyd_system(&scene(&[p.noise_sd; 2], 0.0)?, 4, |_| 1.0)?.with_channels(vec![channel; 2])?;
        let mut both = start.clone();
        push(&mut chain, crossover, [0, 1, 0], &both)?;
        for k in 1..=2 * p.steps {
            let stage = if k <= p.steps { 1 } else { 2 };
            let quantizer = if stage == 1 {
                design::alternating_step(&first_alone(&both)?, 0, MI)?
            } else {
                design::alternating_step(&both, 1, MI)?
            };
            both = both.with_quantizer(stage - 1, quantizer)?;
            push(&mut chain, crossover, [k, stage, k - (stage - 1) * p.steps], &both)?;
        }
        let mut both = start;
        push(&mut cyclic, crossover, [0, 1, 0], &both)?;
        for k in 1..=2 * p.steps {
            let sensor = (k - 1) % 2;
            both = both.with_quantizer(sensor, design::alternating_step(&both, sensor, MI)?)?;
            push(&mut cyclic, crossover, [k, sensor + 1, k.div_ceil(2)], &both)?;
        }
    }
    Ok(Tables::from(chain).with("cyclic", cyclic))
}

/// Neighbours that fall by more than rounding.
fn falls(values: &[f64]) -> usize {
    values.windows(2).filter(|w| w[1] < w[0] - 1e-13).count()
}

fn claims(p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
    let (mut stage_falls, mut error_rises, mut cyclic_falls) = (0, 0, 0);
    let mut curves = Vec::new();
    for &crossover in &p.crossovers {
        let rows = tables.main.only("crossover", crossover)?;
        let (one, two, mse) = (rows.numbers("mi_x_z1_nats")?, rows.numbers("mi_x_z1z2_nats")?, rows.numbers("mse")?);
        stage_falls += falls(&one[..=p.steps]) + falls(&two[p.steps..]);
        error_rises += falls(&mse.iter().map(|m| -m).collect::<Vec<_>>());
        cyclic_falls += falls(
            &tables
                .named("cyclic")?
                .only("crossover", crossover)?
                .numbers("mi_x_z1z2_nats")?,
        );
        curves.push((two, mse));
    }
    let mut disordered = 0;
    for pair in curves.windows(2) {
        disordered += pair[0].0.iter().zip(&pair[1].0).filter(|(a, b)| a <= b).count();
        disordered += pair[0].1.iter().zip(&pair[1].1).filter(|(a, b)| a >= b).count();
    }
    let mut claims = vec![
        Claim::never("stage-criterion", "each stage's own information never falls", stage_falls),
        Claim::never("error-falls", "the squared error never rises", error_rises).at_defaults(),
        Claim::never("cyclic", "alternating single steps never lower the joint information", cyclic_falls),
    ];
    if p.crossovers.len() > 1 {
        let what = "the smaller the crossover, the higher the information and the lower the error, at every step";
        claims.push(Claim::never("ordered", what, disordered).at_defaults());
    }
    if p.crossovers.contains(&0.0) {
        let rows = tables.main.only("crossover", 0.0)?;
        let columns = ["mi_x_z1_nats", "mi_x_z1z2_nats", "mse"];
        for (k, known) in [0, p.steps, 2 * p.steps].into_iter().zip(CLEAN) {
            for (name, known) in columns.iter().zip(known) {
                let found = rows.numbers(name)?.get(k).copied().unwrap_or(f64::NAN);
                claims.push(exact(
                    format!("clean-{k}-{name}"),
                    format!("clean channel, step {k}: {name}"),
                    found,
                    known,
                    1e-8,
                ));
            }
        }
    }
    if p.crossovers.contains(&0.05) {
        let two = tables.main.only("crossover", 0.05)?.numbers("mi_x_z1z2_nats")?;
        let what = "at 0.05 the joint information falls in stage 1, which designs for sensor 1 alone";
        claims.push(Claim::above("not-monotone", what, falls(&two[..=p.steps]) as f64, 0.0).at_defaults());
        let end = two.last().copied().unwrap_or(f64::NAN);
        let what = "at 0.05 the greedy end is below the Lloyd-Max start";
        claims.push(exact("greedy-end", what, end - two[0], 0.366_727_70 - 0.366_758_78, 2e-8));
        claims.push(Claim::below("greedy-end-sign", what, end - two[0], 0.0).at_defaults());
    }
    Ok(claims)
}

fn panel(p: &Parameters, tables: &Tables, title: &str, columns: &[(&str, &str)], y: &str) -> Result<Plot, Error> {
    let mut panel = Panel::new(title, Axis::linear("iteration"), Axis::linear(y)).legend(Legend::Outside);
    for &crossover in &p.crossovers {
        let rows = tables.main.only("crossover", crossover)?;
        for (column, label) in columns {
            let label = if p.crossovers.len() > 1 {
                format!("{label}{crossover}")
            } else {
                (*label).to_owned()
            };
            panel = panel.with(Layer::line(label, rows.points("iteration", column)?));
        }
    }
    let edge = p.steps as f64;
    let divider = |values: Vec<f64>| {
        let (low, high) = (claim::smallest(values.iter().copied()), claim::largest(values));
        Layer::dashed("stage 2 begins", vec![(edge, low), (edge, high)])
    };
    let values = columns
        .iter()
        .map(|c| tables.main.numbers(c.0))
        .collect::<Result<Vec<_>, _>>()?
        .concat();
    let mut panels = vec![panel.with(divider(values))];
    if let (Some(worst), true) = (p.crossovers.last(), p.crossovers.len() > 1) {
        // On the common scale the worst channel's curve looks flat.
        let rows = tables.main.only("crossover", *worst)?;
        let close = Panel::new(format!("crossover {worst} alone"), Axis::linear("iteration"), Axis::linear(y));
        let column = columns[0].0;
        let close = close.with(Layer::line(column, rows.points("iteration", column)?).coloured(p.crossovers.len() - 1));
        panels.push(close.with(divider(rows.numbers(column)?)).legend(Legend::Hidden));
    }
    Ok(Plot::grid(1, panels))
}

/// Figure 4.2: information over iterations, clean channel.
pub struct Figure42;
/// Figure 4.3: squared error over iterations, clean channel.
pub struct Figure43;
/// Figure 4.4: information over iterations, binary symmetric channels.
pub struct Figure44;
/// Figure 4.5: squared error over iterations, binary symmetric channels.
pub struct Figure45;

const ONE_AND_BOTH: [(&str, &str); 2] = [("mi_x_z1_bits", "sensor 1"), ("mi_x_z1z2_bits", "both sensors")];

impl Figure for Figure42 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-fig4-2",
            title: "Information over iterations, clean channel",
            caption: "Mutual information rises in two steps, one a sensor, to a plateau each.",
            source: "thesis, Figure 4.2",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        series(p)
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        claims(p, tables)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        panel(p, tables, "information", &ONE_AND_BOTH, "mutual information, bits")
    }
}

impl Figure for Figure43 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-fig4-3",
            title: "Squared error over iterations, clean channel",
            caption: "The squared error falls while the information rises, though it is not what is optimised.",
            source: "thesis, Figure 4.3",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        series(p)
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        claims(p, tables)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        panel(p, tables, "squared error", &[("mse", "both sensors")], "mean squared error")
    }
}

impl Figure for Figure44 {
    type Parameters = Channels;

    fn about(&self) -> About {
        About {
            id: "mi-fig4-4",
            title: "Information over iterations, noisy channels",
            caption: "Joint information at four crossovers, natural words. It rises for the better channels; at 0.05 the first \
                      stage lowers it, and the greedy result is below its start.",
            source: "thesis, Figure 4.4",
        }
    }

    fn run(&self, p: &Channels, _: &Context<'_>) -> Result<Tables, Error> {
        series(&p.0)
    }

    fn claims(&self, p: &Channels, tables: &Tables) -> Result<Vec<Claim>, Error> {
        claims(&p.0, tables)
    }

    fn plot(&self, p: &Channels, tables: &Tables) -> Result<Plot, Error> {
        panel(&p.0, tables, "information", &[("mi_x_z1z2_bits", "crossover ")], "mutual information, bits")
    }
}

impl Figure for Figure45 {
    type Parameters = Channels;

    fn about(&self) -> About {
        About {
            id: "mi-fig4-5",
            title: "Squared error over iterations, noisy channels",
            caption: "Squared error at four crossovers, natural words. It falls at every step, on every channel.",
            source: "thesis, Figure 4.5",
        }
    }

    fn run(&self, p: &Channels, _: &Context<'_>) -> Result<Tables, Error> {
        series(&p.0)
    }

    fn claims(&self, p: &Channels, tables: &Tables) -> Result<Vec<Claim>, Error> {
        claims(&p.0, tables)
    }

    fn plot(&self, p: &Channels, tables: &Tables) -> Result<Plot, Error> {
        panel(&p.0, tables, "squared error", &[("mse", "crossover ")], "mean squared error")
    }
}
