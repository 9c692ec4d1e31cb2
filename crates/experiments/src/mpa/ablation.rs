//! `mpa-ablation`: improved message passing with one erratum put back at a time.

use super::scores::{Row, agree, ladder, mse};
use super::sweeps::SPEED;
use super::world::{Field, Method, Point, compare};
use crate::prelude::*;
use fewbits_pf_mpa::published::{DynamicsWeight, KernelRule, MessagePassing, ProductSampler, Ring, RingWeight};
use fewbits_pf_mpa::{IntervalRule, Velocity};

parameters! {
    pub struct Parameters {
        particles: usize [3..=1000] = 40 => "Particles.",
        trials: u64 [2..=100_000] = 200 => quick 4 => "Trajectories.",
    }
}

pub struct Ablation;

/// The variants by name.
fn variants(n: usize) -> Result<Vec<(&'static str, MessagePassing, IntervalRule)>, Error> {
    let base = MessagePassing::improved(n)?;
    let sweeps = |sweeps| MessagePassing {
        sampler: ProductSampler::Gibbs { sweeps },
        ..base
    };
    let correct = [
        ("1 sweep", sweeps(1)),
        ("2 sweeps", sweeps(2)),
        ("improved", base),
        ("20 sweeps", sweeps(20)),
        (
            "importance",
            MessagePassing {
                sampler: ProductSampler::MixtureImportance { draws: 300 },
                ..base
            },
        ),
        (
            "uniform ring",
            MessagePassing {
                ring_weight: RingWeight::Uniform,
                ..base
            },
        ),
        (
            "ring ratio",
            MessagePassing {
                ring_weight: RingWeight::PrintedRatio,
                ..base
            },
        ),
        (
            "dynamics ratio",
            MessagePassing {
                dynamics_weight: DynamicsWeight::PrintedRatio,
                ..base
            },
        ),
        (
            "printed kernel",
            MessagePassing {
                kernel: KernelRule::Printed,
                ..base
            },
        ),
        (
            "transfer",
            MessagePassing {
                velocity: Velocity::Transfer,
                ..base
            },
        ),
        (
            "full ring",
            MessagePassing {
                ring: Ring::Full,
                ..base
            },
        ),
        ("published", MessagePassing::published(n)?),
    ];
    let mut all: Vec<_> = correct.map(|(name, m)| (name, m, IntervalRule::Correct)).to_vec();
    all.push(("printed interval", base, IntervalRule::Printed));
    Ok(all)
}

impl Figure for Ablation {
    figure!(Parameters => Vec<Row>, "mpa-ablation", "Which erratum costs what", "",
        "Improved message passing with one printed choice put back at a time, 50 and 30 dB, four levels. Full rings, the \
         printed interval and transferred velocities cost most.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for snr in [50.0, 30.0] {
            for (name, messages, interval) in variants(p.particles)? {
                let point = Point {
                    interval,
                    ..Point::published(snr, 4, SPEED)?
                };
                let method = Method::Messages(messages);
                let score = compare(context, &point, Field::Confined, &[(method, p.trials)])?.remove(0);
                rows.push(Row {
                    point: format!("{snr}dB"),
                    snr_db: snr,
                    levels: 4,
                    method: name.to_owned(),
                    family: method.family(),
                    size: method.size(),
                    score,
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, t: &Vec<Row>, claims: &mut Claims) {
        let paper = claims.at_defaults().at_full_trials();
        agree(claims, t, "", true);
        let ratio = |name: &str| Some(mse(t, "50dB", name)? / mse(t, "50dB", "improved")?);
        paper.above(
            "transfer",
            "transferring velocities costs half as much again (erratum mpa-7)",
            ratio("transfer"),
            1.25,
        );
        paper.above("full-ring", "a full ring loses what its kernel cannot hold", ratio("full ring"), 4.0);
        paper.above("interval", "the printed interval costs a factor (erratum mpa-1)", ratio("printed interval"), 1.8);
        paper.above(
            "ratios",
            "ratio weights of the dynamics only add noise (erratum mpa-4, erratum mpa-16)",
            ratio("dynamics ratio"),
            1.05,
        );
        paper.near("radius", "the missing radius costs little here (erratum mpa-3)", ratio("uniform ring"), 1.04, 0.12);
    }

    fn plot(&self, _: &Parameters, t: &Vec<Row>) -> Plot {
        let panel = |snr: f64| ladder(&format!("{snr} dB"), t.iter().filter(|r| r.snr_db == snr));
        Plot::grid(2, vec![panel(50.0), panel(30.0)])
    }
}
