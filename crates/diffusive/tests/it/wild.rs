//! Wild arguments: sensors, rates, messages and searches answer numbers or errors.

use fewbits_core::NumberFormat;
use fewbits_core::laws::wild;
use fewbits_diffusive::message::{SampleCode, Wire};
use fewbits_diffusive::{RateModel, RateRange, RateSums, Search, SearchBox, SearchField, SourceSensor};
use fewbits_models::SourceGradient;
use fewbits_models::diffusion::{Air, Ground};
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn sensor(x: &[f64]) -> Option<SourceSensor> {
    let air = Air::new(x[0], Vector3::new(x[1], x[2], 0.0), Ground::Impermeable).ok()?;
    let air = air.with_closest(x[3]).unwrap_or(air);
    let sensor = SourceSensor::new(air, vec![5.0, x[4]], x[5]).ok()?;
    let sensor = sensor.clone().with_bias(x[6]).unwrap_or(sensor);
    let sensor = sensor.clone().with_heights(x[7], x[8]).unwrap_or(sensor);
    Some(sensor.clone().with_start(x[9]).unwrap_or(sensor))
}

proptest! {
    #[test]
    fn sensors_and_rates_answer_numbers(x in prop::array::uniform14(wild())) {
        if let Some(sensor) = sensor(&x) {
            let (node, source) = (Vector2::new(x[10], x[11]), Vector2::new(x[12], x[13]));
            if node.iter().chain(source.iter()).all(|x| x.is_finite()) {
                let responses = sensor.responses(&node, &source).unwrap();
                prop_assert!(responses.iter().all(|r| !r.is_nan() && *r >= 0.0), "{:?} {:?} {:?}: {:?}", sensor, node, source, responses);
                let height = if [x[7], x[8]].iter().all(|h| *h >= 0.0 && h.is_finite()) { x[7] } else { 0.0 };
                let at = Vector3::new(source.x, source.y, height);
                let age = sensor.instants()[1] - sensor.start();
                let SourceGradient { value: response, gradient: slope } =
                    sensor.model().source_gradient(&sensor.receptor(&node).unwrap(), &at, age);
                prop_assert!(!response.is_nan() && slope.iter().all(|x| !x.is_nan()), "{:?} {:?} {:?}: {} {}", sensor, node, source, response, slope);
            }
            let _ = sensor.record(&node, &[x[0], x[1]]);
        }
        let Ok(range) = RateRange::new(x[0], x[1]) else { return Ok(()) };
        if let Ok(sums) = RateSums::of(&x[2..4], &x[4..6], x[6]) {
            let logs = [sums.log_given_rate(range.low()), sums.log_marginal(&range)];
            prop_assert!(logs.iter().all(|log| !log.is_nan() && *log < f64::INFINITY), "{:?} {:?}: {:?}", sums, range, logs);
        }
        if let Ok(sums) = RateSums::of(&x[2..3], &[x[3].abs()], x[4]) {
            let log = sums.log_marginal(&range);
            prop_assert!(!log.is_nan() && log < f64::INFINITY, "{:?} {:?}: {}", &x[2..5], range, log);
        }
    }
}

proptest! {
    // Each case is a whole search: one case in 32.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(32), ..ProptestConfig::default() })]
    #[test]
    fn searches_end_with_numbers(x in prop::array::uniform10(wild()), bits in 0..40_u32) {
        let deployment = Deployment::given(vec![Vector2::new(50.0, 50.0), Vector2::new(55.0, 50.0), Vector2::new(52.0, 58.0)]).unwrap();
        let graph = Graph::within(deployment.positions(), 10.0).unwrap();
        let nodes = SearchField::new(super::sensor(1.0, false), deployment, graph).unwrap();
        let rate = RateRange::new(x[0], x[1]).map_or(RateModel::Known(x[0]), RateModel::Joint);
        let within = SearchBox { lower: [x[2], 0.0], upper: [x[3], 100.0] };
        for within in [within, SearchBox { lower: [0.0; 2], upper: [100.0; 2] }] {
            let Ok(mut search) = Search::new(&Vector2::new(50.0, 50.0), x[4], within, rate, x[5]) else { continue };
            search.wire = Wire { numbers: NumberFormat::Single, samples: Some(SampleCode { bits, step: x[6] }), ..Wire::default() };
            search.max_nodes = 3;
            if let Ok(outcome) = search.run(&nodes, 0, |_| Ok(vec![x[7], x[8], x[9], 1e-4, 1e-4])) {
                prop_assert!(outcome.estimate().is_none_or(|estimate| estimate.is_finite()), "{:?}", outcome.estimate());
                prop_assert!(outcome.steps.iter().all(|step| step.estimate.is_finite()));
            }
        }
    }
}
