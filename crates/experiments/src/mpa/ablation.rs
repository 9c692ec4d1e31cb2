//! `mpa-ablation`: improved message passing with one erratum put back at a time.

use super::scores::{self, Row, mse};
use super::world::{Method, Point};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::{
    DynamicsWeight, IntervalRule, KernelRule, MessagePassing, ProductSampler, Ring, RingWeight, Velocity,
};

parameters! {
    pub struct Parameters {
        particles: usize [3..=1000] = 40 => "Particles.",
        trials: u64 [2..=100_000] = 60 => quick 4 => "Trajectories.",
    }
}

pub struct Ablation;

/// The variants by name.
fn variants(n: usize) -> Result<[(&'static str, MessagePassing, IntervalRule); 13], Error> {
    let base = MessagePassing::improved(n)?;
    let with = |change: fn(&mut MessagePassing)| {
        let mut changed = base;
        change(&mut changed);
        changed
    };
    let correct = IntervalRule::Correct;
    Ok([
        ("1 sweep", with(|m| m.sampler = ProductSampler::Gibbs { sweeps: 1 }), correct),
        ("2 sweeps", with(|m| m.sampler = ProductSampler::Gibbs { sweeps: 2 }), correct),
        ("improved", base, correct),
        ("20 sweeps", with(|m| m.sampler = ProductSampler::Gibbs { sweeps: 20 }), correct),
        ("importance", with(|m| m.sampler = ProductSampler::MixtureImportance { draws: 300 }), correct),
        ("uniform ring", with(|m| m.ring_weight = RingWeight::Uniform), correct),
        ("ring ratio", with(|m| m.ring_weight = RingWeight::PrintedRatio), correct),
        ("dynamics ratio", with(|m| m.dynamics_weight = DynamicsWeight::PrintedRatio), correct),
        ("printed kernel", with(|m| m.kernel = KernelRule::Printed), correct),
        ("transfer", with(|m| m.velocity = Velocity::Transfer), correct),
        ("full ring", with(|m| m.ring = Ring::Full), correct),
        ("published", MessagePassing::published(n)?, correct),
        ("printed interval", base, IntervalRule::Printed),
    ])
}

impl Figure for Ablation {
    figure!(Parameters => Vec<Row>, "mpa-ablation", "Which erratum costs what", "",
        "Improved message passing with one printed choice put back at a time, 50 and 30 dB, four levels. Full rings, the \
         printed interval and transferred velocities cost most."; semilog(scores::MSE));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for snr in [50.0, 30.0] {
            for (name, messages, interval) in variants(p.particles)? {
                let mut point = Point::published(snr, 4)?;
                (point.name, point.interval) = (format!("{snr}dB"), interval);
                let mut own = scores::rows(context, &point, &[(Method::Messages(messages), p.trials)])?;
                own.iter_mut().for_each(|row| row.method = name.to_owned());
                rows.extend(own);
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, t: &Vec<Row>, claims: &mut Claims) {
        let paper = claims.at_defaults().at_full_trials();
        let ratio = |name: &str| over(mse(t, &format!("50dB {name}")), mse(t, "50dB improved"));
        let what = "transferring velocities costs half as much again (erratum mpa-7)";
        paper.above("transfer", what, ratio("transfer"), 1.25);
        paper.above("full-ring", "a full ring loses what its kernel cannot hold", ratio("full ring"), 4.0);
        paper.above("interval", "the printed interval costs a factor (erratum mpa-1)", ratio("printed interval"), 1.8);
        let what = "ratio weights of the dynamics only add noise (erratum mpa-4, erratum mpa-16)";
        paper.above("ratios", what, ratio("dynamics ratio"), 1.05);
        paper.near("radius", "the missing radius costs little here (erratum mpa-3)", ratio("uniform ring"), 1.04, 0.12);
    }
}
