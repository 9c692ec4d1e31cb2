//! Kernels against high-precision values, at every width of this machine.

use super::Fixture;
use fewbits_numerics::kernels::{self, scalar};
use fewbits_numerics::normal;
use pulp::{Arch, NullaryFnOnce};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct Entry {
    function: String,
    args: Vec<String>,
    value: String,
}

fn ulps(value: f64, truth: f64) -> f64 {
    if value == truth {
        return 0.0;
    }
    (value - truth).abs() / (truth.abs().next_up() - truth.abs())
}

#[test]
fn every_function_is_within_its_bound() {
    let bounds = BTreeMap::from([
        ("exp", 1.0),
        ("exp_subnormal", 1.5),
        ("ln", 1.0),
        ("pdf", 3.0),
        ("erfcx", 6.0),
        ("cdf", 6.0),
        ("log_cdf", 6.0),
        ("inverse_mills", 8.0),
        ("interval", 10.0),
        ("log_interval", 8.0),
        ("quantile", 8.0),
    ]);
    let fixture: Fixture<Entry> = serde_json::from_str(include_str!("../fixtures/kernels.json")).unwrap();
    let mut worst: BTreeMap<&str, (f64, Vec<f64>)> = BTreeMap::new();
    for entry in &fixture.entries {
        let a: Vec<f64> = entry.args.iter().map(|a| a.parse().unwrap()).collect();
        let got = match entry.function.as_str() {
            "exp" | "exp_subnormal" => scalar::exp(a[0]),
            "ln" => scalar::ln(a[0]),
            "pdf" => normal::pdf(a[0]),
            "erfcx" => normal::erfcx(a[0]),
            "cdf" => normal::cdf(a[0]),
            "log_cdf" => normal::log_cdf(a[0]),
            "inverse_mills" => normal::inverse_mills(a[0]),
            "interval" => normal::interval(a[0], a[1]),
            "log_interval" => normal::log_interval(a[0], a[1]),
            "quantile" => normal::quantile(a[0]),
            other => panic!("no test for {other}"),
        };
        let off = ulps(got, entry.value.parse().unwrap());
        assert!(!off.is_nan(), "{}{a:?}", entry.function);
        let entry = worst.entry(entry.function.as_str()).or_insert((-1.0, a.clone()));
        if off > entry.0 {
            *entry = (off, a);
        }
    }
    assert_eq!(worst.len(), bounds.len());
    for (function, (off, a)) in &worst {
        assert!(*off <= bounds[function], "{function}{a:?} is {off} ulp off; all: {worst:#?}");
    }
}

/// The vector units of this machine, narrowest first.
fn widths() -> Vec<Arch> {
    #[cfg(target_arch = "x86_64")]
    {
        let wider = [
            pulp::x86::V3::try_new().map(Arch::V3),
            pulp::x86::V4::try_new().map(Arch::V4),
        ];
        std::iter::once(Arch::Scalar)
            .chain(wider.into_iter().flatten())
            .collect()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        vec![Arch::Scalar, Arch::new()]
    }
}

/// Arguments of all kinds, in an order that puts them next to one another.
fn arguments() -> Vec<f64> {
    let mut x = vec![
        0.0,
        -0.0,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        f64::MIN_POSITIVE,
        f64::from_bits(1),
        -f64::from_bits(77),
        f64::MAX,
        f64::MIN,
        1e160,
        -1e160,
        1.0,
        -1.0,
        0.5,
    ];
    let mut state = 1_u64;
    for i in 0..1500 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let unit = (state >> 11) as f64 / 9_007_199_254_740_992.0;
        let scale = [1.0, 10.0, 40.0, 800.0, 1e-9][i % 5];
        x.push(scale * (2.0 * unit - 1.0));
    }
    x
}

struct Elementwise<'a> {
    work: fn(f64, f64) -> f64,
    x: &'a [f64],
    y: &'a [f64],
    out: &'a mut [f64],
}

macro_rules! elementwise {
    ($name:ident, $f:expr) => {
        struct $name<'a>(&'a [f64], &'a [f64], &'a mut [f64]);

        impl NullaryFnOnce for $name<'_> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                for ((out, x), y) in self.2.iter_mut().zip(self.0).zip(self.1) {
                    *out = $f(*x, *y);
                }
            }
        }
    };
}

elementwise!(Exp, |x, _| scalar::exp(x));
elementwise!(Ln, |x, _| scalar::ln(x));
elementwise!(Pdf, |x, _| scalar::pdf(x));
elementwise!(Erfcx, |x, _| scalar::erfcx(x));
elementwise!(Cdf, |x, _| scalar::cdf(x));
elementwise!(LogCdf, |x, _| scalar::log_cdf(x));
elementwise!(Interval, scalar::interval);
elementwise!(LogInterval, scalar::log_interval);

impl NullaryFnOnce for Elementwise<'_> {
    type Output = ();

    /// One element at a time, through calls that are not inlined.
    fn call(self) {
        for ((out, x), y) in self.out.iter_mut().zip(self.x).zip(self.y) {
            *out = (self.work)(*x, *y);
        }
    }
}

fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter()
        .zip(b)
        .all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan())
}

#[test]
fn every_width_gives_the_same_bits_and_so_do_scalars() {
    let x = arguments();
    let mut y = x.clone();
    y.rotate_left(1);
    macro_rules! check {
        ($($kernel:ident: $scalar:expr,)*) => {$({
            let mut alone = vec![0.0; x.len()];
            Elementwise { work: $scalar, x: &x, y: &y, out: &mut alone }.call();
            for arch in widths() {
                let mut out = vec![0.0; x.len()];
                arch.dispatch($kernel(&x, &y, &mut out));
                let first = (0..x.len()).find(|i| !same(&out[*i..=*i], &alone[*i..=*i]));
                assert!(first.is_none(), "{} at {:?}: {arch:?}", stringify!($kernel), first.map(|i| (x[i], y[i], out[i], alone[i])));
            }
        })*};
    }
    check! {
        Exp: |x, _| scalar::exp(x),
        Ln: |x, _| scalar::ln(x),
        Pdf: |x, _| normal::pdf(x),
        Erfcx: |x, _| normal::erfcx(x),
        Cdf: |x, _| normal::cdf(x),
        LogCdf: |x, _| normal::log_cdf(x),
        Interval: normal::interval,
        LogInterval: normal::log_interval,
    }
}

#[test]
fn slices_are_the_scalars_at_every_length() {
    let x = arguments();
    for count in (0..40).chain([x.len()]) {
        let one = |kernel: fn(&mut [f64]), scalar: fn(f64) -> f64| {
            let mut values = x[..count].to_vec();
            kernel(&mut values);
            let expected: Vec<f64> = x[..count].iter().map(|x| scalar(*x)).collect();
            assert!(same(&values, &expected));
        };
        one(kernels::exp, scalar::exp);
        one(kernels::ln, scalar::ln);
        one(kernels::cdf, normal::cdf);
        one(kernels::log_cdf, normal::log_cdf);
        let upper: Vec<f64> = x.iter().map(|x| x + 0.7).collect();
        for (kernel, scalar) in [
            (kernels::interval as fn(&mut [f64], &[f64]), normal::interval as fn(f64, f64) -> f64),
            (kernels::log_interval, normal::log_interval),
        ] {
            let mut values = x[..count].to_vec();
            kernel(&mut values, &upper);
            let expected: Vec<f64> = x[..count].iter().zip(&upper).map(|(x, u)| scalar(*x, *u)).collect();
            assert!(same(&values, &expected));
        }
    }
}

#[test]
fn ends_have_their_limits() {
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    assert_eq!([normal::cdf(-inf), normal::cdf(inf), normal::cdf(-40.0)], [0.0, 1.0, 0.0]);
    assert_eq!([normal::log_cdf(-inf), normal::log_cdf(inf), normal::log_cdf(40.0)], [-inf, 0.0, 0.0]);
    assert_eq!([normal::inverse_mills(-inf), normal::inverse_mills(inf)], [inf, 0.0]);
    assert_eq!([normal::erfcx(-inf), normal::erfcx(inf), normal::erfcx(-26.7)], [inf, 0.0, inf]);
    assert_eq!(normal::pdf(inf), 0.0);
    for f in [
        normal::cdf,
        normal::log_cdf,
        normal::inverse_mills,
        normal::erfcx,
        normal::pdf,
    ] {
        assert!(f(nan).is_nan());
    }
    for (a, b, p) in [
        (-inf, inf, 1.0),
        (-inf, -inf, 0.0),
        (inf, inf, 0.0),
        (1.0, 1.0, 0.0),
        (2.0, 1.0, 0.0),
        (-inf, 0.0, 0.5),
        (0.0, inf, 0.5),
        (50.0, inf, 0.0),
    ] {
        assert_eq!(normal::interval(a, b), p, "[{a}, {b}]");
        if p > 0.0 || a >= b {
            assert_eq!(normal::log_interval(a, b), p.ln(), "[{a}, {b}]");
        }
    }
    assert!(normal::log_interval(1e160, inf) == -inf && normal::log_interval(1e10, inf).is_finite());
    for (a, b) in [(nan, 1.0), (-1.0, nan), (nan, nan), (nan, inf), (-inf, nan)] {
        assert!(normal::interval(a, b).is_nan() && normal::log_interval(a, b).is_nan(), "[{a}, {b}]");
    }
}

#[test]
fn erfcx_of_a_negative_argument_is_as_good_as_of_a_positive_one() {
    // mpmath: erfcx(-20.3), 20 units off before.
    assert!(ulps(normal::erfcx(-20.3), 1.859_700_651_326_472_2e179) < 6.0);
}

/// Largest distance between an empirical distribution function and `Phi`, times the root of the count.
fn kolmogorov_smirnov(draws: &mut [f64]) -> f64 {
    draws.sort_by(f64::total_cmp);
    let n = draws.len() as f64;
    let distance = draws.iter().enumerate().fold(0.0_f64, |d, (i, x)| {
        let p = normal::cdf(*x);
        d.max(p - i as f64 / n).max((i + 1) as f64 / n - p)
    });
    distance * n.sqrt()
}

#[test]
fn blocks_of_draws_are_normal_to_the_tails() {
    use rand::SeedableRng;
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
    let mut draws = vec![0.0; 2_000_000];
    kernels::StandardNormals::new(&mut rng).fill(&mut draws);
    let n = draws.len() as f64;
    // Serial correlation at every distance up to two rows of lanes, and of squares.
    for lag in 1..=16 {
        let products: f64 = draws.windows(lag + 1).map(|w| w[0] * w[lag]).sum();
        assert!(products.abs() < 4.5 * n.sqrt(), "lag {lag}");
        let squares: f64 = draws
            .windows(lag + 1)
            .map(|w| (w[0] * w[0] - 1.0) * (w[lag] * w[lag] - 1.0))
            .sum();
        assert!(squares.abs() < 4.5 * 2.0 * n.sqrt(), "squares at lag {lag}");
    }
    // Moments against their standard errors.
    for (power, mean, variance) in [
        (1, 0.0, 1.0),
        (2, 1.0, 2.0),
        (3, 0.0, 15.0),
        (4, 3.0, 96.0),
        (6, 15.0, 10_170.0),
    ] {
        let moment = draws.iter().map(|x| x.powi(power)).sum::<f64>() / n;
        assert!((moment - mean).abs() < 4.0 * (variance / n).sqrt(), "moment {power}: {moment}");
    }
    // Masses of cells that cut through layers, the tail beyond the lowest edge and the far tail, on either side.
    for edge in [0.1, 0.5, 1.0, 2.0, 3.0, 3.654_152_885_361_009, 4.0, 4.5] {
        let p = normal::cdf(-edge);
        for sign in [-1.0, 1.0] {
            let count = draws.iter().filter(|x| sign * **x > edge).count() as f64;
            assert!((count - n * p).abs() < 4.5 * (n * p).sqrt() + 1.0, "{count} beyond {edge}");
        }
    }
    // Beyond 1.95 with probability below 0.001.
    assert!(kolmogorov_smirnov(&mut draws) < 1.95);
    // The tail alone, given that it is one.
    let tail: Vec<f64> = draws
        .iter()
        .map(|x| x.abs())
        .filter(|x| *x > 3.654_152_885_361_009)
        .collect();
    let mut mapped: Vec<f64> = tail
        .iter()
        .map(|x| normal::quantile(normal::cdf(-*x) / normal::cdf(-3.654_152_885_361_009)))
        .collect();
    assert!(mapped.len() > 400 && kolmogorov_smirnov(&mut mapped) < 1.95);
}

#[test]
fn draws_depend_on_the_stream_alone() {
    use rand::SeedableRng;
    for count in [0, 1, 7, 47, 48, 127, 128, 129, 1000] {
        let draw = |seed| {
            let mut out = vec![0.0; count];
            kernels::StandardNormals::new(&mut rand_pcg::Pcg64Mcg::seed_from_u64(seed)).fill(&mut out);
            out
        };
        assert_eq!(draw(3), draw(3));
        assert!(count == 0 || draw(3) != draw(4));
        assert!(draw(3).iter().all(|x| x.is_finite()));
    }
}
