//! Lower bounds on the error of schemes with `N` bits.
//!
//! | quantity | function | valid for |
//! |---|---|---|
//! | optimal-weight van Trees bound of given sensors | [`optimal_weight_van_trees`] | every bank, both sources |
//! | exact centralised bound | [`centralised_bound`] | every scheme |

mod centralised;
mod conditional_mean;
mod van_trees;

pub use centralised::centralised_bound;
pub use conditional_mean::ConditionalMean;
pub use van_trees::optimal_weight_van_trees;
