//! A belief that travels from leader to leader in a few bytes: figures.

pub(crate) mod fig2;
pub(crate) mod fig3;
pub(crate) mod fig4;
pub(crate) mod fig5;
pub(crate) mod fig6;
pub(crate) mod fig6c;
pub mod filters;
pub(crate) mod rate;
pub(crate) mod reduction;
pub mod world;
