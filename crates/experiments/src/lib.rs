//! The papers' experiments as functions: configuration in, table and claims out.
