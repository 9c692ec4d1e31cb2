//! Core's laws on the quantizing sensor and its reports.

use fewbits_core::bits::BitString;
use fewbits_core::laws::{factor, message, scheme};
use fewbits_core::{Gaussian, Link, Observation, Scheme};
use fewbits_monte_carlo::Stream;
use fewbits_quantizers::{Channel, Labelling, Quantizer, QuantizingSensor, Symbol, lloyd_max};
use proptest::prelude::*;
use rand::RngExt;
use rand_distr::StandardNormal;

type Scalar = fewbits_core::nalgebra::SVector<f64, 1>;

/// Contiguous and folded cells, complete and incomplete words, at three scales.
fn sensors() -> Vec<QuantizingSensor> {
    let mut all = Vec::new();
    for scale in [1e-4, 1.0, 1e4] {
        let lloyd = Quantizer::from(&lloyd_max::gaussian(4).unwrap().affine(0.0, scale).unwrap());
        let folded = Quantizer::with_labels(vec![-scale, 0.2 * scale, 1.5 * scale], vec![0, 1, 2, 0]).unwrap();
        let variance = 0.3 * scale * scale;
        all.push(QuantizingSensor::with_variance(lloyd, Labelling::gray(4).unwrap(), variance).unwrap());
        let gaps = Labelling::with_words(2, vec![0, 1, 3]).unwrap();
        all.push(QuantizingSensor::with_variance(folded, gaps, variance).unwrap());
    }
    all
}

fn symbols(sensor: &QuantizingSensor) -> impl Iterator<Item = Symbol> + use<> {
    (0..sensor.labelling().symbols()).map(Symbol)
}

fn points(sensor: &QuantizingSensor) -> Vec<Scalar> {
    let s = sensor.noise_variance().sqrt();
    [-60.0, -4.0, -0.3, 0.0, 1.1, 5.0, 1e9]
        .map(|m| Scalar::from([m * s]))
        .to_vec()
}

fn links() -> [Link; 4] {
    [
        Link::PERFECT,
        Link::new(0.2, 0.1).unwrap(),
        Link::flipping(0.5).unwrap(),
        Link::new(0.2, 0.1).unwrap().with_erasure(0.3).unwrap(),
    ]
}

#[test]
fn every_quantizing_sensor_obeys_the_laws_of_schemes() {
    for (i, sensor) in sensors().into_iter().enumerate() {
        let s = sensor.noise_variance().sqrt();
        for (j, link) in links().into_iter().enumerate() {
            scheme::total_probability(&sensor, &(), &link, symbols(&sensor), &points(&sensor)).unwrap();
            let mut rng = Stream::new(7).indexed(i as u64).indexed(j as u64).rng();
            let noise = |rng: &mut rand_pcg::Pcg64Dxsm| Scalar::from([s * rng.sample::<f64, _>(StandardNormal)]);
            let m = Scalar::from([0.7 * s]);
            scheme::frequencies(&sensor, &(), &link, &mut rng, 20_000, &m, noise, symbols(&sensor)).unwrap();
        }
        let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
        scheme::deterministic(&sensor, &(), &sources, &points(&sensor)).unwrap();
    }
}

#[test]
fn every_received_symbol_obeys_the_laws_of_factors() {
    for sensor in sensors() {
        let s = sensor.noise_variance().sqrt();
        let prior = Gaussian::scalar(0.4 * s, 2.0 * s * s).unwrap();
        for link in links() {
            for symbol in symbols(&sensor) {
                let Ok(received) = sensor.factor(&(), &Observation::Received(symbol), &link) else {
                    panic!("{symbol:?} is refused");
                };
                factor::is_a_number(&received, &points(&sensor)).unwrap();
                factor::sweep_is_scalar(&received, &points(&sensor)).unwrap();
                let possible = symbol.0 < sensor.labelling().levels() || link.crossover() > 0.0;
                if possible {
                    factor::tilted_is_quadrature(&received, &prior, 20.0 * s, 20_001, 1e-9).unwrap();
                }
            }
            assert!(sensor.factor(&(), &Observation::Received(Symbol(4)), &link).is_err());
        }
    }
}

#[test]
fn a_symbol_through_any_channel_is_a_lawful_factor() {
    let quantizer = Quantizer::new(vec![-0.7, 0.1, 1.3]).unwrap();
    let channels = [
        Channel::symbol_erasure(4, 0.2).unwrap(),
        Channel::pulse_amplitude(4, 10.0).unwrap(),
        Channel::binary_symmetric(&Labelling::gray(4).unwrap(), 0.1).unwrap(),
    ];
    let prior = Gaussian::scalar(0.2, 1.5).unwrap();
    for channel in channels {
        for symbol in 0..channel.outputs() {
            let received = quantizer.factor(symbol, &channel, 0.4).unwrap();
            factor::tilted_is_quadrature(&received, &prior, 14.0, 20_001, 1e-9).unwrap();
        }
    }
}

#[test]
fn a_failed_measurement_is_an_error_and_not_a_level() {
    let sensor = &sensors()[0];
    let mut rng = Stream::new(1).rng();
    assert!(
        sensor
            .encode(&mut rng, &mut (), &Scalar::from([f64::NAN]), &())
            .is_err()
    );
    let quantizer = || Quantizer::symmetric(1.0).unwrap();
    assert!(QuantizingSensor::with_variance(quantizer(), Labelling::gray(8).unwrap(), 1.0).is_err());
    assert!(QuantizingSensor::with_variance(quantizer(), Labelling::gray(4).unwrap(), f64::NAN).is_err());
    let json = serde_json::to_string(sensor).unwrap();
    assert_eq!(&serde_json::from_str::<QuantizingSensor>(&json).unwrap(), sensor);
}

proptest! {
    #[test]
    fn any_bits_decode_and_any_sample_encodes(bytes in prop::collection::vec(any::<u8>(), 0..3), y in any::<f64>()) {
        let q = Quantizer::new(vec![-1.0, 0.0, 1.0, 2.0]).unwrap();
        let labelling = Labelling::gray(5).unwrap();
        if let Ok(level) = q.encode(y) {
            prop_assert!(level < 5 && q.cell(level).unwrap().contains(y) | y.is_infinite());
            prop_assert_eq!(message::round_trip(&Symbol(level), &labelling), Ok(3));
        } else {
            prop_assert!(y.is_nan());
        }
        let bits = bytes.len() * 8;
        prop_assert!(message::decoding_is_total::<Symbol>(&BitString::from_bytes(bytes, bits).unwrap(), &labelling));
    }
}

/// Defect: a label of `usize::MAX` overflowed, from JSON too.
#[test]
fn huge_labels_are_refused() {
    assert!(Quantizer::with_labels(vec![0.0], vec![0, usize::MAX]).is_err());
    let json = format!(r#"{{"breakpoints":[0.0],"labels":[0,{}]}}"#, usize::MAX);
    assert!(serde_json::from_str::<Quantizer>(&json).is_err());
}
