//! Table I: Hermite polynomials of two variables.

use crate::prelude::*;
use fewbits_baselines::diffusive::polynomials::{gaussian_moment, hermite_terms, multi_indices};

parameters! {
    pub struct Parameters {
        variance1: f64 [0.01..=100.0] = 2.0 => "Variance of the first coordinate.",
        variance2: f64 [0.01..=100.0] = 0.5 => "Variance of the second coordinate.",
        correlation: f64 [-0.99..=0.99] = 0.7 => "Correlation.",
        degree: usize [1..=8] = 4 => "Highest degree.",
    }
}

rows! {
    pub struct Rows {
        monomials: Vec<Monomial> => "The monomials of every polynomial.",
        means: Vec<Mean> => "The mean of every polynomial under the Gaussian, which must be zero.",
    }

    struct Monomial {
        nu1: usize => "First index.",
        nu2: usize => "Second index.",
        monomial: String => "Powers of z1 and z2.",
        coef: f64 => "Its coefficient.",
        printed: Option<f64> => "The coefficient as printed, where the entry is misprinted.",
    }

    struct Mean by "{nu1} {nu2}" {
        nu1: usize as x("index nu") => "First index.",
        nu2: usize as x => "Second index.",
        mean: f64 as points("by the recursion") => "Mean of the recursion's polynomial under the Gaussian.",
        printed: Option<f64> as points("as printed") => "Mean of the printed polynomial, where it is misprinted (erratum diffusive-3).",
    }
}

/// The misprinted entries as printed: He40 with a constant `3 w11`, He22 with `w11 z1 z2` in place of `w11 z2^2`.
fn printed(nu: [usize; 2], w: &Matrix2<f64>) -> Option<Vec<([usize; 2], f64)>> {
    let (w11, w12, w22) = (w[(0, 0)], w[(0, 1)], w[(1, 1)]);
    match nu {
        [4, 0] => Some(vec![([4, 0], 1.0), ([2, 0], -6.0 * w11), ([0, 0], 3.0 * w11)]),
        [2, 2] => Some(vec![
            ([2, 2], 1.0),
            ([2, 0], -w22),
            ([1, 1], -w11 - 4.0 * w12),
            ([0, 0], w11 * w22 + 2.0 * w12 * w12),
        ]),
        _ => None,
    }
}

pub struct Table1;

impl Figure for Table1 {
    figure!(Parameters => Rows, "diffusive-table1", "Hermite polynomials of two variables", "Zhao and Nehorai 2007, Table I",
        "The polynomials He_nu(z; W) by the recursion, with the two misprinted entries of the paper's table beside \
         them. Every polynomial but the first has mean zero under the Gaussian; the misprints do not."; linear("mean under the Gaussian"));

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let cross = p.correlation * (p.variance1 * p.variance2).sqrt();
        let precision = Matrix2::new(p.variance1, cross, cross, p.variance2).try_inverse();
        let w = precision.ok_or_else(|| Error::failed("the covariance is singular"))?;
        let mean_of = |terms: &[([usize; 2], f64)]| -> Result<f64, Error> {
            let parts = terms
                .iter()
                .map(|(power, c)| Ok(c * gaussian_moment(*power, &Vector2::zeros(), &w)?));
            parts.sum()
        };
        let (mut monomials, mut means) = (Vec::new(), Vec::new());
        for nu in multi_indices::<2>(p.degree)? {
            let terms = hermite_terms(nu, &w)?;
            let misprint = printed(nu, &w);
            let mut powers: Vec<[usize; 2]> = terms.iter().map(|t| t.0).collect();
            let further = misprint.iter().flatten().map(|t| t.0);
            powers.extend(further.filter(|power| !terms.iter().any(|t| t.0 == *power)));
            let value = |list: &[([usize; 2], f64)], power| list.iter().find(|t| t.0 == power).map_or(0.0, |t| t.1);
            for power in powers {
                monomials.push(Monomial {
                    nu1: nu[0],
                    nu2: nu[1],
                    monomial: format!("z1^{} z2^{}", power[0], power[1]),
                    coef: value(&terms, power),
                    printed: misprint.as_ref().map(|list| value(list, power)),
                });
            }
            means.push(Mean {
                nu1: nu[0],
                nu2: nu[1],
                mean: mean_of(&terms)?,
                printed: misprint.map(|list| mean_of(&list)).transpose()?,
            });
        }
        Ok(Rows { monomials, means })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "every polynomial but the first has mean zero";
        claims.all("zero-mean", what, rows.means.iter().filter(|m| m.nu1 + m.nu2 > 0), |m| m.mean.abs() < 1e-10);
        let count = rows.means.len() as f64;
        here.near("complete", "fifteen polynomials up to degree four", count, 15.0, 0.0);
    }
}
