//! The schemes of the comparison at their settings.

use super::receivers::{Followers, LookUp, each};
use super::worlds::{COEFFICIENT, Entry, PROCESS, SENSORS, World, member};
use crate::prelude::Error;
use fewbits_baselines::cfwmd::centre::CensoringEstimator;
use fewbits_baselines::dymbo::centre::{ParallelEstimator, ScalarEstimator};
use fewbits_binary_patterns::{Bank, BinaryQuantizer, PatternSensor, Source};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{FullValue, Gaussian, LinearDynamics, Link, SensorNode};
use fewbits_dymbo::{
    CountFusion, InnovationWord, MultibitFilter, ParallelFilter, Prediction, ScalarFilter, ScalarPlant,
};
use fewbits_models::{Ar1, LinearGaussian, PLANE_POSITION};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use fewbits_protocol::{Feedback, Member, ReportLength};
use fewbits_quantizer_design::{Criterion, Newton, ObservationModel, System, design};
use fewbits_quantizers::{Labelling, Quantizer, QuantizingSensor, lloyd_max};

/// Distance of the range sensors from where the target starts; it covers some 300 in the standard run.
const FAR: f64 = 10_000.0;
/// How sensors are told the question.
const TALKS: [Feedback; 2] = [Feedback::Told, Feedback::Echoed];

/// What a word of the innovation is told.
fn asked(measured: &Gaussian<1>) -> Prediction {
    Prediction {
        mean: measured.mean()[0],
        deviation: measured.covariance()[0].sqrt(),
    }
}

fn nothing(_: &Gaussian<1>) {}

/// Schemes of both worlds.
fn common<const D: usize, G>(world: &World<D, G>) -> Result<Vec<Entry>, Error>
where
    G: LinearDynamics<D> + Clone + Send + Sync + 'static,
{
    let mut all = Vec::new();
    for talk in TALKS {
        for m in 1..=4 {
            let (name, scheme) = (("innovation-words", format!("m={m}")), InnovationWord::new(1.0, m)?);
            all.push(world.of_scheme(name, &world.sensors, member(talk, m as u32), scheme, asked));
        }
        for (family, shared) in [("CFwMD", false), ("CFwMD2", true)] {
            for messages in [0.25, 0.5, 1.0, 2.0] {
                let threshold = Budget::new(messages, SENSORS).and_then(|budget| budget.threshold(1))?;
                let network = Network::new(world.sensors.clone(), threshold, Link::PERFECT)?.with_format(world.fine);
                let (dynamics, start) = (world.dynamics.clone(), world.start);
                let censors = match shared {
                    true => CensoringEstimator::told(network, dynamics, start),
                    false => CensoringEstimator::own(network, dynamics, start, world.slots)?,
                };
                let (nodes, member) = (censors.clone(), member(talk, world.fine.bits()));
                let node = move |i| -> Box<dyn SensorNode<1>> { Box::new(nodes.node(i)) };
                all.push(world.of_estimator((family, format!("n={messages}")), member, censors, node));
            }
        }
    }
    let all_send = |setting: &str| ("all-send", setting.to_owned());
    let (reach, bits) = world.coarse;
    let step = 2.0 * reach / f64::from((1 << bits) - 1);
    let edges = (1..1 << bits).map(|i| step * (f64::from(i) - 0.5) - reach).collect();
    let coarse = QuantizingSensor::with_variance(Quantizer::new(edges)?, Labelling::natural(1 << bits)?, 1.0)?;
    let told = |bits| member(Feedback::Clock, bits);
    all.push(world.of_scheme(all_send("few bits"), &world.sensors, told(bits), coarse, nothing));
    let fine = FullValue::new(1.0)?.with_format(world.fine);
    all.push(world.of_scheme(all_send("32 bit"), &world.sensors, told(world.fine.bits()), fine, nothing));
    for delta in [0.25, 0.5, 1.0, 2.0, 4.0] {
        let followers = Followers {
            dynamics: world.dynamics.clone(),
            sensors: world.sensors.clone(),
            noise_variance: 1.0,
            config: fewbits_adaptive::Config::new(delta)?,
            start: world.start,
        };
        let (node, report) = (followers.nodes(), ReportLength::Varying);
        let member = Member {
            feedback: Feedback::Clock,
            report,
        };
        all.push(world.of_estimator(("adaptive", format!("delta={delta}")), member, followers, node));
    }
    for components in [1, 3] {
        all.extend([1.0, 0.25].map(|resolution| world.hand_off(components, resolution)));
    }
    Ok(all)
}

/// The schemes of the scalar world.
///
/// # Errors
/// If a scheme refuses its setting.
pub fn of_scalar(world: &World<1, Ar1>) -> Result<Vec<Entry>, Error> {
    let mut all = common(world)?;
    let plant = ScalarPlant::new(COEFFICIENT, PROCESS, 1.0)?;
    let (start, deviation) = (world.start, world.start.standard_deviations()[0]);
    for talk in TALKS {
        for sensors in [1, 2, 4] {
            let counted = ParallelEstimator::new(ParallelFilter::new(plant, sensors, CountFusion::Exact)?, start)?;
            let node = each(vec![counted.scheme()]);
            all.push(world.of_estimator(("Dymbo", format!("K={sensors}")), member(talk, 1), counted, node));
        }
        for m in [2, 3, 4] {
            let filter = MultibitFilter::new(plant, m)?;
            let (name, node) = (("Dymbo-multibit", format!("m={m}")), each(vec![filter.scheme()]));
            all.push(world.of_estimator(name, member(talk, m as u32), ScalarEstimator { filter, start }, node));
        }
    }
    let untold = |levels: usize| member(Feedback::Clock, levels.next_power_of_two().trailing_zeros());
    let scene = || ObservationModel::gaussian_with_deviations(deviation, &[1.0; SENSORS]);
    let table = |family, system: &System, levels: usize| -> Result<Entry, Error> {
        let (look_up, schemes) = LookUp::of_system(system, 10_000)?;
        Ok(world.of_estimator((family, format!("L={levels}")), untold(levels), look_up, each(schemes)))
    };
    for levels in [2, 4, 8] {
        all.push(table("Lloyd-Max-table", &System::lloyd_max(scene()?, levels)?, levels)?);
    }
    for levels in [2, 4, 8] {
        let spread = (deviation * deviation + 1.0).sqrt();
        let design = lloyd_max::gaussian(levels).and_then(|design| design.affine(0.0, spread));
        let scheme = QuantizingSensor::with_variance(Quantizer::from(&design?), Labelling::gray(levels)?, 1.0)?;
        let name = ("Lloyd-Max-filter", format!("L={levels}"));
        all.push(world.of_scheme(name, &world.sensors, untold(levels), scheme, nothing));
    }
    for levels in [2, 4] {
        let from = System::lloyd_max(scene()?, levels)?;
        let best = design::joint(&from, Criterion::MutualInformation, &Newton::default())?;
        all.push(table("MI-table", &best.system, levels)?);
    }
    let sensor = |edges: &[f64]| {
        let cells = BinaryQuantizer::new(edges.iter().map(|e| e * deviation).collect())?;
        PatternSensor::with_deviation(cells, 1.0)
    };
    let edges: [&[f64]; SENSORS] = [&[0.0], &[-1.0, 1.0], &[0.0], &[-1.5, 0.0, 1.5]];
    let sensors = edges.into_iter().map(sensor).collect::<Result<Vec<_>, _>>()?;
    let source = Source::gaussian_with_deviation(deviation)?;
    let bank = Bank::new(source, sensors.clone()).and_then(|bank| bank.table());
    let patterns = LookUp::of_patterns(SENSORS, bank?, deviation * deviation)?;
    all.push(world.of_estimator(("patterns-table", "K=4".to_owned()), untold(2), patterns, each(sensors)));
    Ok(all)
}

/// The schemes of the plane. Range sensors of unit noise stand at 10 km on the axes: to first order each has the coordinate that the
/// world's own sensors have.
///
/// # Errors
/// If a scheme refuses its setting.
pub fn of_plane(world: &World<4, LinearGaussian<4, 2>>) -> Result<Vec<Entry>, Error> {
    let mut all = common(world)?;
    let noise = RangeNoise::constant(1.0)?;
    let places = [[-FAR, 0.0], [0.0, -FAR], [FAR, 0.0], [0.0, FAR]];
    let sensor =
        |place: [f64; 2]| RangeSensor::new(place.into(), noise).and_then(|sensor| sensor.on_axes::<4>(PLANE_POSITION));
    let sensors = places.into_iter().map(sensor).collect::<Result<Vec<_>, _>>()?;
    for talk in TALKS {
        for m in 1..=4 {
            let loading = optimal_loading(1 << m)?;
            // In single precision, as it travels.
            let asked = move |measured: &Gaussian<1>| RangeReference {
                centre: f64::from(measured.mean()[0] as f32),
                half_width: f64::from((loading * measured.covariance()[0].sqrt()) as f32),
            };
            let (name, scheme) = (("quantized-ranges", format!("m={m}")), QuantizedRange::new(1 << m, noise)?);
            all.push(world.of_scheme(name, &sensors, member(talk, m), scheme, asked));
        }
    }
    Ok(all)
}
