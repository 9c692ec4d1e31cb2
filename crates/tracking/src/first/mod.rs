//! What rows tell that nobody says.
//!
//! | file | what it holds |
//! |---|---|
//! | `values` | values of the first rows |
//! | `groups`, `lags` | groups of sensors of different levels, sensors that come late |
//! | `lasting` | errors that last from row to row |
//! | `stuck`, `held`, `constant`, `derived` | sensors that repeat one value, columns that hold values, never vary, or are computed from others |
//! | `again` | reports that come again a little later |
//! | `limits`, `marks`, `units`, `rounding` | detection limits, numbers that stand for gaps, changes of the unit, steps of rounding |

pub(crate) mod again;
pub(crate) mod constant;
pub(crate) mod derived;
pub(crate) mod groups;
pub(crate) mod held;
pub(crate) mod lags;
pub(crate) mod lasting;
pub(crate) mod limits;
pub(crate) mod marks;
pub(crate) mod rounding;
pub(crate) mod stuck;
pub(crate) mod units;
pub(crate) mod values;
