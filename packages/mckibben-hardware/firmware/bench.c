#include "bench.h"

#define LAST 0xFFFFFFFFu       /* sample that there is not */
#define LEAST_WATCHDOG 2u      /* samples */
#define SAMPLE_HEAD 15u        /* bytes before the counts */
#define WELCOME_HEAD 12u       /* bytes before the bits */

enum kind {
    HELLO = 0x01, START = 0x02, COMMAND = 0x03, VENT = 0x04, STOP = 0x05,
    WELCOME = 0x81, SAMPLE = 0x82, FAULT = 0x83
};
enum mode { FREE = 0, LOCK_STEP = 1 };
enum reason { WRONG_VERSION = 1, REFUSED = 2, HARDWARE = 3, END = 4 }; /* of FAULT */
enum { OPEN = 1 };                                               /* flag of COMMAND */
enum { HAS_ENCODER = 1, HAS_MOTOR = 2 };                         /* flags of WELCOME */
enum { VENTED = 1, BY_ITSELF = 2, UNANSWERED = 4, DAMAGED = 8 }; /* flags of SAMPLE */

static struct {
    struct frame_decoder decoder;
    uint8_t payload[FRAME_PAYLOAD];
    uint8_t line[FRAME_CODED + 1u];
    uint32_t counts[HAL_CHANNELS];
    uint32_t dropped, told;     /* frames dropped: of unknown kinds, and all until the newest sample */
    uint32_t next, unanswered;  /* next sample; the oldest that a command may answer */
    uint32_t period, silent, motor;
    uint16_t run, watchdog;
    uint8_t greeted, running, due, mode, vented, by_itself;
} it;

static void tell(uint8_t kind, uint32_t sequence, size_t size)
{
    size_t all = frame_write(kind, sequence, it.payload, size, it.line);
    if (all > 0) {
        hal_send(it.line, all);
    }
}

static void put(uint32_t valve, uint32_t motor, int opened)
{
    it.motor = motor;
    hal_write(valve, motor, opened);
}

static void rest(void)
{
    put(0, hal_about()->motor_rest, 1);
}

static void halt(void)
{
    it.running = 0;
    it.due = 0;
    hal_stop();
    rest();
}

/* A text at `at` of the payload; where the next thing stands, or beyond the payload if it does not fit. */
static size_t text(size_t at, const char *words)
{
    size_t length = 0;
    while (words[length] != '\0' && length < 255u && at + 1u + length < FRAME_PAYLOAD) {
        it.payload[at + 1u + length] = (uint8_t)words[length];
        length++;
    }
    if (words[length] != '\0' || at >= FRAME_PAYLOAD) {
        return FRAME_PAYLOAD + 1u;
    }
    it.payload[at] = (uint8_t)length;
    return at + 1u + length;
}

static void fault(enum reason code, const char *words)
{
    halt();
    it.payload[0] = (uint8_t)code;
    tell(FAULT, it.next, text(1, words));
}

static void welcome(uint32_t sequence)
{
    const struct hal_about *about = hal_about();
    uint8_t channels = about->channels > HAL_CHANNELS ? (uint8_t)HAL_CHANNELS : about->channels;
    size_t at = WELCOME_HEAD + channels, i;
    frame_put16(it.payload, BENCH_VERSION);
    frame_put32(it.payload + 2, about->shortest);
    it.payload[6] = (uint8_t)((about->encoder ? HAS_ENCODER : 0) | (about->motor ? HAS_MOTOR : 0));
    frame_put32(it.payload + 7, about->motor_rest);
    it.payload[11] = channels;
    for (i = 0; i < channels; i++) {
        it.payload[WELCOME_HEAD + i] = about->bits[i];
    }
    at = text(at, about->firmware);
    for (i = 0; i < channels && at <= FRAME_PAYLOAD; i++) {
        at = text(at, about->names[i]);
    }
    if (at > FRAME_PAYLOAD) {
        fault(HARDWARE, "names too long");
    } else {
        tell(WELCOME, sequence, at);
    }
}

static void start(uint32_t run, const uint8_t *payload)
{
    uint32_t period = frame_get32(payload);
    uint8_t mode = payload[4];
    uint16_t watchdog = frame_get16(payload + 5);
    halt();
    if (!it.greeted) {
        fault(WRONG_VERSION, "not the version of the protocol");
        return;
    }
    if (period == 0 || period < hal_about()->shortest ||
        !(mode == LOCK_STEP || (mode == FREE && watchdog >= LEAST_WATCHDOG))) {
        fault(REFUSED, "this period, mode or watchdog is not possible");
        return;
    }
    it.run = (uint16_t)run;
    it.period = period;
    it.mode = mode;
    it.watchdog = watchdog;
    it.next = it.unanswered = it.silent = 0;
    it.vented = it.by_itself = 0;
    it.running = 1;
    it.due = mode == LOCK_STEP;
    it.told = it.decoder.bad_checksum + it.decoder.oversized + it.decoder.undecodable + it.dropped;
    hal_start(period, mode == FREE);
}

static void command(uint32_t sequence, const uint8_t *payload)
{
    if (!it.running || sequence < it.unanswered || sequence >= it.next) {
        return;
    }
    it.unanswered = sequence + 1u;
    it.silent = 0;
    it.due = it.mode == LOCK_STEP;
    put(it.vented ? 0 : frame_get32(payload), it.by_itself ? it.motor : frame_get32(payload + 4),
        it.vented || (payload[8] & OPEN));
}

static void message(const struct frame *f)
{
    if (f->kind == COMMAND && f->size == 9u) {
        command(f->sequence, f->payload);
    } else if (f->kind == VENT && f->size == 0u) {
        it.vented = 1;
        put(0, it.motor, 1);
    } else if (f->kind == STOP && f->size == 0u) {
        halt();
    } else if (f->kind == HELLO && f->size == 2u) {
        halt();
        it.greeted = frame_get16(f->payload) == BENCH_VERSION;
        welcome(f->sequence);
    } else if (f->kind == START && f->size == 7u) {
        start(f->sequence, f->payload);
    } else {
        it.dropped++;
    }
}

void bench_begin(void)
{
    it.decoder.count = 0;
    it.decoder.skipping = 0;
    it.decoder.bad_checksum = it.decoder.oversized = it.decoder.undecodable = 0;
    it.dropped = it.told = it.next = it.unanswered = it.silent = it.period = 0;
    it.greeted = it.vented = it.by_itself = 0;
    it.mode = FREE;
    halt();
}

void bench_receive(const uint8_t *data, size_t size)
{
    struct frame found;
    size_t i;
    for (i = 0; i < size; i++) {
        if (frame_feed(&it.decoder, data[i], &found)) {
            message(&found);
        }
    }
}

int bench_due(void)
{
    return it.due;
}

/* The watchdog, where a timer takes the samples; the flag of a sample whose predecessor nobody answered. */
static uint8_t watch(void)
{
    if (it.mode != FREE || it.next == 0) {
        return 0;
    }
    if (++it.silent >= it.watchdog) {
        it.vented = it.by_itself = 1;
        rest();
    }
    return it.unanswered != it.next ? UNANSWERED : 0;
}

void bench_tick(void)
{
    uint8_t channels = hal_about()->channels > HAL_CHANNELS ? (uint8_t)HAL_CHANNELS : hal_about()->channels;
    uint32_t dropped;
    int32_t encoder = 0;
    uint64_t now;
    uint8_t flags;
    size_t i;
    if (!it.running || (it.mode == LOCK_STEP && !it.due)) {
        return;
    }
    now = it.mode == LOCK_STEP ? (uint64_t)it.next * it.period : hal_now();
    if (hal_read(it.counts, &encoder) != 0) {
        fault(HARDWARE, "the machine cannot be read");
        return;
    }
    flags = watch();
    dropped = it.decoder.bad_checksum + it.decoder.oversized + it.decoder.undecodable + it.dropped;
    flags |= (uint8_t)((dropped != it.told ? DAMAGED : 0) | (it.vented ? VENTED : 0) | (it.by_itself ? BY_ITSELF : 0));
    it.told = dropped;
    it.due = 0;
    frame_put16(it.payload, it.run);
    frame_put64(it.payload + 2, now);
    it.payload[10] = flags;
    frame_put32(it.payload + 11, (uint32_t)encoder);
    for (i = 0; i < channels; i++) {
        frame_put32(it.payload + SAMPLE_HEAD + 4u * i, it.counts[i]);
    }
    tell(SAMPLE, it.next, SAMPLE_HEAD + 4u * channels);
    it.next++;
    if (it.next == LAST) {
        fault(END, "a run has no more samples");
    }
}
