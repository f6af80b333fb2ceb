/* The state machine on what comes by the standard input, a tick after every 16 bytes; prints how many frames it sent. */
#include <stdio.h>

#include "bench.h"

static const uint8_t bits[2] = {12, 16};
static const char *const names[2] = {"one", "two"};
static const struct hal_about about = {"fuzz", 1000, 7, 1, 1, 2, bits, names};
static unsigned long sent;

const struct hal_about *hal_about(void) { return &about; }
void hal_start(uint32_t period, int clocked) { (void)period; (void)clocked; }
void hal_stop(void) {}
void hal_write(uint32_t valve, uint32_t motor, int opened) { (void)valve; (void)motor; (void)opened; }
uint64_t hal_now(void) { return sent; }

int hal_read(uint32_t *counts, int32_t *encoder)
{
    counts[0] = counts[1] = 0;
    *encoder = -1;
    return 0;
}

void hal_send(const uint8_t *data, size_t size)
{
    sent += size > 0 && data[size - 1] == 0;
}

int main(void)
{
    uint8_t data[16];
    size_t size;
    bench_begin();
    while ((size = fread(data, 1, sizeof data, stdin)) > 0) {
        bench_receive(data, size);
        bench_tick();
    }
    printf("%lu\n", sent);
    return 0;
}
