//! What travels beside the exact belief, and how rules rank the next node: after a few nodes of example B.

use super::searches::run;
use super::{joint, sensor};
use fewbits_baselines::diffusive::polynomials::{hermite, multi_indices};
use fewbits_baselines::diffusive::{Peak, lpg, particles};
use fewbits_core::{Density, Gaussian, Likelihood};
use fewbits_diffusive::{
    Form, Outcome, Posterior, RateModel, SelectionRule, Selector, SentBelief, SourceLikelihood, Status, Travelling,
    project,
};
use fewbits_mixture_codec::MixtureFit;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Vector2};

const DEPLOYMENTS: u64 = 12;

/// The exact search until so many nodes have sampled.
fn exact(seed: u64, nodes: usize) -> Option<(Posterior, Outcome)> {
    let mut outcome = run(seed, 1.0, false, 300, |search| {
        (search.rule, search.max_nodes, search.threshold, search.refusal) =
            (SelectionRule::Mahalanobis, nodes, 1e-300, None);
    });
    Some((outcome.posterior.take()?, outcome))
}

/// `KL(exact || form)` of the position, nats.
fn divergence(posterior: &Posterior, form: Form) -> f64 {
    match project(posterior, form, &RateModel::Known(1.0)).unwrap() {
        Some(Travelling::Position(SentBelief::Mixture(mixture))) => posterior.cells.kl_to(&mixture),
        Some(Travelling::Position(other)) => {
            let [x, y] = posterior.cells.columns();
            let logs = x.iter().zip(y).map(|(x, y)| other.log_density(&Vector2::new(*x, *y)));
            posterior.cells.kl_to_logs(&logs.collect::<Vec<_>>())
        }
        _ => 0.0,
    }
}

/// A Gaussian and the coefficients of `sum C_nu He_nu` that multiply it.
struct Term {
    mean: Vector2<f64>,
    precision: Matrix2<f64>,
    coefficients: Vec<f64>,
}

impl Term {
    /// `phi He_nu` of every index.
    fn basis(&self, x: &Vector2<f64>) -> Vec<f64> {
        let z = self.precision * (x - self.mean);
        let height = self.precision.determinant().sqrt() / std::f64::consts::TAU;
        let phi = height * (-0.5 * (x - self.mean).dot(&z)).exp();
        let indices = multi_indices::<2>(5).unwrap().into_iter();
        indices
            .map(|nu| phi * hermite(nu, &z, &self.precision).unwrap())
            .collect()
    }

    fn value(&self, x: &Vector2<f64>) -> f64 {
        self.basis(x).iter().zip(&self.coefficients).map(|(b, c)| b * c).sum()
    }
}

/// Least squares with columns scaled to one: polynomials of different degrees differ by many orders.
fn least_squares(rows: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
    let design = DMatrix::from_row_slice(rows.len(), rows[0].len(), &rows.concat());
    let scale: Vec<f64> = design.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(design.nrows(), design.ncols(), |i, j| design[(i, j)] / scale[j]);
    let solution = scaled
        .svd(true, true)
        .solve(&DVector::from_row_slice(values), 1e-10)
        .unwrap();
    solution.iter().zip(&scale).map(|(c, s)| c / s).collect()
}

/// `KL(exact || fit)` of the fit that the paper prints, a plain density of two terms of degree 5, and the share of terms without answer:
/// the Hessian at the peak is not definite. They take the moments of a mixture's component instead.
///
/// ```text
/// mean, covariance of a term = peak and inverse Hessian there
/// phase 1: C_l    = least squares of p on the mesh of term l alone
/// phase 2: lambda = least squares of p on all meshes together
/// ```
fn two_phases(posterior: &Posterior, outcome: &Outcome) -> (f64, f64) {
    let prior = Gaussian::new(Vector2::new(44.396, 52.042), Matrix2::identity() * 2500.0).unwrap();
    let (prior, likelihood) =
        (prior.factored().unwrap(), SourceLikelihood::new(outcome.records.clone(), joint()).unwrap());
    let log_density = |x: &Vector2<f64>| prior.log_pdf(x) + likelihood.log_likelihood(x);
    let cells = &posterior.cells;
    let [x, y] = cells.columns();
    let places: Vec<Vector2<f64>> = x.iter().zip(y).map(|(x, y)| Vector2::new(*x, *y)).collect();
    let weighted = || places.iter().zip(cells.weights());
    let (best, _) = weighted().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    let scale = log_density(best) - cells.log_density(best);
    let density = |x: &Vector2<f64>| (log_density(x) - scale).exp();
    let mixture = posterior
        .clumps(200)
        .unwrap()
        .fit(&MixtureFit::new(2).unwrap())
        .unwrap();
    let (mut terms, mut meshes, mut unanswered) = (Vec::new(), Vec::new(), 0.0);
    for component in mixture.components() {
        let extent = component.covariance().diagonal().map(f64::sqrt);
        let (mean, covariance) = match Peak::climb(&log_density, component.mean(), &extent) {
            Ok(peak) => (peak.mode, peak.covariance),
            Err(_) => {
                unanswered += 1.0 / mixture.len() as f64;
                (*component.mean(), *component.covariance())
            }
        };
        let factor = Cholesky::new(covariance).unwrap();
        // Three standard deviations on either side.
        let steps = (-6..=6).flat_map(|i| (-6..=6).map(move |j| Vector2::new(f64::from(i), f64::from(j)) / 2.0));
        let mesh: Vec<Vector2<f64>> = steps.map(|step| mean + factor.l() * step).collect();
        let (precision, coefficients) = (factor.inverse(), Vec::new());
        let mut term = Term {
            mean,
            precision,
            coefficients,
        };
        let rows: Vec<Vec<f64>> = mesh.iter().map(|x| term.basis(x)).collect();
        term.coefficients = least_squares(&rows, &mesh.iter().map(density).collect::<Vec<_>>());
        terms.push(term);
        meshes.extend(mesh);
    }
    let rows: Vec<Vec<f64>> = meshes
        .iter()
        .map(|x| terms.iter().map(|term| term.value(x)).collect())
        .collect();
    let shares = least_squares(&rows, &meshes.iter().map(density).collect::<Vec<_>>());
    // Every polynomial but the zeroth integrates to zero: the mass is that of the zeroth coefficients.
    let mass: f64 = terms
        .iter()
        .zip(&shares)
        .map(|(term, share)| share * term.coefficients[0])
        .sum();
    let mass = if mass > 0.0 { mass } else { 1.0 };
    let value = |x: &Vector2<f64>| {
        terms
            .iter()
            .zip(&shares)
            .map(|(t, share)| share * t.value(x))
            .sum::<f64>()
            / mass
    };
    // A series may be negative.
    let least = 1e-12 * places.iter().map(value).fold(f64::MIN_POSITIVE, f64::max);
    let gap = |x: &Vector2<f64>| cells.log_density(x) - value(x).max(least).ln();
    (weighted().map(|(x, weight)| weight * gap(x)).sum(), unanswered)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The median, and its standard error from the spread of the middle half, as of a normal sample.
fn median(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: usize| 0.5 * (sorted[sorted.len() * share / 4] + sorted[(sorted.len() * share - 1) / 4]);
    (at(2), 1.2533 * (at(3) - at(1)) / 1.349 / (values.len() as f64).sqrt())
}

/// Medians of another program over 12 deployments of its own, after 1 to 4 nodes; the last form is the printed one. Erratum `diffusive-14`.
#[test]
fn divergences_of_forms_are_those_of_another_program() {
    const UNKNOWN: f64 = f64::NAN;
    let forms = [
        Form::Gaussian,
        Form::Mixture(2),
        Form::Mixture(4),
        Form::Mixture(8),
        lpg::<2, 5>(),
        particles::<25>(),
    ];
    let known = [
        [1.25, UNKNOWN, 0.34, 0.054, 0.82, 1.0, UNKNOWN],
        [1.23, UNKNOWN, 0.036, 0.029, 0.016, 0.95, 0.09],
        [1.76, 0.14, 0.11, 0.035, 0.017, 1.1, 0.06],
        [0.39, UNKNOWN, 0.021, 0.013, 0.11, 0.24, 0.04],
    ];
    for (nodes, known) in (1..).zip(known) {
        let beliefs: Vec<_> = (0..DEPLOYMENTS).filter_map(|seed| exact(seed, nodes)).collect();
        let of = |form| {
            beliefs
                .iter()
                .map(|(posterior, _)| divergence(posterior, form))
                .collect()
        };
        let (printed, unanswered): (Vec<f64>, Vec<f64>) = beliefs
            .iter()
            .map(|(posterior, outcome)| two_phases(posterior, outcome))
            .unzip();
        let all: Vec<Vec<f64>> = forms.into_iter().map(of).chain([printed]).collect();
        let medians: Vec<f64> = all.iter().map(|values| median(values).0).collect();
        for (values, known) in all.iter().zip(known) {
            // What sums over cells leave.
            assert!(mean(values) >= -0.01, "{nodes}: {values:?}");
            let (own, error) = median(values);
            let tolerance = f64::max(0.9 * known, 0.06) + 4.0 * error;
            assert!(known.is_nan() || (own - known).abs() <= tolerance, "{nodes}: {own}, known {known}");
        }
        let [gaussian, two, four, eight, lpg, _, printed] = medians[..] else {
            panic!("seven forms")
        };
        match nodes {
            1 => {
                assert!(eight < lpg, "{eight} {lpg}");
                assert!(mean(&all[6]) > 2.0 * mean(&all[4]) && mean(&unanswered) > 0.5, "{unanswered:?}");
            }
            2 => assert!(gaussian > 5.0 * lpg, "{gaussian} {lpg}"),
            3 => assert!(gaussian > 5.0 * lpg && gaussian > two && two > four && four > eight, "{medians:?}"),
            // The printed fit has a heavy tail.
            _ => assert!(mean(&all[6]) > 10.0 * printed, "{:?}", all[6]),
        }
    }
}

/// Nodes to the threshold with the exact belief; 5.56(9) is the mean of another program by information.
#[test]
fn searches_by_information_stall_less_than_by_distance() {
    let nodes = |rule| -> Vec<f64> {
        let search = |seed| {
            let outcome = run(seed, 1.0, false, 300, |search| {
                (search.rule, search.max_nodes, search.refusal) = (rule, 30, None);
            });
            (outcome.status == Status::Converged).then_some(outcome.steps.len() as f64)
        };
        (0..DEPLOYMENTS).filter_map(search).collect()
    };
    let rules = [
        SelectionRule::MutualInformation,
        SelectionRule::PairwiseInformation,
        SelectionRule::Mahalanobis,
    ];
    let [information, pairwise, distance] = rules.map(nodes);
    assert!(information.len() >= distance.len(), "{information:?} {distance:?}");
    let (own, n) = (mean(&information), information.len() as f64);
    let variance = information.iter().map(|x| (x - own).powi(2)).sum::<f64>() / (n - 1.0);
    assert!((own - 5.56).abs() <= 0.6 + 4.0 * (variance / n).sqrt().hypot(0.09), "{own}");
    // The better ranking of the pairwise bound saves less than half a node.
    assert!(own - mean(&pairwise) <= 0.5, "{pairwise:?} {information:?}");
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let below = |x: f64| values.iter().filter(|v| **v < x).count() as f64;
    values.iter().map(|x| below(*x)).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let cross: f64 = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum();
    let own = |v: &[f64], m: f64| v.iter().map(|x| (x - m).powi(2)).sum::<f64>();
    cross / (own(a, ma) * own(b, mb)).sqrt()
}

/// Of 16 candidates around the last of three nodes: mean rank correlation with exact information, information lost by the rule's choice, and
/// how far the rule overrates (nats). Erratum `diffusive-16`.
#[test]
fn the_pairwise_bound_ranks_as_exact_information_does() {
    let rules = [
        SelectionRule::PairwiseInformation,
        SelectionRule::MutualInformation,
        SelectionRule::Mahalanobis,
    ];
    let one = |seed| {
        let (posterior, outcome) = exact(seed, 3).unwrap();
        let (estimate, last) = (outcome.steps[2].estimate, *outcome.records[2].node());
        let scores = |rule| -> Vec<f64> {
            let selector = Selector::new(rule, &posterior, &estimate, &joint()).unwrap();
            let angles = (0..16).map(|i| f64::from(i).mul_add(std::f64::consts::TAU / 16.0, 0.1));
            let places = angles.map(|angle| last + 12.0 * Vector2::new(angle.cos(), angle.sin()));
            places
                .map(|place| selector.score(&sensor(1.0, false), &place))
                .collect()
        };
        let exact = scores(SelectionRule::ExactInformation);
        let best = exact.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        rules.map(|rule| {
            let own = scores(rule);
            let chosen = (0..own.len()).max_by(|a, b| own[*a].total_cmp(&own[*b])).unwrap();
            [
                correlation(&ranks(&own), &ranks(&exact)),
                best - exact[chosen],
                mean(&own) - mean(&exact),
            ]
        })
    };
    let all: Vec<[[f64; 3]; 3]> = (0..DEPLOYMENTS).map(one).collect();
    let [pairwise, gaussian, distance] =
        [0, 1, 2].map(|rule| [0, 1, 2].map(|k| mean(&all.iter().map(|one| one[rule][k]).collect::<Vec<_>>())));
    assert!(pairwise[0] > 0.98 && pairwise[0] > distance[0] + 0.2, "{pairwise:?} {distance:?}");
    assert!(pairwise[0] > gaussian[0] + 0.1 && gaussian[1] < 0.15, "{gaussian:?}");
    assert!(distance[1] > pairwise[1], "{distance:?} {pairwise:?}");
    assert!(pairwise[2] < 0.05 && gaussian[2] > -0.1, "{pairwise:?} {gaussian:?}");
}
