//! Design and decoding of scalar and binary quantizers for distributed estimation.
