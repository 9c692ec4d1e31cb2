//! Models of the medium that are not air: everything along the general path.

use super::{joint, posterior_of, searched, sensor};
use fewbits_core::{Belief, Gaussian, Likelihood};
use fewbits_diffusive::{
    Form, ModelGrid, Posterior, Prior, RateModel, RateRange, SourceLikelihood, SourceSensor, Status,
};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_models::{Receptor, SourceGradient, SourceModel};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Air that does not say that nothing changes along the ground, with a block in which no source can be, and receptors within 200 m.
#[derive(Debug)]
struct Opaque {
    air: Air,
    block: Option<[f64; 4]>,
}

impl SourceModel for Opaque {
    fn receptor(&self, place: &Vector3<f64>) -> Result<Receptor, fewbits_models::Error> {
        if place.norm() > 200.0 {
            let refused = fewbits_numerics::ArgumentError::new("place", place.norm(), "within 200 m");
            return Err(refused.into());
        }
        Ok(Receptor {
            place: *place,
            index: 3,
        })
    }

    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64 {
        assert_eq!(receptor.index, 3);
        if self.admits(source, 0.0) {
            self.air.concentration(&receptor.place, source, age)
        } else {
            0.0
        }
    }

    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient {
        self.air.source_gradient(&receptor.place, source, age)
    }

    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64 {
        self.air.variation(receptor, source, half_width, age)
    }

    fn admits(&self, source: &Vector3<f64>, half_width: f64) -> bool {
        self.block.is_none_or(|[left, lower, right, upper]| {
            source.x - half_width < left
                || source.x + half_width > right
                || source.y - half_width < lower
                || source.y + half_width > upper
        })
    }
}

fn opaque(windy: bool, block: Option<[f64; 4]>) -> SourceSensor {
    let plain = sensor(1.0, windy);
    let model = Opaque {
        air: super::air(1.0, windy),
        block,
    };
    SourceSensor::new(model, plain.instants().to_vec(), plain.noise()).unwrap()
}

const NODES: [[f64; 2]; 3] = [[50.0, 54.0], [52.0, 44.0], [58.0, 60.0]];

fn likelihood(sensor: &SourceSensor, windy: bool, nodes: usize, rate: RateModel) -> SourceLikelihood {
    let world = super::sensor(1.0, windy);
    let mut rng = Stream::new(5).rng();
    let records = NODES[..nodes].iter().map(|n| {
        let node = Vector2::from(*n);
        let samples = world.sample(&mut rng, &node, &Vector2::new(62.0, 50.0), 1.0).unwrap();
        sensor.record(&node, &samples).unwrap()
    });
    SourceLikelihood::new(records.collect(), rate).unwrap()
}

fn posterior(likelihood: &SourceLikelihood) -> Posterior {
    let prior = Prior::Exact(Gaussian::new(Vector2::from(NODES[0]), Matrix2::identity() * 2500.0).unwrap());
    posterior_of(&prior, likelihood).unwrap()
}

#[test]
fn any_model_gives_the_posterior_of_the_special_case() {
    let range = RateRange::new(0.5, 1.5).unwrap();
    for (windy, nodes, rate) in [
        (false, 1, joint()),
        (false, 3, joint()),
        (true, 2, joint()),
        (false, 2, RateModel::Known(1.0)),
        (false, 2, RateModel::NodeWise(range)),
    ] {
        let special = posterior(&likelihood(&sensor(1.0, windy), windy, nodes, rate));
        let general = posterior(&likelihood(&opaque(windy, None), windy, nodes, rate));
        let deviation = special.cells.covariance().diagonal().map(f64::sqrt);
        let off = (special.cells.mean() - general.cells.mean())
            .component_div(&deviation)
            .amax();
        let evidence = special.cells.log_evidence() - general.cells.log_evidence();
        assert!(off < 5e-3 && evidence.abs() < 5e-3, "{windy} {nodes} {rate:?}: {off} {evidence}");
        assert!((special.fit.per_sample() - general.fit.per_sample()).abs() < 5e-3);
    }
}

#[test]
fn posterior_within_a_wall_is_zero() {
    // The ring about one node, less the part in the block: the same density elsewhere.
    let block = [56.0, 40.0, 70.0, 64.0];
    let open = posterior(&likelihood(&sensor(1.0, false), false, 1, joint()));
    let walled = posterior(&likelihood(&opaque(false, Some(block)), false, 1, joint()));
    let inside = |x: f64, y: f64| x > block[0] && x < block[2] && y > block[1] && y < block[3];
    let share: f64 = {
        let [x, y] = open.cells.columns();
        (0..x.len())
            .filter(|i| inside(x[*i], y[*i]))
            .map(|i| open.cells.weights()[i])
            .sum()
    };
    assert!(share > 0.2 && share < 0.8, "{share}");
    let [x, y] = walled.cells.columns();
    assert!((0..x.len()).all(|i| !inside(x[i], y[i])));
    let lost = walled.cells.log_evidence() - open.cells.log_evidence();
    assert!((lost - (1.0 - share).ln()).abs() < 0.02, "{lost} {}", (1.0 - share).ln());
    let at = |x: f64| likelihood(&opaque(false, Some(block)), false, 1, joint()).log_likelihood(&Vector2::new(x, 50.0));
    assert!(at(60.0) == f64::NEG_INFINITY && at(50.0).is_finite());
}

#[test]
fn search_runs_on_any_model() {
    let sensor = opaque(false, None);
    let alone = ModelGrid::from(sensor.clone());
    for form in [Form::Raw, Form::Mixture(4)] {
        let (outcome, error) = searched((3, 150, 18.0, 1e-4), form, &alone, &sensor).unwrap();
        assert_eq!(outcome.status, Status::Converged);
        assert!(error < 0.5, "{form:?}: {error}");
    }
}

#[test]
fn node_without_concentrations_is_refused() {
    let far = opaque(false, None).receptor(&Vector2::new(300.0, 0.0));
    assert!(far.unwrap_err().to_string().contains("within 200 m"));
    assert!(opaque(false, None).receptor(&Vector2::new(f64::NAN, 0.0)).is_err());
    let flat =
        SourceSensor::new(Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap(), vec![5.0], 8e-6).unwrap();
    assert!(flat.receptor(&Vector2::new(f64::INFINITY, 0.0)).is_err());
}
