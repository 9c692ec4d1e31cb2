//! Finding a diffusing source by a belief that travels from sensor to sensor.
//!
//! A substance is released at an unknown place, at an unknown rate. Sensors sample its concentration a few times. There is no fusion
//! centre: a node updates a belief about the source with its own samples, chooses the neighbour whose samples would tell most, and
//! sends the belief on, until the belief is sharp ([`Search`]).
//!
//! | question | answer |
//! |---|---|
//! | what sensors sample, and in which medium | [`SourceSensor`], any [`SourceModel`](fewbits_models::SourceModel) |
//! | how likely samples are for a position, the rate integrated out | [`SourceLikelihood`], [`RateModel`], [`RateSums`] |
//! | where the source is, exactly | [`Posterior`]: small cells, refined until evidence and determinant have settled |
//! | what travels: samples, a Gaussian, a mixture, polynomial Gaussians | [`Form`], [`project`] |
//! | as which bits | [`message`]: the next node knows what it decodes and nothing else |
//! | which node is asked next | [`SelectionRule`], [`Selector`], [`information`] |
//! | whether the model fits the samples at all | [`Fit`], [`Status::Misfit`] |
//! | wind or diffusivity known up to a few candidates | [`ModelGrid`], [`Search::run_models`] |
//! | where the concentration exceeds a threshold | [`Envelope`] |
//!
//! The central choice is that the posterior of every update is **exact**, over cells, and that a form is fitted to it afterwards. After
//! the first node the belief is a ring about that node, metres wide in theory and decimetres wide in fact. Filters that start from a
//! Gaussian there report convergence in the wrong place. The price is some thousand likelihoods per node, so a record tabulates what
//! it needs once and a likelihood costs two polynomials.
//!
//! A sharp belief is no evidence that the model is right. A search in a box that does not hold the source, or with a wrong range of
//! the rate, becomes as sharp as any other. The residuals tell: at its end every search compares them with the noise.
//!
//! ```
//! use fewbits_diffusive::{RateModel, RateRange, Search, SearchBox, SourceSensor, Status};
//! use fewbits_models::diffusion::{Air, Ground};
//! use fewbits_topology::{Deployment, Graph};
//! use nalgebra::{Vector2, Vector3};
//! use rand_pcg::{Pcg64Mcg, rand_core::SeedableRng};
//!
//! let mut rng = Pcg64Mcg::seed_from_u64(1);
//! let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable)?;
//! let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6)?;
//! let field = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300)?;
//! let graph = Graph::within(field.positions(), 15.0)?;
//! let start = field.nearest_to(&Vector2::new(44.0, 52.0));
//!
//! let rate = RateModel::Joint(RateRange::new(0.5, 1.5)?);
//! let everywhere = SearchBox { lower: [-20.0; 2], upper: [120.0; 2] };
//! let search = Search::new(&field.positions()[start], 50.0, everywhere, rate, 1e-5)?;
//! let find = |source: Vector2<f64>, rate: f64| {
//!     let mut rng = Pcg64Mcg::seed_from_u64(2);
//!     let positions = field.positions();
//!     search.run(&sensor, &field, &graph, start, |node| sensor.sample(&mut rng, &positions[node], &source, rate))
//! };
//! let source = Vector2::new(62.0, 50.0);
//! let found = find(source, 1.0)?;
//! assert_eq!(found.status, Status::Converged);
//! assert!((found.estimate().unwrap().mean() - source).norm() < 1.0);
//! // A rate outside the range: the belief becomes sharp as well, and its residuals refuse it.
//! let refused = find(source, 2.5)?;
//! assert_eq!(refused.status, Status::Misfit);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: several sources, sources that start and stop at unknown times, the medium itself
//! ([`fewbits_models::diffusion`]), losses and delays of the radio.

mod belief;
mod best_fit;
mod chain;
pub mod density;
mod envelope;
mod fit;
pub mod information;
mod likelihood;
pub mod message;
mod model_grid;
mod posterior;
mod project;
mod rate;
mod record;
mod select;
mod sensor;
mod target;
mod walk;

pub use belief::{JointBelief, PositionBelief, Prior, SearchBox, SentBelief};
pub use chain::{Outcome, Search, Status, Step};
pub use envelope::Envelope;
pub use fewbits_core::Error;
pub use fit::Fit;
pub use likelihood::SourceLikelihood;
pub use model_grid::ModelGrid;
pub use posterior::Posterior;
pub use project::{Form, Travelling, project};
pub use rate::{RateModel, RateRange, RateSums};
pub use record::Record;
pub use select::{SelectionRule, Selector};
pub use sensor::SourceSensor;
pub use walk::SourceChain;
