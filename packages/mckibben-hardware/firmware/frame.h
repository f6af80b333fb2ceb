/* The frames of the serial line: COBS, CRC-32, and messages of a kind, a sequence and a payload. README.md has the bytes.
 *
 * Nothing is allocated and nothing waits; a decoder does bounded work per byte, and at the end of a frame work in proportion
 * to its length. */
#ifndef MCKIBBEN_FRAME_H
#define MCKIBBEN_FRAME_H

#include <stddef.h>
#include <stdint.h>

#ifndef FRAME_LONGEST
#define FRAME_LONGEST 1024u                                      /* bytes of a body; a board with little memory takes fewer */
#endif
#define FRAME_SHORTEST 9u                                        /* kind, sequence, checksum */
#define FRAME_PAYLOAD (FRAME_LONGEST - FRAME_SHORTEST)           /* bytes at most */
#define FRAME_CODED (FRAME_LONGEST + FRAME_LONGEST / 254u + 1u)  /* without the zero at the end */

struct frame {
    uint8_t kind;
    uint32_t sequence;
    const uint8_t *payload; /* inside the decoder, until its next byte */
    size_t size;
};

struct frame_decoder {
    uint8_t bytes[FRAME_CODED];
    size_t count;
    uint8_t skipping;
    uint32_t bad_checksum, oversized, undecodable; /* frames that were dropped */
};

/* CRC-32 of IEEE 802.3, of what follows data whose checksum is `crc` (0 at the beginning). */
uint32_t frame_crc(uint32_t crc, const uint8_t *data, size_t size);

/* COBS of `size` bytes into `out`, which needs size + size/254 + 1; how many these are. */
size_t frame_code(const uint8_t *data, size_t size, uint8_t *out);

/* What a COBS came from, into `out`, which may be `data`; how many bytes, or SIZE_MAX where it is none. */
size_t frame_uncode(const uint8_t *data, size_t size, uint8_t *out);

/* A frame with its zero into `out`, which needs FRAME_CODED + 1; how many bytes, or 0 where the payload is too long. */
size_t frame_write(uint8_t kind, uint32_t sequence, const uint8_t *payload, size_t size, uint8_t *out);

/* One more byte of the stream; 1 if it completes a sound frame. */
int frame_feed(struct frame_decoder *decoder, uint8_t byte, struct frame *found);

/* Little endian. */
void frame_put16(uint8_t *out, uint16_t value);
void frame_put32(uint8_t *out, uint32_t value);
void frame_put64(uint8_t *out, uint64_t value);
uint16_t frame_get16(const uint8_t *data);
uint32_t frame_get32(const uint8_t *data);

#endif
