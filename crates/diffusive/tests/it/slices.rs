//! Series over a plane and one more coordinate, against quadrature and closed forms.

use fewbits_baselines::diffusive::{Lpg, Slice};
use fewbits_core::{Belief, Columns, Density};
use fewbits_densities::Component;
use fewbits_diffusive::density::{CellOptions, CellTarget, Cells};
use fewbits_numerics::quadrature::Rule;
use nalgebra::{Matrix3, Vector2, Vector3};

fn gaussians() -> [Component<3>; 2] {
    let tilted = Matrix3::new(4.0, 1.0, 0.3, 1.0, 2.0, -0.2, 0.3, -0.2, 0.1);
    let round = Matrix3::new(1.0, -0.3, 0.0, -0.3, 1.5, 0.05, 0.0, 0.05, 0.02);
    [
        Component::new(0.6, Vector3::new(1.0, -2.0, 1.0), tilted).unwrap(),
        Component::new(0.4, Vector3::new(4.0, 1.0, 0.8), round).unwrap(),
    ]
}

fn belief() -> Lpg<3> {
    let lists = [0.9, -0.3].map(|scale| (0..10).map(|i| scale * (0.7 + f64::from(i)).cos()).collect());
    Lpg::new(&gaussians(), 2, &lists).unwrap()
}

#[test]
fn slices_are_integrals_of_the_density() {
    let (belief, mut slice) = (belief(), Slice::default());
    for (x, y) in [(1.0, -2.0), (3.0, 0.5), (-4.0, -6.0), (12.0, 3.0)] {
        let place = Vector2::new(x, y);
        for (sums, range) in [
            ([0.0, 0.0, 0.0], [-3.0, 4.0]),
            ([50.0, 45.0, 41.0], [0.5, 1.5]),
            ([4e4, 3.9e4, 3.81e4], [0.5, 1.5]),
            ([900.0, 200.0, 60.0], [0.5, 1.5]),
        ] {
            belief.slice(&place, 0.0, &mut slice);
            let got = slice.tilted(sums, range);
            let log = |t: f64| {
                belief.log_density(&Vector3::new(x, y, t)) - 0.5 * (sums[2] - t * (2.0 * sums[1] - t * sums[0]))
            };
            let rule = Rule::gauss_legendre(20);
            let peak = rule
                .panels(range[0], range[1], 500)
                .fold(f64::NEG_INFINITY, |m, (t, _)| m.max(log(t)));
            let moment = |k: i32| rule.composite(range[0], range[1], 500, |t| t.powi(k) * (log(t) - peak).exp());
            let (mass, mean) = (moment(0), moment(1) / moment(0));
            assert!((got.log_mass - peak - mass.ln()).abs() < 1e-6, "{place} {sums:?}: {got:?} {}", peak + mass.ln());
            assert!((got.mean - mean).abs() < 1e-6, "{got:?} {mean}");
            assert!((got.variance / (moment(2) / mass - mean * mean) - 1.0).abs() < 1e-4, "{got:?}");
            belief.slice(&(place + Vector2::new(0.2, -0.2)), 0.2, &mut slice);
            // Half a nat is what a widened Gaussian may lack of a moved one.
            assert!(slice.tilted(sums, range).log_mass > got.log_mass - 0.51, "{place} {sums:?}");
        }
    }
    belief.slice(&Vector2::new(1e200, 0.0), 0.0, &mut slice);
    assert_eq!(slice.tilted([1.0, 1.0, 1.0], [0.5, 1.5]).log_mass, f64::NEG_INFINITY);
}

/// `exp(-(energy - 2 correlation t + response t^2)/2)` of a measurement `t = place` of the given precision.
fn measured(place: f64, precision: f64) -> [f64; 3] {
    [precision, precision * place, precision * place * place]
}

/// One Gaussian without a polynomial, where everything has a closed form: also a hundred deviations off, where only what is
/// scaled by the right peak is a number, and in a range a million times as wide as the mass.
#[test]
fn of_a_gaussian_slices_are_conditionals() {
    let gaussian = gaussians()[0];
    let (m, s) = (*gaussian.mean(), *gaussian.covariance());
    let (plane, cross) = (s.fixed_view::<2, 2>(0, 0).into_owned(), s.fixed_view::<2, 1>(0, 2).into_owned());
    let precision = plane.try_inverse().unwrap();
    let gain = precision * cross;
    let own = s[(2, 2)] - gain.dot(&cross);
    let belief = Lpg::new(&[gaussian], 0, &[vec![-1.7]]).unwrap();
    let mut slice = Slice::default();
    let log_normal = |square: f64, variance: f64| -0.5 * (square + (std::f64::consts::TAU * variance).ln());
    for (x, y) in [(1.0, -2.0), (2.9, -0.3), (-3.0, 1.0)] {
        let place = Vector2::new(x, y);
        let d = place - m.xy();
        let (square, centre) = (d.dot(&(precision * d)), m.z + gain.dot(&d));
        let log_marginal = log_normal(square, std::f64::consts::TAU * plane.determinant());
        belief.slice(&place, 0.0, &mut slice);
        let reach = 100.0 * own.sqrt();
        for (at, accuracy, range) in [
            (centre + 0.3, 7.0, [-1e5, 1e5]),
            (centre - reach, 1e4, [-200.0, 200.0]),
            (centre + reach, 1e4, [-200.0, 200.0]),
            (centre + 30.0 * reach, 0.9, [-1e6, 1e6]),
        ] {
            let got = slice.tilted(measured(at, accuracy), range);
            let variance = 1.0 / (accuracy + 1.0 / own);
            let mean = variance * (accuracy * at + centre / own);
            let gap = at - centre;
            let log_mass = log_marginal - 0.5 * (1.0 + own * accuracy).ln() - 0.5 * gap * gap / (own + 1.0 / accuracy);
            assert!((got.log_mass - log_mass).abs() < 1e-7 * log_mass.abs().max(1.0), "{got:?} {log_mass}");
            assert!((got.mean - mean).abs() < 1e-7 * mean.abs().max(1.0), "{got:?} {mean}");
            assert!((got.variance / variance - 1.0).abs() < 1e-6, "{got:?} {variance}");
        }
        // Only a tail is inside: `E(-t)` of an exponential beyond an end far from the centre.
        for (side, range) in [
            (1.0, [centre + 0.4 * reach, centre + reach]),
            (-1.0, [centre - reach, centre - 0.4 * reach]),
        ] {
            let got = slice.tilted([0.0; 3], range);
            let log = |t: f64| log_marginal + log_normal((t - centre) * (t - centre) / own, own);
            let end = centre + side * 0.4 * reach;
            // Mills' ratio at 40 deviations, to its third term.
            let mills = own.sqrt() / 40.0 * (1.0 - 1.0 / 1600.0 + 3.0 / 2.56e6);
            assert!((got.log_mass - log(end) - mills.ln()).abs() < 1e-7, "{got:?}");
            assert!((got.mean - end - side * own.sqrt() / 40.0 * (1.0 - 2.0 / 1600.0)).abs() < 1e-6, "{got:?}");
        }
        // Cells: the centre may move along the third coordinate, and the plane's part is the most within the cell, about.
        for half in [1e-3, 0.05, 0.4] {
            belief.slice(&place, half, &mut slice);
            let got = slice.tilted([0.0; 3], [-60.0, 60.0]);
            let shift = half * (gain.x.abs() + gain.y.abs());
            assert!((got.variance / (own + shift * shift) - 1.0).abs() < 1e-7, "{got:?}");
            let widened = 0.5 * ((own + shift * shift) / own).ln();
            let most = |reach: f64| {
                let grid = (-10..=10).flat_map(|i| (-10..=10).map(move |j| Vector2::new(f64::from(i), f64::from(j))));
                let squares = grid.map(|g| d + g * (0.1 * reach)).map(|d| d.dot(&(precision * d)));
                log_normal(squares.fold(f64::INFINITY, f64::min), std::f64::consts::TAU * plane.determinant())
            };
            let log = got.log_mass - widened;
            assert!(log > most(half) - 1e-7 && log < most(3.0 * half).max(log_marginal + 1e-7) + 3.0 * half, "{half}");
        }
    }
}

/// Steep along the diagonal of the cell, in any unit.
#[test]
fn slices_of_cells_bound_ridges_in_every_unit() {
    for unit in [1e-3, 1.0, 1e3] {
        let scale = Matrix3::from_diagonal(&Vector3::new(unit, unit, 1.0));
        let ridge = scale * Matrix3::new(1.0, -0.98, 0.0, -0.98, 1.0, 0.0, 0.0, 0.0, 0.5) * scale;
        let ridge = Component::new(1.0, Vector3::zeros(), ridge).unwrap();
        let belief = Lpg::new(&[ridge], 0, &[vec![1.0]]).unwrap();
        let (mut slice, place) = (Slice::default(), |x: f64| Vector2::new(x, x) * unit);
        let mut mass = |x: f64, half: f64| {
            belief.slice(&place(x), half * unit, &mut slice);
            slice.tilted([0.0; 3], [-9.0, 9.0]).log_mass
        };
        let (bound, corner, beyond) = (mass(1.0, 0.2), mass(0.8, 0.0), mass(0.6, 0.0));
        assert!(bound >= corner - 1e-9 && bound < beyond, "{unit}: {corner} {bound} {beyond}");
    }
}

/// Absolute polynomials, as the bound of the whole has them at the same places; a coarse cell takes them for one at least.
#[test]
fn slices_of_cells_bound_as_the_whole_does() {
    let (belief, mut slice, mut scratch) = (belief(), Slice::default(), Vec::new());
    let rule = Rule::gauss_legendre(20);
    for (x, y) in [(1.0, -2.0), (3.0, 0.5), (-2.0, -3.0)] {
        belief.slice(&Vector2::new(x, y), 1e-13, &mut slice);
        let got = slice.tilted([0.0; 3], [-3.0, 4.0]);
        let mut bound = |t: f64| {
            belief
                .log_density_and_bound(&Vector3::new(x, y, t), 1e-13, &mut scratch)
                .1
                .exp()
        };
        let mass: f64 = rule.panels(-3.0, 4.0, 500).map(|(t, w)| w * bound(t)).sum();
        // Absolute values have kinks.
        assert!((got.log_mass - mass.ln()).abs() < 0.01, "{got:?} {}", mass.ln());
    }
    let gaussian = gaussians()[1];
    let odd = Lpg::new(&[gaussian], 1, &[vec![0.0, -1.7, 0.0, 0.0]]).unwrap();
    let peak = -0.5 * (std::f64::consts::TAU.powi(2) * (1.5 - 0.09)).ln();
    odd.slice(&gaussian.mean().xy(), 1.0, &mut slice);
    let coarse = slice.tilted([0.0; 3], [-3.0, 4.0]).log_mass;
    let shift: f64 = 0.05 / 1.41 * (0.3 + 1.0);
    let own: f64 = 0.02 - 0.05 * 0.05 / 1.41;
    assert!((coarse - peak - 0.5 * ((own + shift * shift) / own).ln()).abs() < 1e-7, "{coarse} {peak}");
    odd.slice(&gaussian.mean().xy(), 1e-3, &mut slice);
    assert_eq!(slice.tilted([0.0; 3], [-3.0, 4.0]).log_mass, f64::NEG_INFINITY);
}

/// The marginal over the plane of a tilted Gaussian.
struct Plane;

impl CellTarget<2> for Plane {
    fn evaluate(&self, centres: &Columns<'_, 2>, _: f64, logs: &mut [f64], scores: &mut [f64]) {
        let s = gaussians()[0].covariance().fixed_view::<2, 2>(0, 0).into_owned();
        let precision = s.try_inverse().unwrap();
        for i in 0..logs.len() {
            let d = Vector2::new(centres[0][i] - 1.0, centres[1][i] + 2.0);
            logs[i] = -0.5 * d.dot(&(precision * d));
            scores[i] = logs[i];
        }
    }
}

#[test]
fn a_gaussian_is_fitted_without_loss() {
    let cells = Cells::cover(&Plane, [-12.0; 2], [12.0; 2], 40, &CellOptions::default()).unwrap();
    let exact = gaussians()[0];
    let s = exact.covariance();
    let gain = s.fixed_view::<2, 2>(0, 0).try_inverse().unwrap() * s.fixed_view::<2, 1>(0, 2);
    let variance = s[(2, 2)] - gain.dot(&s.fixed_view::<2, 1>(0, 2));
    let [x, y] = cells.columns();
    let means: Vec<f64> = x
        .iter()
        .zip(y)
        .map(|(x, y)| 1.0 + gain.dot(&Vector2::new(x - 1.0, y + 2.0)))
        .collect();
    let variances = vec![variance; means.len()];
    // About another Gaussian, so that the polynomials have something to do.
    let other = Component::new(1.0, exact.mean().add_scalar(0.05), s * 1.3).unwrap();
    let fit = Lpg::fit_lifted(&cells, &means, &variances, &[other], 6).unwrap();
    assert!(fit.affinity > 1.0 - 1e-4, "{}", fit.affinity);
    assert!((fit.belief.mean() - exact.mean()).amax() < 1e-2, "{}", fit.belief.mean());
    assert!((fit.belief.covariance() - s).amax() < 0.02 * s.amax(), "{}", fit.belief.covariance());
    assert!(Lpg::fit_lifted(&cells, &means[1..], &variances, &[other], 6).is_err());
    assert!(Lpg::fit_lifted(&cells, &means, &variances, &[other, other], 2).is_err());
    assert!(Lpg::fit_lifted(&cells, &means, &variances, &[other], 21).is_err());
}
