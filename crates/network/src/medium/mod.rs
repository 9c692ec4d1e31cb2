//! What a transmission costs and what happens to it: positions, radio, channel, frame.

pub(crate) mod channel;
pub(crate) mod field;
pub(crate) mod frame;
pub(crate) mod loss;
pub(crate) mod radio;

pub use channel::{Channel, Check, ReceivedCopy};
pub use field::Field;
pub use frame::{Frame, Kind, Stored, digest};
pub use loss::Loss;
pub use radio::{CC2420_OUTPUT, FRAGMENT_OVERHEAD, Radio, TWO_AA_CELLS, Transceiver};
