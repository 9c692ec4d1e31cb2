//! Published schemes for comparison: other ways to send one bit per sensor, and the thesis's substitutes for a search. The
//! recommended designs are in [`search`](fewbits_binary_patterns::search). All errors are computed exactly.

mod adaptive;
mod centralised;
mod conditional_mean;
pub mod count;
mod decoders;
mod information;
mod luo;
mod multi_threshold;
mod rate_distortion;
mod separation;
mod strategies;

pub use adaptive::{AdaptiveErrors, AdaptiveRule, adaptive, bounded_mle};
pub use centralised::centralised_bound;
pub use conditional_mean::ConditionalMean;
pub use decoders::Decoder;
pub use information::printed_crlb;
pub use luo::{Luo, LuoErrors};
pub use multi_threshold::{MultiThreshold, multi_threshold_bound};
pub use rate_distortion::{RemoteDistortion, network_rate_distortion, remote_distortion};
pub use separation::check_separation;
pub use strategies::{by_information, tile, with_basis};

use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::Nodes;
use fewbits_binary_patterns::engine::Kind;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Source};
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_numerics::quadrature::Rule;
use fewbits_quantizers::Quantizer;

/// A bank of `sensors` sensors that all send the sign of their measurement.
///
/// # Errors
/// If there is no sensor or `noise_deviation` is not positive and finite.
pub fn fixed_threshold(source: Source, noise_deviation: f64, sensors: usize) -> Result<Bank, Error> {
    at_least_one("sensors", sensors)?;
    let sign = BinaryQuantizer::new(vec![0.0])?;
    Bank::homogeneous_with_deviation(source, vec![sign; sensors], noise_deviation)
}

/// Interior edges of the eight-level Lloyd-Max quantizer of `N(0, 1)` with the four digits that Max (1960) prints.
const MAX_EIGHT_LEVEL_EDGES: [f64; 7] = [-1.748, -1.05, -0.5006, 0.0, 0.5006, 1.05, 1.748];

/// The eight cells for a Gaussian source with the four digits that Max (1960) prints.
///
/// # Errors
/// If `deviation` is not positive and finite.
pub fn printed_gaussian_cells(deviation: f64) -> Result<Quantizer, Error> {
    let deviation = positive("deviation", deviation)?;
    Quantizer::new(MAX_EIGHT_LEVEL_EDGES.iter().map(|t| t * deviation).collect())
}

/// Largest number of panels: enough for 75 dB if all of the support must be resolved.
const MAX_PANELS: usize = 20_000;

/// Nodes over the whole support in panels of equal width, at most `width`, for noise so large that the bits are uncertain everywhere.
pub(crate) fn even_nodes(source: &Source, width: f64, rule: &Rule) -> Nodes {
    let reach = source.reach();
    let widest = match source.kind() {
        Kind::Uniform { half_width } => 0.5 * half_width,
        Kind::Gaussian { deviation } => 1.5 * deviation,
    };
    let panels = ((2.0 * reach / width.min(widest)).ceil() as usize).clamp(1, MAX_PANELS);
    let (points, weights) = rule
        .panels(-reach, reach, panels)
        .map(|(x, w)| (x, w * source.density(x)))
        .unzip();
    Nodes { points, weights }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn nodes_carry_mass_and_variance() {
        for source in [
            Source::uniform(1.3).unwrap(),
            Source::gaussian_with_deviation(0.4).unwrap(),
        ] {
            let nodes = even_nodes(&source, 0.2, gauss_legendre::<12>());
            assert_relative_eq!(nodes.expectation(|_| 1.0), 1.0, max_relative = 1e-14);
            assert_relative_eq!(nodes.expectation(|x| x * x), source.variance(), max_relative = 1e-14);
        }
    }
}
