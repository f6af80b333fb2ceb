/* Port to the Arduino Uno and Nano: samples by a timer, converters one after the other, encoder by interrupts, PWM.
 *
 * Only interrupts that move data exist here; the state machine runs in the main program, so that bench_tick and
 * bench_receive cannot interrupt each other and a byte is never missed. A sample goes like this:
 *
 *   timer 2    the tick: latches the encoder and starts the first conversion
 *   converter  52 us per channel, then ground or the reference of 1.1 V, which must read what they are
 *   main       bench_tick: frame, checksum, and into the queue of the serial port
 *
 * Two watchdogs vent. The state machine's, when the host is silent. The processor's, which is fed only while both the timer
 * and the main program go: after 15 ms it restarts the board, whose outputs are then those of a board without power. The
 * same loop makes the square wave `alive`; without it a pump of two diodes runs empty, and the dump valve opens. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "../bench.h"
#include "board.h"

#define NOT_RUNNING 0xFFu
#define MUX(n) ((uint8_t)(_BV(REFS0) | (n))) /* against the supply */
#define REFERENCE 14u
#define GROUND 15u

static const uint8_t bits[CHANNELS] = {ADC_BITS, ADC_BITS, ADC_BITS};
static const char pressure[] = "pressure", tension[] = "tension", valve_pressure[] = "valve_pressure";
static const char *const names[CHANNELS] = {pressure, tension, valve_pressure};
static struct hal_about about = {"mckibben uno 1", SHORTEST_NS, MOTOR_REST, 1, 1, CHANNELS, bits, names};

const struct hal_about *hal_about(void)
{
    return &about;
}

/* ---- the clock of the samples: timer 2 counts 0.5 us, in pieces of at most 256 that are never shorter than 32 us */

static struct {
    uint16_t period_full, tail;   /* pieces of 256 in a period, and what is left of it, 128 to 383 */
    uint16_t rest, carry;         /* what is left of half a microsecond, and its sum [ns] */
    uint16_t full;                /* pieces of 256 still to come */
    uint8_t tail_a, tail_b;       /* the pieces after these, less one; 0: none */
} timing;
static volatile uint8_t running, beat, ready, failed;
static uint32_t period_ns;
static uint64_t now_ns;

/* ---- converters: the channels, then a known voltage twice, for it needs time to settle */

static volatile uint8_t converting = NOT_RUNNING, checked_ground;
static volatile uint16_t converted[CHANNELS];
static volatile uint8_t converter_bad;

/* ---- encoder: each edge of A or B */

static volatile int32_t edges;
static volatile uint8_t lines, skipped;
static int32_t latched;

#define SKIP 2
static const int8_t steps[16] = {0, 1, -1, SKIP, -1, 0, SKIP, 1, 1, SKIP, 0, -1, SKIP, -1, 1, 0};

static uint8_t encoder_lines(void)
{
    return (uint8_t)((PIND >> PIN_A) & 3u);
}

ISR(INT0_vect)
{
    uint8_t new = encoder_lines();
    int8_t step = steps[(uint8_t)(lines << 2) | new];
    lines = new;
    if (step == SKIP) {
        skipped = 1;
    } else {
        edges += step;
    }
}

ISR(INT1_vect, ISR_ALIASOF(INT0_vect));

/* Lay out the pieces of the next period. */
static inline void lay_out(void)
{
    uint16_t tail = timing.tail;
    timing.carry += timing.rest;
    if (timing.carry >= TICK_NS) {
        timing.carry -= TICK_NS;
        tail++;
    }
    timing.full = timing.period_full;
    if (tail > 256u) {
        timing.tail_a = (uint8_t)(tail / 2u - 1u);
        timing.tail_b = (uint8_t)(tail - tail / 2u - 1u);
    } else {
        timing.tail_a = (uint8_t)(tail - 1u);
        timing.tail_b = 0;
    }
}

/* The next piece, or 0 where the period is over. */
static inline uint8_t piece(void)
{
    uint8_t next = timing.tail_a;
    if (timing.full != 0) {
        timing.full--;
        return 255u;
    }
    timing.tail_a = timing.tail_b;
    timing.tail_b = 0;
    return next;
}

ISR(TIMER2_COMPA_vect)
{
    uint8_t next = piece();
    beat = 1;
    if (next != 0) {
        OCR2A = next;
        return;
    }
    lay_out();
    OCR2A = piece();
    if (!running) {
        return;
    }
    latched = edges;
    if (converting != NOT_RUNNING || ready) {
        failed = 1; /* the converter or the main program did not come to its end in a period */
        ready = 1;
        return;
    }
    converting = 0;
    ADCSRA |= _BV(ADSC); /* of channel 0, to which the converter is connected since the last one */
}

ISR(ADC_vect)
{
    uint16_t value = ADC;
    uint8_t at = converting;
    if (at < CHANNELS) {
        converted[at] = value;
        at++;
        if (at < CHANNELS) {
            ADMUX = MUX(at);
        } else {
            ADMUX = MUX(checked_ground ? REFERENCE : GROUND);
            ready = 1;
        }
    } else if (at == CHANNELS) {
        at++; /* settled now */
    } else {
        if (checked_ground ? value < REFERENCE_LEAST || value > REFERENCE_MOST : value > GROUND_MOST) {
            converter_bad = 1;
        }
        checked_ground = !checked_ground;
        ADMUX = MUX(0);
        converting = NOT_RUNNING;
        return;
    }
    converting = at;
    ADCSRA |= _BV(ADSC);
}

/* Units of 0.5 us: pieces of 256, and a tail of 128 to 383. */
static void set_period(uint32_t period)
{
    uint32_t units = period / TICK_NS;
    timing.rest = (uint16_t)(period % TICK_NS);
    timing.carry = 0;
    timing.period_full = (uint16_t)((units - 128u) / 256u);
    timing.tail = (uint16_t)(units - 256ul * timing.period_full);
    timing.full = 0;
    timing.tail_a = timing.tail_b = 0; /* the first tick comes with the next piece, within 0.13 ms */
}

void hal_start(uint32_t period, int clocked)
{
    ATOMIC_BLOCK(ATOMIC_FORCEON)
    {
        edges = latched = 0;
        lines = encoder_lines();
        skipped = failed = ready = 0;
        period_ns = period;
        set_period(period);
        running = 1;
    }
    if (!clocked) { /* a machine under pressure does not wait: the first sample says so */
        failed = 1;
    }
    PORTB |= _BV(PIN_LAMP);
}

void hal_stop(void)
{
    running = 0;
    PORTB &= (uint8_t)~_BV(PIN_LAMP);
    PORTD &= (uint8_t)~_BV(PIN_ALIVE);
}

int hal_read(uint32_t *counts, int32_t *encoder)
{
    uint8_t i;
    if (failed || converter_bad || skipped) {
        return -1;
    }
    for (i = 0; i < CHANNELS; i++) {
        counts[i] = converted[i];
    }
    ATOMIC_BLOCK(ATOMIC_FORCEON)
    {
        *encoder = latched;
    }
    return 0;
}

/* The part of a count of the timer's period, count/1024: it is high for one clock more than its register says. A PWM of count
 * 0 is no pulse at all: the pin is then the port's, and low. */
void hal_write(uint32_t valve, uint32_t motor, int opened)
{
    uint16_t valve_count = valve > PWM_TOP ? PWM_TOP : (uint16_t)valve;
    uint16_t motor_count = motor > PWM_TOP ? PWM_TOP : (uint16_t)motor;
    uint8_t connect = _BV(WGM11);
    if (valve_count != 0) {
        OCR1A = valve_count - 1u;
        connect |= _BV(COM1A1);
    }
    if (motor_count != 0) {
        OCR1B = motor_count - 1u;
        connect |= _BV(COM1B1);
    }
    TCCR1A = connect;
    if (opened) {
        PORTD &= (uint8_t)~_BV(PIN_SHUT);
    } else {
        PORTD |= _BV(PIN_SHUT);
    }
}

uint64_t hal_now(void)
{
    now_ns += period_ns;
    return now_ns;
}

/* ---- serial line */

static volatile uint8_t rx[64], rx_in, rx_out;
static volatile uint8_t tx[256], tx_in, tx_out;

ISR(USART_RX_vect)
{
    uint8_t byte = UDR0, next = (uint8_t)((rx_in + 1u) % sizeof rx);
    if (next != rx_out) { /* else the frame is damaged, which its checksum tells */
        rx[rx_in] = byte;
        rx_in = next;
    }
}

ISR(USART_UDRE_vect)
{
    UDR0 = tx[tx_out++];
    if (tx_out == tx_in) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    }
}

void hal_send(const uint8_t *data, size_t size)
{
    uint8_t used = (uint8_t)(tx_in - tx_out), at = tx_in;
    size_t i;
    if (size >= sizeof tx - used) {
        return;
    }
    for (i = 0; i < size; i++) {
        tx[at++] = data[i];
    }
    ATOMIC_BLOCK(ATOMIC_FORCEON)
    {
        tx_in = at;
        UCSR0B |= _BV(UDRIE0);
    }
}

static uint8_t received(uint8_t *data, uint8_t most)
{
    uint8_t count = 0;
    while (count < most && rx_out != rx_in) {
        data[count++] = rx[rx_out];
        rx_out = (uint8_t)((rx_out + 1u) % sizeof rx);
    }
    return count;
}

/* ---- start */

/* After a restart by the watchdog it is still on, and shorter than the start. */
static void watchdog_off(void) __attribute__((naked, used, section(".init3")));
static void watchdog_off(void)
{
    MCUSR = 0;
    wdt_disable();
}

static uint16_t convert(uint8_t mux)
{
    uint8_t i;
    ADMUX = MUX(mux);
    for (i = 0; i < 4u; i++) { /* the first ones settle */
        ADCSRA |= _BV(ADSC);
        while (ADCSRA & _BV(ADSC)) {
        }
    }
    return ADC;
}

/* What the board finds out about itself before anybody connects; the name of the firmware tells it. */
static void self_test(void)
{
    uint16_t reference = convert(REFERENCE), ground = convert(GROUND);
    if (ground > GROUND_MOST) {
        about.firmware = "mckibben uno 1, self-test failed: converter does not read ground";
    } else if (reference < REFERENCE_LEAST || reference > REFERENCE_MOST) {
        about.firmware = "mckibben uno 1, self-test failed: supply is not 5 V";
    } else if (PINB & (_BV(PIN_VALVE) | _BV(PIN_MOTOR))) {
        about.firmware = "mckibben uno 1, self-test failed: valve or motor is not low";
    } else {
        return;
    }
    converter_bad = 1; /* no sample is ever taken */
}

static void begin(void)
{
    EICRA = _BV(ISC00) | _BV(ISC10); /* edges, before the lines have levels */
    DDRD = _BV(PIN_ALIVE) | _BV(PIN_SHUT);
    PORTD = _BV(PIN_A) | _BV(PIN_B); /* pull-ups of the encoder */
    DDRB = _BV(PIN_LAMP);
    DIDR0 = 7u;
    UCSR0A = _BV(U2X0);
    UBRR0 = F_CPU / 8u / BAUD - 1u;
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1); /* 250 kHz */
    self_test();
    ADMUX = MUX(0);
    ADCSRA |= _BV(ADIF) | _BV(ADIE); /* what the self-test has left behind is no sample */
    ICR1 = PWM_TOP;
    TCCR1B = _BV(WGM13) | _BV(WGM12) | _BV(CS10); /* fast, up to ICR1 */
    bench_begin();
    DDRB |= _BV(PIN_VALVE) | _BV(PIN_MOTOR); /* only now, at rest */
    EIFR = _BV(INTF0) | _BV(INTF1);
    EIMSK = _BV(INT0) | _BV(INT1);
    set_period(SHORTEST_NS);
    TCCR2A = _BV(WGM21);
    OCR2A = 255u;
    TCCR2B = _BV(CS21);
    TIMSK2 = _BV(OCIE2A);
    set_sleep_mode(SLEEP_MODE_IDLE);
    wdt_enable(WDTO_15MS);
    sei();
}

int main(void)
{
    uint8_t data[16], size;
    begin();
    for (;;) {
        if (beat) {
            beat = 0;
            wdt_reset();
            if (running) {
                PIND = _BV(PIN_ALIVE); /* toggles */
            }
        }
        if (ready && running) {
            bench_tick();
            ready = 0;
        }
        size = received(data, sizeof data);
        if (size != 0) {
            bench_receive(data, size);
            continue;
        }
        cli();
        if (!beat && !ready && rx_out == rx_in) {
            sleep_enable();
            sei(); /* takes effect after the next instruction, so that no interrupt comes between */
            sleep_cpu();
            sleep_disable();
        }
        sei();
    }
}
