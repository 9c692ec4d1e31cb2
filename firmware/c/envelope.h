/* Envelopes of docs/wire.md for C99 and C++: who sent a frame, and that it is not a repetition. No allocation, no global state; needs
 * envelope.c and nothing else. Functions return a number of bytes or 0, or FEWBITS_ENVELOPE_REFUSED; what they write to is then unchanged.
 */
#ifndef FEWBITS_ENVELOPE_H
#define FEWBITS_ENVELOPE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FEWBITS_ENVELOPE_REFUSED (-1)
/* Bytes of an envelope besides its frame. */
#define FEWBITS_ENVELOPE_OVERHEAD 28

enum { FEWBITS_TO_CENTRE = 0, FEWBITS_TO_SENSOR = 1 };

/* Writes the envelope of a frame of `frame_bytes` bytes and returns its length. The key has 32 bytes or more. `counter` rises with each envelope,
 * from 1 on, for as long as the key is used: a sensor keeps it over a restart. Refused: a shorter key, counter 0, no room, no such direction. */
int32_t fewbits_envelope_write(const uint8_t *key, size_t key_bytes, int32_t direction, uint32_t sensor, uint64_t counter, const uint8_t *frame,
    size_t frame_bytes, uint8_t *bytes, size_t room);

/* Reads an envelope that takes all `count` bytes and returns the length of its frame, which begins at `bytes + 12`. Refused: a shorter key, too
 * few bytes, a code that was not made with this key for this direction. */
int32_t fewbits_envelope_read(const uint8_t *key, size_t key_bytes, int32_t direction, const uint8_t *bytes, size_t count, uint32_t *sensor,
    uint64_t *counter);

/* Accepted counters: each once, among the last 64 in any order. Zero before the first. */
typedef struct {
    uint64_t highest;
    uint64_t taken;
} fewbits_replay_window;

/* Accepts the counter of an envelope that was read: 0, or FEWBITS_ENVELOPE_REFUSED if it came before or is too old. */
int32_t fewbits_replay_take(fewbits_replay_window *window, uint64_t counter);

#ifdef __cplusplus
}
#endif

#endif
