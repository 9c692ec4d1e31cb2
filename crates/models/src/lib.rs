//! Dynamics and sensing models.
