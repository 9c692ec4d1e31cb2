//! Cells against closed forms.

use fewbits_core::{Belief, Columns, Density};
use fewbits_diffusive::Error;
use fewbits_diffusive::density::{CellOptions, CellTarget, Cells};
use nalgebra::Vector2;

/// A thin ring: radius 20, half a centimetre wide.
struct Ring;

impl CellTarget<2> for Ring {
    fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
        for i in 0..logs.len() {
            let off = Vector2::new(centres[0][i], centres[1][i]).norm() - 20.0;
            logs[i] = -0.5 * off * off / (0.05 * 0.05);
            scores[i] = -0.5 * off * off / (0.05 * 0.05 + half * half);
        }
    }
}

#[test]
fn a_thin_ring_is_found_whole() {
    let cells = Cells::cover(&Ring, [-50.0; 2], [60.0; 2], 40, &CellOptions::default()).unwrap();
    // The integral of the Gaussian profile times the circumference.
    let exact = (std::f64::consts::TAU * 20.0 * (std::f64::consts::TAU).sqrt() * 0.05).ln();
    assert!((cells.log_evidence() - exact).abs() < 1e-3, "{} {exact}", cells.log_evidence());
    // The stop rule promises the determinant to 2 per cent and no more.
    assert!(cells.mean().norm() < 0.1 && (cells.covariance()[(0, 0)] / 200.0 - 1.0).abs() < 1e-2);
    // Every cell has its own density, at its centre and off it.
    for (i, off) in [(0, 0.0), (cells.len() / 2, 0.4), (cells.len() - 1, -0.4)] {
        let centre = Vector2::new(cells.columns()[0][i], cells.columns()[1][i]);
        let density = cells.weights()[i].ln() - 2.0 * cells.width().ln();
        let found = cells.log_density(&centre.add_scalar(off * cells.width()));
        assert!((found - density).abs() < 1e-9 * density.abs().max(1.0), "{found} {density}");
    }
    assert_eq!(cells.log_density(&Vector2::zeros()), f64::NEG_INFINITY);
    // With cells that resolve the profile the midpoint rule is exact: E r^2 = 20^2 + 3 sd^2.
    let mut fine = CellOptions::default();
    (fine.evidence_tolerance, fine.determinant_tolerance) = (1e-9, 1e-7);
    let cells = Cells::cover(&Ring, [-50.0; 2], [60.0; 2], 40, &fine).unwrap();
    assert!((cells.log_evidence() - exact).abs() < 1e-7, "{} {exact}", cells.log_evidence());
    let variance = 0.5 * (400.0 + 3.0 * 0.05 * 0.05);
    assert!(cells.mean().norm() < 1e-5 && (cells.covariance()[(0, 0)] / variance - 1.0).abs() < 1e-6);
}

/// A correlated normal in the plane that notes where it was first asked, scores as it is.
struct Normal {
    first: std::cell::RefCell<Option<[Vec<f64>; 2]>>,
    halves: std::cell::RefCell<Vec<(usize, f64)>>,
}

impl CellTarget<2> for Normal {
    fn evaluate(&self, centres: &Columns<'_, 2>, half: f64, logs: &mut [f64], scores: &mut [f64]) {
        self.first
            .borrow_mut()
            .get_or_insert_with(|| centres.map(<[f64]>::to_vec));
        self.halves.borrow_mut().push((logs.len(), half));
        logs.fill(0.7);
        normal().add_log_densities(centres, logs);
        scores.copy_from_slice(logs);
    }
}

fn normal() -> fewbits_densities::Mixture<2> {
    let covariance = nalgebra::Matrix2::new(0.9, 0.3, 0.3, 0.4);
    fewbits_densities::Mixture::new(vec![
        fewbits_densities::Component::new(1.0, Vector2::new(0.4, -0.3), covariance).unwrap(),
    ])
    .unwrap()
}

#[test]
fn cells_of_a_normal_have_its_moments_and_divergences() {
    let target = Normal {
        first: None.into(),
        halves: Vec::new().into(),
    };
    // Boxes of 13 by 8.1 at 20 cells a side of 13: 13 cells of 0.65 cover 8.1 evenly.
    let (lower, upper) = ([-6.0, -4.5], [7.0, 3.6]);
    let mut options = CellOptions::default();
    (options.keep, options.width) = (40.0, 0.8);
    let cells = Cells::cover(&target, lower, upper, 20, &options).unwrap();
    let [x, y] = target.first.take().unwrap();
    assert_eq!(x.len(), 20 * 13);
    for (i, (x, y)) in x.iter().zip(&y).enumerate() {
        let (a, b) = ((i % 20) as f64, (i / 20) as f64);
        assert!((x - (-6.0 + 0.65 * (a + 0.5))).abs() < 1e-12 && (y - (-0.45 + 0.65 * (b - 6.0))).abs() < 1e-12);
    }
    let asked = target.halves.take();
    assert!(
        asked
            .iter()
            .enumerate()
            .all(|(k, (_, half))| *half == 0.325 / 2.0_f64.powi(k as i32))
    );
    assert_eq!(cells.evaluations(), asked.iter().map(|(n, _)| n).sum::<usize>());
    // It has settled once the cells were halved, narrower than 0.8 of the least deviation, 0.51.
    assert_eq!((asked.len(), cells.width()), (2, 0.325));
    assert!((cells.log_evidence() - 0.7).abs() < 1e-9);
    assert!((cells.mean() - normal().mean()).amax() < 1e-9);
    assert!((cells.covariance() - normal().covariance()).amax() < 1e-8);
    assert!((cells.weights().iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let (low, high) = cells.bounds();
    for d in 0..2 {
        let column = cells.columns()[d];
        assert!(column.iter().all(|x| x - 0.162 > low[d] && x + 0.162 < high[d]));
        assert!(column.iter().any(|x| x - 0.163 < low[d]) && column.iter().any(|x| x + 0.163 > high[d]));
    }
    // KL between normals: (tr(Q^-1 P) - 2 + d' Q^-1 d + ln det Q - ln det P)/2.
    let other = nalgebra::Matrix2::new(1.4, -0.2, -0.2, 0.8);
    let q = fewbits_densities::Mixture::new(vec![
        fewbits_densities::Component::new(1.0, Vector2::new(0.1, 0.2), other).unwrap(),
    ])
    .unwrap();
    let (precision, d) = (other.try_inverse().unwrap(), Vector2::new(0.3, -0.5));
    let log = (other.determinant() / normal().covariance().determinant()).ln();
    let exact = 0.5 * ((precision * normal().covariance()).trace() - 2.0 + d.dot(&(precision * d)) + log);
    assert!((cells.kl_to(&q) - exact).abs() < 1e-8, "{} {exact}", cells.kl_to(&q));
    assert!(cells.kl_to(&normal()).abs() < 1e-9);
    // Draws are centres, as often as their weights say.
    let mut rng = fewbits_monte_carlo::Stream::new(3).rng();
    let drawn = fewbits_densities::Particles::from_belief(&mut rng, &cells, 20_000).unwrap();
    assert!((drawn.mean() - cells.mean()).amax() < 0.03 && (drawn.covariance() - cells.covariance()).amax() < 0.04);
    assert!(drawn.columns()[0].iter().all(|x| cells.columns()[0].contains(x)));
    // Settled long before the cells are as narrow as they must be: 0.3 of 0.51.
    let mut narrow = options;
    narrow.width = 0.3;
    assert_eq!(Cells::cover(&target, lower, upper, 20, &narrow).unwrap().width(), 0.081_25);
    // Too few cells allowed at the start, and after the first splitting.
    for most in [200, 600] {
        let mut few = options;
        few.max_cells = most;
        let error = Cells::cover(&target, lower, upper, 20, &few).unwrap_err();
        assert!(
            most == 200 || matches!(error, Error::Unresolved { value, .. } if value > 600.0 && value % 4.0 == 0.0),
            "{error}"
        );
    }
}

struct Nowhere;

impl CellTarget<2> for Nowhere {
    fn evaluate(&self, _: &Columns<'_, 2>, _: f64, logs: &mut [f64], scores: &mut [f64]) {
        logs.fill(f64::NEG_INFINITY);
        scores.fill(f64::NEG_INFINITY);
    }
}

#[test]
fn misses_are_errors() {
    let cover = |lower, upper, n| Cells::cover(&Nowhere, lower, upper, n, &CellOptions::default());
    assert!(matches!(cover([0.0; 2], [1.0; 2], 8), Err(Error::Impossible)));
    assert!(cover([0.0; 2], [0.0; 2], 8).is_err() && cover([0.0; 2], [1.0; 2], 0).is_err());
    assert!(cover([0.0; 2], [1.0; 2], 1 << 20).is_err());
}
