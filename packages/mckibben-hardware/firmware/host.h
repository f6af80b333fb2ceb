/* A board that is not there: the hardware calls functions that whoever loads the library gives. */
#ifndef MCKIBBEN_HOST_H
#define MCKIBBEN_HOST_H

#include "bench.h"

struct host_calls {
    void (*start)(uint32_t period, int clocked);
    void (*stop)(void);
    int (*read)(uint32_t *counts, int32_t *encoder);
    void (*write)(uint32_t valve, uint32_t motor, int opened);
    void (*send)(const uint8_t *data, size_t size);
    uint64_t (*now)(void);
};

/* The board and its functions, which must stay where they are; the state machine begins anew. */
void host_begin(const struct hal_about *about, const struct host_calls *calls);

/* A decoder of its own, which calls for each sound frame; `counts` are its bad checksums, oversized and undecodable. */
void host_decode(const uint8_t *data, size_t size, void (*frame)(uint8_t, uint32_t, const uint8_t *, size_t));
void host_decode_begin(void);
void host_decode_counts(uint32_t *counts);

#endif
