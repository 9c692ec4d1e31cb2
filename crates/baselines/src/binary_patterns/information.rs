//! Equation 5.13: the Fisher information of the bits, averaged over the source.

use fewbits_binary_patterns::engine::Kind;
use fewbits_binary_patterns::{Bank, Error, Nodes};
use fewbits_numerics::error::refuse;
use fewbits_numerics::quadrature::gauss_legendre;

/// Width of quadrature panels in noise standard deviations; the integrand, a quotient, is less smooth than the probabilities.
const INFORMATION_PANEL: f64 = 0.5;

/// Mean Fisher information `E[J(X)]` of the bits about the source.
pub(crate) fn mean_information(bank: &Bank) -> f64 {
    let reach = bank.source().reach();
    Nodes::adapted(bank.source(), -reach, reach, &bank.thresholds(), INFORMATION_PANEL, gauss_legendre::<12>())
        .expectation(|x| bank.fisher_information(x))
}

/// Equation 5.13: `1/(E[J] + J2)` with `J2 = 1/sigma_x^2` for a Gaussian source and 0 for a uniform one.
///
/// For a Gaussian source this is the van Trees bound with constant weight, hence valid. The density of a uniform source
/// does not vanish at `+-V`, so with `J2 = 0` it is no bound, and the mean squared error can be smaller (three Gray
/// bits at 0 dB: 0.198 against 0.382; erratum `binary-7`). It is provided because the thesis ranks patterns by it.
///
/// # Errors
/// If the information is zero to machine precision, so that the quotient is not finite.
pub fn printed_crlb(bank: &Bank) -> Result<f64, Error> {
    let prior = match bank.source().kind() {
        Kind::Uniform { .. } => 0.0,
        Kind::Gaussian { deviation } => 1.0 / (deviation * deviation),
    };
    let information = mean_information(bank) + prior;
    if information > 0.0 && (1.0 / information).is_finite() {
        Ok(1.0 / information)
    } else {
        refuse("information", information, "information above 0")
    }
}
