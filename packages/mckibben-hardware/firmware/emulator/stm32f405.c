/* The peripherals of the STM32F405 that QEMU has no model of, as a machine of counts in another program.
 *
 * Linked in the place of stm32f405/peripherals.c, with the unchanged rest of the program. It talks by semihosting through two
 * pipes, whose names are the processor's command line: name, answers, requests, whether it waits (1 or 0). Requests, each answered by
 * the counts of the three channels, of the reference and of the encoder, or by nothing where the converter is to hang:
 *
 *   start PERIOD                                 a run begins; period [ns]
 *   step VALVE MOTOR OPENED INTERVAL IDLE WORK TIME   a period is over: time between its ticks, of which the processor
 *                                                     slept [ns], instructions of bench_tick and bench_receive, and the
 *                                                     board's time [ns]
 *
 * and, without an answer, `outputs VALVE MOTOR OPENED TIME ALIVE` whenever these change: the board's time [ns], and that of
 * the last edge of `alive`. Where the counts are followed by a sixth number that is not zero, the timer of the samples stops;
 * then `hung FED ALIVE` tells when the watchdog was fed for the last time [ns], and when `alive` changed.
 *
 * Where it waits, the board's time stands still after a sample until the host has answered, or the other program has sent an
 * empty frame in its place. The processor sleeps then, and QEMU leaves the computer to host and machine. The time is that of
 * TIM2, which QEMU counts in nanoseconds; with `-icount shift=0` an instruction takes one. */
#include <stddef.h>

#include "../bench.h"
#include "../stm32f405/peripherals.h"
#include "../stm32f405/registers.h"
#include "../stm32f405/start.h"

enum call { OPEN = 0x01, WRITE = 0x05, READ = 0x06, COMMAND_LINE = 0x15 };

void __real_bench_tick(void);
void __real_bench_receive(const uint8_t *data, size_t size);
void __real_wait_for_interrupt(void);
void __wrap_bench_tick(void);
void __wrap_bench_receive(const uint8_t *data, size_t size);
void __wrap_wait_for_interrupt(void);

static int answers, requests;
static uint32_t period_ns, before, idle, work;
static char line[256];
static uint32_t edge_at, fed_at, stood; /* [ns]; for how long the time stood still, and since when */
static uint32_t stands_since;
static uint16_t counts[CHANNELS + 1u];
static int32_t edges;
static uint16_t out_valve, out_motor = MOTOR_REST;
static uint8_t out_opened = 1, first, ready, stopped, hung, waits;

static uint32_t board_time(void)
{
    return (stopped ? stands_since : TIM2->cnt) - stood;
}

static int host(enum call call, const void *arguments)
{
    register int r0 __asm("r0") = (int)call;
    register const void *r1 __asm("r1") = arguments;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static int host_open(const char *path, uint32_t mode)
{
    uint32_t length = 0;
    while (path[length] != '\0') {
        length++;
    }
    {
        const uint32_t arguments[3] = {(uint32_t)(uintptr_t)path, mode, length};
        return host(OPEN, arguments);
    }
}

static char *put_number(char *at, uint32_t number)
{
    char digits[10];
    unsigned count = 0;
    do {
        digits[count++] = (char)('0' + number % 10u);
        number /= 10u;
    } while (number != 0);
    *at++ = ' ';
    while (count != 0) {
        *at++ = digits[--count];
    }
    return at;
}

static char *put_word(char *at, const char *word)
{
    while (*word != '\0') {
        *at++ = *word++;
    }
    return at;
}

static char *put_outputs(char *at)
{
    return put_number(put_number(put_number(at, out_valve), out_motor), out_opened);
}

/* The line until `at`, to the other program. */
static void request(char *at)
{
    uint32_t arguments[3] = {(uint32_t)requests, (uint32_t)(uintptr_t)line, 0};
    *at++ = '\n';
    arguments[2] = (uint32_t)(at - line);
    host(WRITE, arguments);
}

static const char *get_number(const char *at, int32_t *number)
{
    int negative;
    while (*at == ' ') {
        at++;
    }
    negative = *at == '-';
    at += negative;
    for (*number = 0; *at >= '0' && *at <= '9'; at++) {
        *number = 10 * *number + (*at - '0');
    }
    *number = negative ? -*number : *number;
    return at;
}

const char *peripherals_begin(void)
{
    const uint32_t arguments[2] = {(uint32_t)(uintptr_t)line, sizeof line};
    char *words[4], *at = line;
    int32_t number;
    unsigned i;
    if (host(COMMAND_LINE, arguments) != 0) {
        return "no command line";
    }
    for (i = 0; i < 4u; i++) {
        words[i] = at;
        while (*at != ' ' && *at != '\0') {
            at++;
        }
        if (*at == ' ') {
            *at++ = '\0';
        }
    }
    answers = host_open(words[1], 0);
    requests = host_open(words[2], 4u);
    get_number(words[3], &number);
    waits = number != 0;
    TIM2->arr = 0xFFFFFFFFul;
    TIM2->psc = 0;
    TIM2->egr = 1u;
    TIM2->cr1 = 1u;
    return answers < 0 || requests < 0 ? "no machine at the pins" : 0;
}

void outputs_begin(void)
{
}

void sampling_begin(uint32_t period)
{
    period_ns = period;
    first = 1;
}

void converter_start(void)
{
    uint32_t now = TIM2->cnt;
    const uint32_t read[3] = {(uint32_t)answers, (uint32_t)(uintptr_t)line, sizeof line - 1u};
    const char *from = line;
    int left;
    unsigned i;
    int32_t number;
    if (first) {
        request(put_number(put_word(line, "start"), period_ns));
    } else {
        char *at = put_number(put_outputs(put_word(line, "step")), now - before);
        request(put_number(put_number(put_number(at, idle), work), board_time()));
    }
    before = now;
    first = 0;
    idle = work = 0;
    left = host(READ, read);
    line[left < 0 || left > (int)read[2] ? 0 : (int)read[2] - left] = '\0';
    ready = line[0] != '\n' && line[0] != '\0';
    for (i = 0; i <= CHANNELS; i++) {
        from = get_number(from, &number);
        counts[i] = (uint16_t)number;
    }
    from = get_number(from, &edges);
    get_number(from, &number);
    if (number != 0) { /* nobody feeds the watchdog any more */
        SYSTICK->csr = 6u;
        hung = 1;
    }
}

int converter_ready(void)
{
    return ready;
}

void converter_read(uint16_t read[CHANNELS + 1u])
{
    unsigned i;
    for (i = 0; i <= CHANNELS; i++) {
        read[i] = counts[i];
    }
}

int32_t encoder_latched(void)
{
    return edges;
}

void outputs_write(uint16_t valve, uint16_t motor, int opened)
{
    if (valve == out_valve && motor == out_motor && (opened != 0) == out_opened) {
        return;
    }
    out_valve = valve;
    out_motor = motor;
    out_opened = opened != 0;
    request(put_number(put_number(put_outputs(put_word(line, "outputs")), board_time()), edge_at));
}

void alive_toggle(void)
{
    edge_at = board_time();
}

void alive_stop(void)
{
}

void lamp_write(int on)
{
    (void)on;
}

void watchdog_feed(void)
{
    fed_at = board_time();
}

/* ---- time: it stands still while the timer of the samples is off */

void __wrap_bench_tick(void)
{
    uint32_t begin = TIM2->cnt;
    __real_bench_tick();
    work += TIM2->cnt - begin;
    if (waits) {
        SYSTICK->csr = 6u;
        stopped = 1;
        stands_since = TIM2->cnt;
    }
}

static void go_on(void)
{
    if (stopped) {
        stopped = 0;
        stood += TIM2->cnt - stands_since;
        SYSTICK->csr = hung ? 6u : 7u;
    }
    if (hung == 1u) {
        hung = 2u;
        request(put_number(put_number(put_word(line, "hung"), fed_at), edge_at));
    }
}

void __wrap_bench_receive(const uint8_t *data, size_t size)
{
    uint32_t begin = TIM2->cnt;
    size_t i;
    __real_bench_receive(data, size);
    work += TIM2->cnt - begin;
    for (i = 0; i < size; i++) {
        if (data[i] == 0u) { /* a frame has come */
            go_on();
        }
    }
}

void __wrap_wait_for_interrupt(void)
{
    if (!stopped) {
        uint32_t begin = TIM2->cnt;
        if (waits) {
            __real_wait_for_interrupt();
        } else {
            while (!(SCB_ICSR & (BIT(26) | BIT(22)))) { /* instructions, so that the time of no other computer comes in */
                unsigned i;
                for (i = 0; i < 20u; i++) {
                    __asm volatile("nop");
                }
            }
        }
        idle += TIM2->cnt - begin;
    } else {
        __real_wait_for_interrupt(); /* of a byte, of the host or of the other program */
    }
}
