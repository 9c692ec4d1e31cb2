//! Estimation from sensors that may send only a few bits: one bit per sample, a message only when it matters.
//!
//! This crate only re-exports; depend on the single crates if you need one of them. Each is behind a feature of its name,
//! all but `diffusion` and `tracking` (which build a sparse solver), `link-mqtt` and `link-zenoh` on by default:
//!
//! | module | feature | what it is for |
//! |---|---|---|
//! | [`core`] | always | messages and their bits, factors and likelihoods, beliefs |
//! | [`numerics`], [`monte_carlo`] | always | normal-distribution numerics; random streams, Monte Carlo |
//! | `adaptive` | `adaptive` | any signal within a guaranteed error, in as few bits as it deserves |
//! | `dymbo` | `dymbo` | Kalman-like filters fed with one sign bit a sample |
//! | `cfwmd` | `cfwmd` | sensors that send only surprising measurements, and fusion that learns from their silence |
//! | `diffusion` | `diffusion` | concentrations in rooms, walls and wind, by sparse factorisations |
//! | `diffusive`, `topology` | `diffusive` | a diffusive source, found by a belief that walks the network |
//! | `handoff`, `mixture_codec` | `handoff` | a particle filter whose belief travels from leader to leader in a few bytes |
//! | `quantizers` | `quantizers` | the quantizer a sensor holds, its words, Lloyd-Max tables |
//! | `quantizer_design` | `quantizer-design` | joint design and decoding of distributed scalar quantizers |
//! | `binary_patterns` | `binary-patterns` | one-bit quantizers with patterned cells |
//! | `multi_target` | `multi-target` | several targets that appear and disappear, labelled tracks, GOSPA |
//! | `pf_mpa` | `pf-mpa` | tracking from quantized ranges |
//! | `sensor_assignment` | `sensor-assignment` | which sensor sends which bit |
//! | `block_codec`, `record` | `record` | blocks of samples in few bits; files and frames of many columns within guaranteed errors |
//! | `table` | `table` | tables of strangers: dialects, times, gaps and kinds of columns |
//! | `tracking` | `tracking` | estimates from tables: a level, a place from ranges, a leak, the calibration of sensors |
//! | `recipes` | `recipes` | what a person does with a table: bounds, plan, pack, verify, as functions |
//! | `link`, `protocol` | `link`; `link-mqtt`, `link-zenoh` | a fusion centre and its sensors as processes: frames, keys, sockets; over MQTT, over zenoh |
//! | `node` | `node` | the sensor's halves of all schemes, without the standard library |
//! | `network`, `protocol` | `network` | a simulated network: bits, joules, faults, and every estimator over it; brings `link`, whose `FusionReceiver` is the fusion centre over bits |
//! | `filters`, `models`, `densities` | `filters` | Kalman, particle and exact grid filters, and what they run on |

pub use fewbits_core as core;
pub use fewbits_monte_carlo as monte_carlo;
pub use fewbits_numerics as numerics;

#[cfg(feature = "adaptive")]
pub use fewbits_adaptive as adaptive;
#[cfg(feature = "binary-patterns")]
pub use fewbits_binary_patterns as binary_patterns;
#[cfg(feature = "record")]
pub use fewbits_block_codec as block_codec;
#[cfg(feature = "cfwmd")]
pub use fewbits_cfwmd as cfwmd;
#[cfg(feature = "filters")]
pub use fewbits_densities as densities;
#[cfg(feature = "diffusion")]
pub use fewbits_diffusion as diffusion;
#[cfg(feature = "diffusive")]
pub use fewbits_diffusive as diffusive;
#[cfg(feature = "dymbo")]
pub use fewbits_dymbo as dymbo;
#[cfg(feature = "filters")]
pub use fewbits_filters as filters;
#[cfg(feature = "handoff")]
pub use fewbits_handoff as handoff;
#[cfg(feature = "link")]
pub use fewbits_link as link;
#[cfg(feature = "handoff")]
pub use fewbits_mixture_codec as mixture_codec;
#[cfg(feature = "filters")]
pub use fewbits_models as models;
#[cfg(feature = "multi-target")]
pub use fewbits_multi_target as multi_target;
#[cfg(feature = "network")]
pub use fewbits_network as network;
#[cfg(feature = "node")]
pub use fewbits_node as node;
#[cfg(feature = "pf-mpa")]
pub use fewbits_pf_mpa as pf_mpa;
#[cfg(any(feature = "link", feature = "network"))]
pub use fewbits_protocol as protocol;
#[cfg(feature = "quantizer-design")]
pub use fewbits_quantizer_design as quantizer_design;
#[cfg(feature = "quantizers")]
pub use fewbits_quantizers as quantizers;
#[cfg(feature = "recipes")]
pub use fewbits_recipes as recipes;
#[cfg(feature = "record")]
pub use fewbits_record as record;
#[cfg(feature = "sensor-assignment")]
pub use fewbits_sensor_assignment as sensor_assignment;
#[cfg(feature = "table")]
pub use fewbits_table as table;
#[cfg(any(feature = "diffusive", feature = "network"))]
pub use fewbits_topology as topology;
#[cfg(feature = "tracking")]
pub use fewbits_tracking as tracking;

/// The programs of the README and of the pages in `docs`, kept running.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../../../README.md")]
    struct Readme;
    #[doc = include_str!("../../../docs/guide.md")]
    struct Guide;
    #[doc = include_str!("../../../docs/tutorial.md")]
    struct Tutorial;
    #[doc = include_str!("../../../docs/own-scheme.md")]
    struct OwnScheme;
    #[doc = include_str!("../../../docs/adaptive.md")]
    struct Adaptive;
    #[doc = include_str!("../../../docs/dymbo.md")]
    struct Dymbo;
    #[doc = include_str!("../../../docs/quantizers.md")]
    struct Quantizers;
    #[doc = include_str!("../../../docs/binary.md")]
    struct Binary;
    #[doc = include_str!("../../../docs/cfwmd.md")]
    struct Cfwmd;
    #[doc = include_str!("../../../docs/diffusive.md")]
    struct Diffusive;
    #[doc = include_str!("../../../docs/network.md")]
    struct Network;
    #[doc = include_str!("../../../docs/pf-mpa.md")]
    struct PfMpa;
    #[doc = include_str!("../../../docs/problems.md")]
    struct Problems;
}
