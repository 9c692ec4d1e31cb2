//! The laws of schemes, slot by slot.

use super::common::mixed;
use fewbits_adaptive::{Config, Sensor, SlotScheme};
use fewbits_core::{Factor, Gaussian, Link, Observation, Scheme, laws};
use fewbits_monte_carlo::Stream;
use nalgebra::Vector1;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

#[test]
fn slots_obey_the_laws_of_schemes() {
    for (seed, config) in [
        (1, Config::new(0.3).unwrap()),
        (2, Config::new(0.3).unwrap().resilient(4, None).unwrap()),
    ] {
        let mut sensor = Sensor::new(config);
        for x in mixed(seed, 200) {
            sensor.encode(x).unwrap();
        }
        let scheme = SlotScheme::new(&sensor, 0.16).unwrap();
        let reports = || (-40..=40).filter(|k| *k != 0).map(|k| scheme.packet(k).unwrap());
        let centre = scheme.prediction();
        let measurements = [-3.0, -0.4, 0.0, 0.29, 2.0].map(|d| Vector1::new(centre + d));
        for link in [Link::PERFECT, Link::lossy(0.2).unwrap().with_erasure(0.3).unwrap()] {
            laws::scheme::total_probability(&scheme, &(), &link, reports(), &measurements).unwrap();
            let noise = |rng: &mut _| Vector1::new(0.4 * normal(rng));
            let few = (-3..=3).filter(|k| *k != 0).map(|k| scheme.packet(k).unwrap());
            let mut rng = Stream::new(seed).rng();
            laws::scheme::frequencies(&scheme, &(), &link, &mut rng, 20_000, &measurements[3], noise, few).unwrap();
        }
        let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
        laws::scheme::deterministic(&scheme, &(), &sources, &measurements).unwrap();
        assert!(
            scheme
                .factor(&(), &Observation::Nothing, &Link::flipping(0.1).unwrap())
                .is_err()
        );
        assert!(SlotScheme::new(&Sensor::new(config), 0.1).is_err());
    }
}

/// A sample that no lattice point represents is sent whole. Its factor is `(1 - loss) N(sample; m, noise)`.
#[test]
fn whole_sample_over_a_lossy_link_counts_its_arrival() {
    let mut sensor = Sensor::new(Config::new(0.3).unwrap());
    for x in mixed(1, 50) {
        sensor.encode(x).unwrap();
    }
    let (noise, loss, far) = (0.16, 0.2, 1e15);
    let scheme = SlotScheme::new(&sensor, noise).unwrap();
    let mut rng = Stream::new(1).rng();
    let report = scheme
        .encode(&mut rng, &mut (), &Vector1::new(far), &())
        .unwrap()
        .unwrap();
    let factor = scheme
        .factor(&(), &Observation::Received(report), &Link::lossy(loss).unwrap())
        .unwrap();
    let expected = |variance: f64, off: f64| {
        (1.0 - loss).ln() - 0.5 * (std::f64::consts::TAU * variance).ln() - 0.5 * off * off / variance
    };
    for off in [0.0, 0.5] {
        let at = factor.log_likelihood(&Vector1::new(far + off));
        assert!((at - expected(noise, off)).abs() < 1e-12, "{at}");
    }
    let mut sweep = [0.0; 2];
    factor.add_log_likelihoods(&[&[far, far + 0.5]], &mut sweep);
    assert!((sweep[0] - expected(noise, 0.0)).abs() < 1e-12 && (sweep[1] - expected(noise, 0.5)).abs() < 1e-12);
    let tilted = factor.tilted(&Gaussian::scalar(far, 1.0).unwrap()).unwrap();
    assert!((tilted.log_evidence - expected(1.0 + noise, 0.0)).abs() < 1e-12);
}

fn normal<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    rng.sample(StandardNormal)
}
