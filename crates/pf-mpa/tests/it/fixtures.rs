//! Reference values of another program, every one by its id.

use fewbits_baselines::pf_mpa::association::{self, AssociationRule, tanh_rule};
use fewbits_baselines::pf_mpa::leader::StepBits;
use fewbits_baselines::pf_mpa::product;
use fewbits_baselines::pf_mpa::{
    AccelerationChain, CramerRao, Encoder, Linearised, Manoeuvres, Network, Normalisation, POSITION, Ranged, Reports,
    Target, Tracker, position_information,
};
use fewbits_baselines::pf_mpa::{LabelChain, RingBias, kernel_error, ratio_second_moments};
use fewbits_core::factor::Factor;
use fewbits_core::{Belief, Gaussian, NumberFormat, Observed};
use fewbits_densities::{Bandwidth, BandwidthRule, Component, Mixture};
use fewbits_filters::StateFilter;
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise, RangeReference, level_information, range_information};
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix4, SMatrix, SVector, Vector1, Vector2, Vector4};
use serde_json::Value;

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap()
}

fn numbers(v: &Value) -> Vec<f64> {
    match v {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        Value::Number(_) => vec![number(v)],
        Value::Object(map) => map.values().flat_map(numbers).collect(),
        _ => panic!("{v}"),
    }
}

/// Whether `found` agrees with the entry's value, as its tolerance says.
fn check(entry: &Value, found: &[f64]) {
    let (expected, tolerance) = (numbers(&entry["value"]), entry["tolerance"].as_str().unwrap());
    assert_eq!(expected.len(), found.len(), "{}", entry["id"]);
    let words: Vec<&str> = tolerance.split([' ', '(', ')']).filter(|w| !w.is_empty()).collect();
    for (e, f) in expected.iter().zip(found) {
        let near = match words[..] {
            ["exact"] => e == f,
            ["abs", t] => (e - f).abs() <= t.parse::<f64>().unwrap(),
            ["rel", t, "on", ..] => (e - f).abs() <= t.parse::<f64>().unwrap() * e.abs(),
            ["rel", t] => {
                // Relative to zero: the other program's rounding.
                let slack = if *e == 0.0 { 1e-15 } else { 0.0 };
                (e - f).abs() <= t.parse::<f64>().unwrap() * e.abs() + slack
            }
            ["rel", t, "abs", a] => {
                (e - f).abs() <= (t.parse::<f64>().unwrap() * e.abs()).max(a.parse::<f64>().unwrap())
            }
            _ => panic!("unknown tolerance {tolerance}"),
        };
        assert!(near, "{}: {f} instead of {e} ({tolerance})", entry["id"]);
    }
}

fn noise(input: &Value) -> RangeNoise {
    RangeNoise::from_snr_db(number(&input["snr_db"])).unwrap()
}

fn reference(input: &Value) -> RangeReference {
    RangeReference {
        centre: number(&input["zref"]),
        half_width: number(&input["nf"]),
    }
}

fn count(v: &Value) -> usize {
    v.as_u64().unwrap() as usize
}

fn places(v: &Value) -> Vec<Vector2<f64>> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|p| Vector2::new(number(&p[0]), number(&p[1])))
        .collect()
}

fn network(input: &Value) -> Network {
    let scheme = QuantizedRange::new(count(&input["levels"]), noise(input)).unwrap();
    let encoder = Encoder::published(number(&input["vmax"])).unwrap();
    Network::new(&places(&input["sensors"]), scheme, encoder).unwrap()
}

fn vector4(v: &Value) -> Vector4<f64> {
    Vector4::from_iterator(numbers(v))
}

fn mixtures<const D: usize>(input: &Value) -> Vec<Mixture<D>> {
    let of = |l: usize| {
        let covariance = SMatrix::<f64, D, D>::from_iterator(numbers(&input["covs"][l]));
        let means = input["means"][l].as_array().unwrap().iter();
        let components = means
            .zip(numbers(&input["weights"][l]))
            .map(|(m, w)| Component::new(w, SVector::<f64, D>::from_iterator(numbers(m)), covariance).unwrap());
        Mixture::new(components.collect()).unwrap()
    };
    (0..input["means"].as_array().unwrap().len()).map(of).collect()
}

fn gibbs<const D: usize>(entry: &Value, what: &str) {
    let all = mixtures::<D>(&entry["inputs"]);
    let factors: Vec<&Mixture<D>> = all.iter().collect();
    if what == "mixing" {
        let chain = LabelChain::new(&factors).unwrap();
        let mut found = vec![chain.second_eigenvalue()];
        found.extend([0, 1, 2, 5, 10, 50].map(|t| chain.total_variation(t)));
        return check(entry, &found);
    }
    let exact = product::exact(&factors).unwrap();
    let mut found = vec![exact.log_normaliser];
    found.extend(exact.belief.mean().iter());
    found.extend(exact.belief.covariance().iter());
    let others: usize = factors[1..].iter().map(|f| f.len()).product();
    let components: Vec<f64> = exact.belief.components().iter().map(Component::weight).collect();
    found.extend(components.chunks(others).map(|c| c.iter().sum::<f64>()));
    check(entry, &found);
}

/// Position bounds after steps 1, 5, 10, 25 along the noise-free straight line.
fn bounds(input: &Value) -> Vec<f64> {
    let target = Target::printed().unwrap();
    let (noise, levels, speed) = (noise(input), count(&input["levels"]), number(&input["vmax"]));
    let corners = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]].map(Vector2::from);
    let network =
        Network::new(&corners, QuantizedRange::new(levels, noise).unwrap(), Encoder::published(speed).unwrap())
            .unwrap();
    let mut state = vector4(&input["m0"]);
    let mut bound = CramerRao::new(Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01)));
    let mut found = Vec::new();
    for k in 1..=25 {
        let references = network
            .references(&target, k, &Gaussian::known(state).unwrap())
            .unwrap();
        state = target.transition() * state;
        let quantizer = input["quantised"]
            .as_bool()
            .unwrap()
            .then_some((&references[..], levels));
        let place = Vector2::new(state[0], state[1]);
        let information = position_information(network.sensors(), &place, quantizer).unwrap();
        bound.step_with(&target, &information).unwrap();
        if [1, 5, 10, 25].contains(&k) {
            found.push(bound.position());
        }
    }
    found
}

/// The filters of the fixed records: estimate after step 20 and mean squared position error.
fn run<T: Tracker>(tracker: &T, input: &Value, reports: Reports) -> Vec<f64> {
    let (network, phase) = (network(input), number(&input["phase"]));
    let target = Target::printed().unwrap();
    let prior = Gaussian::new(
        Vector4::new(13.0, 17.0, 0.0, -0.6),
        Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01)),
    )
    .unwrap();
    let mut rng = Stream::new(1).rng();
    let mut belief = tracker.start(&mut rng, &target, &prior).unwrap();
    let c = 10.0_f64.powf(number(&input["snr_db"]) / 20.0);
    let mut squares = 0.0;
    for k in 0..20 {
        let t = f64::from(k + 1);
        let truth = Vector2::new(13.0 - 0.15 * t + 0.8 * (0.3 * t + phase).sin(), 17.0 - 0.5 * t);
        let ranges: Vec<f64> = network
            .sensors()
            .iter()
            .enumerate()
            .map(|(s, sensor)| {
                let wave = (1.7 * f64::from(k + 1) * (s + 1) as f64 + phase).sin();
                sensor.distance(truth[0], truth[1]) * (1.0 + wave / c)
            })
            .collect();
        let previous = tracker.estimate(&belief);
        let observed = network
            .observe(&target, k as usize, &previous, &ranges, reports)
            .unwrap();
        belief = tracker
            .step(&mut rng, &target, k as usize, &belief, &observed)
            .unwrap()
            .0;
        let estimate = tracker.estimate(&belief);
        squares += (Vector2::new(estimate.mean()[0], estimate.mean()[1]) - truth).norm_squared();
    }
    let mut found: Vec<f64> = tracker.estimate(&belief).mean().iter().copied().collect();
    found.push(squares / 20.0);
    found
}

/// The exact posterior of one step: a fine grid is.
fn one_step(entry: &Value) {
    let input = &entry["inputs"];
    let network = network(input);
    let target = Target::printed().unwrap();
    let covariance = Matrix4::from_iterator(numbers(&input["P"]));
    let prior = Gaussian::new(vector4(&input["m"]), covariance).unwrap();
    let truth = numbers(&input["truth"]);
    let ranges: Vec<f64> = network
        .sensors()
        .iter()
        .map(|s| s.distance(truth[0], truth[1]))
        .collect();
    let references = network.references(&target, 0, &prior).unwrap();
    let levels: Vec<usize> = ranges
        .iter()
        .zip(&references)
        .map(|(z, r)| network.scheme().level(*z, r).unwrap().0)
        .collect();
    assert_eq!(serde_json::to_value(&levels).unwrap(), input["q"]);
    let observed = network.observe(&target, 0, &prior, &ranges, Reports::Levels).unwrap();
    let predicted = target.predict(&prior, 0, Manoeuvres::AsNoise);
    let found = |nodes: usize, reach: f64| {
        let filter = GridFilter::new(POSITION).unwrap().with_nodes(nodes).unwrap();
        let (mut filter, mut belief) = (filter.with_reach(reach).unwrap(), predicted);
        let in_state = |one: &Ranged| Observed::new(one.sensing.on_axes::<4>(POSITION).unwrap(), one.factor.clone());
        let observed: Vec<_> = observed.iter().map(in_state).collect();
        let info = filter
            .update(&mut Stream::new(9).rng(), &mut belief, &[&observed])
            .unwrap();
        let mut found = vec![info.log_likelihood];
        found.extend(belief.mean().iter());
        found.extend(belief.covariance().iter());
        found
    };
    check(entry, &found(201, 7.0));
    let expected = numbers(&entry["value"]);
    for (a, b) in found(31, 4.0)[1..5].iter().zip(&expected[1..5]) {
        assert!((a - b).abs() < 1e-4, "{}: grid of 31 {a}, exact {b}", entry["id"]);
    }
}

fn pair(input: &Value) -> Vec<f64> {
    let target = |m: &str, p: &str| Gaussian::scalar(number(&input[m]), number(&input[p])).unwrap();
    let targets = [target("m1", "P1"), target("m2", "P2")];
    let (z, r) = ([number(&input["zA"]), number(&input["zB"])], number(&input["R"]));
    let straight = AssociationRule::Exact.probability(&targets, z, r).unwrap();
    let after = association::update(&targets, z, r, straight).unwrap();
    let [a, b] = after.targets;
    vec![
        straight,
        a.mean()[0],
        b.mean()[0],
        a.covariance()[0],
        b.covariance()[0],
        after.covariance,
    ]
}

/// Largest asymmetry of the printed rule, and where: golden section.
fn asymmetry() -> Vec<f64> {
    let defect = |d: f64| (1.0 - tanh_rule(Some(d), 0.55) - tanh_rule(Some(1.0 / d), 0.55)).abs();
    let at = (0..2_000_000).map(|i| 1.0 + 1e-5 * f64::from(i));
    let best = at.fold(1.0, |best, d| if defect(d) > defect(best) { d } else { best });
    vec![defect(best), best]
}

fn one(entry: &Value) {
    let (id, input) = (entry["id"].as_str().unwrap(), &entry["inputs"]);
    let parts: Vec<&str> = id.strip_prefix("pfmpa.").unwrap().splitn(3, '.').collect();
    match parts[..] {
        ["loglik", _] => {
            let scheme = QuantizedRange::new(count(&input["levels"]), noise(input)).unwrap();
            let factor = scheme.received(Symbol(count(&input["q"])), &reference(input)).unwrap();
            check(entry, &[factor.log_likelihood(&Vector1::new(number(&input["d"])))]);
        }
        ["nf", ..] => {
            let which = match input["mode"].as_str().unwrap() {
                "printed" => Normalisation::Printed,
                "process" => Normalisation::Process,
                "robust" => Normalisation::Robust,
                other => panic!("{other}"),
            };
            let chain = AccelerationChain::printed(0.1).unwrap();
            let target = Target::new(number(&input["ts"]), 0.02, chain).unwrap();
            let (speed, range) = (number(&input["vmax"]), number(&input["zref"]));
            check(entry, &[Encoder::normaliser(&target, &noise(input), speed, which, range)]);
        }
        ["interval", ..] => {
            let cell = reference(input)
                .nominal_cell(count(&input["q"]), count(&input["levels"]))
                .unwrap();
            check(entry, &[cell.lower(), cell.upper()]);
        }
        ["ring", ..] => {
            let ring = RingBias::new(number(&input["a"]), number(&input["b"]), number(&input["sigma"])).unwrap();
            check(entry, &[ring.printed, ring.exact, ring.total_variation]);
        }
        ["wratio", ..] => {
            let (each, first) = ratio_second_moments(&numbers(&input["means"]), number(&input["sigma"]));
            check(entry, &[each, first]);
        }
        ["gibbs", "A1d" | "B1d-modes", what] => gibbs::<1>(entry, what),
        ["gibbs", "C2d", what] => gibbs::<2>(entry, what),
        ["kde", ..] => {
            let (n, d) = (number(&input["n"]), count(&input["d"]));
            let width = |rule: BandwidthRule| {
                let bandwidth = Bandwidth {
                    rule,
                    ..Bandwidth::default()
                };
                let width = if d == 1 {
                    bandwidth.width::<1>(n)
                } else {
                    bandwidth.width::<2>(n)
                };
                width.unwrap().powi(2)
            };
            let (printed, best) =
                (width(BandwidthRule::Power { exponent: 1.0 / 12.0 }), width(BandwidthRule::Silverman));
            let error = |lambda: f64| kernel_error(n, d as u32, lambda);
            check(entry, &[printed, best, error(printed), error(best)]);
        }
        ["fisher", _] => {
            let (noise, d) = (noise(input), number(&input["d"]));
            let own = level_information(&reference(input), count(&input["levels"]), &noise, d).unwrap();
            check(entry, &[own, range_information(&noise, d).unwrap()]);
        }
        ["crlb", _] => check(entry, &bounds(input)),
        ["markov", what] => {
            let chain = AccelerationChain::printed(0.1).unwrap();
            let found: Vec<f64> = match what {
                "var" => (0..6).map(|k| chain.moments(k).1).collect(),
                "stationary" => {
                    let law = chain.law(1000);
                    // From +g, the mean of the next acceleration in units of g.
                    let mut next = 0.0;
                    for (j, sign) in [0.0, 1.0, -1.0].into_iter().enumerate() {
                        next += sign * [0.4, 0.5, 0.1][j];
                    }
                    law.into_iter().chain([next]).collect()
                }
                other => panic!("{other}"),
            };
            check(entry, &found);
        }
        ["da", "tanh", _] => check(entry, &[tanh_rule(Some(number(&input["D"])), 0.55)]),
        ["da", "asym"] => check(entry, &asymmetry()),
        ["da", "exact", _] => check(entry, &pair(input)),
        ["onestep", _] => one_step(entry),
        ["run", _, "EKF-U"] => check(entry, &run(&Linearised::EKF, input, Reports::Ranges)),
        ["run", _, "EKF-Q"] => check(entry, &run(&Linearised::EKF, input, Reports::Levels)),
        ["run", _, "GMPA"] => check(entry, &run(&Linearised::MESSAGE_PASSING, input, Reports::Levels)),
        ["run", _, "GMPA-vtransfer"] => {
            check(entry, &run(&Linearised::MESSAGE_PASSING_TRANSFER, input, Reports::Levels));
        }
        ["run", _, "ADF"] => {
            // The other program's grid ends at 4 deviations of the prediction, too: part of the definition of its numbers.
            check(entry, &run(&GridFilter::new(POSITION).unwrap().with_nodes(401).unwrap(), input, Reports::Levels));
        }
        ["bits", ..] => {
            let format = NumberFormat::Single;
            assert_eq!(input["float_bits"], 32);
            let bits = StepBits::new(count(&input["sensors"]), count(&input["levels"]), &format).unwrap();
            check(entry, &[bits.reports, bits.handover, bits.raw].map(|b| b as f64));
        }
        _ => panic!("unknown entry {id}"),
    }
}

#[test]
fn every_entry_agrees() {
    let all: Vec<Value> = serde_json::from_str(include_str!("../fixtures/pf_mpa.json")).unwrap();
    assert_eq!(all.len(), 62);
    let failed: Vec<String> = all
        .iter()
        .filter_map(|entry| {
            std::panic::catch_unwind(|| one(entry))
                .err()
                .map(|_| entry["id"].to_string())
        })
        .collect();
    assert!(failed.is_empty(), "{failed:?}");
}
