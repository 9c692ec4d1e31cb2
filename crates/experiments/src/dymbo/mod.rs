//! The Dymbo filter: figures and tables.

pub(crate) mod bits;
mod common;
pub(crate) mod fig3;
pub(crate) mod fig4;
pub(crate) mod fig5;
pub(crate) mod gap;
pub(crate) mod prop1b;
pub(crate) mod prop2;
pub(crate) mod selftuning;
pub(crate) mod threshold;
