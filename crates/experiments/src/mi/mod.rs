//! Distributed quantizers by mutual information: figures and tables.

mod common;
pub(crate) mod iterations;
pub(crate) mod table4_1;
pub(crate) mod table4_2;
pub(crate) mod table4_3;
pub(crate) mod table4_4;
pub(crate) mod table4_5;
