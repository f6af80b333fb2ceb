/* Pins and limits of the port to the STM32F405 (168 MHz, 3.3 V), such as the Olimex STM32-H405.
 *
 *   PC0 pressure             PB6, PB7    encoder, channels A and B
 *   PC1 tension              PB12        alive: a square wave while a run is on, for the pump that holds the dump valve shut
 *   PC2 pressure at valve    PB13        shut-off: high shuts it
 *   PC8 valve, PWM           PC9         motor, PWM
 *   PB10, PB11 serial line   PC12        lamp, low: a run is on
 */
#ifndef MCKIBBEN_STM32F405_BOARD_H
#define MCKIBBEN_STM32F405_BOARD_H

#ifndef CRYSTAL_MHZ
#define CRYSTAL_MHZ 8u          /* of the board; 4 to 26 */
#endif
#define CYCLES_US 168u          /* of the processor in a microsecond */
#define BAUD_DIVIDER 0x16u      /* 3 Mbit/s: 42 MHz by 8 and by 1.75 */
#define SHORTEST_NS 200000ul    /* period [ns] */
#define PIECE_CYCLES 21000u     /* of a period at most, 125 us; alive changes after each */

#define CHANNELS 3u
#define ADC_BITS 12u
#define PWM_TOP 4095u           /* 12 bits, 41 kHz */
#define MOTOR_REST 2048u

#define PIN_A 6u                /* of port B */
#define PIN_B 7u
#define PIN_TX 10u
#define PIN_RX 11u
#define PIN_ALIVE 12u
#define PIN_SHUT 13u
#define PIN_VALVE 8u            /* of port C */
#define PIN_MOTOR 9u
#define PIN_LAMP 12u

/* The reference of 1.18 to 1.24 V, in counts of a supply of 3.0 to 3.6 V. */
#define REFERENCE_LEAST 1342u
#define REFERENCE_MOST 1693u

#endif
