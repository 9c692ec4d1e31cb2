//! Every entry of the fixture file, computed by independent programs, against the library.

use crate::entry::{Entry, check};
use fewbits_baselines::binary_patterns::{
    AdaptiveErrors, AdaptiveRule, Decoder, Luo, adaptive, by_information, centralised_bound, count, fixed_threshold,
    multi_threshold_bound, network_rate_distortion, printed_crlb, printed_gaussian_cells, remote_distortion,
};
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;
use fewbits_binary_patterns::search::{LinearSearch, MaskSet, free_breakpoints};
use fewbits_binary_patterns::{
    Bank, Mask, Pattern, PatternSensor, Source, gray_basis, linear_pattern, natural_basis, uniform_cells,
};
use fewbits_quantizers::Quantizer;
use serde_json::Value;
use std::collections::BTreeMap;

fn entries() -> Vec<Entry> {
    serde_json::from_str(include_str!("../fixtures/binary_quantization.json")).unwrap()
}

fn uniform() -> Source {
    Source::uniform(1.0).unwrap()
}

fn gauss() -> Source {
    Source::gaussian_with_deviation(0.1f64.sqrt()).unwrap()
}

fn gauss_grid() -> Quantizer {
    printed_gaussian_cells(0.1f64.sqrt()).unwrap()
}

fn grid(bits: usize) -> Quantizer {
    uniform_cells(1.0, bits).unwrap()
}

fn bank(source: Source, grid: &Quantizer, masks: &[Mask], snr: f64) -> Bank {
    let noise = source.noise_deviation(snr).unwrap();
    let bits = grid.cells().trailing_zeros() as usize;
    let quantizers = masks
        .iter()
        .map(|&m| linear_pattern(m, bits).unwrap().on(grid).unwrap())
        .collect();
    Bank::homogeneous_with_deviation(source, quantizers, noise).unwrap()
}

fn mmse(source: Source, grid: &Quantizer, masks: &[Mask], snr: f64) -> f64 {
    bank(source, grid, masks, snr).mmse().unwrap()
}

fn masks_of(value: &Value) -> Vec<Mask> {
    serde_json::from_value(value.clone()).unwrap()
}

/// The number after the last `snr`.
fn snr_of(id: &str) -> f64 {
    id.rsplit_once("snr").unwrap().1.parse().unwrap()
}

/// Walks the entries of one family (a prefix of the ids) and reports all failures at once.
fn family(prefix: &str, compute: impl Fn(&Entry) -> f64) {
    let failures: Vec<String> = entries()
        .iter()
        .filter(|e| e.id.starts_with(prefix))
        .filter_map(|e| check(e, compute(e)).err())
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Prefixes that the tests below walk, with the number of their entries.
const FAMILIES: [(&str, usize); 26] = [
    ("count.", 20),
    ("t51.", 9),
    ("t52.", 6),
    ("f56.", 46),
    ("f57.N", 21),
    ("f57x.", 21),
    ("f57.luo.", 21),
    ("f57.strat13.", 7),
    ("f57.cross.", 1),
    ("f58.uniform.mmse.", 9),
    ("f58.uniform.dmap.", 9),
    ("f58.uniform.cmap.", 9),
    ("f58.uniform.crlb.", 9),
    ("f58.uniform.vt.", 9),
    ("f58.uniform.b1.", 18),
    ("f58.uniform.central8.", 9),
    ("f58.gauss.", 45),
    ("f59.", 27),
    ("f510.lbqp.", 6),
    ("f510.fixed.", 6),
    ("f510.aqml.", 12),
    ("f510.aqvs.", 6),
    ("f510.postmean.", 6),
    ("f510.ribeiro.", 6),
    ("f510.luo.", 6),
    ("bp.", 1),
];

#[test]
fn no_entry_is_left_out() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let all = entries();
    for entry in &all {
        let matching: Vec<&str> = FAMILIES
            .iter()
            .map(|f| f.0)
            .filter(|f| entry.id.starts_with(f))
            .collect();
        assert_eq!(matching.len(), 1, "{} belongs to {matching:?}", entry.id);
        *seen.entry(matching[0]).or_default() += 1;
    }
    assert_eq!(seen, FAMILIES.into_iter().collect());
    assert_eq!(all.len(), 345);
}

#[test]
fn counts() {
    family("count.", |e| {
        let bits = e.inputs["B"].as_u64().unwrap_or(3) as usize;
        let sensors = e.inputs["N"].as_u64().unwrap_or(0) as usize;
        let name = e.id.split('.').nth(1).unwrap();
        let count = match name {
            "omega1" => count::unordered_bases(bits),
            "omega2_print" => count::printed_pattern_sets(bits, sensors),
            "multisets" => count::full_rank_multisets(bits, sensors),
            "labelings" => count::bijective_labelings(bits),
            "labelings_mod_reflection" => count::bijective_labelings_up_to_reflection(bits),
            "triples" => count::multisets(Pattern::all(8).unwrap().len() as u128, 3),
            other => panic!("unknown count {other}"),
        };
        count.unwrap() as f64
    });
}

const PRINTED_51: [Mask; 8] = [1, 2, 3, 3, 3, 4, 5, 6];

#[test]
fn table_5_1() {
    let noise = uniform().noise_deviation(18.2).unwrap();
    let search = LinearSearch::with_deviation(uniform(), grid(3), noise, 8).unwrap();
    for e in entries().iter().filter(|e| e.id.starts_with("t51.")) {
        let printed = bank(uniform(), &grid(3), &PRINTED_51, 18.2);
        let ours = match e.id.as_str() {
            "t51.sigma" => noise,
            "t51.printed.mmse" => printed.mmse().unwrap(),
            "t51.best.mmse" => {
                let best = search.best().unwrap();
                assert_eq!(best.masks, masks_of(&e.inputs["masks"]));
                best.mse
            }
            "t51.printed.rank" => search
                .ranking()
                .unwrap()
                .iter()
                .position(|s| s.masks == PRINTED_51)
                .unwrap() as f64,
            "t51.printed.dmap" => Decoder::DiscreteMap(&grid(3)).mse(&printed).unwrap(),
            "t51.dmap_best.dmap" => {
                // The best of all sets under this decoder; ties to the printed digits are not expected.
                let best = search
                    .ranking()
                    .unwrap()
                    .iter()
                    .map(|set| MaskSet {
                        mse: Decoder::DiscreteMap(&grid(3))
                            .mse(&search.bank(&set.masks).unwrap())
                            .unwrap(),
                        masks: set.masks.clone(),
                    })
                    .min_by(|a, b| a.mse.total_cmp(&b.mse))
                    .unwrap();
                assert_eq!(best.masks, masks_of(&e.inputs["masks"]));
                best.mse
            }
            "t51.printed.crlb" => printed_crlb(&printed).unwrap(),
            "t51.best.vt" => {
                optimal_weight_van_trees(&bank(uniform(), &grid(3), &masks_of(&e.inputs["masks"]), 18.2)).unwrap()
            }
            // A simulation of t51.best.mmse: the exact value must lie within its four standard errors.
            "t51.best.mmse.mc" => {
                let exact = search.best().unwrap().mse;
                assert!((exact - e.value.as_f64().unwrap()).abs() <= 4.0 * 2.739_467_250_025_785_6e-6);
                continue;
            }
            other => panic!("unknown entry {other}"),
        };
        check(e, ours).unwrap();
    }
}

#[test]
fn table_5_2() {
    let noise = gauss().noise_deviation(5.2).unwrap();
    let search = LinearSearch::with_deviation(gauss(), gauss_grid(), noise, 3).unwrap();
    family("t52.", |e| match e.id.as_str() {
        "t52.sigma" => noise,
        "t52.printed.mmse" => {
            let quantizers = e.inputs["patterns"]
                .as_array()
                .unwrap()
                .iter()
                .map(|p| {
                    p.as_str()
                        .unwrap()
                        .parse::<Pattern>()
                        .unwrap()
                        .on(&gauss_grid())
                        .unwrap()
                })
                .collect();
            Bank::homogeneous_with_deviation(gauss(), quantizers, noise)
                .unwrap()
                .mmse()
                .unwrap()
        }
        "t52.best_linear.mmse" => {
            let best = search.best().unwrap();
            assert_eq!(best.masks, masks_of(&e.inputs["masks"]));
            best.mse
        }
        "t52.unrestricted.mmse" => {
            let best = search.clone().any_rank().best().unwrap();
            assert_eq!(best.masks, masks_of(&e.inputs["masks"]));
            best.mse
        }
        "t52.gray.mmse" | "t52.natural.mmse" => mmse(gauss(), &gauss_grid(), &masks_of(&e.inputs["masks"]), 5.2),
        other => panic!("unknown entry {other}"),
    });
}

fn information_bound(kind: &str, bits: usize, snr: f64) -> f64 {
    let masks = match kind {
        "fixed" => vec![1 << (bits - 1); bits],
        "natural" => natural_basis(bits).unwrap(),
        "gray" => gray_basis(bits).unwrap(),
        other => panic!("unknown patterns {other}"),
    };
    printed_crlb(&bank(uniform(), &grid(bits), &masks, snr)).unwrap()
}

/// Where `f` changes sign.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let sign = f(low).signum();
    assert!(sign != f(high).signum());
    while high - low > 1e-9 {
        let middle = 0.5 * (low + high);
        if f(middle).signum() == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[test]
fn figure_5_6() {
    family("f56.", |e| {
        let bits = e.inputs["B"].as_u64().unwrap() as usize;
        match e.id.split('.').nth(2).unwrap() {
            "cross" => {
                let (a, b) = e.id.rsplit_once('.').unwrap().1.split_once('_').unwrap();
                let (low, high) = if a == "fixed" { (2.0, 10.0) } else { (10.0, 25.0) };
                root(low, high, |snr| information_bound(a, bits, snr) - information_bound(b, bits, snr))
            }
            kind => information_bound(kind, bits, snr_of(&e.id)),
        }
    });
}

fn optimum(e: &Entry, any_rank: bool) -> f64 {
    let snr = snr_of(&e.id);
    let sensors = e.inputs["N"].as_u64().unwrap_or(10) as usize;
    let noise = uniform().noise_deviation(snr).unwrap();
    let search = LinearSearch::with_deviation(uniform(), grid(3), noise, sensors).unwrap();
    let best = if any_rank {
        search.any_rank().best()
    } else {
        search.best()
    }
    .unwrap();
    assert_eq!(best.masks, masks_of(&e.inputs["argmin"]), "{}", e.id);
    best.mse
}

#[test]
fn figure_5_7_optima() {
    family("f57.N", |e| optimum(e, false));
    family("f57x.", |e| optimum(e, true));
}

#[test]
fn figure_5_7_others() {
    family("f57.luo.", |e| {
        let luo = Luo::new(uniform(), uniform().noise_deviation(snr_of(&e.id)).unwrap(), 3, 8).unwrap();
        assert_eq!(luo.allocation(), [4, 2, 2]);
        let errors = luo.errors().unwrap();
        match e.id.split('.').nth(2).unwrap() {
            "soft" => errors.soft,
            "majority" => errors.majority,
            "mmse" => errors.mmse,
            other => panic!("unknown fusion {other}"),
        }
    });
    family("f57.strat13.", |e| {
        let snr = snr_of(&e.id);
        let gray = gray_basis(3).unwrap();
        let masks = by_information(&uniform(), &grid(3), uniform().noise_deviation(snr).unwrap(), 8, &gray).unwrap();
        let extra = e.inputs["extra_mask"].as_u64().unwrap() as Mask;
        assert!(masks.iter().filter(|m| **m == extra).count() >= 5, "{}: {masks:?}", e.id);
        mmse(uniform(), &grid(3), &masks, snr)
    });
    family("f57.cross.", |_| {
        root(6.0, 10.0, |snr| {
            mmse(uniform(), &grid(3), &[4, 5, 6], snr) - mmse(uniform(), &grid(3), &[4, 6, 3], snr)
        })
    });
}

fn figure_5_8(e: &Entry) -> f64 {
    let snr = snr_of(&e.id);
    let (source, grid) = if e.id.contains("uniform") {
        (uniform(), grid(3))
    } else {
        (gauss(), gauss_grid())
    };
    let noise = source.noise_deviation(snr).unwrap();
    let bank = bank(source, &grid, &gray_basis(3).unwrap(), snr);
    let parts: Vec<&str> = e.id.split('.').collect();
    match (parts[2], parts[3]) {
        ("mmse", _) => bank.mmse().unwrap(),
        ("dmap", _) => Decoder::DiscreteMap(&grid).mse(&bank).unwrap(),
        ("cmap", _) => Decoder::ContinuousMap.mse(&bank).unwrap(),
        ("crlb", _) => printed_crlb(&bank).unwrap(),
        ("vt", _) => optimal_weight_van_trees(&bank).unwrap(),
        ("central8", _) => centralised_bound(&source, noise, 3).unwrap(),
        ("b1", variant) => {
            let noise = if variant == "print" { noise } else { noise / 3f64.sqrt() };
            let bound = remote_distortion(&source, noise).unwrap();
            for (ours, name) in [
                (bound.estimation_error, "D1"),
                (bound.entropy_power, "Q1"),
                (noise, "s"),
            ] {
                let expected = e.inputs[name].as_f64().unwrap();
                assert!((ours - expected).abs() <= 1e-6 * expected, "{} {name}: {ours} instead of {expected}", e.id);
            }
            if variant == "perN" {
                let network = network_rate_distortion(&source, noise * 3f64.sqrt(), 3).unwrap();
                assert!((network - bound.at(3.0).unwrap()).abs() < 1e-12);
            }
            bound.at(3.0).unwrap()
        }
        other => panic!("unknown curve {other:?}"),
    }
}

#[test]
fn figure_5_8_uniform() {
    family("f58.uniform.", figure_5_8);
}

#[test]
fn figure_5_8_gaussian() {
    family("f58.gauss.", figure_5_8);
}

#[test]
fn figure_5_9() {
    family("f59.", |e| {
        let noise = gauss().noise_deviation(snr_of(&e.id)).unwrap();
        match e.id.split('.').nth(1).unwrap() {
            "best" => {
                let best = LinearSearch::with_deviation(gauss(), gauss_grid(), noise, 3)
                    .unwrap()
                    .best()
                    .unwrap();
                assert_eq!(best.masks, masks_of(&e.inputs["argmin"]), "{}", e.id);
                best.mse
            }
            "dr_print" => remote_distortion(&gauss(), noise).unwrap().at(3.0).unwrap(),
            "dr_perN" => network_rate_distortion(&gauss(), noise, 3).unwrap(),
            other => panic!("unknown curve {other}"),
        }
    });
}

fn heard(e: &Entry, rule: AdaptiveRule) -> AdaptiveErrors {
    adaptive(&uniform(), uniform().noise_deviation(snr_of(&e.id)).unwrap(), 10, rule).unwrap()
}

#[test]
fn figure_5_10_without_feedback() {
    family("f510.lbqp.", |e| optimum(e, false));
    family("f510.fixed.", |e| {
        let noise = uniform().noise_deviation(snr_of(&e.id)).unwrap();
        fixed_threshold(uniform(), noise, 10).unwrap().mmse().unwrap()
    });
    family("f510.luo.", |e| {
        let luo = Luo::new(uniform(), uniform().noise_deviation(snr_of(&e.id)).unwrap(), 3, 10).unwrap();
        assert_eq!(serde_json::json!(luo.allocation()), e.inputs["alloc"]);
        luo.errors().unwrap().soft
    });
}

#[test]
fn figure_5_10_thresholds() {
    family("f510.ribeiro.", |e| {
        let noise = uniform().noise_deviation(snr_of(&e.id)).unwrap();
        let found = multi_threshold_bound(&uniform(), noise, 10).unwrap();
        assert!(found.gap < 3e-4);
        found.bound
    });
}

#[test]
fn figure_5_10_with_feedback() {
    family("f510.aqml.", |e| {
        let errors = heard(e, AdaptiveRule::MaximumLikelihood);
        if e.id.contains("mmse") { errors.mmse } else { errors.mle }
    });
    family("f510.aqvs.", |e| heard(e, AdaptiveRule::VariableStep { step: 0.5, factor: 1.5 }).mle);
    family("f510.postmean.", |e| heard(e, AdaptiveRule::PosteriorMean).mmse);
}

#[test]
fn free_breakpoints_reach_the_best_known() {
    for e in entries().iter().filter(|e| e.id.starts_with("bp.")) {
        assert_eq!(e.id, "bp.joint.gauss.N3.5p2");
        let noise = gauss().noise_deviation(5.2).unwrap();
        let start: Vec<PatternSensor> = [4, 4, 6]
            .iter()
            .map(|&m| {
                PatternSensor::with_deviation(linear_pattern(m, 3).unwrap().on(&gauss_grid()).unwrap(), noise).unwrap()
            })
            .collect();
        let found = free_breakpoints(&gauss(), &start, 0.02 / 0.1f64.sqrt(), 2).unwrap();
        let expected = e.value.as_f64().unwrap();
        assert!(found.mse <= expected * (1.0 + 1e-6), "{} instead of {expected}", found.mse);
    }
}
