//! KL against bits.

use super::filters::{TIMES, Truth, as_f32, over_beliefs};
use crate::prelude::*;
use fewbits_core::Message;
use fewbits_densities::{Bandwidth, KernelEstimate, Mixture};
use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};
use fewbits_mixture_codec::{Criterion, Reduction};

parameters! {
    pub struct Parameters {
        components: Vec<usize> [1..=60; 1..] = vec![1, 3, 5, 10] => "Components.",
        resolution: Vec<f64> [0.01..=1.0; 1..] = vec![0.5, 0.35, 0.25, 0.15] => "Resolutions: quantiser steps in standard deviations.",
        trials: u64 [2..=10_000] = 12 => quick 2 => "Worlds, of three beliefs each.",
    }
    cost |p| Cost::new(p.trials as f64, 1e6 * p.trials as f64);
}

rows! {
    pub struct Row by name {
        /// What is sent: coded, f32 (mixture parameters as floats), coded-kd (a cut by KL, coded), particles (f32, resampled).
        message: &'static str,
        size: usize => "Components, or particles.",
        resolution: Option<f64> => "Quantiser step in standard deviations, if coded.",
        bits: Measured ["bit"] => "Mean length.",
        kl: Measured ["nat"] => "KL from the estimate to what the receiver knows.",
    }
}

pub struct Rate;

/// Name of a message.
fn name(row: &Row) -> String {
    let resolution = row.resolution.map_or(String::new(), |r| format!("-r{r}"));
    format!("{}-{}{resolution}", row.message, row.size)
}

impl Figure for Rate {
    figure!(Parameters => Vec<Row>, "handoff-rate", "What bits buy", "our own comparison",
        "KL from the estimate to what the receiver decodes against the length of the message. Coded mixtures need a \
         seventh of the bits of their parameters as floats, and a hundredth of those of particles.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        // A message format has at most 16 resolutions of which one is chosen in the message; here both ends agree on it.
        let format = |r: &f64| WireFormat::new(Vector2::zeros(), 20.0, 1.0, &[*r]);
        let single = p.resolution.iter().map(format).collect::<Result<Vec<_>, _>>()?;
        let all = over_beliefs(context, "handoff-rate", p.trials, |estimate, stream| {
            let truth = Truth::new(estimate);
            let mut cells = Vec::new();
            let mut push = |message, size, step, bits: usize, received: &Mixture<2>| {
                let share = 1.0 / TIMES.len() as f64;
                cells.push(((message, size, step), [bits as f64 * share, truth.kl(received) * share]));
            };
            for &m in &p.components {
                let best = Reduction::default().reduce(estimate, m)?;
                let cut = Reduction::paper(Criterion::Kl).reduce(estimate, m)?;
                push("f32", m, None, 32 * (6 * best.len() - 1), &as_f32(&best)?);
                for (format, step) in single.iter().zip(&p.resolution) {
                    for (message, mixture) in [("coded", &best), ("coded-kd", &cut)] {
                        let coded = CodedMixture::new(mixture, format, 0)?;
                        push(message, m, Some(*step), coded.to_bits(format)?.bits(), coded.mixture());
                    }
                }
            }
            for n in [100, 500] {
                let mut rng = stream.named("particles").indexed(n as u64).fast_rng();
                let sample = estimate.sample_systematic(&mut rng, n)?;
                let received = Bandwidth::default().kernel(&sample)?;
                let shrunk = Bandwidth::default().shrunk(&sample, &received);
                push("particles", n, None, 64 * n, &KernelEstimate::new(shrunk, received)?.to_mixture()?);
            }
            Ok(cells)
        })?;
        let row = |((message, size, resolution), [bits, kl]): (_, [Measured; 2])| Row {
            message,
            size,
            resolution,
            bits,
            kl,
        };
        Ok(all.into_iter().map(row).collect())
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        let bits = |message: &str| find(rows, message).map(|r| r.bits);
        let kl = |message: &str| find(rows, message).map(|r| r.kl);
        let share = over(bits("coded-5-r0.25"), bits("f32-5"));
        here.at_most("sixth", "five coded components take at most a sixth of the bits of floats", share, 1.0 / 6.0);
        let share = over(bits("coded-10-r0.15"), bits("particles-500"));
        here.at_most("hundredth", "ten take at most a hundredth of the bits of 500 particles", share, 0.01);
        let gap = minus(kl("coded-10-r0.15"), kl("particles-100"));
        paper.below("particles", "and lose less than 100 particles", gap, 0.0);
        for m in [3, 5, 10] {
            let by = [0.35, 0.25, 0.15].map(|r| kl(&format!("coded-{m}-r{r}")));
            paper.decreasing(format!("finer-m{m}"), "finer steps lose less", by.map(|kl| kl.map(|kl| kl.value)));
            let gap = minus(by[2], kl(&format!("coded-kd-{m}-r0.15")));
            let what = "at the same bits the pipeline loses less than the paper's cut";
            paper.below(format!("pipeline-m{m}"), what, gap, 0.0);
        }
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let place = |r: &Row| (r.bits.value, r.kl);
        let of = |size: usize| select(rows, move |r| r.message == "coded" && r.size == size);
        let all = |message: &'static str| select(rows, move |r| r.message == message);
        let coded = p.components.iter().enumerate();
        let layers =
            coded.flat_map(|(i, m)| Layer::curve(format!("coded, {m} components"), i, of(*m).map(place).collect()));
        let panel = Panel::loglog("One belief", "message / bit", "KL / nat")
            .with_all(layers)
            .with(Layer::dashed("mixture as floats", points(all("f32"), place)).coloured(5))
            .with(Layer::measured("particles as floats", all("particles"), place).coloured(6));
        Plot::of(panel)
    }
}
