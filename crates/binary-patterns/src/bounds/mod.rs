//! Lower bounds on the error of schemes with `N` bits.
//!
//! | quantity | function | valid for |
//! |---|---|---|
//! | optimal-weight van Trees bound of given sensors | [`optimal_weight_van_trees`] | every bank, both sources |
//! | remote rate-distortion bound, `N` observations and bits | [`network_rate_distortion`] | every scheme |
//! | exact centralised bound | [`centralised_bound`] | every scheme; the tightest of those for every scheme |
//! | equations 5.12 and B.1 as printed | [`RemoteDistortion`] of one observation | one sensor only |

mod centralised;
mod rate_distortion;
mod van_trees;

pub use centralised::centralised_bound;
pub use rate_distortion::{ConditionalMean, RemoteDistortion, network_rate_distortion, remote_distortion};
pub use van_trees::optimal_weight_van_trees;
