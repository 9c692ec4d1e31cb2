//! The medium: positions of nodes, radios, channels and frames on air.

pub(crate) mod air;
pub(crate) mod channel;
mod duty;
pub(crate) mod field;
pub(crate) mod lora;
pub(crate) mod loss;
pub(crate) mod radio;

pub use air::on_air;
pub use channel::{Channel, ReceivedCopy};
pub use field::Field;
pub use lora::Lora;
pub use loss::Loss;
pub use radio::{Radio, TWO_AA_CELLS, Transceiver};
