//! Beliefs as values: particles, mixtures and the operations on them.
