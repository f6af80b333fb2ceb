/* An Arduino Uno with its wiring, in simavr: pins, converters, encoder, serial line and supply, and faults of all these.
 *
 *     uno IMAGE.hex LINE [fault=KIND@SAMPLE] [patience=MS] [tick=ADDRESS] [receive=ADDRESS]
 *
 * LINE is the number of an open descriptor, the board's end of a pseudo-terminal. What is behind the pins is asked by the
 * standard output and answered by the standard input, a line each: "start NS" at the first sample of a run and
 * "advance VALVE MOTOR OPEN" once a period, both answered by the counts of A0 to A2 and of the encoder. At the end of the
 * standard input it prints "report" with what was measured, in cycles, and ends. With the addresses of bench_tick and
 * bench_receive in the image [bytes] the report divides the cycles of a period among the tasks: an interrupt counts for
 * itself, not for the function that it interrupts.
 *
 * The time of the board is its own. It stands still while the host thinks about a sample, for at most `patience`; so what
 * happens does not depend on how busy this computer is. The outputs act after nine tenths of a period, where the machine
 * is advanced; its edges of the encoder come between then and the next sample.
 *
 * The dump valve and the motor's amplifier are held by a pump of two diodes on the pin `alive`: PUMP after its last edge
 * they let go. A board without power has no pin that is high. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <avr_adc.h>
#include <avr_ioport.h>
#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_cycle_timers.h>
#include <sim_hex.h>
#include <sim_io.h>
#include <sim_time.h>

#include "../frame.h"
#include "../uno/board.h"

#define FREQUENCY 16000000u
#define PUMP (FREQUENCY / 100u)        /* 10 ms */
#define BYTE (FREQUENCY / BAUD * 10u)  /* of ten bits */
#define AFTER 400u                     /* periods for which the machine goes on when the board has stopped */
#define HIGHEST 0x8FFu                 /* of the memory */
#define PAINT 0xC5u
enum { UBRR0L_ = 0xC4, TCCR1A_ = 0x80, OCR1AL_ = 0x88, OCR1BL_ = 0x8A, TIMSK2_ = 0x70, DDRB_ = 0x24, DDRD_ = 0x2A, PORTD_ = 0x2B };

static avr_t *avr;
static avr_adc_t *adc;
static avr_irq_t *pin_a, *pin_b;

/* What is behind the pins. */
static unsigned counts[3];
static long edges, shown;              /* of the machine, and those that the lines A and B have gone through */
static avr_cycle_count_t tick, period, alive;
static unsigned long ticks, silent;    /* samples of this run; periods without one */
static int failing;                     /* before the next instruction, not in the middle of one */
static int running, begun, powered = 1, torn, jammed;
static unsigned acted[3];              /* valve, motor, open: what the machine was advanced with */

/* The line. */
static int line, patience = 2000;
static uint8_t to_board[4096];
static size_t in, out;
static struct frame_decoder from_host, from_board;
static int waiting;

static const char *fault = "";
static unsigned long fault_at = (unsigned long)-1;

/* What is measured. */
static struct {
    unsigned long samples, late_outputs, exchanges, starts;
    unsigned long long tick_to_frame, tick_to_sent, command_to_output, idle_least, idle_sum, jitter;
    unsigned long idle_count;
    avr_cycle_count_t command_at, slept, slept_before, fault_cycle, pins_after, pump_after;
} seen = {.idle_least = ~0ull};

/* ---- the tasks of the processor, and their cycles in this period, in the longest and in all */

enum task { CLOCK, CONVERTER, ENCODER, RECEIVE, SEND, SAMPLE, COMMAND, REST, TASKS };
static const char *const task_names[TASKS] = {"timer", "converters", "encoder", "receive", "send", "sample", "command", "main"};
static struct {
    uint32_t entry;
    unsigned task;
} entries[] = { /* interrupts by their vectors [bytes]; the functions stand in the image wherever they stand */
    {7u * 4u, CLOCK}, {21u * 4u, CONVERTER}, {1u * 4u, ENCODER}, {2u * 4u, ENCODER}, {18u * 4u, RECEIVE}, {19u * 4u, SEND},
    {~0u, SAMPLE}, {~0u, COMMAND},
};
#define OF_SAMPLE 6u
#define OF_COMMAND 7u
#define DEEPEST 8u
static struct {
    unsigned task, stack;
} calls[DEEPEST];
static unsigned depth;
static struct {
    unsigned long long now, most, sum;
} spent[TASKS];
static unsigned long long busy_most;
static unsigned long periods_counted;

static unsigned stack_pointer(void)
{
    return (unsigned)(avr->data[0x5D] | avr->data[0x5E] << 8);
}

/* Before an instruction: which task it belongs to. */
static unsigned task_of_instruction(void)
{
    unsigned i, stack = stack_pointer();
    while (depth != 0 && stack > calls[depth - 1u].stack) {
        depth--;
    }
    for (i = 0; i < sizeof entries / sizeof entries[0] && depth < DEEPEST; i++) {
        if (avr->pc == entries[i].entry && (depth == 0 || stack < calls[depth - 1u].stack)) {
            calls[depth].task = entries[i].task;
            calls[depth++].stack = stack;
        }
    }
    return depth != 0 ? calls[depth - 1u].task : REST;
}

/* At a tick: the period before is over. */
static void count_period(int counts_it)
{
    unsigned long long busy = 0;
    unsigned i;
    for (i = 0; i < TASKS; i++) {
        if (counts_it) {
            busy += spent[i].now;
            spent[i].sum += spent[i].now;
            spent[i].most = spent[i].now > spent[i].most ? spent[i].now : spent[i].most;
        }
        spent[i].now = 0;
    }
    busy_most = busy > busy_most ? busy : busy_most;
    periods_counted += counts_it != 0;
}

static void report(void);

static void ask(const char *request)
{
    char reply[160];
    fputs(request, stdout);
    fflush(stdout);
    if (fgets(reply, sizeof reply, stdin) == NULL) {
        report();
        exit(0);
    }
    if (sscanf(reply, "%u %u %u %ld", &counts[0], &counts[1], &counts[2], &edges) != 4) {
        exit(3);
    }
    seen.exchanges++;
}

/* When a fault has vented: the pins ask for nothing, and the pump has run empty, in cycles after it; and after the newest
 * command. */
static void watch_vent(void)
{
    const uint8_t *data = avr->data;
    int asks = powered && (data[TCCR1A_] & 0x80) && (data[DDRB_] & 2);
    int shuts = powered && (data[DDRD_] & 0x80) && (data[PORTD_] & 0x80);
    if (seen.pins_after == 0 && !asks && !shuts) {
        seen.pins_after = avr->cycle - seen.fault_cycle + 1u;
    }
    if (seen.pump_after == 0 && avr->cycle - alive >= PUMP) {
        seen.pump_after = avr->cycle - seen.fault_cycle;
    }
}

/* The outputs as the valve and the motor get them, in parts of the timer's period of 1024. */
static void outputs(unsigned now[3])
{
    const uint8_t *data = avr->data;
    int held = powered && avr->cycle - alive < PUMP;
    now[0] = held && (data[TCCR1A_] & 0x80) && (data[DDRB_] & 2) ? (data[OCR1AL_] | data[OCR1AL_ + 1] << 8) + 1u : 0;
    now[1] = MOTOR_REST;
    if (held) {
        now[1] = (data[TCCR1A_] & 0x20) && (data[DDRB_] & 4) ? (data[OCR1BL_] | data[OCR1BL_ + 1] << 8) + 1u : 0;
    }
    now[2] = !(held && (data[DDRD_] & 0x80) && (data[PORTD_] & 0x80));
}

/* Levels on the lines of the encoder; a write to the port would else put its pull-ups there. */
static void encoder_lines(int a, int b)
{
    avr_ioport_external_t levels = {.name = 'D', .mask = 3u << PIN_A, .value = (unsigned)(a | b << 1) << PIN_A};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &levels);
    avr_raise_irq(pin_a, a);
    avr_raise_irq(pin_b, b);
}

/* One more edge of the encoder on its lines. */
static avr_cycle_count_t edge(avr_t *a, avr_cycle_count_t when, void *step)
{
    int phase;
    (void)a;
    if (shown == edges || jammed) {
        return 0;
    }
    shown += shown < edges ? 1 : -1;
    phase = (int)(shown & 3);
    encoder_lines(phase == 1 || phase == 2, phase >= 2);
    return shown == edges ? 0 : when + (avr_cycle_count_t)(size_t)step;
}

static void fail(void)
{
    unsigned i;
    seen.fault_cycle = avr->cycle;
    if (strcmp(fault, "power") == 0) {
        powered = 0;
    } else if (strcmp(fault, "brown-out") == 0) {
        avr->vcc = avr->avcc = avr->aref = 4200; /* of what the sensors get, too: they follow their supply */
    } else if (strcmp(fault, "hang") == 0) {
        avr->data[TIMSK2_] = 0; /* nobody feeds the watchdog any more */
        avr_regbit_clear(avr, (avr_regbit_t)AVR_IO_REGBIT(TIMSK2_, 1));
    } else if (strcmp(fault, "converter-stopped") == 0) {
        avr_regbit_clear(avr, adc->aden);
    } else if (strcmp(fault, "converter-stuck") == 0) {
        for (i = 0; i < 64u; i++) {
            adc->muxmode[i] = (avr_adc_mux_t)AVR_ADC_SINGLE(0);
        }
    } else if (strcmp(fault, "encoder-jammed") == 0) {
        jammed = 1;
    } else if (strcmp(fault, "encoder-skips") == 0) {
        shown += 2; /* both lines at once */
        avr->data[0x29] ^= 3u << PIN_A;
        encoder_lines((shown & 3) == 1 || (shown & 3) == 2, (shown & 3) >= 2);
    } else if (strcmp(fault, "line") == 0) {
        torn = 1;
    } /* "host": it is killed by whoever runs this, at this sample */
}

/* Nine tenths after a sample: the machine goes on by a period. */
static avr_cycle_count_t exchange(avr_t *a, avr_cycle_count_t when, void *unused)
{
    char request[80];
    unsigned now[3];
    unsigned long gap;
    (void)a;
    (void)unused;
    if (!running) {
        return 0;
    }
    if (when > tick + period && ++silent > AFTER) {
        running = 0;
        return 0;
    }
    outputs(now);
    memcpy(acted, now, sizeof acted);
    snprintf(request, sizeof request, "advance %u %u %u\n", now[0], now[1], now[2]);
    ask(request);
    gap = (unsigned long)labs(edges - shown);
    if (gap != 0 && !jammed) {
        size_t step = (size_t)(period * 8u / 100u / gap);
        avr_cycle_timer_register(avr, 1, edge, (void *)(step ? step : 1));
    }
    return when + period;
}

/* A conversion begins; that of channel 0 is a sample. */
static void conversion(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    avr_adc_mux_t mux;
    unsigned now[3];
    char request[80];
    (void)irq;
    (void)unused;
    memcpy(&mux, &value, sizeof mux < sizeof value ? sizeof mux : sizeof value);
    if (adc->muxmode[avr->data[0x7C] & 15].kind != ADC_MUX_SINGLE) {
        return;
    }
    if ((avr->data[0x7C] & 15) == 0 && running && begun) {
        begun = 0;
        ticks = 0;
        snprintf(request, sizeof request, "start %llu\n", (unsigned long long)period * 125u / 2u);
        ask(request);
        shown = edges;
        seen.slept_before = seen.slept;
    } else if ((avr->data[0x7C] & 15) == 0 && running) {
        ticks++;
        outputs(now);
        seen.late_outputs += memcmp(now, acted, sizeof now) != 0;
        if (ticks > 1u) {
            unsigned long long idle = seen.slept - seen.slept_before;
            avr_cycle_count_t off = avr->cycle - tick > period ? avr->cycle - tick - period : period - (avr->cycle - tick);
            seen.idle_least = idle < seen.idle_least ? idle : seen.idle_least;
            seen.idle_sum += idle;
            seen.idle_count++;
            seen.jitter = off > seen.jitter ? off : seen.jitter;
        }
        count_period(ticks > 1u);
        seen.slept_before = seen.slept;
    }
    if ((avr->data[0x7C] & 15) == 0 && running) {
        tick = avr->cycle;
        silent = 0;
        seen.samples++;
        avr_cycle_timer_cancel(avr, exchange, NULL);
        avr_cycle_timer_register(avr, period * 9u / 10u, exchange, NULL);
        failing = ticks == fault_at;
    }
    if ((avr->data[0x7C] & 15) < 3) {
        unsigned count = counts[avr->data[0x7C] & 15];
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + (avr->data[0x7C] & 15)),
                      (count * avr->avcc + 1022u) / 1023u); /* the least voltage that reads so */
    }
}

static void alive_edge(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    alive = avr->cycle;
}

static void output_put(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    if (seen.command_at != 0 && avr->cycle - seen.command_at > seen.command_to_output) {
        seen.command_to_output = avr->cycle - seen.command_at;
    }
    seen.command_at = 0;
}

static void byte_from_board(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    uint8_t byte = (uint8_t)value;
    struct frame frame;
    (void)irq;
    (void)unused;
    if (torn) {
        return;
    }
    if (from_board.count == 0 && running && ticks > 1u && avr->cycle - tick > seen.tick_to_frame && byte != 0 && avr->cycle - tick < period) {
        seen.tick_to_frame = avr->cycle - tick;
    }
    while (write(line, &byte, 1) < 0 && errno == EAGAIN) {
        usleep(100);
    }
    if (frame_feed(&from_board, byte, &frame)) {
        if (frame.kind == 0x82 && running) {
            unsigned long long took = avr->cycle - tick;
            seen.tick_to_sent = took > seen.tick_to_sent && ticks > 1u ? took : seen.tick_to_sent;
            waiting = 1;
        } else if (frame.kind == 0x83) {
            waiting = 0;
        }
    }
}

/* Bytes of the host, as fast as the line carries them. */
static avr_cycle_count_t byte_to_board(avr_t *a, avr_cycle_count_t when, void *unused)
{
    struct frame frame;
    uint8_t byte;
    (void)a;
    (void)unused;
    if (out == in || !powered) {
        return 0;
    }
    byte = to_board[out++ % sizeof to_board];
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
    if (frame_feed(&from_host, byte, &frame)) {
        if (frame.kind == 0x02 && frame.size == 7u) {
            period = (avr_cycle_count_t)frame_get32(frame.payload) * 2u / 125u;
            running = begun = 1;
            tick = avr->cycle;
            silent = 0;
        } else if (frame.kind == 0x01 || frame.kind == 0x05) {
            running = 0;
        } else if (frame.kind == 0x03) {
            seen.command_at = when + BYTE;
        }
    }
    return out == in ? 0 : when + BYTE;
}

/* Take what the host has sent; whether a whole frame is among it. */
static int listen_to_host(int wait)
{
    struct pollfd both[2] = {{line, POLLIN, 0}, {0, POLLIN, 0}};
    uint8_t data[512];
    ssize_t got, i;
    int whole = 0;
    if (poll(both, running ? 1 : 2, wait) <= 0) {
        return 0;
    }
    if (!running && (both[1].revents & (POLLIN | POLLHUP))) {
        return -1; /* nothing is asked now: it is the end */
    }
    got = read(line, data, sizeof data);
    if (got <= 0) {
        usleep(1000); /* nobody holds the other end */
        return 0;
    }
    if (torn) {
        return 0;
    }
    if (in == out) {
        avr_cycle_timer_register(avr, BYTE, byte_to_board, NULL);
    }
    for (i = 0; i < got; i++) {
        to_board[in++ % sizeof to_board] = data[i];
        whole |= data[i] == 0;
    }
    return whole;
}

/* The firmware sets the speed of its line once, where it starts. */
static void start_of_board(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    seen.starts++;
}

static void slept(avr_t *a, avr_cycle_count_t cycles)
{
    (void)a;
    seen.slept += cycles;
}

static void quiet(avr_t *a, const int level, const char *format, va_list arguments)
{
    (void)a;
    if (level <= LOG_ERROR && getenv("EMULATOR_LOG") != NULL) {
        vfprintf(stderr, format, arguments);
    }
}

static void connect(const char *image)
{
    uint32_t size, start, i;
    avr_io_t *io;
    uint8_t *program = read_ihex_file(image, &size, &start);
    uint32_t flags = 0;
    avr_ioport_external_t low = {.name = 'D', .mask = 3u << PIN_A, .value = 0};
    if (program == NULL || (avr = avr_make_mcu_by_name("atmega328p")) == NULL) {
        fprintf(stderr, "%s: no image of an ATmega328P\n", image);
        exit(2);
    }
    avr_init(avr);
    avr->frequency = FREQUENCY;
    avr->vcc = avr->avcc = avr->aref = 5000;
    avr->sleep = slept;
    avr_loadcode(avr, program, size, start);
    avr->codeend = avr->flashend;
    for (i = 0x100; i <= HIGHEST; i++) {
        avr->data[i] = PAINT;
    }
    for (io = avr->io_port; io != NULL; io = io->next) {
        adc = strcmp(io->kind, "adc") == 0 ? (avr_adc_t *)io : adc;
    }
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_from_board, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), conversion, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), PIN_ALIVE), alive_edge, NULL);
    avr_irq_register_notify(avr_iomem_getirq(avr, TCCR1A_, NULL, AVR_IOMEM_IRQ_ALL), output_put, NULL);
    pin_a = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), PIN_A);
    pin_b = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), PIN_B);
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &low); /* no edge yet: simavr would go on to poll it as a level */
    avr_irq_register_notify(avr_iomem_getirq(avr, UBRR0L_, NULL, AVR_IOMEM_IRQ_ALL), start_of_board, NULL);
}

static void report(void)
{
    unsigned long free_memory = 0, at = 0, run = 0;
    unsigned i;
    for (at = 0x100; at <= HIGHEST; at++) { /* the longest stretch that nothing ever wrote to lies below the stack */
        run = avr->data[at] == PAINT ? run + 1u : 0;
        free_memory = run > free_memory ? run : free_memory;
    }
    printf("report {\"samples\": %lu, \"period\": %llu, \"late_outputs\": %lu, \"starts\": %lu, "
           "\"tick_to_frame\": %llu, \"tick_to_sent\": %llu, \"command_to_output\": %llu, \"idle_least\": %llu, "
           "\"idle_mean\": %llu, \"jitter\": %llu, \"free_memory\": %lu, \"busy_most\": %llu, "
           "\"pins_after\": %llu, \"pump_after\": %llu",
           seen.samples, (unsigned long long)period, seen.late_outputs, seen.starts, seen.tick_to_frame,
           seen.tick_to_sent, seen.command_to_output, seen.idle_count ? seen.idle_least : 0ull,
           seen.idle_count ? seen.idle_sum / seen.idle_count : 0ull, seen.jitter, free_memory,
           busy_most, (unsigned long long)seen.pins_after,
           (unsigned long long)seen.pump_after);
    for (i = 0; i < TASKS; i++) {
        printf(", \"%s_most\": %llu, \"%s_mean\": %llu", task_names[i], spent[i].most, task_names[i],
               periods_counted ? spent[i].sum / periods_counted : 0ull);
    }
    printf("}\n");
    fflush(stdout);
}

int main(int count, char **words)
{
    avr_cycle_count_t look = 0;
    int i, told;
    if (count < 3) {
        fprintf(stderr, "usage: %s IMAGE.hex LINE [fault=KIND@SAMPLE] [patience=MS] [tick=ADDRESS] [receive=ADDRESS]\n", words[0]);
        return 2;
    }
    for (i = 3; i < count; i++) {
        char *at = strchr(words[i], '@');
        if (strncmp(words[i], "fault=", 6) == 0 && at != NULL) {
            *at = '\0';
            fault = words[i] + 6;
            fault_at = strtoul(at + 1, NULL, 10);
        } else if (strncmp(words[i], "patience=", 9) == 0) {
            patience = atoi(words[i] + 9);
        } else if (strncmp(words[i], "tick=", 5) == 0) {
            entries[OF_SAMPLE].entry = (uint32_t)strtoul(words[i] + 5, NULL, 0);
        } else if (strncmp(words[i], "receive=", 8) == 0) {
            entries[OF_COMMAND].entry = (uint32_t)strtoul(words[i] + 8, NULL, 0);
        }
    }
    line = atoi(words[2]);
    avr_global_logger_set(quiet);
    connect(words[1]);
    for (;;) {
        if (waiting && running && !torn) {
            waiting = 0;
            for (told = 0; told == 0 && running;) {
                size_t before = in;
                told = listen_to_host(patience);
                if (told == 0 && in == before) {
                    break; /* the host is silent: time goes on without it */
                }
            }
        } else if (avr->cycle >= look) {
            int watched = seen.fault_cycle != 0 && seen.pump_after == 0 && avr->cycle - seen.fault_cycle < FREQUENCY / 10u;
            int idle = !running && !watched && in == out && avr->cycle > FREQUENCY / 10u && avr->state == cpu_Sleeping;
            look = avr->cycle + 1600u;
            if (listen_to_host(idle ? 1000 : 0) < 0) {
                break;
            }
        }
        if (failing) {
            failing = 0;
            fail();
        }
        if (seen.fault_cycle != 0 && (seen.pins_after == 0 || seen.pump_after == 0)) {
            watch_vent();
        }
        if (!powered) {
            avr->cycle += 160u;
            avr_cycle_timer_process(avr);
        } else {
            unsigned task = task_of_instruction();
            avr_cycle_count_t before = avr->cycle - seen.slept;
            int state = avr_run(avr);
            spent[task].now += avr->cycle - seen.slept - before;
            if (state == cpu_Done || state == cpu_Crashed) {
                fprintf(stderr, "the processor has crashed at %x\n", avr->pc);
                return 4;
            }
        }
    }
    report();
    return 0;
}
