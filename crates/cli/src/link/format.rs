//! Formats of messages that `fewbits receive` reads.

/// Format of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Format {
    /// Uplinks of ChirpStack or The Things Stack as JSON, one per line, with payloads in Cayenne LPP; with `--sensor` payloads are frames.
    Lorawan,
    /// Lists of SenML (RFC 8428) in JSON, one per line.
    Senml,
    /// One list of SenML in CBOR.
    SenmlCbor,
}
