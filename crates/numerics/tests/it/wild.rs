//! Wild arguments: every function returns a number, an error, or NaN where an argument is NaN.

use fewbits_numerics::factored::Factored;
use fewbits_numerics::linalg::{semidefinite_factor, solve_semidefinite, triangular_factor};
use fewbits_numerics::normal::{self, truncated_moments};
use fewbits_numerics::{binomial, eigen, kernels, quadrature::Rule, roots, tridiagonal, wild};
use nalgebra::{Matrix2, Matrix3, Vector2};
use proptest::prelude::*;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn normal_functions_are_numbers(x in prop::array::uniform2(wild())) {
        let [a, b] = x;
        for (name, value) in [
            ("pdf", normal::pdf(a)), ("log_pdf", normal::log_pdf(a)), ("cdf", normal::cdf(a)), ("log_cdf", normal::log_cdf(a)),
            ("erfcx", normal::erfcx(a)), ("mills", normal::inverse_mills(a)),
            ("one_sided variance", normal::one_sided(a).variance),
        ] {
            prop_assert_eq!(value.is_nan(), a.is_nan(), "{}({}) = {}", name, a, value);
        }
        prop_assert!(normal::cdf(a).is_nan() || (0.0..=1.0).contains(&normal::cdf(a)));
        let log = normal::log_interval(a, b);
        prop_assert!(log.is_nan() == (a.is_nan() || b.is_nan()) || a > b, "log_interval({}, {}) = {}", a, b, log);
        prop_assert!(log.is_nan() || log <= 0.0, "log_interval({}, {}) = {}", a, b, log);
        prop_assert!(normal::interval(a, b).is_nan() || normal::interval(a, b) >= 0.0);
        let quantile = normal::quantile(a);
        prop_assert_eq!(quantile.is_nan(), !(0.0..=1.0).contains(&a), "quantile({}) = {}", a, quantile);
        if let Ok(moments) = truncated_moments(a, b) {
            prop_assert!(moments.mean.is_finite() && moments.variance >= 0.0 && moments.variance <= 1.0, "{} {}: {:?}", a, b, moments);
        }
        if let Ok(draw) = normal::sample_truncated(&mut Pcg64Mcg::seed_from_u64(1), a, b) {
            prop_assert!(draw.is_finite() && a <= draw && draw <= b, "{} {}: {}", a, b, draw);
        }
    }

    #[test]
    fn vectorised_functions_are_numbers(x in prop::array::uniform4(wild())) {
        for (name, value) in [("exp", kernels::scalar::exp(x[0])), ("ln", kernels::scalar::ln(x[0].abs())), ("log_cdf", kernels::scalar::log_cdf(x[0]))] {
            prop_assert_eq!(value.is_nan(), x[0].is_nan(), "{}({}) = {}", name, x[0], value);
        }
        let finite = x.iter().all(|x| !x.is_nan());
        prop_assert!(!finite || !kernels::log_sum_exp(&x).is_nan() || x.contains(&f64::INFINITY), "{:?}", x);
        let _ = (kernels::dot(&x, &x[..2]), kernels::sum(&x), kernels::largest(&x), kernels::largest_number(&x));
        let mut out = [0.0; 3];
        let _ = kernels::exp_minus(&x, x[0], &mut out);
        kernels::StandardNormals::new(&mut Pcg64Mcg::seed_from_u64(2)).fill(&mut out);
        prop_assert!(out.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn solvers_answer_numbers_or_errors(x in prop::array::uniform8(wild()), n in 0..70_usize, k in 0..70_usize) {
        let matrix = Matrix2::new(x[0], x[1], x[1], x[2]);
        if let Ok(Factored { lower, .. }) = Factored::new("matrix", &matrix) {
            prop_assert!(lower.iter().all(|x| x.is_finite()), "{} {}", matrix, lower);
        }
        if let Ok(factor) = semidefinite_factor("matrix", &matrix) {
            prop_assert!(factor.iter().all(|x| x.is_finite()), "{} {}", matrix, factor);
        }
        if let Ok(solved) = solve_semidefinite(&matrix, &Vector2::new(x[3], x[4])) {
            let known = matrix.iter().chain(&x[3..5]).all(|x| x.is_finite());
            prop_assert!(!known || solved.iter().all(|x| !x.is_nan()), "{} {:?}: {}", matrix, &x[3..5], solved);
        }
        if matrix.iter().all(|x| x.abs() < 1e150) {
            let (values, vectors) = eigen::symmetric_eigen(matrix);
            prop_assert!(values.iter().chain(vectors.iter()).all(|x| x.is_finite()), "{} {} {}", matrix, values, vectors);
        }
        if let Ok(solved) = tridiagonal::solve(&x[..1], &x[1..3], &x[3..4], &x[4..6]) {
            prop_assert!(solved.iter().all(|x| x.is_finite()), "{:?}: {:?}", x, solved);
        }
        if let Ok(root) = roots::bracketed(|t| (t - x[0]) * x[1], x[2], x[3], x[4]) {
            prop_assert!(root.is_finite(), "{:?}: {}", x, root);
        }
        let _ = (binomial::exact(n as u128, k as u128), binomial::saturating(n, k), binomial::log_row(n));
        let rule = Rule::gauss_legendre(n % 20);
        if x[..2].iter().all(|x| x.abs() < 1e150) {
            prop_assert!(rule.sum(x[0], x[1], |t| t).is_finite(), "{:?}", &x[..2]);
        }
    }
}

/// Of full rank and of rank one, in units that differ by ten orders of magnitude; a variance of zero has a column of zeros.
#[test]
fn triangular_factors_of_singular_covariances_give_them_back() {
    let units = [1e-5, 1.0, 1e5];
    let columns = Matrix3::new(1.0, 0.0, 0.0, 0.5, 2.0, 0.0, -0.7, 0.4, 1.3);
    for rank in 1..=3 {
        let root = Matrix3::from_fn(|i, j| if j < rank { units[i] * columns[(i, j)] } else { 0.0 });
        let covariance = root * root.transpose();
        let lower = triangular_factor(&covariance);
        for i in 0..3 {
            for j in 0..3 {
                let off = (lower * lower.transpose() - covariance)[(i, j)];
                assert!(off.abs() <= 1e-11 * units[i] * units[j], "rank {rank}: {off}");
                assert!(j <= i || lower[(i, j)] == 0.0);
            }
            assert!(i < rank || lower.column(i).amax() == 0.0, "rank {rank}: {lower}");
        }
    }
}
