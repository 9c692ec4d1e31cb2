use fewbits_diffusive::*;
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Vector2, Vector3};

fn stat(name: &str, form: Form, rate: RateModel, rule: Rule, a: bool, range: f64, wind: bool, n: u64, cap: usize) {
    let v = if wind { Vector3::new(-20.0, -10.0, 0.0) } else { Vector3::zeros() };
    let air = Air::new(40.0, v, Ground::Impermeable).unwrap();
    let count = if a { 10 } else { 5 };
    let sensor = SourceSensor::new(air, (1..=count).map(|j| 5.0 * j as f64).collect(), if a { 4e-6 } else { 8e-6 }).unwrap().with_bias(1e-5).unwrap();
    let source = if a { Vector2::new(73.0, 38.0) } else { Vector2::new(62.0, 50.0) };
    let alarm = Vector2::new(44.396, 52.042);
    let (mut nodes, mut errs, mut reach, mut wrong) = (vec![], vec![], 0, 0);
    let mut nees = vec![];
    let mut stats = std::collections::BTreeMap::new();
    let mut evals = 0;
    let mut updates = 0;
    let t0 = std::time::Instant::now();
    for s in 0..n {
        let mut rng = Stream::new(1).indexed(s).rng();
        let d = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300).unwrap();
        let start = d.nearest_to(&alarm);
        let d = d.with_moved(start, alarm).unwrap();
        let g = Graph::within(d.positions(), range).unwrap();
        let mut search = Search::new(&alarm, 50.0, SearchBox { lower: [-20.0; 2], upper: [120.0; 2] }, rate, if a { 1e-6 } else { 1e-5 }).unwrap();
        search.form = form;
        search.rule = rule;
        search.most_nodes = cap;
        let out = search.run(&sensor, &d, &g, start, |k| sensor.sample(&mut rng, &d.positions()[k], &source, 1.0)).unwrap();
        *stats.entry(format!("{:?}", out.status)).or_insert(0) += 1;
        evals += out.steps.iter().map(|s| s.evaluations).sum::<usize>();
        updates += out.steps.len();
        if let Some(e) = out.estimate() {
            let err = (e.mean() - source).norm();
            errs.push(err);
            if err > 1.0 { wrong += 1; }
            nees.push(e.mahalanobis_squared(&source).unwrap_or(f64::NAN));
        }
        if out.status == Status::Converged { reach += 1; nodes.push(out.steps.len() as f64); }
    }
    let med = |v: &mut Vec<f64>| { v.sort_by(f64::total_cmp); if v.is_empty() { f64::NAN } else { v[v.len() / 2] } };
    println!("{name:24} reach {:.3} nodes {} err {:.4} wrong {} nees {:.2} {:.1} ms/chain {:.2} ms/update {} evals/update {:?}", reach as f64 / n as f64, med(&mut nodes), med(&mut errs), wrong, med(&mut nees), t0.elapsed().as_secs_f64() * 1e3 / n as f64, t0.elapsed().as_secs_f64() * 1e3 / updates as f64, evals / updates, stats);
}

#[test]
fn scratch() {
    let range = RateRange::new(0.5, 1.5).unwrap();
    let (joint, known) = (RateModel::Joint(range), RateModel::Known(1.0));
    let n = std::env::var("N").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let m = Rule::Mahalanobis;
    stat("B exact joint", Form::Raw, joint, m, false, 15.0, false, n, 30);
    stat("B exact joint MI", Form::Raw, joint, Rule::MutualInformation, false, 15.0, false, n, 30);
    stat("A15 exact joint", Form::Raw, joint, m, true, 15.0, false, n, 30);
    stat("A10 exact joint", Form::Raw, joint, m, true, 10.0, false, n, 30);
    stat("B exact known", Form::Raw, known, m, false, 15.0, false, n, 30);
    stat("B gauss known", Form::Gaussian, known, m, false, 15.0, false, n, 40);
    stat("B gauss9", Form::Gaussian, joint, m, false, 15.0, false, n, 40);
    stat("B gmm4 joint", Form::Mixture(4), joint, m, false, 15.0, false, n, 40);
    stat("B gmm4 known", Form::Mixture(4), known, m, false, 15.0, false, n, 40);
    stat("B lpg2x5 known", Form::Lpg { components: 2, degree: 5 }, known, m, false, 15.0, false, n, 40);
    stat("B part25 known", Form::Particles(25), known, m, false, 15.0, false, n, 40);
    stat("B laplace known", Form::Laplace, known, m, false, 15.0, false, n, 40);
    stat("A15 gauss9", Form::Gaussian, joint, m, true, 15.0, false, n, 40);
    stat("A15 gmm4 joint", Form::Mixture(4), joint, m, true, 15.0, false, n, 40);
    stat("A15 lpg", Form::Lpg { components: 2, degree: 5 }, known, m, true, 15.0, false, n, 40);
    stat("W62 gmm4 MI", Form::Mixture(4), joint, Rule::MutualInformation, false, 15.0, true, n, 14);
    stat("W62 gmm4 cov", Form::Mixture(4), joint, Rule::Covariance, false, 15.0, true, n, 14);
    stat("W62 gmm4 maha", Form::Mixture(4), joint, m, false, 15.0, true, n, 14);
}
