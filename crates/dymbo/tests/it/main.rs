//! Integration tests of the Dymbo filters.

mod fixtures;
