/* What a port has to write: the hardware under the state machine. None of these may wait.
 *
 * All of them are called from bench_receive and bench_tick, which must not interrupt each other. */
#ifndef MCKIBBEN_HAL_H
#define MCKIBBEN_HAL_H

#include <stddef.h>
#include <stdint.h>

#define HAL_CHANNELS 32u /* at most */

struct hal_about {
    const char *firmware;      /* name and version, UTF-8, at most 255 bytes */
    uint32_t shortest;         /* period it can sample with [ns] */
    uint32_t motor_rest;       /* count at which the motor does nothing */
    uint8_t encoder, motor;    /* whether there is one */
    uint8_t channels;          /* at most HAL_CHANNELS */
    const uint8_t *bits;       /* of each channel's converter */
    const char *const *names;  /* of each channel, UTF-8, at most 255 bytes */
};

/* What this board is; the same whenever it is asked. */
const struct hal_about *hal_about(void);

/* A run begins: zero the encoder; where `clocked`, let a timer call bench_tick every `period` [ns], the first time at once. */
void hal_start(uint32_t period, int clocked);

/* It ends: no more ticks. */
void hal_stop(void);

/* Convert all channels now; 0, or another number if that is not possible. */
int hal_read(uint32_t *counts, int32_t *encoder);

/* Put the outputs, held until the next call. A count beyond what the output has is its highest. */
void hal_write(uint32_t valve, uint32_t motor, int opened);

/* Queue bytes for the host: all of them or, if there is no room, none. */
void hal_send(const uint8_t *data, size_t size);

/* A clock that never goes back [ns], of any origin. */
uint64_t hal_now(void);

#endif
