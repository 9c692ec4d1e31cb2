//! `binary-table5-2`: three patterns for a Gaussian source at 5.2 dB.

use super::{Scene, each, pattern, pattern_panel, sweep};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{Decoder, check_separation, count};
use fewbits_binary_patterns::{Pattern, mask_of};

pub struct Table;

parameters! {
    pub struct Parameters {
        snr_db: f64 [-60.0..=60.0] = 5.2 => "Signal-to-noise ratio, dB.",
        /// The printed patterns, eight bits each.
        printed: Vec<String> [; 3..=3] = ["01100110", "10001110", "01011010"].map(String::from).to_vec(),
    }
    check |p| accept_each("printed", &p.printed, |text| eight_bits(text));
}

/// Refuses what is no pattern of eight cells.
fn eight_bits(text: &str) -> Option<String> {
    match text.parse::<Pattern>() {
        Ok(pattern) if pattern.cells() == CELLS => None,
        Ok(_) => Some("expected eight bits".to_owned()),
        Err(error) => Some(error.to_string()),
    }
}

const CELLS: usize = 8;

rows! {
    pub struct Rows {
        sets: Vec<Set> => "The printed and other sets.",
        over_gray: Vec<OverGray> => "Errors of the printed triple over those of Gray.",
        sizes: Vec<Size> => "How many sets there are.",
    }

    struct Set by "{set}" {
        set: &'static str => "Which set.",
        patterns: String => "Its patterns.",
        linear: usize => "Patterns that are XORs of natural ones.",
        mse_mmse: f64 => "Exact error of the posterior mean; the variance of the source is 0.1.",
        mse_dmap: f64 => "Exact error of the discrete maximum a posteriori decoder.",
        rank: Option<usize> => "Place among the labelings of eight cells, from 0.",
    }

    struct OverGray {
        snr_db: f64 ["dB"] => "Signal-to-noise ratio.",
        mmse: f64 => "Posterior mean.",
        dmap: f64 => "Discrete maximum a posteriori decoder.",
        dmap_print: f64 => "Equation 5.10 as printed.",
        dmap_exact: f64 => "Discrete decoder with exact cell probabilities.",
        cmap: f64 => "Continuous maximum a posteriori decoder.",
    }

    struct Size by "{what}" {
        what: &'static str => "What is counted.",
        count: f64 => "How many.",
    }
}

/// All labelings of the cells by three bits, up to the order and the complements of the bits: triples of balanced patterns
/// that separate the cells.
fn labelings() -> Result<Vec<[Pattern; 3]>, Error> {
    let mut balanced = Pattern::all(CELLS)?;
    balanced.retain(|p| p.bits().iter().filter(|b| **b).count() == CELLS / 2);
    let mut found = Vec::new();
    for (i, a) in balanced.iter().enumerate() {
        for (j, b) in balanced[..i].iter().enumerate() {
            let triples = balanced[..j].iter().map(|c| [a.clone(), b.clone(), c.clone()]);
            found.extend(triples.filter(|triple| check_separation(triple).is_ok()));
        }
    }
    Ok(found)
}

fn over_gray(snr_db: f64, printed: &[Pattern]) -> Result<OverGray, Error> {
    let scene = Scene::gaussian(snr_db)?;
    let (ours, gray) = (scene.pattern_bank(printed)?, scene.bank(&[4, 6, 3])?);
    let ratio = |decoder: Decoder<'_>| Ok::<_, Error>(decoder.mse(&ours)? / decoder.mse(&gray)?);
    Ok(OverGray {
        snr_db,
        mmse: ratio(Decoder::Mmse)?,
        dmap: ratio(Decoder::DiscreteMap(&scene.grid))?,
        dmap_print: ratio(Decoder::PrintedDiscreteMap(&scene.grid))?,
        dmap_exact: ratio(Decoder::ExactDivisionMap(&scene.grid))?,
        cmap: ratio(Decoder::ContinuousMap)?,
    })
}

impl Figure for Table {
    figure!(Parameters => Rows, "binary-table5-2", "Printed and best patterns, Gaussian source", "Movaghati, thesis, table 5.2",
        "The printed triple has nearly the error of knowing nothing, and its second pattern is not linear: a misprint. The best \
         basis is half a per cent better than Gray at this ratio; without the rank constraint a quarter is gained.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let scene = Scene::gaussian(p.snr_db)?;
        let printed: Vec<Pattern> = p.printed.iter().map(|p| p.parse()).collect::<Result<_, _>>()?;
        let search = scene.search(3)?;
        let best = search.best()?.masks;
        let any = search.any_rank().best()?.masks;
        let all = parallel::try_map(&labelings()?, |l| Ok::<_, Error>(scene.pattern_bank(l)?.mmse()?))?;
        let linear = |masks: &[u32]| masks.iter().map(|&m| pattern(m, 3)).collect::<Result<Vec<_>, _>>();
        let set = |(set, patterns): (_, Vec<Pattern>)| {
            let bank = scene.pattern_bank(&patterns)?;
            let mse_mmse = bank.mmse()?;
            // Mirror images tie up to rounding.
            let better = || all.iter().filter(|e| **e < mse_mmse * (1.0 - 1e-9)).count();
            Ok(Set {
                set,
                patterns: joined(&patterns, " "),
                linear: patterns.iter().filter(|p| mask_of(p).is_some()).count(),
                mse_mmse,
                mse_dmap: Decoder::DiscreteMap(&scene.grid).mse(&bank)?,
                rank: check_separation(&patterns).is_ok().then(better),
            })
        };
        let sets = [
            ("printed", printed.clone()),
            ("best basis", linear(&best)?),
            ("Gray", linear(&[4, 6, 3])?),
            ("natural", linear(&[4, 2, 1])?),
            ("any three masks", linear(&any)?),
        ];
        let sizes = [
            ("labelings", all.len() as f64),
            ("linear bases", count::unordered_bases(3)? as f64),
            ("labelings up to reflection", count::bijective_labelings_up_to_reflection(3)? as f64),
        ];
        Ok(Rows {
            sets: sets.into_iter().map(set).collect::<Result<_, Error>>()?,
            over_gray: each(&sweep(5.0, 52.0, 1.0), |snr| over_gray(snr, &printed))?,
            sizes: sizes.map(|(what, count)| Size { what, count }).into(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let at = |set: &str| rows.sets.iter().find(|r| r.set == set);
        let linear = at("printed").map(|r| r.linear as f64);
        here.near("not-linear", "one of the printed patterns is not linear (erratum binary-12)", linear, 2.0, 0.0);
        let rank = at("printed").and_then(|r| Some(r.rank? as f64));
        here.near("rank", "708 of the 840 labelings are better", rank, 708.0, 0.0);
        let what = "from 5 to 52 dB, under five decoders, Gray is better: nothing makes the print optimal";
        let decoders = |r: &OverGray| [r.mmse, r.dmap, r.dmap_print, r.dmap_exact, r.cmap];
        let ratios = rows.over_gray.iter().flat_map(decoders);
        here.all("never-best", what, ratios, |ratio| ratio > 1.0);
        let what = "the best basis is 00001111, 00111100, 01101001";
        here.all("best-patterns", what, at("best basis"), |r| r.patterns == "00001111 00111100 01101001");
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let panel = |r: &Set| {
            let patterns = r.patterns.split(' ').enumerate();
            let named = patterns.filter_map(|(at, p)| Some((format!("sensor {}", at + 1), p.parse().ok()?)));
            pattern_panel(format!("{}: error {:.5}", r.set, r.mse_mmse), &named.collect::<Vec<_>>())
        };
        Plot::grid(2, rows.sets.iter().map(panel).collect())
    }
}
