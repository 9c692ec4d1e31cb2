//! Search for a diffusing source: a belief of its position is updated by one sensor after another.
//!
//! A substance is released at an unknown place and rate. Sensors sample its concentration a few times. There is no fusion
//! centre. A node updates a belief of the source with its own samples, chooses the neighbour whose samples would bring the most
//! information, and sends the belief to it. The search ends when the covariance of the position is small ([`Search`]).
//!
//! | question | answer |
//! |---|---|
//! | what sensors sample, and in which medium | [`SourceSensor`], any [`SourceModel`](fewbits_models::SourceModel) |
//! | likelihood of the samples for a position, the rate integrated out | [`SourceLikelihood`], [`RateModel`], [`RateSums`] |
//! | exact posterior of the position | [`Posterior`]: cells, refined until evidence and determinant have converged |
//! | form of the messages: samples, a Gaussian, a mixture, or one that another crate adds | [`Form`], [`project`], [`form`] |
//! | messages as bits | [`message`]: the next node knows only what it decodes |
//! | choice of the next node | [`SelectionRule`], [`Selector`], [`information`] |
//! | whether the model fits the samples | [`Fit`], [`Status::Misfit`] |
//! | wind or diffusivity known up to a few candidates | [`ModelGrid`] |
//! | one node's part in a real network: decode, step, encode | [`Search::step`], [`SearchState`], [`SourceChain`] |
//! | where the concentration exceeds a threshold | [`Envelope`] |
//!
//! **The posterior of every update is exact**, over cells; the form of the message is fitted to it afterwards. After
//! the first node the posterior is a ring about that node: its radius is metres, its width decimetres. Filters that start there from
//! a Gaussian converge to wrong places. Exact posteriors cost some thousand likelihoods per node. Each record therefore tabulates its
//! sums once, and a likelihood costs two polynomials.
//!
//! A small covariance does not show that the model is right. If the source is outside the search box or the range of the rate is wrong,
//! the covariance becomes as small. Therefore every search at its end compares the residuals with the noise.
//!
//! ```
//! use fewbits_diffusive::{RateModel, RateRange, Search, SearchBox, SearchField, SourceSensor, Status};
//! use fewbits_models::diffusion::{Air, Ground};
//! use fewbits_topology::{Deployment, Graph};
//! use nalgebra::{Vector2, Vector3};
//! use rand_pcg::{Pcg64Mcg, rand_core::SeedableRng};
//!
//! let mut rng = Pcg64Mcg::seed_from_u64(1);
//! let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable)?;
//! let sensor = SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6)?;
//! let nodes = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300)?;
//! let graph = Graph::within(nodes.positions(), 15.0)?;
//! let start = nodes.nearest_to(&Vector2::new(44.0, 52.0));
//! let field = SearchField::new(sensor.clone(), nodes, graph)?;
//! let positions = field.deployment().positions();
//!
//! let rate = RateModel::Joint(RateRange::new(0.5, 1.5)?);
//! let everywhere = SearchBox { lower: [-20.0; 2], upper: [120.0; 2] };
//! let search = Search::new(&positions[start], 50.0, everywhere, rate, 1e-5)?;
//! let find = |source: Vector2<f64>, rate: f64| {
//!     let mut rng = Pcg64Mcg::seed_from_u64(2);
//!     search.run(&field, start, |node| sensor.sample(&mut rng, &positions[node], &source, rate))
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
//! ([`fewbits_models::diffusion`]), losses and delays of the radio (`fewbits-network`).

mod added_density;
mod belief;
mod best_fit;
mod chain;
pub mod density;
mod envelope;
mod fit;
pub mod form;
pub mod information;
mod likelihood;
pub mod message;
mod model_grid;
mod packed;
mod posterior;
mod project;
mod rate;
mod record;
mod search_box;
mod select;
mod sensor;
mod target;
mod walk;

pub use belief::{Prior, SentBelief, Travelling};
pub use chain::{Action, Next, Outcome, Search, SearchField, SearchState, Status, Step};
pub use envelope::Envelope;
pub use fewbits_core::Error;
pub use fit::Fit;
pub use form::Form;
pub use likelihood::SourceLikelihood;
pub use model_grid::ModelGrid;
pub use posterior::Posterior;
pub use project::project;
pub use rate::{RateModel, RateRange, RateSums};
pub use record::Record;
pub use search_box::SearchBox;
pub use select::{SelectionRule, Selector};
pub use sensor::SourceSensor;
pub use walk::SourceChain;
