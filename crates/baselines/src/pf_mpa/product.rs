//! Products of Gaussian mixtures, exact by enumeration.
//!
//! The product of `F` mixtures is a mixture of one Gaussian for each choice of labels `b_1 .. b_F`, with
//! `J = sum S_l^-1`, `h = sum S_l^-1 m_l`, mean `J^-1 h`, covariance `J^-1` and a weight in closed form. This is exact if the labels can
//! be enumerated; otherwise one draws from the product.

use fewbits_core::Belief;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::error::{at_least_one, refuse};
use fewbits_numerics::factored::Factored;
use fewbits_numerics::normal::LN_SQRT_2PI;
use fewbits_pf_mpa::Error;
use nalgebra::{SMatrix, SVector};

/// Largest number of label choices that [`exact`] enumerates.
pub const MAX_TERMS: usize = 1_000_000;

/// A normalised product and the logarithm of its normaliser.
#[derive(Debug, Clone, PartialEq)]
pub struct Product<const D: usize> {
    /// The normalised product.
    pub belief: Mixture<D>,
    /// `ln int prod_l p_l(x) dx`.
    pub log_normaliser: f64,
}

/// Information form of one component: `S^-1`, `S^-1 m`, and `ln w + ln N(0; m, S)`.
#[derive(Clone, Copy)]
struct Information<const D: usize> {
    precision: SMatrix<f64, D, D>,
    shift: SVector<f64, D>,
    log_weight: f64,
}

impl<const D: usize> Information<D> {
    fn of(c: &Component<D>, origin: &SVector<f64, D>) -> Self {
        let w = &c.factor().whitener;
        let precision = w.transpose() * w;
        let mean = c.mean() - origin;
        Self {
            precision,
            shift: precision * mean,
            log_weight: c.weight().ln()
                - 0.5 * c.factor().squared(&mean)
                - c.factor().half_log_det
                - D as f64 * LN_SQRT_2PI,
        }
    }
}

/// A Gaussian from its information form.
fn gaussian<const D: usize>(
    precision: &SMatrix<f64, D, D>,
    shift: &SVector<f64, D>,
) -> Result<(SVector<f64, D>, SMatrix<f64, D, D>, Factored<D>), Error> {
    let factor = Factored::new("precision", &((precision + precision.transpose()) * 0.5))?;
    let covariance = factor.whitener.transpose() * factor.whitener;
    Ok((factor.whitener.transpose() * (factor.whitener * shift), covariance, factor))
}

fn check<const D: usize>(factors: &[&Mixture<D>]) -> Result<SVector<f64, D>, Error> {
    at_least_one("factors", factors.len())?;
    Ok(factors.iter().map(|f| f.mean()).sum::<SVector<f64, D>>() / factors.len() as f64)
}

/// The product of mixtures, with one component for every choice of labels.
///
/// # Errors
/// If there is no factor, there are more than [`MAX_TERMS`] choices, or every weight underflows
/// ([`Error::Impossible`]: the factors have almost no overlap).
pub fn exact<const D: usize>(factors: &[&Mixture<D>]) -> Result<Product<D>, Error> {
    let origin = check(factors)?;
    let terms = factors
        .iter()
        .try_fold(1_usize, |n, f| n.checked_mul(f.len()).filter(|n| *n <= MAX_TERMS));
    if terms.is_none() {
        let sizes: Vec<usize> = factors.iter().map(|f| f.len()).collect();
        let expected = format!("at most {MAX_TERMS} choices of labels");
        return refuse("factors", format!("mixtures of {sizes:?} components"), expected);
    }
    let zero = Information {
        precision: SMatrix::zeros(),
        shift: SVector::zeros(),
        log_weight: 0.0,
    };
    let mut products = vec![zero];
    for factor in factors {
        let parts: Vec<Information<D>> = factor
            .components()
            .iter()
            .filter(|c| c.weight() > 0.0)
            .map(|c| Information::of(c, &origin))
            .collect();
        products = products
            .iter()
            .flat_map(|a| {
                parts.iter().map(move |b| Information {
                    precision: a.precision + b.precision,
                    shift: a.shift + b.shift,
                    log_weight: a.log_weight + b.log_weight,
                })
            })
            .collect();
    }
    let mut gaussians = Vec::with_capacity(products.len());
    for p in &products {
        let (mean, covariance, factor) = gaussian(&p.precision, &p.shift)?;
        // prod_l N(0; m_l, S_l) equals N(0; mean, covariance) times the weight: divide by the Gaussian.
        let own = 0.5 * mean.dot(&p.shift) - factor.half_log_det + D as f64 * LN_SQRT_2PI;
        gaussians.push((p.log_weight + own, mean, covariance));
    }
    let largest = gaussians.iter().fold(f64::NEG_INFINITY, |m, g| m.max(g.0));
    if !largest.is_finite() {
        return Err(Error::Impossible);
    }
    let total: f64 = gaussians.iter().map(|g| (g.0 - largest).exp()).sum();
    let components = gaussians.into_iter().map(|(log, mean, covariance)| {
        let symmetric = (covariance + covariance.transpose()) * 0.5;
        Component::new((log - largest).exp(), mean + origin, symmetric)
    });
    Ok(Product {
        belief: Mixture::new(components.collect::<Result<_, _>>()?)?,
        log_normaliser: largest + total.ln(),
    })
}
