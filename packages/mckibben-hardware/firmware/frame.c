#include "frame.h"

#define NOT_COBS ((size_t)-1)

/* Checksum of every byte, 1 KB: it is linear, so that each entry is the sum (without carry) of those of its bits. */
#define BIT(n, k, sum) (((n) >> (k)) & 1u ? (sum) : 0u)
#define ENTRY(n)                                                                                         \
    (BIT(n, 0, 0x77073096u) ^ BIT(n, 1, 0xEE0E612Cu) ^ BIT(n, 2, 0x076DC419u) ^ BIT(n, 3, 0x0EDB8832u) ^ \
     BIT(n, 4, 0x1DB71064u) ^ BIT(n, 5, 0x3B6E20C8u) ^ BIT(n, 6, 0x76DC4190u) ^ BIT(n, 7, 0xEDB88320u))
#define ENTRIES4(n) ENTRY(n), ENTRY((n) + 1u), ENTRY((n) + 2u), ENTRY((n) + 3u)
#define ENTRIES16(n) ENTRIES4(n), ENTRIES4((n) + 4u), ENTRIES4((n) + 8u), ENTRIES4((n) + 12u)
#define ENTRIES64(n) ENTRIES16(n), ENTRIES16((n) + 16u), ENTRIES16((n) + 32u), ENTRIES16((n) + 48u)

#ifdef __AVR__ /* constants are in memory unless they are asked to stay in the program */
#include <avr/pgmspace.h>
#define LOOK_UP(at) pgm_read_dword(at)
#else
#define PROGMEM
#define LOOK_UP(at) (*(at))
#endif

static const uint32_t sums[256] PROGMEM = {ENTRIES64(0u), ENTRIES64(64u), ENTRIES64(128u), ENTRIES64(192u)};

uint32_t frame_crc(uint32_t crc, const uint8_t *data, size_t size)
{
    size_t i;
    crc = ~crc;
    for (i = 0; i < size; i++) {
        crc = (crc >> 8) ^ LOOK_UP(&sums[(uint8_t)crc ^ data[i]]);
    }
    return ~crc;
}

/* Bytes as they come into COBS; the length of a run is written where the run ends. */
struct coder {
    uint8_t *next, *length; /* of the next byte; where the length of this run stands */
};

static void code_begin(struct coder *c, uint8_t *out)
{
    c->length = out;
    c->next = out + 1;
}

static void code_end(struct coder *c)
{
    *c->length = (uint8_t)(c->next - c->length);
    c->length = c->next++;
}

static void code_bytes(struct coder *c, const uint8_t *data, size_t size)
{
    struct coder at = *c; /* in registers: a store through `next` could change what `c` points to */
    const uint8_t *end = data + size;
    while (data != end) {
        uint8_t byte = *data++;
        if (byte != 0u) {
            *at.next++ = byte;
            if (at.next - at.length != 255) {
                continue;
            }
        }
        code_end(&at);
    }
    *c = at;
}

/* Where the code ends. */
static uint8_t *code_finish(struct coder *c)
{
    code_end(c);
    return c->length;
}

size_t frame_code(const uint8_t *data, size_t size, uint8_t *out)
{
    struct coder c;
    code_begin(&c, out);
    code_bytes(&c, data, size);
    return (size_t)(code_finish(&c) - out);
}

size_t frame_uncode(const uint8_t *data, size_t size, uint8_t *out)
{
    size_t at = 0, put = 0, i;
    while (at < size) {
        size_t code = data[at];
        if (code == 0u || code > size - at) {
            return NOT_COBS;
        }
        for (i = 1; i < code; i++) {
            out[put++] = data[at + i];
        }
        at += code;
        if (code < 255u && at < size) {
            out[put++] = 0u;
        }
    }
    return put;
}

size_t frame_write(uint8_t kind, uint32_t sequence, const uint8_t *payload, size_t size, uint8_t *out)
{
    struct coder c;
    uint8_t head[5], tail[4], *end;
    if (size > FRAME_PAYLOAD) {
        return 0;
    }
    head[0] = kind;
    frame_put32(head + 1, sequence);
    frame_put32(tail, frame_crc(frame_crc(0, head, sizeof head), payload, size));
    code_begin(&c, out);
    code_bytes(&c, head, sizeof head);
    code_bytes(&c, payload, size);
    code_bytes(&c, tail, sizeof tail);
    end = code_finish(&c);
    *end++ = 0u;
    return (size_t)(end - out);
}

/* The frame of what came between two zeros. */
__attribute__((noinline)) static int whole(struct frame_decoder *d, struct frame *found)
{
    size_t size;
    if (d->count == 0) {
        return 0;
    }
    size = frame_uncode(d->bytes, d->count, d->bytes);
    if (size == NOT_COBS || size < FRAME_SHORTEST || size > FRAME_LONGEST) {
        d->undecodable++;
        return 0;
    }
    if (frame_crc(0, d->bytes, size - 4u) != frame_get32(d->bytes + size - 4u)) {
        d->bad_checksum++;
        return 0;
    }
    found->kind = d->bytes[0];
    found->sequence = frame_get32(d->bytes + 1);
    found->payload = d->bytes + 5;
    found->size = size - FRAME_SHORTEST;
    return 1;
}

int frame_feed(struct frame_decoder *d, uint8_t byte, struct frame *found)
{
    int complete = 0;
    if (byte == 0u) {
        if (!d->skipping) {
            complete = whole(d, found);
        }
        d->skipping = 0;
        d->count = 0;
    } else if (!d->skipping) {
        if (d->count == FRAME_CODED) {
            d->oversized++;
            d->skipping = 1;
        } else {
            d->bytes[d->count++] = byte;
        }
    }
    return complete;
}

void frame_put16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
}

void frame_put32(uint8_t *out, uint32_t value)
{
    frame_put16(out, (uint16_t)value);
    frame_put16(out + 2, (uint16_t)(value >> 16));
}

void frame_put64(uint8_t *out, uint64_t value)
{
    frame_put32(out, (uint32_t)value);
    frame_put32(out + 4, (uint32_t)(value >> 32));
}

uint16_t frame_get16(const uint8_t *data)
{
    return (uint16_t)(data[0] | (data[1] << 8));
}

uint32_t frame_get32(const uint8_t *data)
{
    return (uint32_t)frame_get16(data) | ((uint32_t)frame_get16(data + 2) << 16);
}
