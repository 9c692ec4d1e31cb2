//! What travels, as bits.

use super::{joint, posterior_of, sensor};
use fewbits_baselines::diffusive::{lpg, particles};
use fewbits_core::laws::message::{decoding_is_total, round_trip};
use fewbits_core::{BitString, Gaussian, Message, NumberFormat};
use fewbits_diffusive::message::{Contract, Packet, SampleCode, Wire};
use fewbits_diffusive::{Fit, Form, Posterior, Prior, RateModel, SourceLikelihood, project};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

fn contract(form: Form, numbers: NumberFormat) -> Contract {
    let wire = Wire {
        numbers,
        samples: Some(SampleCode { bits: 9, step: 1.0 }),
        index_bits: 9,
    };
    Contract {
        form,
        wire,
        noise: 8e-6,
        samples: 5,
    }
}

fn posterior(rate: RateModel) -> (Posterior, SourceLikelihood) {
    let sensor = sensor(1.0, false);
    let record = |n: [f64; 2]| {
        let node = Vector2::from(n);
        sensor
            .record(&node, &sensor.responses(&node, &Vector2::new(62.0, 50.0)).unwrap())
            .unwrap()
    };
    let likelihood = SourceLikelihood::new(vec![record([50.0, 54.0]), record([58.0, 60.0])], rate).unwrap();
    let prior = Prior::Exact(Gaussian::new(Vector2::new(50.0, 54.0), Matrix2::identity() * 2500.0).unwrap());
    (posterior_of(&prior, &likelihood).unwrap(), likelihood)
}

#[test]
fn beliefs_arrive_as_they_were_sent() {
    for numbers in [NumberFormat::Double, NumberFormat::Single] {
        for (form, rate) in [
            (Form::Gaussian, joint()),
            (Form::Mixture(4), joint()),
            (Form::Mixture(3), RateModel::Known(1.0)),
            (lpg::<2, 5>(), RateModel::Known(1.0)),
            (lpg::<2, 3>(), joint()),
            (particles::<25>(), RateModel::Known(1.0)),
        ] {
            let format = contract(form, numbers);
            let (posterior, likelihood) = posterior(rate);
            let sent = project(&posterior, form, &rate).unwrap().unwrap();
            let fit = Fit {
                chi_squared: 7.25,
                samples: likelihood.records().iter().map(|record| record.samples().len()).sum(),
            };
            let packet = Packet::belief_of(&sent, &fit, &format.wire).unwrap();
            let bits = round_trip(&packet, &format).unwrap();
            let (received, arrived) = packet.belief(form).unwrap().unwrap();
            assert_eq!(arrived, fit);
            let received = received.gaussian();
            let tolerance = if numbers == NumberFormat::Double { 1e-9 } else { 1e-4 };
            assert!((received.mean() - sent.gaussian().mean()).amax() < 100.0 * tolerance);
            let off = (received.covariance() - sent.gaussian().covariance()).amax();
            assert!(off < 10.0 * tolerance * sent.gaussian().covariance().amax(), "{form:?} {off}");
            // Kind, components, degree, rate: 12 bits before the numbers; the fit: 48 after them.
            let count = (bits - 60) / numbers.bits() as usize;
            let own = form.scalars(&rate).unwrap();
            // Of two polynomial Gaussians one may be all there is.
            let is_series = [lpg::<2, 5>(), lpg::<2, 3>()].contains(&form);
            assert!(count == own || is_series && 2 * count == own, "{form:?} {count} {own}");
        }
    }
}

#[test]
fn raw_records_cost_what_they_should() {
    let (_, likelihood) = posterior(joint());
    let format = contract(Form::Raw, NumberFormat::Single);
    let quantised: Vec<_> = likelihood
        .records()
        .iter()
        .map(|r| format.wire.quantised(r.clone()).unwrap())
        .collect();
    for (before, after) in likelihood.records().iter().zip(&quantised) {
        assert!((after.noise() / before.noise() - (13.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        for (a, b) in before.samples().iter().zip(after.samples()) {
            assert!((a - b).abs() <= 0.5 * 8e-6 + 1e-15);
        }
    }
    let packet = Packet::raw(&quantised, &[17, 301]);
    // One bit, a count of ten bits, and 54 bits a node.
    assert_eq!(round_trip(&packet, &format).unwrap(), 11 + 2 * 54);
    assert_eq!(packet.belief(Form::Raw).unwrap(), None);
    // What arrives is what was quantised, to the bit.
    let bits = packet.to_bits(&format).unwrap();
    assert_eq!(Packet::from_bits(&format, &bits).unwrap(), packet);
}

proptest! {
    #[test]
    fn any_bits_are_a_message_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200), cut in 0_usize..8) {
        let bits = (bytes.len() * 8).saturating_sub(cut);
        let string = BitString::from_bytes(bytes, bits).unwrap();
        for numbers in [NumberFormat::Double, NumberFormat::Single] {
            for form in [Form::Raw, Form::Gaussian, lpg::<2, 5>(), particles::<25>()] {
                let contract = contract(form, numbers);
                prop_assert!(decoding_is_total::<Packet>(&string, &contract));
                if let Ok(packet) = Packet::decode(&contract, &mut fewbits_core::BitReader::new(&string)) {
                    // A belief or an error, never a panic.
                    let _ = packet.belief(form);
                }
            }
        }
    }
}
