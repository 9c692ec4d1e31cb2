/* The sensor's halves of fewbits for C99 and C++: no allocation, no global state, no call that can fail to return.
 *
 * Functions that decide return 1 (report, or bit 1), 0 (silence, or bit 0) or FEWBITS_REFUSED; those that find a cell return its number,
 * from 0, or FEWBITS_REFUSED. An argument is refused if it is a null pointer, or a number that is not finite where one must be. State is
 * unchanged by a refused call. Thresholds must increase; a sample on a threshold belongs to the cell above it.
 */
#ifndef FEWBITS_H
#define FEWBITS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FEWBITS_REFUSED (-1)

/* Sign bit: sample >= threshold. */
int32_t fewbits_sign_bit_f64(double sample, double threshold);
int32_t fewbits_sign_bit_f32(float sample, float threshold);
int32_t fewbits_sign_bit_i32(int32_t sample, int32_t threshold);

/* Cell of a sample among `count` thresholds. The word of a quantizer is words[cell], the bit of a pattern cell & 1. */
int32_t fewbits_cell_f64(const double *thresholds, size_t count, double sample);
int32_t fewbits_cell_f32(const float *thresholds, size_t count, float sample);
int32_t fewbits_cell_u16(const uint16_t *thresholds, size_t count, uint16_t sample);
int32_t fewbits_cell_i32(const int32_t *thresholds, size_t count, int32_t sample);

/* Cell of the innovation (sample - mean) / deviation. Of codes, the thresholds are multiples of 2^-16 deviations. */
int32_t fewbits_innovation_cell_f64(const double *thresholds, size_t count, double sample, double mean, double deviation);
int32_t fewbits_innovation_cell_i32(const int32_t *thresholds, size_t count, int32_t sample, int32_t mean, uint32_t deviation);

/* Level of a range among equal cells on centre +- half_width, the outer ones continued to infinity. */
int32_t fewbits_range_level_f64(double range, double centre, double half_width, uint32_t levels);
int32_t fewbits_range_level_i32(int32_t range, int32_t centre, uint32_t half_width, uint16_t levels);

/* Censoring: |sample - prediction| >= half_width. */
int32_t fewbits_censor_f64(double sample, double prediction, double half_width);
int32_t fewbits_censor_i32(int32_t sample, int32_t prediction, uint32_t half_width);

/* sqrt(threshold (h P h' + noise_variance)) of a state of two numbers, NaN if refused; `covariance` is P by rows. */
double fewbits_censor_half_width_2(const double row[2], const double covariance[4], double noise_variance, double threshold);

/* A sensor with its own filter, state of two numbers: predicted = F estimate, innovation = sample - h predicted,
 * estimate = predicted + gain innovation; reported if |innovation| >= half_width. */
typedef struct {
    double transition[4];
    double row[2];
    double estimate[2];
} fewbits_own_filter_2;
int32_t fewbits_own_filter_2_speaks(fewbits_own_filter_2 *filter, double sample, const double gain[2], double half_width);

/* Random trigger: uniform < 1 - exp(-(sample - prediction)^2 precision / 2), `uniform` a new random number of [0, 1). */
int32_t fewbits_trigger(double sample, double prediction, double precision, double uniform);

/* Adaptive encoder: every reconstruction within delta of its sample. */
#define FEWBITS_ENCODER_WORDS 472
typedef struct {
    uint64_t opaque[FEWBITS_ENCODER_WORDS];
} fewbits_encoder;

/* `period` 0: no circle. `sequence_bits` 0: for links that lose nothing; else 1 to 16, and a refresh every `refresh_every` slots, or
 * (0) only on request. Returns 0 or FEWBITS_REFUSED. */
int32_t fewbits_encoder_init(fewbits_encoder *encoder, double delta, double period, uint32_t sequence_bits, uint32_t refresh_every);

/* A sample `elapsed` slots after the last (1: the next slot). Returns the bits of the packet, most significant first in `bytes`, or 0 for
 * silence, or FEWBITS_REFUSED. */
int32_t fewbits_encoder_encode(fewbits_encoder *encoder, uint32_t elapsed, double sample, uint8_t bytes[16]);

/* Makes the next report a refresh, if there is a sequence. */
void fewbits_encoder_request_refresh(fewbits_encoder *encoder);

/* What a receiver that lost nothing holds for the last sample; NaN before the first. */
double fewbits_encoder_reconstruction(const fewbits_encoder *encoder);

/* Frames of docs/wire.md, with the check over the whole frame. What a sensor writes are reports, requests and heartbeats, what it reads
 * feedback, acknowledgements and heartbeats. Bits of the payload are packed from the most significant of the first byte; those behind the
 * last are 0. Without bits `payload` may be null. A frame has 10 bytes besides its payload. */
enum { FEWBITS_FEEDBACK = 0, FEWBITS_REPORT = 1, FEWBITS_REQUEST = 4, FEWBITS_HEARTBEAT = 6, FEWBITS_ACKNOWLEDGEMENT = 7 };
typedef struct {
    uint32_t kind;
    uint32_t slot;   /* modulo 2^24 */
    uint32_t digest; /* of a report: that of the feedback it answers; of a sensor that reports by the clock, of no bits in its slot */
    const uint8_t *payload;
    size_t bits;
} fewbits_frame;

/* The digest of bits in a slot. Returns 0 or FEWBITS_REFUSED. */
int32_t fewbits_frame_digest(uint32_t slot, const uint8_t *payload, size_t bits, uint32_t *digest);

/* Returns the number of bytes written, or FEWBITS_REFUSED if the frame is not one of these kinds or does not fit in `room` bytes. */
int32_t fewbits_frame_write(const fewbits_frame *frame, uint8_t *bytes, size_t room);

/* Reads a frame that takes all `count` bytes; its payload points into them. Returns 0, or FEWBITS_REFUSED if they are no frame of this
 * version, or damaged: `frame` is unchanged then. */
int32_t fewbits_frame_read(const uint8_t *bytes, size_t count, fewbits_frame *frame);

#ifdef __cplusplus
}
#endif

#endif
