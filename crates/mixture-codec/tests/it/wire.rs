//! The wire format: golden bytes, resolution, totality, rate control.

use crate::common::{crescent, lobe, random_mixture};
use fewbits_core::{Belief, BitReader, BitString, Message, laws};
use fewbits_densities::{Component, Mixture};
use fewbits_mixture_codec::plug_in::cubature;
use fewbits_mixture_codec::wire::{CodedMixture, FORMAT, RateControl, WireFormat};
use fewbits_mixture_codec::{Cubature, Reduction};
use fewbits_monte_carlo::Stream;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;
use rand::RngExt;

fn golden() -> Mixture<2> {
    Mixture::new(vec![
        lobe(0.5, [1.25, -0.5], [0.04, 0.01, 0.09]),
        lobe(0.3, [0.5, 0.25], [0.09, -0.03, 0.05]),
        lobe(0.2, [1.75, 0.5], [0.02, 0.0, 0.02]),
    ])
    .unwrap()
}

/// Changing a byte here means a new [`FORMAT`] and a line in the changelog.
#[test]
fn the_bytes_of_format_one() {
    assert_eq!(FORMAT, 1);
    let format = WireFormat::around_origin(1.0, 0.25).unwrap();
    let bits = CodedMixture::new(&golden(), &format, 0)
        .unwrap()
        .to_bits(&format)
        .unwrap();
    let hex: String = bits.bytes().iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!((bits.bits(), hex.as_str()), (100, "0dd7ed83a1a39e43d6ccca0360"));
}

fn golden_bytes<const D: usize>(mixture: &Mixture<D>, format: &WireFormat<D>, resolution: usize) -> (usize, String) {
    let message = CodedMixture::new(mixture, format, resolution).unwrap();
    let bits = message.to_bits(format).unwrap();
    assert_eq!(CodedMixture::from_bits(format, &bits).unwrap(), message);
    assert_eq!(&message.clone().into_mixture(), message.mixture());
    (bits.bits(), bits.bytes().iter().map(|b| format!("{b:02x}")).collect())
}

/// The same in one and three dimensions, off the origin, of one component and many, with escapes, with steps so fine that the low
/// bits are coded apart, and with a last mean that is and one that is not foretold by the others.
#[test]
fn the_bytes_of_format_one_in_every_corner() {
    let part = |w: f64, m: [f64; 3], roots: [f64; 6]| {
        let [a, b, c, d, e, f] = roots;
        let lower = nalgebra::Matrix3::new(a, 0.0, 0.0, b, c, 0.0, d, e, f);
        Component::new(w, SVector::from(m), lower * lower.transpose()).unwrap()
    };
    let solid = |parts: Vec<Component<3>>| Mixture::new(parts).unwrap();
    let line = |parts: &[(f64, f64, f64)]| {
        let part =
            |(w, m, s): &(f64, f64, f64)| Component::new(*w, SVector::from([*m]), SMatrix::from([[s * s]])).unwrap();
        Mixture::new(parts.iter().map(part).collect()).unwrap()
    };
    let three = solid(vec![
        part(0.5, [3.1, -1.2, 0.4], [1.2, 0.3, 0.7, -0.2, 0.4, 0.9]),
        part(0.2, [2.2, 0.9, -1.4], [0.6, -0.3, 1.1, 0.5, 0.1, 0.4]),
        part(0.3, [4.0, -0.3, 1.1], [0.8, 0.0, 0.5, 0.3, -0.6, 1.3]),
    ]);
    let one = solid(vec![part(1.0, [3.1, -1.2, 0.4], [1.2, 0.3, 0.7, -0.2, 0.4, 0.9])]);
    let off = WireFormat::new(SVector::from([1.3, -0.4, 0.2]), 7.3, 2.5, &[0.4, 0.11, 0.003]).unwrap();
    let wide = line(&[
        (0.6, -3.0, 0.2),
        (1e-14, 4.0, 1e-3),
        (0.4, 5.0, 2.0),
        (1e-40, -900.0, 0.3),
    ]);
    let field = WireFormat::new(SVector::from([2.0]), 1e3, 0.5, &[0.2, 2e-4]).unwrap();
    let many = line(
        &(0..9)
            .map(|i| (1.0 + f64::from(i * i % 5), f64::from(i * i) * 0.7, 0.3 + 0.1 * f64::from(i)))
            .collect::<Vec<_>>(),
    );
    for (found, bits, hex) in [
        (golden_bytes(&three, &off, 0), 133, "0c9998f99aaedb151e5d1362b9bca68d18"),
        (golden_bytes(&three, &off, 1), 195, "0df026737d806236173db54aef41c99b41a83737dfb25cf6e0"),
        (
            golden_bytes(&three, &off, 2),
            392,
            "0f4536f5ac9e0990380fb6274e5ff550e82d47d5011b2eda75e214a5d8e7c72ecd9b0860ef270aaad4cbae9885d4d778a2",
        ),
        (golden_bytes(&one, &off, 1), 68, "05f01d2f1e509984c0"),
        (
            golden_bytes(&wide, &field, 0),
            253,
            "1142c64dc93b33fc1e2a95a63003b8b4d64683a9892ee971a04c2d19ce651648",
        ),
        (
            golden_bytes(&wide, &field, 1),
            342,
            "13435da3c907b26c136749f37fcd9119d46f9e7d38786b308e7d3a9adf4361b5975bc3f618991d53aed9f8",
        ),
        (golden_bytes(&many, &field, 0), 223, "256f53802d589d0d492b69e86466c16996cf06ad74965a27760fa712"),
        (
            golden_bytes(&line(&[(1.0, 0.3, 0.2)]), &WireFormat::around_origin(1.0, 0.25).unwrap(), 0),
            24,
            "0598d9",
        ),
    ] {
        assert_eq!((found.0, found.1.as_str()), (bits, hex));
    }
}

/// Lower Cholesky factor in coordinates where the whole is the identity.
fn inner<const D: usize>(whole: &SMatrix<f64, D, D>, c: &Component<D>) -> SMatrix<f64, D, D> {
    let l = nalgebra::Cholesky::new(*whole).unwrap().l();
    let w = l.solve_lower_triangular(&SMatrix::<f64, D, D>::identity()).unwrap();
    nalgebra::Cholesky::new(w * c.covariance() * w.transpose()).unwrap().l()
}

fn quantisation_is_within_the_resolution<const D: usize>(seed: u64, k: usize, r: f64, unit: f64) {
    let mixture = random_mixture::<D, _>(&mut Stream::new(seed).rng(), k, unit);
    let format = WireFormat::around_origin(unit, r).unwrap();
    let message = CodedMixture::new(&mixture, &format, 0).unwrap();
    laws::message::round_trip(&message, &format).unwrap();
    let coded = message.mixture();
    assert_eq!(coded.len(), k);
    let mut sorted: Vec<&Component<D>> = mixture.components().iter().collect();
    sorted.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    for (c, q) in sorted.iter().zip(coded.components()) {
        let (l, gap) = (q.factor().lower, c.mean() - q.mean());
        if k == 1 {
            // Half a step along each axis: a step is `r` deviations given the coordinates before.
            for d in 0..D {
                assert!(gap[d].abs() <= 0.5 * r * l[(d, d)] * (1.0 + 1e-6), "{gap:?} at {r}");
            }
        } else {
            // Off-diagonal entries of the overall factor mix the coordinates, the more the more slanted the component.
            let z = l.solve_lower_triangular(&gap).unwrap();
            let own = inner(&mixture.covariance(), q);
            let slant = own
                .solve_lower_triangular(&SMatrix::<f64, D, D>::identity())
                .unwrap()
                .abs();
            let bound = slant * own.diagonal() * (0.7 * r * (1.0 + 4.0 * r));
            assert!((0..D).all(|d| z[d].abs() <= bound[d]), "{z:?} {bound:?} at {r}");
        }
        let ratio = 2.0 * (c.factor().half_log_det - q.factor().half_log_det).abs();
        assert!(ratio <= 2.0 * D as f64 * (0.5 * r + 0.25 * r) * (1.0 + 3.0 * r) + 1e-9, "{ratio} at {r}");
        let (a, b) = (inner(&mixture.covariance(), c), inner(&mixture.covariance(), q));
        assert!((a - b).amax() < 3.0 * D as f64 * r * (a.amax() + b.amax()));
    }
}

proptest! {
    // One case in 4 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    #[test]
    fn quantisation_errors_are_within_the_resolution(seed in any::<u64>(), k in 1..12_usize, r in 0.01..0.3_f64, e in -4..5_i32) {
        let unit = 10.0_f64.powi(e);
        quantisation_is_within_the_resolution::<1>(seed, k, r, unit);
        quantisation_is_within_the_resolution::<2>(seed, k, r, unit);
        quantisation_is_within_the_resolution::<3>(seed, k, r, unit);
    }

    #[test]
    fn finer_resolutions_converge(seed in any::<u64>(), k in 1..8_usize) {
        let mixture = random_mixture::<2, _>(&mut Stream::new(seed).rng(), k, 1.0);
        let format = WireFormat::around_origin(1.0, 1e-4).unwrap();
        let coded = CodedMixture::new(&mixture, &format, 0).unwrap();
        prop_assert!((coded.mixture().mean() - mixture.mean()).amax() < 2e-3);
        prop_assert!((coded.mixture().covariance() - mixture.covariance()).amax() < 2e-2 * mixture.covariance().amax());
    }

    #[test]
    fn units_change_nothing_but_the_unit(seed in any::<u64>(), k in 1..8_usize) {
        let bits = |unit: f64| {
            let mixture = random_mixture::<2, _>(&mut Stream::new(seed).rng(), k, unit);
            let format = WireFormat::around_origin(unit, 0.25).unwrap();
            CodedMixture::new(&mixture, &format, 0).unwrap().to_bits(&format).unwrap()
        };
        // Powers of two scale without rounding.
        prop_assert_eq!(bits(1.0), bits(1.0 / 8192.0));
        prop_assert_eq!(bits(1.0), bits(16384.0));
        prop_assert!(bits(1e4).bits().abs_diff(bits(1.0).bits()) <= 16);
    }
}

/// Random, truncated and flipped strings: never a panic, and what decodes encodes to the same bits.
#[test]
fn decoding_is_total() {
    let mut rng = Stream::new(41).fast_rng();
    let format = WireFormat::<2>::new(SVector::zeros(), 20.0, 1.0, &[0.5, 0.25, 0.15]).unwrap();
    assert_eq!(format.resolutions(), [0.5, 0.25, 0.15]);
    let good: Vec<BitString> = (0..8)
        .map(|k| {
            let mixture = random_mixture::<2, _>(&mut rng, k + 1, 1.0);
            CodedMixture::new(&mixture, &format, k % 3)
                .unwrap()
                .to_bits(&format)
                .unwrap()
        })
        .collect();
    let mut decoded = 0;
    for round in 0..60_000_usize {
        let bits = match round % 4 {
            0 | 1 => {
                let n = rng.random_range(0..14_usize);
                BitString::from_bytes((0..n).map(|_| rng.random()).collect(), n * 8).unwrap()
            }
            2 => {
                let whole = &good[round / 4 % good.len()];
                let n = rng.random_range(0..whole.bits());
                BitString::from_bytes(whole.bytes().to_vec(), n).unwrap()
            }
            _ => {
                let whole = good[round / 4 % good.len()].clone();
                let at = rng.random_range(0..whole.bits());
                whole.with_flipped(at)
            }
        };
        let mut reader = BitReader::new(&bits);
        if let Ok(message) = CodedMixture::<2>::decode(&format, &mut reader) {
            decoded += 1;
            assert!(message.mixture().len() <= 63);
            let used = bits.bits() - reader.remaining();
            assert_eq!(message.to_bits(&format).unwrap().bits(), used);
            assert!(
                message
                    .mixture()
                    .components()
                    .iter()
                    .all(|c| c.factor().half_log_det.is_finite())
            );
        }
    }
    assert!(decoded > 150, "{decoded}");
}

#[test]
fn messages_need_no_end_mark() {
    let mut rng = Stream::new(42).rng();
    let format = WireFormat::<3>::around_origin(1.0, 0.25).unwrap();
    let messages: Vec<CodedMixture<3>> = (1..6)
        .map(|k| CodedMixture::new(&random_mixture(&mut rng, k, 1.0), &format, 0).unwrap())
        .collect();
    let mut writer = fewbits_core::BitWriter::new();
    for m in &messages {
        m.encode(&format, &mut writer).unwrap();
    }
    let bits = writer.finish();
    let mut reader = BitReader::new(&bits);
    for m in &messages {
        assert_eq!(&CodedMixture::decode(&format, &mut reader).unwrap(), m);
    }
    reader.finish().unwrap();
}

#[test]
fn extremes_are_carried_or_refused_by_name() {
    let format = WireFormat::around_origin(1.0, 0.25).unwrap();
    // Components a million times smaller than the whole, weights of 1e-12.
    let extreme = Mixture::new(vec![
        lobe(1.0, [0.0, 0.0], [1e-12, 0.0, 1e-10]),
        lobe(1e-12, [10.0, -5.0], [4.0, 1.9, 1.0]),
        lobe(0.4, [5.0, 5.0], [1e-8, 0.0, 1e-2]),
    ])
    .unwrap();
    let message = CodedMixture::new(&extreme, &format, 0).unwrap();
    laws::message::round_trip(&message, &format).unwrap();
    assert!((message.mixture().components()[0].mean()).amax() < 1e-3);
    let refused = |m: Mixture<2>| CodedMixture::new(&m, &format, 0).map(|_| ()).unwrap_err().to_string();
    let one = |x: f64, v: f64| Mixture::new(vec![lobe(1.0, [x, 0.0], [v, 0.0, v])]).unwrap();
    assert!(refused(one(25.0, 1.0)).contains("range of the format"));
    assert!(refused(one(0.0, 1e-8)).contains("range of the format"));
    assert!(refused(one(0.0, 1e8)).contains("range of the format"));
    let many = Mixture::new(
        (0..64)
            .map(|i| lobe(1.0, [f64::from(i) * 0.1, 0.0], [1.0, 0.0, 1.0]))
            .collect(),
    )
    .unwrap();
    assert!(refused(many).contains("63"));
    assert!(CodedMixture::new(&golden(), &format, 1).is_err());
    // Standard deviations within 40 nepers of the whole's, if also its mean is to be told in them; the whole's within 8 of the unit.
    let beside = |v: f64| {
        Mixture::new(vec![
            lobe(1.0, [0.0, 0.0], [v, 0.0, 1.0]),
            lobe(1.0, [1.0, 0.0], [1.0, 0.0, 1.0]),
        ])
        .unwrap()
    };
    assert!(CodedMixture::new(&beside((-34.0_f64).exp()), &format, 0).is_ok());
    assert!(!refused(beside((-74.0_f64).exp())).contains("logarithm of a standard deviation"));
    assert!(refused(beside((-84.0_f64).exp())).contains("logarithm of a standard deviation"));
    let overall = |nepers: f64| one(0.0, (2.0 * nepers).exp());
    let wide = WireFormat::new(SVector::zeros(), 1e5, 1.0, &[0.25]).unwrap();
    for nepers in [-7.9, 7.9] {
        let coded = CodedMixture::new(&overall(nepers), &wide, 0).unwrap().into_mixture();
        assert!((0.5 * coded.covariance()[(0, 0)].ln() - nepers).abs() < 0.07);
    }
    for nepers in [-8.2, 8.2] {
        assert!(CodedMixture::new(&overall(nepers), &wide, 0).is_err(), "{nepers}");
    }
    // More places than integers carry.
    let vast = WireFormat::new(SVector::zeros(), 1e10, 1.0, &[1e-4]).unwrap();
    assert!(
        CodedMixture::new(&one(0.0, 4e-6), &vast, 0)
            .unwrap_err()
            .to_string()
            .contains("positions in the field")
    );
    assert!(CodedMixture::new(&one(0.0, 1.0), &vast, 0).is_ok());
    assert!(CodedMixture::new(&one(0.9e10, 1.0), &vast, 0).is_ok());
    // Components of no weight are not sent.
    let mut parts = golden().components().to_vec();
    parts.insert(1, lobe(0.0, [50.0, 50.0], [1.0, 0.0, 1.0]));
    let bits = |m: &Mixture<2>| CodedMixture::new(m, &format, 0).unwrap().to_bits(&format).unwrap();
    assert_eq!(bits(&Mixture::new(parts).unwrap()), bits(&golden()));
    for resolution in [9e-5, 4.1] {
        assert!(WireFormat::<2>::around_origin(1.0, resolution).is_err());
    }
    assert!(WireFormat::<1>::new(SVector::zeros(), 1.0, 1.0, &[0.5; 16]).is_ok());
    assert!(WireFormat::<1>::new(SVector::zeros(), 1.0, 1.0, &[0.5; 17]).is_err());
    assert!(WireFormat::<2>::around_origin(1.0, 0.0).is_err() && WireFormat::<2>::around_origin(0.0, 0.2).is_err());
    assert!(WireFormat::<1>::new(SVector::zeros(), 1.0, 1.0, &[]).is_err());
}

#[test]
fn sixty_three_components_fit_and_formats_are_stored() {
    let format = WireFormat::around_origin(1.0, 0.25).unwrap();
    let mixture = random_mixture::<2, _>(&mut Stream::new(43).rng(), 63, 1.0);
    let message = CodedMixture::new(&mixture, &format, 0).unwrap();
    laws::message::round_trip(&message, &format).unwrap();
    // Also the longest.
    let fine = WireFormat::around_origin(1.0, 1e-4).unwrap();
    let longest = CodedMixture::new(&random_mixture::<3, _>(&mut Stream::new(44).rng(), 63, 1.0), &fine, 0).unwrap();
    laws::message::round_trip(&longest, &fine).unwrap();
    let text = serde_json::to_string(&format).unwrap();
    assert_eq!(serde_json::from_str::<WireFormat<2>>(&text).unwrap(), format);
    assert!(serde_json::from_str::<WireFormat<3>>(&text).is_err());
}

#[test]
fn rate_control_keeps_the_budget_and_uses_it() {
    let estimate = crescent(5, 150, 1.0);
    let format = WireFormat::new(SVector::zeros(), 20.0, 1.0, &[0.5, 0.35, 0.25, 0.15]).unwrap();
    let control = RateControl::default();
    let mut last = f64::INFINITY;
    for budget in [60, 100, 150, 300] {
        let rated = control.fit(&estimate, &format, budget).unwrap();
        assert!(rated.bits <= budget && rated.kl <= last);
        last = rated.kl;
    }
    // The best of all that fit.
    let table = control.table(&estimate, &format).unwrap();
    assert_eq!(table.len(), 7 * 4);
    for row in &table {
        assert_eq!(row.message.to_bits(&format).unwrap().bits(), row.bits);
        let kl = cubature(&estimate, row.message.mixture(), Cubature::GaussHermite).kl_plugin;
        assert!((row.kl - kl).abs() < 1e-12);
    }
    for budget in [table[0].bits, 80, 133] {
        let rated = control.fit(&estimate, &format, budget).unwrap();
        assert!(table.iter().all(|row| row.bits > budget || row.kl >= rated.kl));
    }
    let refusal = control.fit(&estimate, &format, 20).unwrap_err().to_string();
    assert!(refusal.contains("budget") && refusal.contains("at least"), "{refusal}");
    let none = RateControl {
        components: vec![],
        ..control
    };
    assert!(none.fit(&estimate, &format, 300).is_err());
    assert_eq!(none.reduction, Reduction::default());
}
