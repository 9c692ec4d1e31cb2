//! Concentration of a substance that diffuses, is carried by wind and decays, in any geometry: rooms, walls, openings.
//!
//! ```text
//! dc/dt + div(v c - D grad c) + decay c = source,   div v = 0,   no wind through walls
//! ```
//!
//! The method is finite volumes on a rectilinear [`Grid`] in one, two or three dimensions, with sparse factorisations by `faer` on one
//! thread.
//!
//! | question | answer |
//! |---|---|
//! | which cells are air, and the boundary conditions | [`Plan`] (text), [`Domain`] |
//! | the wind: potential flow, a function, measured velocities | [`PotentialFlow`], [`Flow`] |
//! | a room, its wind and its concentrations from files of the simulator GADEN | [`gaden::Room`], [`gaden::Table`] |
//! | diffusivity, decay, the matrix, and where the substance goes | [`Transport`], [`Balance`] |
//! | the concentration that sources cause: steady, in time | [`Steady::concentration`], [`Transient::run`] |
//! | what a sensor measures of a source **anywhere** | [`SensorField`], [`Steady::adjoint`], [`Transient::step_responses`] |
//! | where a leak is, in which room, since when, from readings of a few bits | [`LeakBelief`] |
//!
//! **Sensor responses are adjoint solutions.** A search for a source needs the response of a few sensors to a source in each of many
//! cells. One solution with the transposed matrix per sensor gives it for all cells at once, with one factorisation for all sensors.
//!
//! ```
//! use fewbits_diffusion::{PotentialFlow, Plan, FluxRule, Source, Steady, Transport};
//! let plan = Plan::parse("############\n#.....#....#\n#.....#....O\nI..........O\n############")?;
//! let domain = plan.domain(0.5, 4, 0.0)?;
//! let wind = PotentialFlow::new(&domain, 0.1)?.flow;
//! let (leak, sensor) = (domain.point([1.2, 0.8, 0.0])?, domain.point([4.8, 1.3, 0.0])?);
//! let transport = Transport::new(domain, 0.05, &wind, 0.0, FluxRule::default())?;
//! let steady = Steady::new(&transport)?;
//! let forward = steady.concentration(&[Source { patch: leak.clone(), rate: 1e-6 }])?;
//! // One adjoint solution says what the sensor measures of a source in any cell.
//! let everywhere = &steady.adjoint(&[sensor.clone()])?[0];
//! assert!((sensor.mean(&forward) / (1e-6 * leak.mean(everywhere)) - 1.0).abs() < 1e-12);
//! # Ok::<(), fewbits_diffusion::Error>(())
//! ```
//!
//! Accuracy, with cell width `h`: in boxes, ducts and slabs the error falls as `h^2`. At corners of walls, where the solution is
//! singular, it falls as `h^(4/3)`. With [`FluxRule::Upwind`], at the ends of openings within a flat wall, and for staircases it falls as
//! `h`. To estimate it, solve with two widths.
//!
//! The feature `assembly`, which is on by default, multiplies dense blocks of the factorisations by kernels in assembly, which are 1.9 MB of
//! code on x86-64. Without it a plan of 10,000 cells took as long, one of 90,000 cells 7 % longer (steps in time, Cholesky).
//!
//! Not here: turbulence, buoyancy, pressure; the closed forms of a half-space (`fewbits_models::diffusion`); estimation
//! of the source (`fewbits_diffusive`).

mod domain;
mod error;
mod field;
mod flow;
pub mod gaden;
mod grid;
mod leak;
mod leak_prior;
mod leak_resolution;
mod plan;
mod solver;
mod steady;
mod stepper;
mod transient;
mod transport;
mod wind;

pub use domain::{Boundary, CellKind, Domain, Patch};
pub use error::Error;
pub use field::SensorField;
pub use flow::Flow;
pub use grid::Grid;
pub use leak::LeakBelief;
pub use leak_prior::{LeakPrior, Reading};
pub use plan::Plan;
pub use steady::{Source, Steady};
pub use transient::{Method, Snapshot, StepControl, TimedSource, Transient};
pub use transport::{Balance, FluxRule, PerCell, Transport};
pub use wind::{Divergence, PotentialFlow};
