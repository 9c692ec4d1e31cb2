//! Initial weights of the models at the start of a block.
//!
//! They are means of the weights learned on blocks of 512 rows of several kinds of recordings (gas and weather in a room, positions and
//! ranges of a vehicle, server metrics, electricity) at bounds of .25 to 2 % of their ranges. They are part of the format: with other
//! numbers a reader decodes other samples.

use crate::mixer::CLASSES;

/// Weights of the inputs of each class of decisions: contexts, then experts.
#[rustfmt::skip]
pub(crate) const MIXER_WEIGHTS: [[[f32; 4]; 2]; CLASSES] = [
    // zero
    [[0.196, 0.173, 0.161, 0.210], [0.076, 0.123, -0.015, 0.113]],
    // sign
    [[0.263, 0.172, 0.172, 0.232], [0.233, 0.375, -0.022, 0.118]],
    // at least 2
    [[0.236, 0.213, 0.206, 0.244], [0.101, 0.243, -0.029, 0.148]],
    // at least 3
    [[0.292, 0.246, 0.252, 0.287], [0.109, 0.259, -0.034, 0.163]],
    // at least 4
    [[0.316, 0.277, 0.288, 0.305], [0.111, 0.274, -0.026, 0.176]],
    // further
    [[0.322, 0.303, 0.313, 0.315], [0.121, 0.266, -0.019, 0.205]],
    // inside an interval
    [[0.298, 0.260, 0.271, 0.291], [0.136, 0.325, -0.027, 0.178]],
    // low bits
    [[0.198, 0.162, 0.153, 0.201], [0.193, 0.395, 0.008, 0.340]],
];
