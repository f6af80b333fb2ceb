/* Port to the STM32F405: samples by the processor's timer, converters and encoder by hardware of their own, PWM.
 *
 * The state machine runs in the main program, so that bench_tick and bench_receive cannot interrupt each other. A sample
 * goes like this:
 *
 *   SysTick      the tick: latches the encoder and starts the conversions, before any other interrupt
 *   converter    the three channels, then the internal reference, which must read what it is
 *   main         bench_tick: frame, checksum, and into the queue of the serial port
 *
 * Two watchdogs vent. The state machine's, when the host is silent. The processor's, which is fed only while both the timer
 * and the main program go, and restarts the board, whose outputs then float to rest. The same loop makes the square wave
 * `alive`; without it a pump of two diodes runs empty, and the dump valve opens. */
#include "../bench.h"
#include "board.h"
#include "peripherals.h"
#include "registers.h"
#include "start.h"

#define NAME "mckibben stm32f405 1"
#define RXNE BIT(5) /* of the serial port's status */
#define TXE BIT(7)

static const uint8_t bits[CHANNELS] = {ADC_BITS, ADC_BITS, ADC_BITS};
static const char *const names[CHANNELS] = {"pressure", "tension", "valve_pressure"};
static struct hal_about about = {NAME, SHORTEST_NS, MOTOR_REST, 1, 1, CHANNELS, bits, names};
static char name[128] = NAME ", self-test failed: ";

const struct hal_about *hal_about(void)
{
    return &about;
}

static void interrupts_off(void)
{
    __asm volatile("cpsid i" ::: "memory");
}

static void interrupts_on(void)
{
    __asm volatile("cpsie i" ::: "memory");
}

/* ---- the clock of the samples: a period is cut into pieces of at most PIECE_CYCLES, of which the timer counts one */

static struct {
    uint32_t cycles, rest, carry; /* of a period; what is left of a cycle, and its sum [1/1000] */
    uint32_t pieces, length, longer, next; /* in a period; cycles of one; how many have one more; the next one */
} timing;
static volatile uint8_t running, beat, converting, failed;
static uint8_t defective;
static uint32_t period_ns;
static uint64_t now_ns;

static void lay_out(void)
{
    uint32_t cycles = timing.cycles;
    timing.carry += timing.rest;
    if (timing.carry >= 1000u) {
        timing.carry -= 1000u;
        cycles++;
    }
    timing.pieces = (cycles + PIECE_CYCLES - 1u) / PIECE_CYCLES;
    timing.length = cycles / timing.pieces;
    timing.longer = cycles % timing.pieces;
    timing.next = 0;
}

static void load_next(void)
{
    SYSTICK->load = timing.length + (timing.next < timing.longer) - 1u;
}

void on_systick(void)
{
    uint32_t piece = timing.next; /* which has begun; the timer takes the length of the one after it when this one ends */
    if (piece == 0 && running) {
        if (converting) {
            failed = 1; /* the converter or the main program did not come to its end in a period */
        } else {
            converting = 1;
            converter_start();
        }
    }
    beat = 1;
    if (++timing.next == timing.pieces) {
        lay_out();
    }
    load_next();
}

/* The first period begins after a piece. */
static void set_period(uint32_t period)
{
    uint64_t thousandths = (uint64_t)period * CYCLES_US;
    timing.cycles = (uint32_t)(thousandths / 1000u);
    timing.rest = (uint32_t)(thousandths % 1000u);
    timing.carry = 0;
    lay_out();
    load_next();
    SYSTICK->val = 0;
    SCB_ICSR = BIT(25); /* no tick of the period before */
}

void hal_start(uint32_t period, int clocked)
{
    interrupts_off();
    converting = 0;
    failed = !clocked; /* a machine under pressure does not wait: the first sample says so */
    period_ns = period;
    sampling_begin(period);
    set_period(period);
    running = 1;
    interrupts_on();
    lamp_write(1);
}

void hal_stop(void)
{
    running = 0;
    alive_stop();
    lamp_write(0);
}

int hal_read(uint32_t *counts, int32_t *encoder)
{
    uint16_t converted[CHANNELS + 1u];
    unsigned i;
    if (failed || defective) {
        return -1;
    }
    converter_read(converted);
    if (converted[CHANNELS] < REFERENCE_LEAST || converted[CHANNELS] > REFERENCE_MOST) {
        return -1;
    }
    for (i = 0; i < CHANNELS; i++) {
        counts[i] = converted[i];
    }
    *encoder = encoder_latched();
    return 0;
}

void hal_write(uint32_t valve, uint32_t motor, int opened)
{
    outputs_write((uint16_t)(valve > PWM_TOP ? PWM_TOP : valve), (uint16_t)(motor > PWM_TOP ? PWM_TOP : motor), opened);
}

uint64_t hal_now(void)
{
    now_ns += period_ns;
    return now_ns;
}

void on_failure(void)
{
    interrupts_off();
    hal_stop();
    hal_write(0, MOTOR_REST, 1);
    for (;;) {
    }
}

/* ---- serial line: bytes come by interrupt, and go whenever the main program passes by */

static volatile uint8_t rx[256];
static volatile uint8_t rx_in;
static uint8_t rx_out;
static uint8_t tx[2048];
static uint16_t tx_in, tx_out;

void on_usart3(void)
{
    if (USART3->sr & (RXNE | BIT(3))) { /* a byte, or one that was lost, which the checksum tells */
        uint8_t byte = (uint8_t)USART3->dr, next = (uint8_t)(rx_in + 1u);
        if (next != rx_out) {
            rx[rx_in] = byte;
            rx_in = next;
        }
    }
}

void hal_send(const uint8_t *data, size_t size)
{
    size_t i;
    if (size >= sizeof tx - (uint16_t)(tx_in - tx_out)) {
        return;
    }
    for (i = 0; i < size; i++) {
        tx[tx_in++ % sizeof tx] = data[i];
    }
}

static void transmit(void)
{
    if (tx_in != tx_out && (USART3->sr & TXE)) {
        USART3->dr = tx[tx_out++ % sizeof tx];
    }
}

static size_t received(uint8_t *data, size_t most)
{
    size_t count = 0;
    while (count < most && rx_out != rx_in) {
        data[count++] = rx[rx_out++];
    }
    return count;
}

/* ---- start */

/* What the board finds out about itself before anybody connects; the name of the firmware tells it. */
static void self_test(void)
{
    const char *why = peripherals_begin();
    size_t at = sizeof NAME ", self-test failed: " - 1u;
    if (why == 0) {
        return;
    }
    while (*why != '\0' && at < sizeof name - 1u) {
        name[at++] = *why++;
    }
    about.firmware = name;
    defective = 1; /* no sample is ever taken */
}

static void begin(void)
{
    self_test();
    bench_begin();
    outputs_begin(); /* only now, at rest */
    USART3->brr = BAUD_DIVIDER;
    USART3->cr1 = BIT(15) | BIT(13) | BIT(5) | BIT(3) | BIT(2);
    SCB_SHPR(15u) = 0x00u;
    NVIC_IPR(USART3_IRQ) = 0x40u;
    NVIC_ISER(USART3_IRQ / 32u) = BIT(USART3_IRQ % 32u);
    set_period(SHORTEST_NS);
    SYSTICK->csr = 7u; /* the processor's clock, with interrupt */
}

int main(void)
{
    uint8_t data[16];
    size_t size;
    begin();
    for (;;) {
        if (beat) {
            beat = 0;
            watchdog_feed();
            if (running) {
                alive_toggle();
            }
        }
        if (running && converting && (failed || converter_ready())) {
            bench_tick();
            converting = 0;
        }
        transmit();
        size = received(data, sizeof data);
        if (size != 0) {
            bench_receive(data, size);
        } else if (!converting && tx_in == tx_out) {
            interrupts_off();
            if (!beat && rx_out == rx_in) {
                wait_for_interrupt();
            }
            interrupts_on();
        }
    }
}
