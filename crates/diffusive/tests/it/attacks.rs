//! Arguments that make no sense, and data that do not fit.

use super::{RULES, field, joint, posterior_of, sensor};
use fewbits_baselines::diffusive::polynomials::{hermite, multi_indices};
use fewbits_baselines::diffusive::{LAPLACE, Lpg, Peak, lpg, particles};
use fewbits_core::Gaussian;
use fewbits_densities::Component;
use fewbits_diffusive::information::Predictions;
use fewbits_diffusive::{
    Form, Prior, RateModel, RateRange, RateSums, Record, Search, SearchBox, SearchField, SourceLikelihood,
    SourceSensor, Status,
};
use fewbits_mixture_codec::{Clumps, MixtureFit};
use fewbits_models::diffusion::{Air, Ground, Wall};
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Matrix2, Vector2, Vector3};

#[test]
fn arguments_are_refused() {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    for noise in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(SourceSensor::new(air, vec![1.0], noise).is_err());
    }
    assert!(SourceSensor::new(air, vec![], 1.0).is_err());
    assert!(SourceSensor::new(air, vec![-1.0, 0.0], 1.0).is_err());
    assert!(SourceSensor::new(air, vec![f64::NAN], 1.0).is_err());
    let ok = sensor(1.0, false);
    assert!(ok.clone().with_start(25.0).is_err() && ok.clone().with_start(24.0).is_ok());
    assert!(
        ok.clone().with_bias(f64::NAN).is_err()
            && ok.clone().with_heights(-1.0, 0.0).is_err()
            && ok.clone().with_reach(0.0).is_err()
    );
    let node = Vector2::zeros();
    assert!(ok.record(&node, &[0.0; 4]).is_err());
    assert!(ok.record(&node, &[0.0, 0.0, f64::NAN, 0.0, 0.0]).is_err());
    assert!(ok.record(&Vector2::new(f64::INFINITY, 0.0), &[0.0; 5]).is_err());
    for (low, high) in [
        (1.0, 1.0),
        (2.0, 1.0),
        (-0.1, 1.0),
        (0.0, f64::INFINITY),
        (f64::NAN, 1.0),
    ] {
        assert!(RateRange::new(low, high).is_err());
    }
    assert!(RateSums::of(&[1.0], &[1.0, 2.0], 1.0).is_err() && RateSums::of(&[], &[], 1.0).is_err());
    assert!(RateSums::of(&[1.0], &[1.0], 0.0).is_err() && RateSums::of(&[f64::NAN], &[1.0], 1.0).is_err());
    assert!(SourceLikelihood::new(vec![], joint()).is_err());
    let record = ok.record(&node, &[0.0; 5]).unwrap();
    assert!(SourceLikelihood::new(vec![record], RateModel::Known(-1.0)).is_err());
    assert!(Search::new(&node, 0.0, field(1.0), joint(), 1e-5).is_err());
    assert!(Search::new(&node, 50.0, field(1.0), joint(), 0.0).is_err());
    assert!(
        Search::new(
            &node,
            50.0,
            SearchBox {
                lower: [0.0; 2],
                upper: [0.0; 2]
            },
            joint(),
            1e-5
        )
        .is_err()
    );
    assert!(hermite([21, 0], &Vector2::zeros(), &Matrix2::identity()).is_err() && multi_indices::<2>(21).is_err());
    assert!(MixtureFit::new(0).is_err());
    assert!(
        Predictions::new(&[], &[], 1.0).is_err()
            && Predictions::new(&[vec![1.0], vec![1.0, 2.0]], &[0.5, 0.5], 1.0).is_err()
    );
    assert!(Predictions::new(&[vec![1.0]], &[0.7], 1.0).is_err());
}

/// The physics and the densities under a search refuse theirs; what is not yet released is no error but nothing.
#[test]
fn physics_and_covariances_are_refused() {
    for diffusivity in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Air::new(diffusivity, Vector3::zeros(), Ground::Impermeable).is_err(), "{diffusivity}");
    }
    assert!(Wall::permeable(-1e-300).is_err() && Wall::permeable(f64::NAN).is_err());
    assert!(Air::new(40.0, Vector3::new(f64::NAN, 0.0, 0.0), Ground::Impermeable).is_err());
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    let (field, source) = (Vector3::new(1.0, 0.0, 0.0), Vector3::zeros());
    for age in [0.0, -1.0, f64::NEG_INFINITY] {
        assert_eq!(air.concentration(&field, &source, age), 0.0);
    }
    for covariance in [
        Matrix2::new(1.0, 2.0, 2.0, 1.0),
        Matrix2::zeros(),
        -Matrix2::identity(),
        Matrix2::new(f64::NAN, 0.0, 0.0, 1.0),
    ] {
        assert!(
            Gaussian::new(Vector2::zeros(), covariance)
                .and_then(|g| g.factored())
                .is_err(),
            "{covariance}"
        );
        assert!(Component::new(1.0, Vector2::zeros(), covariance).is_err(), "{covariance}");
    }
}

#[test]
fn runs_refuse_what_they_cannot_do() {
    let field_of = Deployment::given(vec![Vector2::zeros(), Vector2::x()]).unwrap();
    let graph = Graph::within(field_of.positions(), 2.0).unwrap();
    let sensor = sensor(1.0, false);
    let search = |change: fn(&mut Search)| {
        let mut search = Search::new(&Vector2::zeros(), 50.0, field(1.0), joint(), 1e-5).unwrap();
        change(&mut search);
        search
    };
    let nodes = SearchField::new(sensor.clone(), field_of.clone(), graph).unwrap();
    let run = |search: Search, start, samples: Vec<f64>| search.run(&nodes, start, |_| Ok(samples.clone()));
    assert!(run(search(|_| ()), 2, vec![0.0; 5]).is_err());
    assert!(run(search(|_| ()), 0, vec![0.0; 3]).is_err());
    assert!(run(search(|_| ()), 0, vec![f64::NAN; 5]).is_err());
    assert!(run(search(|s| s.max_nodes = 0), 0, vec![0.0; 5]).is_err());
    assert!(run(search(|s| s.form = Form::Mixture(0)), 0, vec![0.0; 5]).is_err());
    for form in [particles::<25>(), LAPLACE, lpg::<0, 5>(), lpg::<2, 21>()] {
        let mut search = search(|_| ());
        search.form = form;
        assert!(run(search, 0, vec![0.0; 5]).is_err(), "{form:?}");
    }
    let other = Graph::within(&[Vector2::zeros()], 1.0).unwrap();
    assert!(SearchField::new(sensor, field_of, other).is_err());
}

/// Samples that fit no source at all, or every source: a status or a belief, never a panic or NaN.
#[test]
fn absurd_samples() {
    let field_of =
        Deployment::uniform(&mut fewbits_monte_carlo::Stream::new(2).rng(), [0.0; 2], [100.0; 2], 60).unwrap();
    let graph = Graph::within(field_of.positions(), 25.0).unwrap();
    let nodes = SearchField::new(sensor(1.0, false), field_of, graph).unwrap();
    let all = [0.0, -1.0, 1e-9, 1e-3, 1.0, 1e6, 1e150];
    for (form, levels) in [
        (Form::Raw, &all[..]),
        (Form::Mixture(4), &all),
        (lpg::<2, 1>(), &[-1.0, 1e-3, 1e150]),
    ] {
        for &level in levels {
            let mut search = Search::new(&Vector2::new(44.0, 52.0), 50.0, field(1.0), joint(), 1e-5).unwrap();
            (search.form, search.max_nodes) = (form, 4);
            let outcome = search.run(&nodes, 0, |_| Ok(vec![level; 5])).unwrap();
            for step in &outcome.steps {
                assert!(step.estimate.mean().iter().all(|x| x.is_finite()), "{form:?} {level} {:?}", outcome.status);
                assert!(step.log10_determinant.is_finite() && !step.log_evidence.is_nan());
            }
            // A thousand kilograms per cubic metre, and squares that overflow: no source does that.
            assert!(level < 1e6 || outcome.status == Status::Misfit, "{form:?} {level} {:?}", outcome.status);
            assert!(level < 1e150 || outcome.steps.is_empty());
        }
    }
}

/// What one node measures without noise.
fn clean_record(node: &Vector2<f64>) -> Record {
    let sensor = sensor(1.0, false);
    let samples = sensor.responses(node, &Vector2::new(62.0, 50.0)).unwrap();
    sensor.record(node, &samples).unwrap()
}

#[test]
fn two_densities_that_exclude_each_other() {
    let record = clean_record(&Vector2::new(50.0, 54.0));
    let far = Gaussian::new(Vector2::new(1e6, 1e6), Matrix2::identity() * 1e-6).unwrap();
    let result = posterior_of(&Prior::Exact(far), &SourceLikelihood::new(vec![record], joint()).unwrap());
    // The prior decides among what is left; whatever comes out is finite or an error.
    if let Ok(posterior) = result {
        assert!(posterior.gaussian().mean().iter().all(|x| x.is_finite()));
    }
}

/// A ring has no peak of Gaussian kind.
#[test]
fn a_ring_has_no_peak() {
    let ring = |x: &Vector2<f64>| -0.5 * ((x.norm() - 10.0) / 0.3).powi(2);
    assert!(Peak::climb(&ring, &Vector2::new(3.0, 4.0), &Vector2::repeat(1.0)).is_err());
    assert!(Peak::climb(&|_: &Vector2<f64>| f64::NEG_INFINITY, &Vector2::zeros(), &Vector2::repeat(1.0)).is_err());
    assert!(Peak::climb(&ring, &Vector2::zeros(), &Vector2::repeat(0.0)).is_err());
}

#[test]
fn polynomial_gaussians_refuse_bad_parts() {
    let node = Vector2::new(50.0, 54.0);
    let record = clean_record(&node);
    let prior = Prior::Exact(Gaussian::new(node, Matrix2::identity() * 2500.0).unwrap());
    let likelihood = SourceLikelihood::new(vec![record], RateModel::Known(1.0)).unwrap();
    let cells = posterior_of(&prior, &likelihood).unwrap().cells;
    let fit = Clumps::new(&cells.columns(), &[&[], &[]], cells.weights(), 100)
        .unwrap()
        .fit(&MixtureFit::new(1).unwrap())
        .unwrap();
    let one = fit.components()[0];
    assert!(Lpg::fit(&cells, &[], 3).is_err() && Lpg::fit(&cells, &[one], 21).is_err());
    assert!(Lpg::fit(&cells, &[one, one], 3).is_err());
    assert!(Lpg::new(&[one], 1, &[vec![0.0; 3]]).is_err() && Lpg::new(&[one], 1, &[vec![1.0; 2]]).is_err());
    assert!(Lpg::new(&[one], 1, &[vec![1.0, f64::NAN, 0.0]]).is_err());
}

/// Nodes that stand together, one of them on the source, samples of any size: statuses, no panic, nothing that is no number.
#[test]
fn coincident_nodes_and_a_source_on_a_node() {
    let place = Vector2::new(50.0, 50.0);
    let mut positions = vec![place; 6];
    positions.extend([Vector2::new(58.0, 50.0), Vector2::new(50.0, 58.0)]);
    let field_of = Deployment::given(positions).unwrap();
    let graph = Graph::within(field_of.positions(), 10.0).unwrap();
    let sensor = sensor(1.0, false);
    let nodes = SearchField::new(sensor.clone(), field_of, graph).unwrap();
    for rule in RULES {
        let mut search = Search::new(&place, 50.0, field(1.0), joint(), 1e-5).unwrap();
        search.rule = rule;
        let mut rng = fewbits_monte_carlo::Stream::new(7).rng();
        let outcome = search
            .run(&nodes, 0, |node| sensor.sample(&mut rng, &nodes.deployment().positions()[node], &place, 1.0))
            .unwrap();
        for step in &outcome.steps {
            assert!(step.estimate.mean().iter().all(|x| x.is_finite()) && step.log10_determinant.is_finite());
        }
        if let Some(estimate) = outcome.estimate() {
            assert!((estimate.mean() - place).norm() < 0.1, "{rule:?}: {:?} {}", outcome.status, estimate.mean());
        }
    }
}

/// Sources far outside, at every unit: the search says that it has not found them.
#[test]
fn sources_outside_the_field_are_not_found() {
    for unit in [1e-4, 1.0, 1e4] {
        let mut rng = fewbits_monte_carlo::Stream::new(8).rng();
        let field_of = Deployment::uniform(&mut rng, [0.0; 2], [100.0 * unit; 2], 200).unwrap();
        let graph = Graph::within(field_of.positions(), 15.0 * unit).unwrap();
        let sensor = sensor(unit, false);
        let nodes = SearchField::new(sensor.clone(), field_of, graph).unwrap();
        let places = [[190.0, 50.0], [-60.0, -60.0], [1e4, 0.0]];
        // Other units only for the nearest.
        for place in if unit == 1.0 { &places[..] } else { &places[..1] } {
            let source = Vector2::from(*place) * unit;
            for form in [Form::Raw, Form::Mixture(4)] {
                let start = nodes.deployment().nearest_to(&(Vector2::new(50.0, 50.0) * unit));
                let mut search = Search::new(
                    &nodes.deployment().positions()[start],
                    50.0 * unit,
                    field(unit),
                    joint(),
                    1e-5 * unit.powi(4),
                )
                .unwrap();
                (search.form, search.max_nodes) = (form, 12);
                let outcome = search
                    .run(&nodes, start, |node| {
                        sensor.sample(&mut rng, &nodes.deployment().positions()[node], &source, 1.0)
                    })
                    .unwrap();
                assert_ne!(outcome.status, Status::Converged, "{place:?} {unit} {form:?}");
            }
        }
    }
}
