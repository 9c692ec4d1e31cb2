//! Nothing here: the tests that cross crates are in `it`, and the examples of `docs/architecture.md` and
//! `docs/node.md` are tests of this crate.

#[cfg(doctest)]
#[doc = include_str!("../docs/architecture.md")]
struct Architecture;

#[cfg(doctest)]
#[doc = include_str!("../docs/node.md")]
struct Node;
