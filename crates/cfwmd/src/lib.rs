//! Censoring sensors, and a fusion centre that hears their silence.
