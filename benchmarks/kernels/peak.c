/* The floating-point peak of one core: independent chains of multiply and add, nothing else. */
#include "simd.h"
#define CHAINS 24 /* more than latency times units, fewer than registers */

EXPORT long operations_per_round(void) { return 2L * CHAINS * LANES; }

EXPORT double peak(long rounds) {
    V a[CHAINS], x = set1(0.999999), y = set1(1e-7);
    REAL out[LANES];
    double sum = 0.0;
    for (int i = 0; i < CHAINS; i++) a[i] = set1(1.0 + 0.01 * i);
    for (long r = 0; r < rounds; r++) {
#pragma GCC unroll 24
        for (int i = 0; i < CHAINS; i++) a[i] = a[i] * x + y;
    }
    for (int i = 1; i < CHAINS; i++) a[0] = a[0] + a[i];
    store(out, a[0]);
    for (int i = 0; i < LANES; i++) sum += (double)out[i];
    return sum;
}
