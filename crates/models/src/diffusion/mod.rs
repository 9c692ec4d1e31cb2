//! How a substance released into air or water spreads: Green's functions of the diffusion equation, and concentrations
//! from sources that vary, move or cover an area.
//!
//! The equation is `dc/dt = kappa lap c - v . grad c + release` (Zhao and Nehorai, IEEE Trans. Signal Processing 55 (2007)
//! 2729, section II). Units are SI: metres, seconds, kilograms, kg/m^3. Any other consistent set works too.
//!
//! | task | item |
//! |---|---|
//! | one coordinate, unbounded or with one wall | [`Axis`] |
//! | three dimensions with wind | [`Space`] |
//! | a source that releases at a constant rate, closed form, with gradient | [`Air`] |
//! | a release that lasts, varies, moves, covers a disk | [`Release`], [`moving_source`], [`disk_source`] |
//! | the region where the concentration exceeds a threshold | [`contour_radius`] |
//! | a table of the response, for many distances | [`Profile`] |
//!
//! Rooms, slabs, vessels and media of varying diffusivity have no closed form, or one for each shape. The crate
//! `fewbits-diffusion` solves them by finite volumes.
//!
//! A Green's function takes field **and** source, `green(field, source, age)`. The difference `field - source` is enough only far from
//! every wall, although equation (10) of the paper uses it. The age counts from the release; at age zero and before every response is
//! exactly 0.
//!
//! ```
//! use fewbits_models::diffusion::{Air, Ground};
//! use nalgebra::Vector3;
//! // 1 kg/s released on impermeable ground, observed 10 m upwind of the source after 5 s of wind.
//! let air = Air::new(40.0, Vector3::new(-20.0, -10.0, 0.0), Ground::Impermeable)?;
//! let (source, sensor) = (Vector3::new(73.0, 38.0, 0.0), Vector3::new(63.0, 38.0, 0.0));
//! assert!((air.concentration(&sensor, &source, 5.0) - 2.962_145_268_583e-4).abs() < 1e-15);
//! assert_eq!(air.concentration(&sensor, &source, -1.0), 0.0);
//! # Ok::<(), fewbits_models::Error>(())
//! ```

mod air;
mod axis;
mod contour;
mod extended;
mod half_space;
mod integrate;
mod profile;
mod release;
mod space;

pub use crate::source_model::SourceGradient;
pub use air::{Air, Ground};
pub use axis::Axis;
pub use contour::contour_radius;
pub use extended::{disk_source, moving_source};
pub use half_space::{Flux, Wall};
pub use profile::Profile;
pub use release::Release;
pub use space::{ImpulseResponse, Space, step_response};
