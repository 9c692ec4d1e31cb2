//! Tests of the search for a diffusive source.

mod fixtures;
