/* Envelopes: HMAC (RFC 2104) with SHA-256 (FIPS 180-4). */
#include "envelope.h"
#include <string.h>

enum { HEADER = 12, TAG = 16, BLOCK = 64, HASH = 32, MIN_KEY = 32 };

typedef struct {
    uint32_t state[8];
    uint64_t length;
    uint8_t block[BLOCK];
} sha256;

/* Fractional parts of cube roots of the first 64 primes. */
static const uint32_t ROUND[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5, 0xd807aa98, 0x12835b01, 0x243185be,
    0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa,
    0x5cb0a9dc, 0x76f988da, 0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967, 0x27b70a85,
    0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85, 0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3,
    0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070, 0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f,
    0x682e6ff3, 0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t turned(uint32_t x, int by) { return x >> by | x << (32 - by); }

static void put(uint8_t *bytes, uint64_t value, int count)
{
    for (int i = 0; i < count; ++i)
        bytes[i] = (uint8_t)(value >> 8 * (count - 1 - i));
}

static uint64_t get(const uint8_t *bytes, int count)
{
    uint64_t value = 0;
    for (int i = 0; i < count; ++i)
        value = value << 8 | bytes[i];
    return value;
}

static void compress(uint32_t state[8], const uint8_t block[BLOCK])
{
    uint32_t w[64], s[8];
    for (int i = 0; i < 64; ++i)
        w[i] = i < 16 ? (uint32_t)get(block + 4 * i, 4)
                      : w[i - 16] + (turned(w[i - 15], 7) ^ turned(w[i - 15], 18) ^ w[i - 15] >> 3) + w[i - 7]
                            + (turned(w[i - 2], 17) ^ turned(w[i - 2], 19) ^ w[i - 2] >> 10);
    memcpy(s, state, sizeof s);
    for (int i = 0; i < 64; ++i) {
        uint32_t chosen = (s[4] & s[5]) ^ (~s[4] & s[6]), most = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
        uint32_t first = s[7] + (turned(s[4], 6) ^ turned(s[4], 11) ^ turned(s[4], 25)) + chosen + ROUND[i] + w[i];
        uint32_t second = (turned(s[0], 2) ^ turned(s[0], 13) ^ turned(s[0], 22)) + most;
        memmove(s + 1, s, 7 * sizeof *s);
        s[4] += first;
        s[0] = first + second;
    }
    for (int i = 0; i < 8; ++i)
        state[i] += s[i];
}

static void begin(sha256 *hash)
{
    static const uint32_t START[8] = {
        0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    memcpy(hash->state, START, sizeof START);
    hash->length = 0;
}

static void add(sha256 *hash, const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        hash->block[hash->length++ % BLOCK] = bytes[i];
        if (hash->length % BLOCK == 0)
            compress(hash->state, hash->block);
    }
}

static void end(sha256 *hash, uint8_t out[HASH])
{
    static const uint8_t ONE = 0x80, ZERO = 0;
    uint8_t length[8];
    put(length, 8 * hash->length, 8);
    add(hash, &ONE, 1);
    while (hash->length % BLOCK != BLOCK - 8)
        add(hash, &ZERO, 1);
    add(hash, length, 8);
    for (int i = 0; i < 8; ++i)
        put(out + 4 * i, hash->state[i], 4);
}

/* The code over a byte of direction and the envelope. */
static void code(const uint8_t *key, size_t key_bytes, int32_t direction, const uint8_t *bytes, size_t count, uint8_t out[HASH])
{
    sha256 hash;
    uint8_t pad[BLOCK] = {0}, way = (uint8_t)direction;
    if (key_bytes > BLOCK) {
        begin(&hash);
        add(&hash, key, key_bytes);
        end(&hash, pad);
    } else
        memcpy(pad, key, key_bytes);
    for (int i = 0; i < BLOCK; ++i)
        pad[i] ^= 0x36;
    begin(&hash);
    add(&hash, pad, BLOCK);
    add(&hash, &way, 1);
    add(&hash, bytes, count);
    end(&hash, out);
    for (int i = 0; i < BLOCK; ++i)
        pad[i] ^= 0x36 ^ 0x5c;
    begin(&hash);
    add(&hash, pad, BLOCK);
    add(&hash, out, HASH);
    end(&hash, out);
}

static int is_known(const uint8_t *key, size_t key_bytes, int32_t direction)
{
    return key && key_bytes >= MIN_KEY && (direction == FEWBITS_TO_CENTRE || direction == FEWBITS_TO_SENSOR);
}

int32_t fewbits_envelope_write(const uint8_t *key, size_t key_bytes, int32_t direction, uint32_t sensor, uint64_t counter, const uint8_t *frame,
    size_t frame_bytes, uint8_t *bytes, size_t room)
{
    uint8_t tag[HASH];
    if (!is_known(key, key_bytes, direction) || !bytes || (frame_bytes && !frame) || counter == 0 || frame_bytes > 65535
        || room < frame_bytes + FEWBITS_ENVELOPE_OVERHEAD)
        return FEWBITS_ENVELOPE_REFUSED;
    if (frame_bytes)
        memmove(bytes + HEADER, frame, frame_bytes);
    put(bytes, sensor, 4);
    put(bytes + 4, counter, 8);
    code(key, key_bytes, direction, bytes, HEADER + frame_bytes, tag);
    memcpy(bytes + HEADER + frame_bytes, tag, TAG);
    return (int32_t)(frame_bytes + FEWBITS_ENVELOPE_OVERHEAD);
}

int32_t fewbits_envelope_read(const uint8_t *key, size_t key_bytes, int32_t direction, const uint8_t *bytes, size_t count, uint32_t *sensor,
    uint64_t *counter)
{
    uint8_t tag[HASH], difference = 0;
    if (!is_known(key, key_bytes, direction) || !bytes || !sensor || !counter || count < FEWBITS_ENVELOPE_OVERHEAD
        || count > 65535 + FEWBITS_ENVELOPE_OVERHEAD)
        return FEWBITS_ENVELOPE_REFUSED;
    code(key, key_bytes, direction, bytes, count - TAG, tag);
    /* The comparison takes the same time wherever the codes differ. */
    for (int i = 0; i < TAG; ++i)
        difference |= tag[i] ^ bytes[count - TAG + i];
    if (difference)
        return FEWBITS_ENVELOPE_REFUSED;
    *sensor = (uint32_t)get(bytes, 4);
    *counter = get(bytes + 4, 8);
    return (int32_t)(count - FEWBITS_ENVELOPE_OVERHEAD);
}

int32_t fewbits_replay_take(fewbits_replay_window *window, uint64_t counter)
{
    if (!window)
        return FEWBITS_ENVELOPE_REFUSED;
    if (counter > window->highest) {
        uint64_t ahead = counter - window->highest;
        window->taken = (ahead < 64 ? window->taken << ahead : 0) | 1;
        window->highest = counter;
        return 0;
    }
    uint64_t behind = window->highest - counter;
    if (counter == 0 || behind >= 64 || window->taken >> behind & 1)
        return FEWBITS_ENVELOPE_REFUSED;
    window->taken |= (uint64_t)1 << behind;
    return 0;
}
