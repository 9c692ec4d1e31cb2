//! Kalman-like filters fed with one sign bit a sample.
