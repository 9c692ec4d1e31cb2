//! The fine first message: what it brings, and the variance to start from.

use crate::prelude::*;
use fewbits_baselines::dymbo::first_message::first_message_mse;
use fewbits_dymbo::chain::first_message_transient;
use fewbits_dymbo::{RoundedSample, ScalarPlant};

parameters! {
    pub struct Parameters {
        sigma: f64 [1e-6..=1e6] = 1.0 => "Measurement noise deviation.",
        tau: Vec<f64> [1e-6..=1e6; 1..] = vec![0.25, 0.5, 1.0, 2.0, 4.0] => "Resolutions of the first message.",
        a: f64 [-1.0..=1.0] = 0.9 => "Plant coefficient.",
        gamma: Vec<f64> [1e-4..=1e3; 1..] = vec![0.5, 0.05] => "Process variances over measurement variance.",
    }
}

rows! {
    pub struct Rows {
        messages: Vec<Row> => "The first message.",
        starts: Vec<Start> => "The filter after it.",
    }

    struct Row by "{tau}" {
        tau: f64 ["unit"] as x("resolution tau") => "Resolution of the first message.",
        exact_sup: f64 ["unit^2"] as points("exact, worst state") in message => "Mean squared error at the worst state.",
        tight: f64 ["unit^2"] as line("sigma^2 + tau^2/12") in message => "Variance to start from, sigma^2 + tau^2/12.",
        printed_bound: f64 ["unit^2"] as dashed("printed bound") in message => "The paper's bound, (sigma + tau/2)^2.",
    }

    struct Start by "{start} {gamma} {n}" {
        gamma: f64 as key("gamma = {}") => "Process variance over measurement variance.",
        n: usize as x("step n") => "Step.",
        start: &'static str as key("{} start") => "Initial variance: tight or printed.",
        mse: f64 ["unit^2"] => "Exact mean squared error (erratum dymbo-7).",
        nees: f64 as line in start => "Exact error over computed variance (erratum dymbo-7).",
    }
}

pub struct FirstMessage;

impl Figure for FirstMessage {
    figure!(Parameters => Rows, "dymbo-prop2", "The fine first message", "Ribeiro and Giannakis, Proposition 2",
        "Mean squared error of the first sample rounded to a multiple of tau, at the worst place of the state: exact, \
         sigma^2 + tau^2/12, and the paper's bound (sigma + tau/2)^2. The bound is valid but loose; a filter that \
         starts from it (right) is over-cautious for several steps (erratum dymbo-7).";
        { message: loglog("mean squared error", "First message"), start: linear("exact error / computed variance", "Consistency after the start") });

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let noise = p.sigma * p.sigma;
        let row = |tau: &f64| {
            let worst = Gaussian::scalar(0.5 * tau, 0.0)?;
            Ok(Row {
                tau: *tau,
                exact_sup: first_message_mse(&RoundedSample::new(noise, *tau)?, &worst),
                tight: noise + tau * tau / 12.0,
                printed_bound: (p.sigma + 0.5 * tau).powi(2),
            })
        };
        let mut starts = Vec::new();
        for &gamma in &p.gamma {
            let plant = ScalarPlant::new(p.a, gamma * noise, noise)?;
            // Where the paper starts: a resolution of one noise deviation.
            for (start, variance) in [("tight", noise * 13.0 / 12.0), ("printed", 2.25 * noise)] {
                let steps = first_message_transient(&plant, p.sigma, variance, 12)?;
                starts.extend(steps.into_iter().enumerate().map(|(n, step)| Start {
                    gamma,
                    n,
                    start,
                    mse: step.mse,
                    nees: step.mse / step.filtered_variance,
                }));
            }
        }
        Ok(Rows {
            messages: p.tau.iter().map(row).collect::<Result<_, Error>>()?,
            starts,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let messages = &rows.messages;
        claims.all("valid", "the printed bound is valid (Minkowski)", messages, |r| r.printed_bound >= r.exact_sup);
        let one = messages.iter().find(|r| r.tau == p.sigma);
        let what = "at tau = sigma the printed bound is 2.08 times the truth (erratum dymbo-7)";
        claims.near("loose", what, one.map(|r| r.printed_bound / r.exact_sup), 2.0769, 2e-4);
        let what = "tau = sigma already costs only 8.3 % (erratum dymbo-8)";
        claims.near("cheap", what, one.map(|r| r.exact_sup / (p.sigma * p.sigma)), 1.0833, 1e-4);
    }
}
