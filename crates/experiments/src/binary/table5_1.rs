//! `binary-table5-1`: eight patterns of three bits at 18.2 dB.

use super::{Scene, mask_text, pattern, pattern_panel};
use crate::legacy::{About, Claim, Context, Error, Figure, Table as Rows, Tables, column, row};
use crate::plot::Plot;
use fewbits_binary_patterns::bounds::{optimal_weight_van_trees, printed_crlb};
use fewbits_binary_patterns::search::MaskSet;
use fewbits_binary_patterns::{Decoder, Mask, count};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// `binary-table5-1`.
pub struct Table;

/// Parameters of `binary-table5-1`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Signal-to-noise ratio, dB.
    snr_db: f64,
    /// The printed masks.
    printed: Vec<Mask>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            snr_db: 18.2,
            printed: vec![4, 6, 3, 3, 3, 2, 1, 5],
        }
    }
}

const BITS: usize = 3;

fn sorted(masks: &[Mask]) -> Vec<Mask> {
    let mut masks = masks.to_vec();
    masks.sort_unstable();
    masks
}

/// Position of a set in a ranking, from 0.
fn rank(sets: &[MaskSet], masks: &[Mask]) -> Result<usize, Error> {
    sets.iter()
        .position(|s| s.masks == masks)
        .ok_or_else(|| Error::Table(format!("{masks:?} is not among the sets of full rank")))
}

impl Figure for Table {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-table5-1",
            title: "Printed and optimal patterns of eight sensors",
            caption: "The printed set is 25 places from the best of 2702 under the posterior mean it is said to be optimal for, and 11 % worse. \
                      It fits a search under the discrete maximum a posteriori decoder, where it is fourth.",
            source: "Movaghati, thesis, table 5.1",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let scene = Scene::uniform(BITS, p.snr_db)?;
        let search = scene.search(p.printed.len())?;
        let ranking = search.ranking().map_err(Error::failed)?;
        let mut by_map: Vec<MaskSet> = ranking
            .par_iter()
            .map(|set| {
                let bank = search.bank(&set.masks)?;
                Ok(MaskSet {
                    masks: set.masks.clone(),
                    mse: bank.mse(Decoder::DiscreteMap(&scene.grid))?,
                })
            })
            .collect::<Result<_, fewbits_binary_patterns::Error>>()
            .map_err(Error::failed)?;
        by_map.sort_by(|a, b| a.mse.total_cmp(&b.mse).then_with(|| a.masks.cmp(&b.masks)));
        let mut table = Rows::new([
            column("set", "", "which set"),
            column("masks", "", "its masks"),
            column("mse_mmse", "V^2", "exact error of the posterior mean"),
            column("mse_dmap", "V^2", "exact error of the discrete maximum a posteriori decoder"),
            column("mse_exact_dmap", "V^2", "the same with exact cell probabilities"),
            column("crlb", "V^2", "equation 5.13"),
            column("van_trees", "V^2", "optimal-weight van Trees bound"),
            column("rank", "", "place among all sets under the posterior mean, from 0"),
            column("rank_dmap", "", "place under the discrete decoder, from 0"),
        ]);
        let printed = sorted(&p.printed);
        let best = search.best().map_err(Error::failed)?.masks;
        for (name, masks) in [
            ("printed", &printed),
            ("best, posterior mean", &best),
            ("best, discrete MAP", &by_map[0].masks),
        ] {
            let bank = scene.bank(masks)?;
            let mse = |decoder| bank.mse(decoder).map_err(Error::failed);
            table.push(row![
                name,
                mask_text(masks),
                mse(Decoder::Mmse)?,
                mse(Decoder::DiscreteMap(&scene.grid))?,
                mse(Decoder::ExactDivisionMap(&scene.grid))?,
                printed_crlb(&bank).map_err(Error::failed)?,
                optimal_weight_van_trees(&bank).map_err(Error::failed)?,
                rank(&ranking, masks)?,
                rank(&by_map, masks)?,
            ])?;
        }
        let mut spaces = Rows::new([
            column("bits", "", "bits B"),
            column("sensors", "", "sensors N"),
            column("printed", "", "sets by equation 5.7"),
            column("exact", "", "multisets of full rank"),
        ]);
        for (bits, sensors) in [(2, 4), (3, 5), (3, 8), (3, 10), (4, 7), (4, 8), (4, 10)] {
            spaces.push(row![
                bits,
                sensors,
                count::printed_pattern_sets(bits, sensors).map_err(Error::failed)? as f64,
                count::full_rank_multisets(bits, sensors).map_err(Error::failed)? as f64,
            ])?;
        }
        Ok(Tables::from(table)
            .with("search-spaces", spaces)
            .with("listed", listed(&ranking, &by_map)?))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mmse = tables.main.numbers("mse_mmse")?;
        let dmap = tables.main.numbers("mse_dmap")?;
        let ranks = tables.main.numbers("rank")?;
        let bound = tables.main.numbers("van_trees")?;
        let spaces = tables.named("search-spaces")?;
        let (printed, exact) = (spaces.numbers("printed")?, spaces.numbers("exact")?);
        let texts = tables.main.texts("masks")?;
        let sets = tables.named("listed")?.len() as f64;
        let strategy = count::forced_basis_sets(BITS, p.printed.len()).map_err(Error::failed)? as f64;
        Ok(vec![
            Claim::near_relative("printed", "error of the printed set", mmse[0], 0.003_473_787_532_911_221, 1e-8)
                .at_defaults(),
            Claim::near("rank", "the printed set is at place 25 of 0..2701 (erratum binary-11)", ranks[0], 25.0, 0.0)
                .at_defaults(),
            Claim::near("sets", "there are 2702 sets", sets, 2702.0, 0.0).at_defaults(),
            Claim::near_relative("best", "error of the best set", mmse[1], 0.003_119_112_724_490_280_5, 1e-8)
                .at_defaults(),
            Claim::never("best-masks", "the best set is {4,6,3,3,3,3,2,2}", usize::from(texts[1] != "2 2 3 3 3 3 4 6"))
                .at_defaults(),
            Claim::near_relative(
                "dmap-printed",
                "discrete error of the printed set",
                dmap[0],
                0.006_920_809_484_397_439,
                1e-8,
            )
            .at_defaults(),
            Claim::near_relative("dmap-best", "least discrete error", dmap[2], 0.006_900_117_289_130_259, 1e-8)
                .at_defaults(),
            Claim::never("dmap-masks", "it belongs to {1,2,3,3,3,3,4,6}", usize::from(texts[2] != "1 2 3 3 3 3 4 6"))
                .at_defaults(),
            Claim::near(
                "dmap-rank",
                "under the discrete decoder the printed set is fourth: the table fits a search with that decoder",
                tables.main.numbers("rank_dmap")?[0],
                3.0,
                0.0,
            )
            .at_defaults(),
            Claim::never(
                "bound",
                "the van Trees bound is below every error",
                (0..3).filter(|&i| bound[i] > mmse[i]).count(),
            ),
            Claim::never(
                "over-count",
                "equation 5.7 counts multisets once per basis, 1.5 to 18 times too often (erratum binary-2)",
                printed
                    .iter()
                    .zip(&exact)
                    .filter(|(p, e)| !(1.4..=18.0).contains(&(*p / *e)))
                    .count(),
            ),
            Claim::near("strategy-1", "with the Gray basis forced 462 sets remain", strategy, 462.0, 0.0).at_defaults(),
        ])
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for (title, masks) in tables.main.texts("set")?.iter().zip(tables.main.texts("masks")?) {
            let rows = masks
                .split(' ')
                .filter_map(|m| m.parse::<Mask>().ok())
                .map(|mask| Ok((format!("mask {mask}"), pattern(mask, BITS)?)))
                .collect::<Result<Vec<_>, Error>>()?;
            panels.push(pattern_panel(format!("{title}, {} dB", p.snr_db), &rows));
        }
        Ok(Plot::grid(3, panels))
    }
}

/// All sets with both errors, in the order of the posterior mean's.
fn listed(ranking: &[MaskSet], by_map: &[MaskSet]) -> Result<Rows, Error> {
    let other: std::collections::BTreeMap<&[Mask], f64> = by_map.iter().map(|s| (s.masks.as_slice(), s.mse)).collect();
    let mut rows = Rows::new([
        column("masks", "", "masks"),
        column("mse_mmse", "V^2", "error of the posterior mean"),
        column("mse_dmap", "V^2", "error of the discrete decoder"),
    ]);
    for set in ranking {
        rows.push(row![mask_text(&set.masks), set.mse, other.get(set.masks.as_slice()).copied()])?;
    }
    Ok(rows)
}
