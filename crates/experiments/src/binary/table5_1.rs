//! `binary-table5-1`: eight patterns of three bits at 18.2 dB.

use super::{Scene, pattern, pattern_panel};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{Decoder, count, printed_crlb};
use fewbits_binary_patterns::Mask;
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;
use fewbits_binary_patterns::search::MaskSet;

pub struct Table;

parameters! {
    pub struct Parameters {
        snr_db: f64 [-60.0..=60.0] = 18.2 => "Signal-to-noise ratio, dB.",
        printed: Vec<Mask> [1..=7; 3..=10] = vec![4, 6, 3, 3, 3, 2, 1, 5] => "The printed masks, below 8.",
    }
}

const BITS: usize = 3;

rows! {
    pub struct Rows {
        sets: Vec<Set> => "The printed and the best sets.",
        search_spaces: Vec<Space> => "Sizes of the search space.",
        listed: Vec<Listed> => "All sets with both errors, in the order of the posterior mean's.",
    }

    struct Set by "{set}" {
        set: &'static str => "Which set.",
        masks: List<Mask> => "Its masks.",
        mse_mmse: f64 ["V^2"] => "Exact error of the posterior mean.",
        mse_dmap: f64 ["V^2"] => "Exact error of the discrete maximum a posteriori decoder.",
        mse_exact_dmap: f64 ["V^2"] => "The same with exact cell probabilities.",
        crlb: f64 ["V^2"] => "Equation 5.13.",
        van_trees: f64 ["V^2"] => "Optimal-weight van Trees bound.",
        rank: Option<usize> => "Place among all sets under the posterior mean, from 0 (erratum binary-11); none if not of full rank.",
        rank_dmap: Option<usize> => "Place under the discrete decoder, which the table fits, from 0 (erratum binary-19).",
    }

    struct Space {
        bits: usize => "Bits B.",
        sensors: usize => "Sensors N.",
        printed: f64 => "Sets by equation 5.7.",
        exact: f64 => "Multisets of full rank.",
        with_gray: f64 => "Sets that hold the Gray basis (strategy 1).",
    }

    struct Listed {
        masks: List<Mask> => "Masks.",
        mse_mmse: f64 ["V^2"] => "Error of the posterior mean.",
        mse_dmap: f64 ["V^2"] => "Error of the discrete decoder.",
    }
}

impl Figure for Table {
    figure!(Parameters => Rows, "binary-table5-1", "Printed and optimal patterns of eight sensors", "Movaghati, thesis, table 5.1",
        "The printed set is 25 places from the best of 2702 under the posterior mean it is said to be optimal for, and 11 % worse. \
         It fits a search under the discrete maximum a posteriori decoder, where it is fourth.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let scene = Scene::uniform(BITS, p.snr_db)?;
        let search = scene.search(p.printed.len())?;
        let ranking = search.ranking()?;
        let other = parallel::try_map(&ranking, |set| {
            Ok::<_, Error>(Decoder::DiscreteMap(&scene.grid).mse(&search.bank(&set.masks)?)?)
        })?;
        let listed = ranking.iter().zip(&other).map(|(set, mse_dmap)| Listed {
            masks: List(set.masks.clone()),
            mse_mmse: set.mse,
            mse_dmap: *mse_dmap,
        });
        let listed = listed.collect();
        let mut by_map = ranking.clone();
        by_map.iter_mut().zip(other).for_each(|(set, mse)| set.mse = mse);
        by_map.sort_by(|a, b| a.mse.total_cmp(&b.mse).then_with(|| a.masks.cmp(&b.masks)));
        let place = |sets: &[MaskSet], masks: &[Mask]| sets.iter().position(|s| s.masks == masks);
        let mut printed = p.printed.clone();
        printed.sort_unstable();
        let best = search.best()?.masks;
        let set = |(set, masks): (_, &Vec<Mask>)| {
            let bank = scene.bank(masks)?;
            Ok(Set {
                set,
                masks: List(masks.clone()),
                mse_mmse: Decoder::Mmse.mse(&bank)?,
                mse_dmap: Decoder::DiscreteMap(&scene.grid).mse(&bank)?,
                mse_exact_dmap: Decoder::ExactDivisionMap(&scene.grid).mse(&bank)?,
                crlb: printed_crlb(&bank)?,
                van_trees: optimal_weight_van_trees(&bank)?,
                rank: place(&ranking, masks),
                rank_dmap: place(&by_map, masks),
            })
        };
        let sets = [
            ("printed", &printed),
            ("best, posterior mean", &best),
            ("best, discrete MAP", &by_map[0].masks),
        ];
        let space = |(bits, sensors)| {
            Ok(Space {
                bits,
                sensors,
                printed: count::printed_pattern_sets(bits, sensors)? as f64,
                exact: count::full_rank_multisets(bits, sensors)? as f64,
                with_gray: count::forced_basis_sets(bits, sensors)? as f64,
            })
        };
        let spaces = [(2, 4), (3, 5), (3, 8), (3, 10), (4, 7), (4, 8), (4, 10)];
        Ok(Rows {
            sets: sets.into_iter().map(set).collect::<Result<_, Error>>()?,
            search_spaces: spaces.into_iter().map(space).collect::<Result<_, Error>>()?,
            listed,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let at = |set: &str| rows.sets.iter().find(|r| r.set == set);
        let (best, decoded) = (at("best, posterior mean"), at("best, discrete MAP"));
        here.near("sets", "there are 2702 sets", rows.listed.len() as f64, 2702.0, 0.0);
        here.all("best-masks", "the best set is {4,6,3,3,3,3,2,2}", best, |r| r.masks.0 == [2, 2, 3, 3, 3, 3, 4, 6]);
        let what = "the best under the discrete decoder is {1,2,3,3,3,3,4,6}";
        here.all("dmap-masks", what, decoded, |r| r.masks.0 == [1, 2, 3, 3, 3, 3, 4, 6]);
        claims.all("bound", "the van Trees bound is below every error", &rows.sets, |r| r.van_trees <= r.mse_mmse);
        let what = "equation 5.7 counts multisets once per basis, 1.5 to 18 times too often (erratum binary-2)";
        claims.all("over-count", what, &rows.search_spaces, |r| (1.4..=18.0).contains(&(r.printed / r.exact)));
        let eight = rows.search_spaces.iter().find(|r| (r.bits, r.sensors) == (3, 8));
        let what = "with the Gray basis forced 462 sets of eight sensors remain";
        claims.near("strategy-1", what, eight.map(|r| r.with_gray), 462.0, 0.0);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let panel = |r: &Set| {
            let named = |mask: &Mask| Some((format!("mask {mask}"), pattern(*mask, BITS).ok()?));
            let patterns = r.masks.0.iter().filter_map(named);
            pattern_panel(format!("{}, {} dB", r.set, p.snr_db), &patterns.collect::<Vec<_>>())
        };
        Plot::grid(2, rows.sets.iter().map(panel).collect())
    }
}
