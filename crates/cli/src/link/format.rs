//! Formats of messages that `fewbits receive` reads.

/// Format of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Format {
    /// Uplinks of ChirpStack or The Things Stack as JSON, one behind the other, with payloads in Cayenne LPP; with `--sensor` payloads are frames.
    Lorawan,
    /// Lists of SenML (RFC 8428) in JSON, one behind the other.
    Senml,
    /// Lists of SenML in CBOR, one behind the other.
    SenmlCbor,
}
