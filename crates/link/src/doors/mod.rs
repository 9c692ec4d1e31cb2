//! Estimates and reports in the formats of other programs. Each is a pure function of a step or of bytes; nothing here opens a connection.
//!
//! | format | way | for |
//! |---|---|---|
//! | [`Metrics`] | out | Prometheus, Grafana: [`LivePage`](crate::LivePage) serves it at `/metrics` |
//! | [`influx_line`] | out | InfluxDB, Telegraf, QuestDB |
//! | [`home_assistant`] | out | Home Assistant over MQTT, with discovery |
//! | [`senml`] | in, out | gateways and CoAP servers: RFC 8428, JSON and CBOR |
//! | [`cayenne`] | in | LoRaWAN devices with Cayenne LPP payloads |
//! | [`lorawan`] | in, out | ChirpStack and The Things Stack over MQTT: uplinks, downlinks |

pub mod cayenne;
pub mod home_assistant;
mod influx;
pub mod lorawan;
mod metrics;
pub mod senml;

pub use influx::influx_line;
pub use metrics::Metrics;
