//! Normal-distribution numerics against high-precision values and against each other.

use super::Fixture;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::normal;
use fewbits_numerics::normal::truncated_moments;
use proptest::prelude::*;
use serde::Deserialize;

#[derive(Deserialize)]
struct Entry {
    function: String,
    args: Vec<serde_json::Value>,
    value: String,
    tolerance: f64,
    kind: String,
}

fn number(value: &serde_json::Value) -> f64 {
    match value.as_str() {
        Some("inf") => f64::INFINITY,
        Some("-inf") => f64::NEG_INFINITY,
        Some(other) => panic!("unknown number {other}"),
        None => value.as_f64().unwrap(),
    }
}

#[test]
fn every_function_meets_high_precision_values() {
    let fixture: Fixture<Entry> = serde_json::from_str(include_str!("../fixtures/normal.json")).unwrap();
    let mut misses = Vec::new();
    for entry in &fixture.entries {
        let a: Vec<f64> = entry.args.iter().map(number).collect();
        let got = match entry.function.as_str() {
            "cdf" => normal::cdf(a[0]),
            "log_cdf" => normal::log_cdf(a[0]),
            "inverse_mills" => normal::inverse_mills(a[0]),
            "one_sided_variance" => normal::one_sided(a[0]).variance,
            "erfcx" => normal::erfcx(a[0]),
            "log_interval" => normal::log_interval(a[0], a[1]),
            "truncated_mean" => truncated_moments(a[0], a[1]).unwrap().mean,
            "truncated_variance" => truncated_moments(a[0], a[1]).unwrap().variance,
            "quantile" => normal::quantile(a[0]),
            other => panic!("no test for {other}"),
        };
        let expected: f64 = entry.value.parse().unwrap();
        let scale = match entry.kind.as_str() {
            "rel" => expected.abs(),
            "abs" => 1.0,
            "abs+rel" => 1.0 + expected.abs(),
            other => panic!("no tolerance kind {other}"),
        };
        let close = (got - expected).abs() <= entry.tolerance * scale;
        if !close {
            misses.push(format!(
                "{}{a:?}: {got:e} instead of {expected:e} (off by {:e})",
                entry.function,
                (got - expected) / scale
            ));
        }
    }
    assert!(misses.is_empty(), "{} of {}:\n{}", misses.len(), fixture.entries.len(), misses.join("\n"));
}

#[test]
fn degenerate_arguments_are_refused_or_have_their_limits() {
    assert_eq!(normal::log_cdf(f64::NEG_INFINITY), f64::NEG_INFINITY);
    assert_eq!(normal::log_cdf(f64::INFINITY), 0.0);
    assert_eq!(normal::log_interval(1.0, 1.0), f64::NEG_INFINITY);
    assert_eq!(normal::log_interval(f64::NEG_INFINITY, f64::INFINITY), 0.0);
    assert_eq!((normal::quantile(0.0), normal::quantile(1.0)), (f64::NEG_INFINITY, f64::INFINITY));
    assert!(normal::quantile(-0.1).is_nan() && normal::quantile(f64::NAN).is_nan());
    assert_eq!(normal::one_sided(f64::NEG_INFINITY).variance, 0.0);
    let nothing = normal::one_sided(f64::INFINITY);
    assert_eq!((nothing.log_probability, nothing.mean, nothing.variance), (0.0, 0.0, 1.0));
    for (lower, upper) in [
        (1.0, 1.0),
        (2.0, 1.0),
        (f64::NAN, 1.0),
        (0.0, f64::NAN),
        (f64::INFINITY, f64::INFINITY),
    ] {
        assert!(truncated_moments(lower, upper).is_err(), "[{lower}, {upper})");
    }
    let whole = truncated_moments(f64::NEG_INFINITY, f64::INFINITY).unwrap();
    assert_eq!((whole.mean, whole.variance), (0.0, 1.0));
}

#[test]
fn draws_from_a_cell_have_its_moments() {
    let cells = [
        (-0.5, 0.5),
        (0.3, 0.9),
        (-3.0, -1.0),
        (2.0, f64::INFINITY),
        (9.0, 9.4),
        (12.0, f64::INFINITY),
        (-20.0, -15.0),
    ];
    for (i, (lower, upper)) in cells.into_iter().enumerate() {
        let mut rng = Stream::new(3).named("cells").indexed(i as u64).rng();
        let draws = 20_000;
        let mut sum = fewbits_monte_carlo::Moments::default();
        for _ in 0..draws {
            let x = normal::sample_truncated(&mut rng, lower, upper).unwrap();
            assert!((lower..=upper).contains(&x));
            sum.add(x);
        }
        let truth = truncated_moments(lower, upper).unwrap();
        assert!(sum.estimate().z_score(truth.mean).abs() < 4.5, "mean in [{lower}, {upper})");
        // The variance of a sample variance is below 8 variance^2 / n for every cell (exponential is the worst).
        let error = (8.0 / f64::from(draws)).sqrt() * truth.variance;
        assert!((sum.variance() - truth.variance).abs() < 4.5 * error, "variance in [{lower}, {upper})");
    }
}

/// The exponential proposal is a little too long where rejection begins: the draws are not.
#[test]
fn draws_at_the_edge_of_rejection_are_not_exponential() {
    for (i, (lower, upper)) in [(8.01, f64::INFINITY), (-8.3, -8.02)].into_iter().enumerate() {
        let mut rng = Stream::new(7).named("edge").indexed(i as u64).rng();
        let (draws, truth) = (400_000, truncated_moments(lower, upper).unwrap());
        let mut sum = fewbits_monte_carlo::Moments::default();
        for _ in 0..draws {
            sum.add(normal::sample_truncated(&mut rng, lower, upper).unwrap());
        }
        assert!(sum.estimate().z_score(truth.mean).abs() < 4.5, "{sum:?}");
        let error = (8.0 / f64::from(draws)).sqrt() * truth.variance;
        assert!((sum.variance() - truth.variance).abs() < 4.5 * error, "{sum:?}");
    }
}

proptest! {
    #[test]
    fn quantile_inverts_the_distribution_function(x in -37.0..8.0_f64) {
        let p = normal::cdf(x);
        // Above the median the spacing of p limits what can be recovered.
        let spacing = f64::EPSILON * p / normal::pdf(x);
        prop_assert!((normal::quantile(p) - x).abs() <= 8.0 * spacing + 1e-14 * x.abs());
    }

    #[test]
    fn what_lies_beyond_a_cut_is_one_thing(x in -300.0..40.0_f64) {
        let together = normal::one_sided(x);
        let close = |a: f64, b: f64| (a - b).abs() <= 4e-15 * (1.0 + a.abs().min(b.abs()));
        prop_assert!(close(together.log_probability, normal::log_cdf(x)));
        prop_assert!(close(together.mean, normal::inverse_mills(x)));
        prop_assert!(close(together.variance, truncated_moments(-x, f64::INFINITY).unwrap().variance));
    }

    #[test]
    fn intervals_add_up(a in -30.0..30.0_f64, w1 in 1e-6..3.0_f64, w2 in 1e-6..3.0_f64) {
        let (b, c) = (a + w1, a + w1 + w2);
        let parts = normal::interval(a, b) + normal::interval(b, c);
        let whole = normal::interval(a, c);
        // Edges are rounded; a shift of an edge by an ulp changes a mass by its density there.
        let rounding = 40.0 * f64::EPSILON * (1.0 + a.abs() * (1.0 + a.abs()));
        prop_assert!((parts - whole).abs() <= whole * (1e-13 + rounding / w1.min(w2).min(1.0)));
        prop_assert!((normal::log_interval(a, c) - whole.ln()).abs() < 1e-10 * (1.0 + whole.ln().abs()));
    }

    #[test]
    fn cells_around_zero_have_mirrored_moments(a in -3.0..-1e-9_f64, b in 1e-9..3.0_f64, narrow in 0.01..1.0_f64) {
        prop_assume!(a != -b);
        let (a, b) = (a * narrow, b * narrow);
        let (m, mirrored) = (truncated_moments(a, b).unwrap(), truncated_moments(-b, -a).unwrap());
        prop_assert_eq!((mirrored.mean, mirrored.variance), (-m.mean, m.variance));
    }

    #[test]
    fn truncated_moments_stay_in_their_cell(a in -200.0..200.0_f64, width in 1e-9..50.0_f64) {
        let b = a + width;
        prop_assume!(a < b);
        let m = truncated_moments(a, b).unwrap();
        prop_assert!(a <= m.mean && m.mean <= b);
        let log_probability = normal::log_interval(a, b);
        prop_assert!((m.log_probability - log_probability).abs() <= 1e-13 * (1.0 + log_probability.abs()));
        let widest = (0.25 * (b - a) * (b - a)).min(1.0);
        prop_assert!(m.variance > 0.0 && m.variance <= widest * (1.0 + 1e-12));
        let mirrored = truncated_moments(-b, -a).unwrap();
        prop_assert_eq!((mirrored.mean, mirrored.variance), (-m.mean, m.variance));
    }
}

#[test]
fn a_cell_ten_billion_deviations_out_still_has_moments() {
    // There `lower + decay length` rounds to `lower`.
    for (lower, upper) in [(1e10, f64::INFINITY), (1e10, 1e10 + 1.0), (-3e12, -1e12)] {
        let cell = truncated_moments(lower, upper).unwrap();
        let edge = lower.abs().min(upper.abs());
        assert!((cell.mean.abs() / edge - 1.0).abs() < 1e-12, "{cell:?}");
        assert!((cell.variance * edge * edge - 1.0).abs() < 1e-9, "{cell:?}");
    }
}

/// Defect: the moments of a cell whose width is the smallest number were NaN.
#[test]
fn cells_of_the_smallest_width_are_points() {
    for (lower, upper) in [(-0.0, 5e-324), (-5e-324, 0.0), (0.0, 1e-200), (1e-150, 1e-150 + 1e-165)] {
        let moments = truncated_moments(lower, upper).unwrap();
        assert!(
            lower <= moments.mean && moments.mean <= upper && moments.variance == 0.0,
            "{lower} {upper}: {moments:?}"
        );
        let expected = (upper - lower).ln() - 0.5 * std::f64::consts::TAU.ln();
        assert!((moments.log_probability - expected).abs() < 1e-12, "{lower} {upper}: {moments:?}");
    }
}
