#include "host.h"

static const struct hal_about *board;
static struct host_calls call;
static struct frame_decoder decoder;

void host_begin(const struct hal_about *about, const struct host_calls *calls)
{
    board = about;
    call = *calls;
    bench_begin();
}

void host_decode_begin(void)
{
    decoder.count = 0;
    decoder.skipping = 0;
    decoder.bad_checksum = decoder.oversized = decoder.undecodable = 0;
}

void host_decode(const uint8_t *data, size_t size, void (*frame)(uint8_t, uint32_t, const uint8_t *, size_t))
{
    struct frame found;
    size_t i;
    for (i = 0; i < size; i++) {
        if (frame_feed(&decoder, data[i], &found)) {
            frame(found.kind, found.sequence, found.payload, found.size);
        }
    }
}

void host_decode_counts(uint32_t *counts)
{
    counts[0] = decoder.bad_checksum;
    counts[1] = decoder.oversized;
    counts[2] = decoder.undecodable;
}

const struct hal_about *hal_about(void)
{
    return board;
}

void hal_start(uint32_t period, int clocked)
{
    call.start(period, clocked);
}

void hal_stop(void)
{
    call.stop();
}

int hal_read(uint32_t *counts, int32_t *encoder)
{
    return call.read(counts, encoder);
}

void hal_write(uint32_t valve, uint32_t motor, int opened)
{
    call.write(valve, motor, opened);
}

void hal_send(const uint8_t *data, size_t size)
{
    call.send(data, size);
}

uint64_t hal_now(void)
{
    return call.now();
}
