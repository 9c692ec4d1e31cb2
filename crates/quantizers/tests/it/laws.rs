//! Laws that hold for every system of quantizers.

use fewbits_quantizers::system::Group;
use fewbits_quantizers::{Channel, Criterion, Labelling, Noise, Prior, Quantizer, Scene, System};
use proptest::prelude::*;

fn breakpoints(count: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.15..1.2f64, count + 1).prop_map(|gaps| {
        let middle: f64 = gaps.iter().sum::<f64>() * 0.5;
        let mut at = -middle;
        gaps[..gaps.len() - 1]
            .iter()
            .map(|g| {
                at += g;
                at
            })
            .collect()
    })
}

/// Two sensors, any correlation, any crossover, the second quantizer with a repeated label.
fn pair() -> impl Strategy<Value = System> {
    (breakpoints(3), breakpoints(4), 0.4..2.0f64, 0.4..2.0f64, -0.9..0.9f64, 0.0..0.2f64, any::<bool>()).prop_map(
        |(a, b, s1, s2, rho, eps, equal)| {
            let sds = if equal { [s1, s1] } else { [s1, s2] };
            let rho = if rho.abs() < 0.2 { 0.0 } else { rho };
            let scene = Scene::new(Prior::gaussian(1.0).unwrap(), Noise::equicorrelated(&sds, rho).unwrap()).unwrap();
            let channel = Channel::binary_symmetric(&Labelling::natural(4).unwrap(), eps).unwrap();
            let quantizers = vec![
                Quantizer::new(a).unwrap(),
                Quantizer::with_labels(b, vec![0, 1, 2, 3, 0]).unwrap(),
            ];
            System::distinct(scene, quantizers, vec![channel.clone(), channel]).unwrap()
        },
    )
}

/// Three identical sensors and a fourth, with a finite or Gaussian prior.
fn grouped() -> impl Strategy<Value = System> {
    (breakpoints(2), breakpoints(1), 0.5..1.5f64, 0.0..0.2f64, 0..3usize).prop_map(|(a, b, sd, loss, kind)| {
        let prior = if kind == 2 {
            Prior::discrete(vec![-1.0, 0.2, 1.5], vec![0.3, 0.5, 0.2]).unwrap()
        } else {
            Prior::gaussian(1.0).unwrap()
        };
        let noise = if kind == 1 {
            Noise::equicorrelated(&[sd; 4], 0.3)
        } else {
            Noise::independent(&[sd, sd, sd, 0.8])
        };
        let scene = Scene::new(prior, noise.unwrap()).unwrap();
        let three = Group::new(Quantizer::new(a).unwrap(), Channel::symbol_erasure(3, loss).unwrap(), vec![0, 1, 2]);
        let one = Group::new(Quantizer::new(b).unwrap(), Channel::ideal(2).unwrap(), vec![3]);
        System::new(scene, vec![three.unwrap(), one.unwrap()]).unwrap()
    })
}

fn moved(system: &System, at: usize, by: f64) -> System {
    let mut left = at;
    let mut quantizers = system.quantizers();
    for q in &mut quantizers {
        let mut b = q.breakpoints().to_vec();
        if left < b.len() {
            b[left] += by;
            *q = q.with_breakpoints(b).unwrap();
            break;
        }
        left -= b.len();
    }
    system.with_quantizers(quantizers).unwrap()
}

/// Fourth-order central difference of `f` along breakpoint `i`.
fn difference<T>(system: &System, i: usize, f: impl Fn(&System) -> T) -> T
where
    T: std::ops::Sub<T, Output = T> + std::ops::Mul<f64, Output = T>,
{
    let h = 3e-4;
    let at = |steps: f64| f(&moved(system, i, steps * h));
    (at(1.0) - at(-1.0)) * (2.0 / (3.0 * h)) - (at(2.0) - at(-2.0)) * (1.0 / (12.0 * h))
}

fn agree_with_differences(system: &System, criterion: Criterion) {
    let found = system.derivatives(criterion).unwrap();
    assert!((found.value - system.value(criterion).unwrap()).abs() < 1e-13);
    for i in 0..found.gradient.len() {
        let slope = difference(system, i, |s| s.value(criterion).unwrap());
        assert!((slope - found.gradient[i]).abs() < 1e-8, "{criterion:?} {i}: {slope} {}", found.gradient[i]);
        let column = difference(system, i, |s| s.derivatives(criterion).unwrap().gradient);
        for j in 0..column.len() {
            let entry = found.hessian[(j, i)];
            assert!((column[j] - entry).abs() < 1e-7, "{criterion:?} {i} {j}: {} {entry}", column[j]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn derivatives_of_pairs_agree_with_central_differences(system in pair()) {
        agree_with_differences(&system, Criterion::MutualInformation);
        agree_with_differences(&system, Criterion::MeanSquaredError);
    }

    #[test]
    fn derivatives_of_groups_agree_with_central_differences(system in grouped()) {
        agree_with_differences(&system, Criterion::MutualInformation);
        agree_with_differences(&system, Criterion::MeanSquaredError);
    }
}
