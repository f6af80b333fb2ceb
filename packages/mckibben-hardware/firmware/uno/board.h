/* Pins and limits of the port to the Arduino Uno and Nano (ATmega328P, 16 MHz, 5 V).
 *
 *   A0 pressure            D2, D3  encoder, channels A and B
 *   A1 tension             D4      alive: a square wave while a run is on, for the pump that holds the dump valve shut
 *   A2 pressure at valve   D7      shut-off: high shuts it
 *   D9  valve, PWM         D10     motor, PWM
 *   D0, D1 serial line     D13     lamp: a run is on
 */
#ifndef MCKIBBEN_UNO_BOARD_H
#define MCKIBBEN_UNO_BOARD_H

#define BAUD 1000000ul          /* bits per second, exact at 16 MHz */
#define SHORTEST_NS 2000000ul   /* period [ns]: a sample and its answer take up to 18200 of its 32000 cycles in the emulator */
#define TICK_NS 500u            /* of the timer of the samples: 16 MHz by 8 */

#define CHANNELS 3u
#define ADC_BITS 10u
#define PWM_TOP 1023u           /* 10 bits, 15.6 kHz */
#define MOTOR_REST 512u

#define PIN_A 2u                /* of port D */
#define PIN_B 3u
#define PIN_ALIVE 4u
#define PIN_SHUT 7u
#define PIN_VALVE 1u            /* of port B */
#define PIN_MOTOR 2u
#define PIN_LAMP 5u

/* The reference of 1.1 V, in counts of the supply: between 5.75 V of a strong and 4.3 V of a weak one. */
#define REFERENCE_LEAST 196u
#define REFERENCE_MOST 262u
#define GROUND_MOST 4u

#endif
