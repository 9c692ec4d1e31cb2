/* A sensor of `report = "bit"` over UDP, for POSIX: what a board without the Rust library has to do (docs/node.md).
 *   ./sensor ADDRESS PORT NUMBER KEY_IN_HEX COUNTER_FILE < samples.txt
 */
#define _POSIX_C_SOURCE 200112L
#include "envelope.h"
#include "fewbits.h"
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static uint8_t key[32];
static uint32_t number;
static uint64_t counter, reserved;
static const char *counter_file;
static int centre;

/* A counter is reserved in the file before it is used, so that a restart never uses one twice. */
static uint64_t next_counter(void)
{
    if (++counter > reserved) {
        FILE *file = fopen(counter_file, "w");
        reserved = counter + 1000;
        if (!file || fprintf(file, "%llu\n", (unsigned long long)reserved) < 0 || fclose(file) != 0)
            exit(1);
    }
    return counter;
}

static void send_frame(uint32_t kind, uint32_t slot, uint32_t digest, const uint8_t *payload, size_t bits)
{
    fewbits_frame frame = {kind, slot, digest, payload, bits};
    uint8_t inner[32], outer[64];
    int32_t count = fewbits_frame_write(&frame, inner, sizeof inner);
    if (count > 0)
        count = fewbits_envelope_write(key, sizeof key, FEWBITS_TO_CENTRE, number, next_counter(), inner, (size_t)count, outer, sizeof outer);
    if (count > 0)
        send(centre, outer, (size_t)count, 0);
}

/* The number whose bits a question of a bit holds. */
static double threshold_of(const uint8_t *payload)
{
    uint64_t bits = 0;
    double threshold;
    for (int i = 0; i < 8; i++)
        bits = bits << 8 | payload[i];
    memcpy(&threshold, &bits, sizeof threshold);
    return threshold;
}

int main(int count, char **arguments)
{
    struct sockaddr_in address = {.sin_family = AF_INET};
    fewbits_replay_window window = {0, 0};
    uint32_t answered = 0;
    int wait = 1, is_told = 0;
    time_t hello_at = 0;
    FILE *file;
    if (count != 6 || strlen(arguments[4]) != 64 || inet_pton(AF_INET, arguments[1], &address.sin_addr) != 1)
        return 2;
    address.sin_port = htons((uint16_t)atoi(arguments[2]));
    number = (uint32_t)strtoul(arguments[3], NULL, 10);
    for (size_t i = 0; i < 32; i++) {
        unsigned byte;
        if (sscanf(arguments[4] + 2 * i, "%2x", &byte) != 1)
            return 2;
        key[i] = (uint8_t)byte;
    }
    counter_file = arguments[5];
    if ((file = fopen(counter_file, "r"))) {
        unsigned long long last;
        if (fscanf(file, "%llu", &last) == 1)
            counter = reserved = last;
        fclose(file);
    }
    centre = socket(AF_INET, SOCK_DGRAM, 0);
    if (centre < 0 || connect(centre, (struct sockaddr *)&address, sizeof address) != 0)
        return 1;
    for (;;) {
        uint8_t bytes[256];
        uint32_t sensor;
        uint64_t sent;
        fewbits_frame frame;
        fd_set ready;
        struct timeval pause = {1, 0};
        /* A heartbeat in slot 0 says where the sensor is: after 1, 2, 4, 8 and every 8 s until it is asked, and when questions stay away. */
        if (time(NULL) >= hello_at) {
            send_frame(FEWBITS_HEARTBEAT, 0, 0, NULL, 0);
            hello_at = time(NULL) + wait;
            wait = wait < 8 ? 2 * wait : 8;
        }
        FD_ZERO(&ready);
        FD_SET(centre, &ready);
        if (select(centre + 1, &ready, NULL, NULL, &pause) <= 0)
            continue;
        ssize_t length = recv(centre, bytes, sizeof bytes, 0);
        if (length <= 0)
            continue;
        int32_t inner = fewbits_envelope_read(key, sizeof key, FEWBITS_TO_SENSOR, bytes, (size_t)length, &sensor, &sent);
        if (inner < 0 || sensor != number || fewbits_replay_take(&window, sent) != 0 || fewbits_frame_read(bytes + 12, (size_t)inner, &frame) != 0)
            continue;
        if (frame.kind != FEWBITS_FEEDBACK || frame.bits != 64 || (is_told && frame.slot == answered))
            continue;
        char line[64];
        char *end;
        if (!fgets(line, sizeof line, stdin))
            return 0;
        answered = frame.slot;
        is_told = 1;
        wait = 1;
        hello_at = time(NULL) + 10;
        double sample = strtod(line, &end);
        int32_t bit = end == line ? FEWBITS_REFUSED : fewbits_sign_bit_f64(sample, threshold_of(frame.payload));
        uint8_t report = bit == 1 ? 0x80 : 0; /* the first bit is the highest */
        if (bit >= 0)
            send_frame(FEWBITS_REPORT, frame.slot, frame.digest, &report, 1);
    }
}
