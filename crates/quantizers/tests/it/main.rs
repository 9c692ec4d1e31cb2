//! Integration tests: the public interface against values computed by independent programs.

mod assignment;
mod binary;
mod bounds;
