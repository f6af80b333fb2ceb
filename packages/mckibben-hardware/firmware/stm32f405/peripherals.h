/* What the emulator has no model of: clock, converters, encoder, outputs and the processor's watchdog.
 *
 * peripherals.c is this for the board; emulator/stm32f405.c puts a machine of counts in its place. */
#ifndef MCKIBBEN_STM32F405_PERIPHERALS_H
#define MCKIBBEN_STM32F405_PERIPHERALS_H

#include <stdint.h>

#include "board.h"

/* Set everything up with the outputs floating; what is wrong, or a null pointer. The watchdog does not run yet. */
const char *peripherals_begin(void);

/* Connect the outputs, which are at rest, and start the watchdog: 10 to 29 ms, as its oscillator is inaccurate. */
void outputs_begin(void);

/* A run with this period [ns] begins: zero the encoder. */
void sampling_begin(uint32_t period);

/* Start the conversion of all channels and of the reference, 37 us, and latch the encoder. */
void converter_start(void);

/* Whether the conversion is over; then its counts, the reference after the channels. */
int converter_ready(void);
void converter_read(uint16_t counts[CHANNELS + 1u]);

/* Edges of the encoder at the latest conversion. */
int32_t encoder_latched(void);

/* At most PWM_TOP each. */
void outputs_write(uint16_t valve, uint16_t motor, int opened);

void alive_toggle(void);

/* No edge, and low. */
void alive_stop(void);
void lamp_write(int on);
void watchdog_feed(void);

#endif
