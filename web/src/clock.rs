//! The clock of the browser.

use std::time::Duration;
use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = performance)]
    fn now() -> f64;
}

/// Time since the worker was started.
pub(crate) fn browser() -> Duration {
    Duration::try_from_secs_f64(1e-3 * now()).unwrap_or_default()
}
