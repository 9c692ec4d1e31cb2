//! Finding a diffusive source.
