//! `binary-table5-2`: three patterns for a Gaussian source at 5.2 dB.

use super::{Scene, each, pattern, pattern_panel, sweep};
use crate::legacy::{About, Claim, Context, Error, Figure, Table as Rows, Tables, column, row};
use crate::plot::Plot;
use fewbits_binary_patterns::{Decoder, Pattern, check_separation, count, mask_of};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// `binary-table5-2`.
pub struct Table;

/// Parameters of `binary-table5-2`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Signal-to-noise ratio, dB.
    snr_db: f64,
    /// The printed patterns.
    printed: Vec<String>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            snr_db: 5.2,
            printed: ["01100110", "10001110", "01011010"].map(String::from).to_vec(),
        }
    }
}

const CELLS: usize = 8;

/// All labelings of the cells by three bits, up to the order and the complements of the bits: triples of balanced patterns
/// that separate the cells.
fn labelings() -> Result<Vec<Vec<Pattern>>, Error> {
    let balanced: Vec<Pattern> = Pattern::all(CELLS)
        .map_err(Error::failed)?
        .into_iter()
        .filter(|p| p.bits().iter().filter(|b| **b).count() == CELLS / 2)
        .collect();
    let mut found = Vec::new();
    for (i, a) in balanced.iter().enumerate() {
        for (j, b) in balanced.iter().enumerate().skip(i + 1) {
            for c in &balanced[j + 1..] {
                let triple = vec![a.clone(), b.clone(), c.clone()];
                if check_separation(&triple).is_ok() {
                    found.push(triple);
                }
            }
        }
    }
    Ok(found)
}

/// Place of `printed` among the labelings under the posterior mean, from 0.
fn place(scene: &Scene, labelings: &[Vec<Pattern>], printed: &[Pattern]) -> Result<usize, Error> {
    let error = |patterns: &[Pattern]| scene.pattern_bank(patterns)?.mmse().map_err(Error::failed);
    let own = error(printed)?;
    let errors = labelings.par_iter().map(|l| error(l)).collect::<Result<Vec<_>, _>>()?;
    // Mirror images tie with it up to rounding.
    Ok(errors.iter().filter(|e| **e < own * (1.0 - 1e-9)).count())
}

/// The decoders under which the printed triple is compared with Gray.
const RULES: [(&str, &str); 5] = [
    ("mmse", "posterior mean"),
    ("dmap", "discrete maximum a posteriori decoder"),
    ("dmap_print", "equation 5.10 as printed"),
    ("dmap_exact", "discrete decoder with exact cell probabilities"),
    ("cmap", "continuous maximum a posteriori decoder"),
];

/// Errors of the printed triple over those of Gray, decoder by decoder.
fn ratios(snr: f64, printed: &[Pattern]) -> Result<[f64; 5], Error> {
    let scene = Scene::gaussian(snr)?;
    let (ours, gray) = (scene.pattern_bank(printed)?, scene.bank(&[4, 6, 3])?);
    let mut ratios = [0.0; 5];
    let grid = &scene.grid;
    let decoders = [
        Decoder::Mmse,
        Decoder::DiscreteMap(grid),
        Decoder::PrintedDiscreteMap(grid),
        Decoder::ExactDivisionMap(grid),
        Decoder::ContinuousMap,
    ];
    for (ratio, decoder) in ratios.iter_mut().zip(decoders) {
        *ratio = ours.mse(decoder).map_err(Error::failed)? / gray.mse(decoder).map_err(Error::failed)?;
    }
    Ok(ratios)
}

impl Parameters {
    fn patterns(&self) -> Result<Vec<Pattern>, Error> {
        self.printed.iter().map(|p| p.parse().map_err(Error::failed)).collect()
    }
}

impl Figure for Table {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-table5-2",
            title: "Printed and best patterns, Gaussian source",
            caption: "The printed triple has nearly the error of knowing nothing, and its second pattern is not linear: a misprint. The best \
                      basis is half a per cent better than Gray at this ratio; without the rank constraint a quarter is gained.",
            source: "Movaghati, thesis, table 5.2",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let scene = Scene::gaussian(p.snr_db)?;
        let printed = p.patterns()?;
        let search = scene.search(3)?;
        let best = search.best().map_err(Error::failed)?.masks;
        let any = search.any_rank().best().map_err(Error::failed)?.masks;
        let all = labelings()?;
        let mut table = Rows::new([
            column("set", "", "which set"),
            column("patterns", "", "its patterns"),
            column("linear", "", "patterns that are XORs of natural ones"),
            column("mse_mmse", "", "exact error of the posterior mean; the variance of the source is 0.1"),
            column("mse_dmap", "", "exact error of the discrete maximum a posteriori decoder"),
            column("rank", "", "place among the labelings of eight cells, from 0"),
        ]);
        let linear = |masks: &[u32]| masks.iter().map(|&m| pattern(m, 3)).collect::<Result<Vec<_>, _>>();
        let sets = [
            ("printed", printed.clone()),
            ("best basis", linear(&best)?),
            ("Gray", linear(&[4, 6, 3])?),
            ("natural", linear(&[4, 2, 1])?),
            ("any three masks", linear(&any)?),
        ];
        for (name, patterns) in sets {
            let rank = if check_separation(&patterns).is_ok() {
                Some(place(&scene, &all, &patterns)? as f64)
            } else {
                None
            };
            let bank = scene.pattern_bank(&patterns)?;
            let text: Vec<String> = patterns.iter().map(ToString::to_string).collect();
            table.push(row![
                name,
                text.join(" "),
                patterns.iter().filter(|p| mask_of(p).is_some()).count(),
                bank.mmse().map_err(Error::failed)?,
                bank.mse(Decoder::DiscreteMap(&scene.grid)).map_err(Error::failed)?,
                rank,
            ])?;
        }
        let mut columns = vec![column("snr_db", "dB", "signal-to-noise ratio")];
        columns.extend(RULES.iter().map(|(name, what)| column(name, "", what)));
        let mut compared = Rows::new(columns);
        let points = sweep(5.0, 52.0, 1.0);
        for (snr, ratios) in points.iter().zip(each(&points, |snr| ratios(snr, &printed))?) {
            let mut row = row![*snr];
            row.extend(ratios.map(Into::into));
            compared.push(row)?;
        }
        let mut sizes = Rows::new([column("what", "", "what is counted"), column("count", "", "how many")]);
        sizes.push(row!["labelings", all.len()])?;
        sizes.push(row!["linear bases", count::unordered_bases(3).map_err(Error::failed)? as f64])?;
        let mirrored = count::bijective_labelings_up_to_reflection(3).map_err(Error::failed)?;
        sizes.push(row!["labelings up to reflection", mirrored as f64])?;
        Ok(Tables::from(table).with("over-gray", compared).with("sizes", sizes))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mse = tables.main.numbers("mse_mmse")?;
        let linear = tables.main.numbers("linear")?;
        let patterns = tables.main.texts("patterns")?;
        let rank: f64 = tables
            .main
            .only("set", "printed")?
            .points("rank", "mse_mmse")?
            .first()
            .map_or(-1.0, |p| p.0);
        let sizes = tables.named("sizes")?.numbers("count")?;
        let compared = tables.named("over-gray")?;
        let mut better = 0;
        for (rule, _) in RULES {
            better += compared.numbers(rule)?.iter().filter(|r| **r <= 1.0).count();
        }
        Ok(vec![
            Claim::near_relative(
                "printed",
                "error of the printed triple, of a variance of 0.1",
                mse[0],
                0.089_637_525_342_898_75,
                1e-8,
            )
            .at_defaults(),
            Claim::near("not-linear", "one of its patterns is not linear (erratum binary-12)", linear[0], 2.0, 0.0)
                .at_defaults(),
            Claim::near("rank", "708 of the 840 labelings are better", rank, 708.0, 0.0).at_defaults(),
            Claim::near("labelings", "there are 840 labelings", sizes[0], 840.0, 0.0),
            Claim::near("bases", "28 of them are linear", sizes[1], 28.0, 0.0),
            Claim::near("mirrored", "472 remain up to reflection", sizes[2], 472.0, 0.0),
            Claim::never(
                "never-best",
                "from 5 to 52 dB, under five decoders, Gray is better: nothing makes the print optimal",
                better,
            )
            .at_defaults(),
            Claim::never(
                "best-patterns",
                "the best basis is 00001111, 00111100, 01101001",
                usize::from(patterns[1] != "00001111 00111100 01101001"),
            )
            .at_defaults(),
            Claim::near_relative("best", "its error", mse[1], 0.034_003_509_354_042_48, 1e-8).at_defaults(),
            Claim::near_relative("gray", "that of Gray, half a per cent more", mse[2], 0.034_181_270_397_403_96, 1e-8)
                .at_defaults(),
            Claim::near_relative("natural", "that of the natural basis", mse[3], 0.047_707_808_937_158_07, 1e-8)
                .at_defaults(),
            Claim::near_relative(
                "any",
                "without the rank constraint, a quarter less",
                mse[4],
                0.025_942_566_579_375_27,
                1e-8,
            )
            .at_defaults(),
        ])
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let sets = tables.main.texts("set")?;
        let mut panels = Vec::new();
        for ((set, patterns), mse) in sets
            .iter()
            .zip(tables.main.texts("patterns")?)
            .zip(tables.main.numbers("mse_mmse")?)
        {
            let rows = patterns
                .split(' ')
                .enumerate()
                .map(|(at, p)| Ok((format!("sensor {}", at + 1), p.parse::<Pattern>().map_err(Error::failed)?)))
                .collect::<Result<Vec<_>, Error>>()?;
            panels.push(pattern_panel(format!("{set}: error {mse:.5}"), &rows));
        }
        Ok(Plot::grid(3, panels))
    }
}
