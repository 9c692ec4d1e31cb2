//! Roots and maxima of functions of one variable.

pub mod bisect;
pub mod golden;
pub mod newton;
pub mod roots;
