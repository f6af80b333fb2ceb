/* The state machine of a device on the serial line, above hal.h. README.md says what it does. */
#ifndef MCKIBBEN_BENCH_H
#define MCKIBBEN_BENCH_H

#include "frame.h"
#include "hal.h"

#define BENCH_VERSION 1u /* of the protocol */

/* Outputs to rest, and nobody known; before anything else, and again after a restart. */
void bench_begin(void);

/* Bytes from the host. */
void bench_receive(const uint8_t *data, size_t size);

/* The next sample: from the timer, or in lock-step where bench_due. */
void bench_tick(void);

/* In lock-step: whether the next sample is to be taken, one period of the machine after the outputs were put. */
int bench_due(void);

#endif
