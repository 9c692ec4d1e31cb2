/* Runs every scheme over the golden vectors and compares the messages: golden FOLDER. */
#include "fewbits.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double THRESHOLDS[] = {-0.982, 0.0, 0.982};
static const int32_t CODE_THRESHOLDS[] = {-64356, 0, 64356};
static const double QUANTIZER[] = {-20, -5, 0, 5, 20};
static const uint16_t QUANTIZER_CODES[] = {8000, 24000, 32768, 40000, 60000};
static const uint16_t WORDS[] = {0, 1, 3, 2, 6, 7};
static const double PATTERN[] = {-10, 0, 10};

static fewbits_encoder encoder;
static fewbits_own_filter_2 own = {{1, 1, 0, 0.9}, {1, 0}, {20, 0}};

static double f64(const uint8_t *input, int at) { double x; memcpy(&x, input + 8 * at, 8); return x; }
static int32_t i32(const uint8_t *input, int at) { int32_t x; memcpy(&x, input + 4 * at, 4); return x; }

/* Writes a word of a few bits as a message. */
static int message(uint8_t bytes[16], uint64_t value, int bits)
{
    value <<= 64 - bits;
    for (int i = 0; i < 8; ++i)
        bytes[i] = (uint8_t)(value >> (56 - 8 * i));
    return bits;
}

static int sample_if(int speaks, uint8_t bytes[16], double sample)
{
    uint64_t word;
    memcpy(&word, &sample, 8);
    return speaks > 0 ? message(bytes, word, 64) : speaks;
}

static int run(int scheme, const uint8_t *in, uint8_t bytes[16])
{
    switch (scheme) {
    case 1: return message(bytes, (uint64_t)fewbits_sign_bit_f64(f64(in, 0), f64(in, 1)), 1);
    case 2: return message(bytes, (uint64_t)fewbits_sign_bit_i32(i32(in, 0), i32(in, 1)), 1);
    case 3: return message(bytes, (uint64_t)fewbits_innovation_cell_f64(THRESHOLDS, 3, f64(in, 0), f64(in, 1), f64(in, 2)), 2);
    case 4:
        return message(bytes,
            (uint64_t)fewbits_innovation_cell_i32(CODE_THRESHOLDS, 3, i32(in, 0), i32(in, 1), (uint32_t)i32(in, 2)), 2);
    case 5: return message(bytes, WORDS[fewbits_cell_f64(QUANTIZER, 5, f64(in, 0))], 3);
    case 6: return message(bytes, WORDS[fewbits_cell_u16(QUANTIZER_CODES, 5, (uint16_t)(in[0] | in[1] << 8))], 3);
    case 7: return message(bytes, (uint64_t)fewbits_cell_f64(PATTERN, 3, f64(in, 0)) & 1, 1);
    case 8: return message(bytes, (uint64_t)fewbits_range_level_f64(f64(in, 0), f64(in, 1), f64(in, 2), 8), 3);
    case 9: return sample_if(fewbits_censor_f64(f64(in, 0), f64(in, 1), f64(in, 2)), bytes, f64(in, 0));
    case 10:
        return fewbits_censor_i32(i32(in, 0), i32(in, 1), (uint32_t)i32(in, 2)) > 0
            ? message(bytes, (uint64_t)(i32(in, 0) & 0xffff), 16) : 0;
    case 11: {
        const double row[2] = {1, 0.5};
        const double covariance[4] = {f64(in, 2), f64(in, 3), f64(in, 3), f64(in, 4)};
        double half_width = fewbits_censor_half_width_2(row, covariance, 0.25, 2);
        return sample_if(fewbits_censor_f64(f64(in, 0), f64(in, 1), half_width), bytes, f64(in, 0));
    }
    case 12: {
        const double gain[2] = {0.5, 0.2};
        return sample_if(fewbits_own_filter_2_speaks(&own, f64(in, 0), gain, 8), bytes, f64(in, 0));
    }
    case 13: return sample_if(fewbits_trigger(f64(in, 0), f64(in, 1), 0.01, f64(in, 2)), bytes, f64(in, 0));
    case 14:
    case 15: return fewbits_encoder_encode(&encoder, 1, f64(in, 0), bytes);
    case 16: return message(bytes, (uint64_t)fewbits_range_level_i32(i32(in, 0), i32(in, 1), (uint32_t)i32(in, 2), 8), 3);
    }
    return FEWBITS_REFUSED;
}

static int check(const char *folder, const char *name)
{
    char path[512];
    static uint8_t data[1 << 16];
    snprintf(path, sizeof path, "%s/%s.bin", folder, name);
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(data, 1, sizeof data, file) : 0;
    if (file)
        fclose(file);
    if (size < 12 || memcmp(data, "fbgv\2", 5) != 0)
        return printf("%s: no golden vectors\n", path), 1;
    int scheme = data[5], width = data[6] | data[7] << 8, records = data[8] | data[9] << 8;
    if ((scheme == 14 || scheme == 15) && fewbits_encoder_init(&encoder, scheme == 14 ? 0.01 : 0.5, scheme == 14 ? 0 : 360, scheme == 14 ? 4 : 0, 1000) != 0)
        return printf("%s: encoder refused\n", name), 1;
    const uint8_t *at = data + 12;
    for (int record = 0; record < records; ++record) {
        uint8_t bytes[16] = {0};
        const uint8_t *input = at, *expected = at + width;
        int bits = run(scheme, input, bytes), count = (bits + 7) / 8;
        if (bits != expected[0] || memcmp(bytes, expected + 1, (size_t)count) != 0)
            return printf("%s: record %d differs\n", name, record), 1;
        at = expected + 1 + count;
    }
    if (at != data + size)
        return printf("%s: bytes are left\n", name), 1;
    printf("%s: %d records\n", name, records);
    return 0;
}

/* CRC-16 and digest as docs/wire.md defines them, bit by bit. */
static uint32_t crc(const uint8_t *bytes, size_t count)
{
    uint32_t sum = 0;
    for (size_t i = 0; i < 8 * count; ++i) {
        uint32_t bit = (bytes[i / 8] >> (7 - i % 8) & 1) ^ (sum >> 15);
        sum = (sum << 1 & 0xffff) ^ (bit ? 0x1021 : 0);
    }
    return sum;
}

static uint64_t fnv(uint64_t hash, uint64_t number, int bytes)
{
    for (int i = 0; i < bytes; ++i)
        hash = (hash ^ (number >> 8 * i & 0xff)) * 0x100000001b3u;
    return hash;
}

/* Frames of random contents against the definition, then read again, then with a bit changed. */
static int frames(void)
{
    static const uint8_t example[] = {0x4c, 1, 2, 3, 0xde, 0xad, 0xbe, 0xef, 0xb0, 0x6a, 0x0a};
    static const uint32_t kinds[] = {FEWBITS_FEEDBACK, FEWBITS_REPORT, FEWBITS_REQUEST, FEWBITS_HEARTBEAT, FEWBITS_ACKNOWLEDGEMENT};
    const uint8_t four = 0xb0;
    uint8_t bytes[64], payload[32], expected[64];
    fewbits_frame frame = {FEWBITS_REPORT, 66051, 0xdeadbeef, &four, 4}, again;
    if (fewbits_frame_write(&frame, bytes, sizeof bytes) != sizeof example || memcmp(bytes, example, sizeof example) != 0)
        return puts("frames: not the example of docs/wire.md"), 1;
    uint64_t state = 1;
    for (int record = 0; record < 10000; ++record) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        uint32_t word = (uint32_t)(state >> 32), sum;
        size_t bits = word % 250, count = (bits + 7) / 8, end = 8 + count;
        for (size_t i = 0; i < count; ++i)
            payload[i] = (uint8_t)(word >> (i % 24) ^ i);
        if (bits % 8)
            payload[count - 1] &= (uint8_t)(0xff << (8 - bits % 8));
        uint32_t slot = word & 0xffffff;
        uint64_t hash = fnv(fnv(0xcbf29ce484222325u, slot, 8), bits, 8);
        for (size_t i = 0; i < count; ++i)
            hash = fnv(hash, payload[i], 1);
        if (fewbits_frame_digest(slot, payload, bits, &sum) != 0 || sum != (uint32_t)(hash ^ hash >> 32))
            return printf("frames: digest %d differs\n", record), 1;
        frame = (fewbits_frame){kinds[word % 5], word, sum, payload, bits};
        expected[0] = (uint8_t)(0x40 | frame.kind << 3 | (8 * count - bits));
        for (int i = 0; i < 3; ++i)
            expected[1 + i] = (uint8_t)(slot >> (16 - 8 * i));
        for (int i = 0; i < 4; ++i)
            expected[4 + i] = (uint8_t)(sum >> (24 - 8 * i));
        memcpy(expected + 8, payload, count);
        expected[end] = (uint8_t)(crc(expected, end) >> 8);
        expected[end + 1] = (uint8_t)crc(expected, end);
        int length = fewbits_frame_write(&frame, bytes, sizeof bytes);
        if (length != (int)end + 2 || memcmp(bytes, expected, end + 2) != 0)
            return printf("frames: frame %d differs\n", record), 1;
        if (fewbits_frame_write(&frame, bytes, end + 1) != FEWBITS_REFUSED || fewbits_frame_read(bytes, end + 2, &again) != 0
            || again.kind != frame.kind || again.slot != slot || again.digest != sum || again.bits != bits
            || (bits && memcmp(again.payload, payload, count) != 0))
            return printf("frames: frame %d is not read\n", record), 1;
        bytes[word % (end + 2)] ^= (uint8_t)(1 << word % 8);
        if (fewbits_frame_read(bytes, end + 2, &again) != FEWBITS_REFUSED)
            return printf("frames: damaged frame %d is read\n", record), 1;
    }
    frame = (fewbits_frame){2, 1, 1, NULL, 0};
    int taken = fewbits_frame_write(&frame, bytes, sizeof bytes) != FEWBITS_REFUSED;
    frame = (fewbits_frame){FEWBITS_REPORT, 1, 1, NULL, 3};
    taken |= fewbits_frame_write(&frame, bytes, sizeof bytes) != FEWBITS_REFUSED || fewbits_frame_write(NULL, bytes, 9) != FEWBITS_REFUSED;
    taken |= fewbits_frame_read(bytes, 9, &frame) != FEWBITS_REFUSED || fewbits_frame_read(NULL, 20, &frame) != FEWBITS_REFUSED;
    if (taken)
        return puts("frames: what must be refused is not"), 1;
    puts("frames: 10000 are as docs/wire.md defines them");
    return 0;
}

int main(int argc, char **argv)
{
    static const char *names[] = {"sign-bit", "sign-bit-codes", "innovation-word", "innovation-word-codes", "quantizer-word",
        "quantizer-word-codes", "pattern-bit", "range-level", "censoring", "censoring-codes", "censoring-told", "censoring-own", "trigger",
        "adaptive", "adaptive-circle", "range-level-codes"};
    int failed = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i)
        failed |= check(argc > 1 ? argv[1] : ".", names[i]);
    failed |= frames();
    /* What is refused, and what a null pointer does. */
    double zero = 0, nan = zero / zero;
    failed |= fewbits_sign_bit_f64(nan, 0) != FEWBITS_REFUSED || fewbits_cell_f64(NULL, 3, 1) != FEWBITS_REFUSED;
    failed |= fewbits_sign_bit_f32(1, 2) != 0 || fewbits_encoder_init(&encoder, -1, 0, 0, 0) != FEWBITS_REFUSED;
    const float floats[] = {-1, 1};
    const int32_t codes[] = {-1, 1};
    failed |= fewbits_cell_f32(floats, 2, 0) != 1 || fewbits_cell_i32(codes, 2, 1) != 2;
    double last = fewbits_encoder_reconstruction(&encoder);
    fewbits_encoder_request_refresh(&encoder);
    failed |= last != last;
    puts(failed ? "failed" : "all messages are those of the golden vectors");
    return failed;
}
