//! Options of times.

use crate::error::Error;
pub(crate) use fewbits_recipes::times::{End, NANOSECONDS, shown, tick};

/// The tolerance in nanoseconds from `exact` or text like `±10ms`.
pub(crate) fn tolerance(text: &str) -> Result<u64, Error> {
    if text == "exact" {
        return Ok(0);
    }
    let size = text.strip_prefix('±').or(text.strip_prefix("+-")).unwrap_or(text);
    let duration = humantime::parse_duration(size)
        .map_err(|_| Error::option("--time", text, "`exact`, or how far times may be off, as `±10ms`"))?;
    // The largest tolerance of a recording is 2^52 ticks.
    Ok(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX).min(1 << 52))
}
