//! Wind and diffusivity known up to a few models.

use super::{field, joint, searched, sensor};
use fewbits_diffusive::{
    Error, Form, ModelGrid, Posterior, Prior, Search, SearchField, SourceLikelihood, SourceSensor, Status,
};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};

const SOURCE: [f64; 2] = [62.0, 50.0];

fn air(diffusivity: f64, wind: f64) -> Air {
    Air::new(diffusivity, Vector3::new(wind, 0.0, 0.0), Ground::Impermeable).unwrap()
}

fn with(diffusivity: f64, wind: f64) -> SourceSensor {
    SourceSensor::new(air(diffusivity, wind), vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6).unwrap()
}

fn candidates() -> ModelGrid {
    let models = [(40.0, 0.0), (40.0, 3.0), (40.0, -3.0), (60.0, 0.0), (27.0, 0.0)];
    ModelGrid::uniform(models.map(|(k, v)| with(k, v)).to_vec()).unwrap()
}

#[test]
fn probabilities_of_models_are_bayes() {
    let mut rng = Stream::new(7).rng();
    let nodes = [[50.0, 54.0], [40.0, 40.0]].map(Vector2::from);
    let taken = nodes.map(|node| {
        let samples = with(40.0, 3.0).sample(&mut rng, &node, &Vector2::from(SOURCE), 1.0);
        samples.unwrap()
    });
    let weights = [0.1, 0.2, 0.3, 0.2, 0.2];
    let sensors: Vec<SourceSensor> = candidates().iter().map(|(s, _)| s.clone()).collect();
    let grid = ModelGrid::new(sensors.clone(), &weights).unwrap();
    let mut search = Search::new(&nodes[0], 50.0, field(1.0), joint(), 1e-300).unwrap();
    search.max_nodes = 2;
    let deployed = Deployment::given(nodes.to_vec()).unwrap();
    let graph = Graph::within(deployed.positions(), 30.0).unwrap();
    let field_of = SearchField::new(grid, deployed, graph).unwrap();
    let found = search.run(&field_of, 0, |node| Ok(taken[node].clone()));
    let found = found.unwrap().models;
    let evidences: Vec<f64> = sensors
        .iter()
        .map(|sensor| {
            let records: Vec<_> = (0..2).map(|i| sensor.record(&nodes[i], &taken[i]).unwrap()).collect();
            let posterior = |count: usize, near| {
                let likelihood = SourceLikelihood::new(records[..count].to_vec(), joint()).unwrap();
                let prior = Prior::Exact(search.prior);
                Posterior::new(&prior, &likelihood, &field(1.0), near, &search.cells).unwrap()
            };
            let near = posterior(1, None).around(&field(1.0));
            posterior(2, Some(near)).cells.log_evidence()
        })
        .collect();
    let total: f64 = (0..5).map(|i| weights[i] * (evidences[i] - evidences[1]).exp()).sum();
    for i in 0..5 {
        let expected = weights[i] * (evidences[i] - evidences[1]).exp() / total;
        assert!((found[i] - expected).abs() < 1e-9, "{i}: {} {expected}", found[i]);
    }
    assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

fn search(truth: &SourceSensor, models: &ModelGrid, form: Form) -> Result<(Status, Vec<f64>, f64), Error> {
    let (outcome, error) = searched((4, 300, 15.0, 1e-5), form, models, truth)?;
    Ok((outcome.status, outcome.models, error))
}

#[test]
fn search_finds_source_and_model() {
    for (truth, index) in [(with(40.0, 0.0), 0), (with(40.0, -3.0), 2), (with(60.0, 0.0), 3)] {
        let (status, models, error) = search(&truth, &candidates(), Form::Raw).unwrap();
        assert_eq!(status, Status::Converged);
        assert!(models[index] > 0.95 && error < 0.5, "{models:?} {error}");
    }
}

#[test]
fn model_that_is_not_among_them_is_a_misfit() {
    let others = ModelGrid::uniform(vec![with(40.0, 0.0), with(60.0, 0.0)]).unwrap();
    let (status, ..) = search(&with(40.0, -8.0), &others, Form::Raw).unwrap();
    assert_eq!(status, Status::Misfit);
}

/// One model is the plain search, to the bit.
#[test]
fn grid_of_one_model_is_the_plain_search() {
    let alone = ModelGrid::from(with(40.0, 0.0));
    let (status, models, error) = search(&with(40.0, 0.0), &alone, Form::Raw).unwrap();
    assert_eq!((status, models), (Status::Converged, vec![1.0]));
    assert!(error < 0.5);
}

#[test]
fn grids_refuse_bad_parts() {
    assert!(ModelGrid::uniform(Vec::new()).is_err());
    assert!(ModelGrid::new(vec![sensor(1.0, false)], &[0.5, 0.5]).is_err());
    assert!(ModelGrid::new(vec![sensor(1.0, false)], &[0.7]).is_err());
    let later = SourceSensor::new(air(40.0, 0.0), vec![9.0], 8e-6).unwrap();
    assert!(ModelGrid::uniform(vec![with(40.0, 0.0), later]).is_err());
    let refusal = search(&with(40.0, 0.0), &candidates(), Form::Mixture(4))
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("Raw"), "{refusal}");
}
