//! Kalman, particle and exact grid filters that hear any message through its likelihood.
