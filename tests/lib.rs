//! Nothing here: the tests that cross crates are in `it`.
