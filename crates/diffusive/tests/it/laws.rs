//! The laws of the library's words, on every implementation here.

use super::{field, joint, posterior_of, sensor};
use fewbits_baselines::diffusive::{Lpg, lpg, lpg_of_position, lpg_with_rate};
use fewbits_core::laws::likelihood::sweep_is_scalar;
use fewbits_core::{Belief, Density, Gaussian, Likelihood, laws};
use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::{
    Form, Posterior, Prior, RateModel, RateRange, RateSums, SourceLikelihood, SourceSensor, Travelling, project,
};
use fewbits_models::diffusion::{Air, Ground, Wall};
use fewbits_numerics::quadrature::Rule;
use nalgebra::{Matrix2, Vector2, Vector3};
use proptest::prelude::*;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

const NODES: [[f64; 2]; 3] = [[50.0, 54.0], [52.0, 44.0], [58.0, 60.0]];

fn likelihood(rate: RateModel, unit: f64, windy: bool, nodes: usize) -> SourceLikelihood {
    let sensor = sensor(unit, windy);
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let source = Vector2::new(62.0, 50.0) * unit;
    let records = NODES[..nodes].iter().map(|n| {
        let node = Vector2::from(*n) * unit;
        sensor
            .record(&node, &sensor.sample(&mut rng, &node, &source, 1.0).unwrap())
            .unwrap()
    });
    SourceLikelihood::new(records.collect(), rate).unwrap()
}

fn models() -> [RateModel; 4] {
    let range = RateRange::new(0.5, 1.5).unwrap();
    [
        RateModel::Known(1.0),
        RateModel::Joint(range),
        RateModel::NodeWise(range),
        RateModel::SampleWise(range),
    ]
}

fn posterior(rate: RateModel, nodes: usize) -> Posterior {
    let prior = Gaussian::new(Vector2::from(NODES[0]), Matrix2::identity() * 2500.0).unwrap();
    posterior_of(&Prior::Exact(prior), &likelihood(rate, 1.0, false, nodes)).unwrap()
}

#[test]
fn likelihoods_are_numbers_everywhere() {
    let places: Vec<f64> = vec![-1e8, -300.0, 0.0, 44.0, 50.0, 50.0 + 1e-9, 61.0, 120.0, 1e4, 1e12];
    for windy in [false, true] {
        for rate in models() {
            let states: Vec<Vector2<f64>> = places
                .iter()
                .flat_map(|x| places.iter().map(|y| Vector2::new(*x, *y)))
                .collect();
            sweep_is_scalar(&likelihood(rate, 1.0, windy, 3), &states).unwrap();
        }
    }
}

fn open_air(sensor: &SourceSensor, heights: [f64; 2], node: &Vector2<f64>, position: &Vector2<f64>) -> Vec<f64> {
    let wind = sensor.model().homogeneous().unwrap().wind;
    let air = Air::new(40.0, Vector3::new(wind.x, wind.y, 0.0), Ground::None).unwrap();
    let open = SourceSensor::new(air, sensor.instants().to_vec(), sensor.noise()).unwrap();
    open.with_heights(heights[0], heights[1])
        .unwrap()
        .responses(node, position)
        .unwrap()
}

proptest! {
    // One case in 5 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(5), ..ProptestConfig::default() })]

    /// The table is the closed form, sample by sample.
    #[test]
    fn tables_are_the_closed_form(x in -40.0..140.0f64, y in -40.0..140.0f64, windy: bool) {
        let all = likelihood(RateModel::Known(1.0), 1.0, windy, 3);
        let position = Vector2::new(x, y);
        for record in all.records() {
            let a = record.sensor().responses(record.node(), &position).unwrap();
            let direct = RateSums::of(record.samples(), &a, record.noise()).unwrap();
            let table = record.sums(&position);
            prop_assert!((table.response - direct.response).abs() <= 1e-9 * direct.response + 1e-12);
            prop_assert!((table.correlation - direct.correlation).abs() <= 1e-9 * (direct.response * direct.energy).sqrt() + 1e-12);
            prop_assert!((table.log_marginal(&RateRange::new(0.5, 1.5).unwrap()) - direct.log_marginal(&RateRange::new(0.5, 1.5).unwrap())).abs() < 1e-5);
        }
    }

    /// At every height over every ground, near the source and far from it.
    #[test]
    fn tables_are_the_closed_form_at_any_height(
        ground in 0_usize..3, scale in 0.03..1.0f64, ratio in 0.0..1.0f64, rho in -2.0..2.0f64, angle in 0.0..6.3f64,
    ) {
        let ground = [Ground::None, Ground::Impermeable, Ground::Wall(Wall::ABSORBING)][ground];
        let air = Air::new(40.0, Vector3::new(3.0, 1.0, 0.0), ground).unwrap();
        let sensor = SourceSensor::new(air, vec![5.0, 25.0], 1e-9).unwrap();
        let heights = [20.0 * scale * scale, 20.0 * scale * scale * ratio];
        let sensor = sensor.with_heights(heights[0], heights[1]).unwrap();
        let node = Vector2::new(50.0, 54.0);
        let position = node + Vector2::new(angle.cos(), angle.sin()) * 10.0_f64.powf(rho);
        let a = sensor.responses(&node, &position).unwrap();
        let record = sensor.record(&node, &[3e-5, 2e-5]).unwrap();
        let direct = RateSums::of(record.samples(), &a, record.noise()).unwrap();
        let table = record.sums(&position);
        // Over absorbing ground the response is the difference of source and image.
        let open = RateSums::of(record.samples(), &open_air(&sensor, heights, &node, &position), record.noise()).unwrap();
        prop_assert!((table.response - direct.response).abs() <= 1e-8 * open.response, "{} {}", table.response, direct.response);
        prop_assert!((table.correlation - direct.correlation).abs() <= 1e-8 * (open.response * direct.energy).sqrt());
    }

    /// The marginal over the rate is the integral of the likelihood given the rate.
    #[test]
    fn the_rate_is_integrated_out(a in -8.0..1.2f64, y in 0.0..30.0f64, low in 0.0..2.0f64, width in 0.01..5.0f64) {
        let range = RateRange::new(low, low + width).unwrap();
        let response = 10.0_f64.powf(a);
        let sums = RateSums::of(&[y, 0.7 * y, 1.2 * y], &[response, 0.8 * response, response], 1.0).unwrap();
        let best = (low..=low + width).contains(&(sums.correlation / sums.response));
        let peak = sums.log_given_rate(if best { sums.correlation / sums.response } else if sums.correlation < low * sums.response { low } else { low + width });
        let integral = Rule::gauss_legendre(30).composite(low, low + width, 400, |mu| (sums.log_given_rate(mu) - peak).exp());
        let exact = peak + (integral / width).ln();
        prop_assert!((sums.log_marginal(&range) - exact).abs() < 1e-7 * exact.abs().max(1.0), "{} {}", sums.log_marginal(&range), exact);
    }

    /// Scaled lengths give scaled posteriors.
    #[test]
    fn nothing_depends_on_the_unit(unit in prop::sample::select(vec![1e-4, 1e4])) {
        let run = |unit: f64| {
            let prior = Gaussian::new(Vector2::from(NODES[0]) * unit, Matrix2::identity() * 2500.0 * unit * unit).unwrap();
            let cells = Posterior::new(&Prior::Exact(prior), &likelihood(joint(), unit, false, 3), &field(unit), None, &CellOptions::default()).unwrap().cells;
            (cells.mean() / unit, cells.covariance() / (unit * unit))
        };
        let ((m, c), (m0, c0)) = (run(unit), run(1.0));
        prop_assert!((m - m0).amax() < 1e-7 && (c - c0).amax() < 1e-6 * c0.amax(), "{m} {m0} {c} {c0}");
    }
}

/// Densities integrate to one over the rate and any samples: total probability of one sample.
#[test]
fn total_probability_of_a_sample() {
    let range = RateRange::new(0.5, 1.5).unwrap();
    for a in [0.0, 1e-3, 0.4, 3.0, 200.0] {
        let reach = 1.5 * a + 12.0;
        let total = Rule::gauss_legendre(30)
            .composite(-12.0, reach, 400, |y| RateSums::of(&[y], &[a], 1.0).unwrap().log_marginal(&range).exp());
        assert!((total - 1.0).abs() < 1e-7, "{a}: {total}");
    }
}

#[test]
fn cells_and_polynomial_gaussians_are_beliefs() {
    let posterior = posterior(RateModel::Known(1.0), 2);
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    laws::belief::samples_have_the_moments(&posterior.cells, &mut rng, 20_000).unwrap();
    let lpg = lpg_of_position(&posterior, 2, 5).unwrap().belief;
    laws::belief::samples_have_the_moments(&lpg, &mut rng, 20_000).unwrap();
    let wide = Gaussian::new(lpg.mean(), lpg.covariance() * 4.0)
        .unwrap()
        .factored()
        .unwrap();
    laws::belief::density_integrates_to_one(&lpg, &wide, &mut rng, 40_000).unwrap();
}

/// Projections keep mean and covariance where they promise to, and a better form is closer.
#[test]
fn projections() {
    let exact = posterior(joint(), 2);
    for components in [1, 2, 4, 8] {
        let sent = project(&exact, Form::Mixture(components), &joint())
            .unwrap()
            .unwrap()
            .gaussian();
        assert!((sent.mean() - exact.cells.mean()).amax() < 1e-6);
        assert!((sent.covariance() - exact.cells.covariance()).amax() < 1e-5 * exact.cells.covariance().amax());
    }
    let known = posterior(RateModel::Known(1.0), 1);
    let gaussians = known
        .clumps(200)
        .unwrap()
        .fit(&fewbits_mixture_codec::MixtureFit::new(4).unwrap())
        .unwrap();
    let mut before = f64::INFINITY;
    for degree in [0, 2, 4, 6] {
        let fit = Lpg::fit(&known.cells, gaussians.components(), degree).unwrap();
        let kl = known.cells.kl_to(&fit.belief);
        assert!(kl > -1e-9 && 1.0 - fit.affinity < before, "{degree}: {kl} {}", fit.affinity);
        before = 1.0 - fit.affinity;
    }
}

/// A belief that was sent on and updated agrees with the joint update where nothing was lost on the way: one tight Gaussian.
#[test]
fn one_update_after_another_is_both_at_once() {
    let all = likelihood(joint(), 1.0, false, 3);
    let at = |x: &Vector2<f64>| all.log_likelihood(x);
    let parts: f64 = all
        .records()
        .iter()
        .map(|r| r.sums(&Vector2::new(60.0, 48.0)).log_given_rate(1.1))
        .sum();
    let whole = all.sums(&Vector2::new(60.0, 48.0)).log_given_rate(1.1);
    assert!((parts - whole).abs() < 1e-9 * whole.abs());
    assert!(at(&Vector2::new(62.0, 50.0)) > at(&Vector2::new(70.0, 40.0)));
}

/// Polynomial Gaussians over position and rate: moments, density and the update they are the prior of, against cells of the plane
/// with the rate on a fine grid.
#[test]
fn polynomial_gaussians_over_position_and_rate() {
    let RateModel::Joint(range) = joint() else { return };
    let exact = posterior(joint(), 3);
    let form = lpg::<2, 4>();
    let Some(Travelling::WithRate(belief)) = project(&exact, form, &joint()).unwrap() else {
        panic!("a belief over position and rate was asked for");
    };
    let lpg = &lpg_with_rate(&exact, 2, 4, &joint()).unwrap().belief;
    // A fit keeps where the belief is.
    let (sent, own) = (belief.position(), exact.gaussian());
    let scale = own.covariance().diagonal().map(f64::sqrt);
    assert!((sent.mean() - own.mean()).component_div(&scale).amax() < 0.3, "{} {}", sent.mean(), own.mean());
    let ratio = sent.covariance().determinant() / own.covariance().determinant();
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    laws::belief::samples_have_the_moments(lpg, &mut rng, 20_000).unwrap();
    let wide = Gaussian::new(lpg.mean(), lpg.covariance() * 4.0)
        .unwrap()
        .factored()
        .unwrap();
    laws::belief::density_integrates_to_one(lpg, &wide, &mut rng, 40_000).unwrap();
    // The next node's update: density of the plane by a sum over the rate.
    let sensor = sensor(1.0, false);
    let node = Vector2::new(66.0, 54.0);
    let record = sensor
        .record(&node, &sensor.sample(&mut rng, &node, &Vector2::new(62.0, 50.0), 1.0).unwrap())
        .unwrap();
    let next = SourceLikelihood::new(vec![record], joint()).unwrap();
    let updated = posterior_of(&Prior::WithRate(belief.clone(), range), &next).unwrap();
    let density = |at: &Vector2<f64>, power: i32| {
        Rule::gauss_legendre(20).composite(range.low(), range.high(), 200, |rate| {
            let prior = lpg.log_density(&Vector3::new(at.x, at.y, rate));
            rate.powi(power) * (prior + next.sums(at).log_given_rate(rate)).exp()
        })
    };
    let [x, y] = updated.cells.columns();
    let area = updated.cells.width().powi(2);
    let (means, _) = updated.rates.as_ref().unwrap();
    for i in (0..x.len()).step_by(x.len() / 40 + 1) {
        let at = Vector2::new(x[i], y[i]);
        let expected = density(&at, 0) * area / updated.cells.log_evidence().exp();
        let weight = updated.cells.weights()[i];
        assert!((weight - expected).abs() < 1e-6 * expected + 1e-9, "{at}: {weight} {expected}");
        if weight > 1e-6 {
            assert!((means[i] - density(&at, 1) / density(&at, 0)).abs() < 1e-6);
        }
    }
    // Nothing of the mass was overlooked: another cover, ten times finer in what it keeps, has the same evidence.
    let mut wider = CellOptions::default();
    (wider.keep, wider.width) = (40.0, 0.4);
    let again = Posterior::new(&Prior::WithRate(belief, range), &next, &field(1.0), None, &wider).unwrap();
    assert!((again.cells.log_evidence() - updated.cells.log_evidence()).abs() < 5e-3);
}
