//! Random streams: stable, and different wherever their paths differ.

use fewbits_monte_carlo::Stream;
use proptest::prelude::*;
use rand::RngExt;
use std::collections::HashSet;

fn first(stream: Stream) -> u64 {
    stream.rng().random()
}

#[test]
fn every_part_of_the_path_matters() {
    let root = Stream::new(1);
    let paths = [
        root,
        Stream::new(2),
        root.named("a"),
        root.named("b"),
        root.named(""),
        root.named("a").named("b"),
        root.named("b").named("a"),
        root.named("ab"),
        root.named("a\0"),
        root.indexed(0),
        root.indexed(1),
        root.indexed(0).indexed(0),
        root.indexed(97),
        root.named("a").indexed(0),
        root.indexed(0).named("a"),
    ];
    let firsts: HashSet<u64> = paths.iter().map(|path| first(*path)).collect();
    assert_eq!(firsts.len(), paths.len());
    let fast: HashSet<u64> = paths.iter().map(|path| path.fast_rng().random()).collect();
    assert_eq!(fast.len(), paths.len());
}

#[test]
fn neighbouring_trials_are_uncorrelated() {
    // Correlation of first uniforms of trials i and i + 1: standard deviation 1/sqrt(n) under independence.
    let n = 20_000_u64;
    let uniforms: Vec<f64> = (0..=n)
        .map(|i| Stream::new(7).named("trial").indexed(i).rng().random::<f64>() - 0.5)
        .collect();
    let correlation = 12.0 * uniforms.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / n as f64;
    assert!(correlation.abs() < 4.0 / (n as f64).sqrt(), "{correlation}");
}

proptest! {
    #[test]
    fn a_path_always_gives_the_same_numbers(seed: u64, name in ".{0,20}", index: u64) {
        let path = || Stream::new(seed).named(&name).indexed(index);
        prop_assert_eq!(path(), path());
        prop_assert_eq!(first(path()), first(path()));
        prop_assert_ne!(first(path()), first(path().indexed(0)));
    }
}
