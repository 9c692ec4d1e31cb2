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

int main(int argc, char **argv)
{
    static const char *names[] = {"sign-bit", "sign-bit-codes", "innovation-word", "innovation-word-codes", "quantizer-word",
        "quantizer-word-codes", "pattern-bit", "range-level", "censoring", "censoring-codes", "censoring-told", "censoring-own", "trigger",
        "adaptive", "adaptive-circle", "range-level-codes"};
    int failed = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i)
        failed |= check(argc > 1 ? argv[1] : ".", names[i]);
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
