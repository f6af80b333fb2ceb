/* Vectors of REAL, muscles in the lanes, for the processor that the compiler is told of.
 *
 * W is one vector, V what a formula is written in: W itself, or with PAIR (C++) two of them side by side, every operation on
 * one followed by the same on the other, so that a unit works on one while the other waits. LANES=1 makes both a number.
 * With COUNT (C++) a number counts what is done to it: + - * / and roots, each once, however many instructions a processor
 * takes for them; minima, choices and moves are not algebra and count nothing. REAL is double, or float with SINGLE.
 */
#ifndef SIMD_H
#define SIMD_H
#include <math.h>
#include <stddef.h>
#if defined(__AVX2__) || defined(__AVX512F__)
#include <immintrin.h>
#endif

#ifdef SINGLE
#define REAL float
#else
#define REAL double
#endif
#define INLINE static inline __attribute__((always_inline))

#if defined(COUNT) /* -------------------------------------------------------------------------------------- counting */
static long counted = 0;
struct W {
    double v;
};
INLINE W operator+(W a, W b) { return ++counted, W{a.v + b.v}; }
INLINE W operator-(W a, W b) { return ++counted, W{a.v - b.v}; }
INLINE W operator*(W a, W b) { return ++counted, W{a.v * b.v}; }
INLINE W operator/(W a, W b) { return ++counted, W{a.v / b.v}; }
INLINE W one_set1(double x) { return W{x}; }
INLINE W one_load(const REAL *p) { return W{*p}; }
INLINE void one_store(REAL *p, W x) { *p = x.v; }
INLINE W one_min(W a, W b) { return a.v < b.v ? a : b; }
INLINE W one_max(W a, W b) { return a.v > b.v ? a : b; }
INLINE W one_abs(W a) { return W{fabs(a.v)}; }
INLINE W one_where_ge(W a, W b, W x, W y) { return a.v >= b.v ? x : y; }
INLINE W one_reciprocal(W x) { return ++counted, W{1.0 / x.v}; }
INLINE W one_root(W x) { return ++counted, W{sqrt(x.v)}; }
#define WIDTH 1

#elif defined(LANES) && LANES == 1 /* ---------------------------------------------------------------------- one lane */
typedef REAL W;
#define ALONE
#define WIDTH 1
INLINE W one_set1(double x) { return (REAL)x; }
INLINE W one_load(const REAL *p) { return *p; }
INLINE void one_store(REAL *p, W x) { *p = x; }
INLINE W one_min(W a, W b) { return a < b ? a : b; }
INLINE W one_max(W a, W b) { return a > b ? a : b; }
INLINE W one_abs(W a) { return a < 0 ? -a : a; }
INLINE W one_where_ge(W a, W b, W x, W y) { return a >= b ? x : y; }
INLINE W one_reciprocal(W x) { return (REAL)1 / x; }
INLINE W one_root(W x) { return sizeof(W) == 8 ? (W)sqrt((double)x) : (W)sqrtf((float)x); }

#elif defined(__AVX512F__) /* ------------------------------------------------------------------------------ AVX-512 */
#ifdef SINGLE
typedef __m512 W;
#define I(name) _mm512_##name##_ps
#define COMPARE _mm512_cmp_ps_mask
#else
typedef __m512d W;
#define I(name) _mm512_##name##_pd
#define COMPARE _mm512_cmp_pd_mask
#endif
#define WIDTH ((int)(64 / sizeof(REAL)))
INLINE W one_set1(double x) { return I(set1)((REAL)x); }
INLINE W one_load(const REAL *p) { return I(loadu)(p); }
INLINE void one_store(REAL *p, W x) { I(storeu)(p, x); }
INLINE W one_min(W a, W b) { return I(min)(a, b); }
INLINE W one_max(W a, W b) { return I(max)(a, b); }
INLINE W one_abs(W a) { return I(abs)(a); }
INLINE W one_where_ge(W a, W b, W x, W y) { return I(mask_blend)(COMPARE(a, b, _CMP_GE_OQ), y, x); }
#ifdef NEWTON
/* Estimates of 14 bits and Newton steps, for x that is neither zero nor subnormal: within 1 or 2 units in the last place. */
INLINE W one_reciprocal(W x) {
    W r = I(rcp14)(x);
    r = r + r * (one_set1(1.0) - x * r);
    return sizeof(REAL) == 4 ? r : r + r * (one_set1(1.0) - x * r);
}
INLINE W one_root(W x) {
    W r = I(rsqrt14)(x), s = x * r, half = one_set1(0.5) * r, e = one_set1(0.5) - half * s;
    s = s + s * e, half = half + half * e;
    return sizeof(REAL) == 4 ? s : s + half * (x - s * s);
}
#else
INLINE W one_reciprocal(W x) { return one_set1(1.0) / x; }
INLINE W one_root(W x) { return I(sqrt)(x); }
#endif

#elif defined(__AVX2__) /* ------------------------------------------------------------------------------------ AVX2 */
#ifdef SINGLE
typedef __m256 W;
#define I(name) _mm256_##name##_ps
#else
typedef __m256d W;
#define I(name) _mm256_##name##_pd
#endif
#define WIDTH ((int)(32 / sizeof(REAL)))
INLINE W one_set1(double x) { return I(set1)((REAL)x); }
INLINE W one_load(const REAL *p) { return I(loadu)(p); }
INLINE void one_store(REAL *p, W x) { I(storeu)(p, x); }
INLINE W one_min(W a, W b) { return I(min)(a, b); }
INLINE W one_max(W a, W b) { return I(max)(a, b); }
INLINE W one_abs(W a) { return I(andnot)(one_set1(-0.0), a); }
INLINE W one_where_ge(W a, W b, W x, W y) { return I(blendv)(y, x, I(cmp)(a, b, _CMP_GE_OQ)); }
INLINE W one_reciprocal(W x) { return one_set1(1.0) / x; }
INLINE W one_root(W x) { return I(sqrt)(x); }

#else /* ------------------------------------------------------ any processor, by the vectors of the compilers */
typedef REAL W __attribute__((vector_size(16)));
#ifdef SINGLE
typedef int M __attribute__((vector_size(16)));
#else
typedef long long M __attribute__((vector_size(16)));
#endif
#define WIDTH ((int)(16 / sizeof(REAL)))
INLINE W one_set1(double x) { return (W){0} + (REAL)x; }
INLINE W one_load(const REAL *p) {
    W x;
    __builtin_memcpy(&x, p, sizeof x);
    return x;
}
INLINE void one_store(REAL *p, W x) { __builtin_memcpy(p, &x, sizeof x); }
INLINE W choose(M m, W x, W y) { return (W)((m & (M)x) | (~m & (M)y)); }
INLINE W one_where_ge(W a, W b, W x, W y) { return choose(a >= b, x, y); }
INLINE W one_min(W a, W b) { return choose(a < b, a, b); }
INLINE W one_max(W a, W b) { return choose(a > b, a, b); }
INLINE W one_abs(W a) { return one_max(a, -a); }
INLINE W one_reciprocal(W x) { return one_set1(1.0) / x; }
INLINE W one_root(W x) {
    for (int i = 0; i < WIDTH; i++) x[i] = sizeof(REAL) == 8 ? (REAL)sqrt((double)x[i]) : (REAL)sqrtf((float)x[i]);
    return x;
}
#endif

#ifdef PAIR /* ------------------------------------------------------------------------------- two vectors side by side */
struct V {
    W a, b;
};
#define LANES (2 * WIDTH)
INLINE V operator+(V x, V y) { return {x.a + y.a, x.b + y.b}; }
INLINE V operator-(V x, V y) { return {x.a - y.a, x.b - y.b}; }
INLINE V operator*(V x, V y) { return {x.a * y.a, x.b * y.b}; }
INLINE V operator/(V x, V y) { return {x.a / y.a, x.b / y.b}; }
INLINE V set1(double x) { return {one_set1(x), one_set1(x)}; }
INLINE V load(const REAL *p) { return {one_load(p), one_load(p + WIDTH)}; }
INLINE void store(REAL *p, V x) { one_store(p, x.a), one_store(p + WIDTH, x.b); }
INLINE V vmin(V x, V y) { return {one_min(x.a, y.a), one_min(x.b, y.b)}; }
INLINE V vmax(V x, V y) { return {one_max(x.a, y.a), one_max(x.b, y.b)}; }
INLINE V vabs(V x) { return {one_abs(x.a), one_abs(x.b)}; }
INLINE V where_ge(V a, V b, V x, V y) { return {one_where_ge(a.a, b.a, x.a, y.a), one_where_ge(a.b, b.b, x.b, y.b)}; }
INLINE V reciprocal(V x) { return {one_reciprocal(x.a), one_reciprocal(x.b)}; }
INLINE V root(V x) { return {one_root(x.a), one_root(x.b)}; }
#else
typedef W V;
#ifndef LANES
#define LANES WIDTH
#endif
INLINE V set1(double x) { return one_set1(x); }
INLINE V load(const REAL *p) { return one_load(p); }
INLINE void store(REAL *p, V x) { one_store(p, x); }
INLINE V vmin(V x, V y) { return one_min(x, y); }
INLINE V vmax(V x, V y) { return one_max(x, y); }
INLINE V vabs(V x) { return one_abs(x); }
INLINE V where_ge(V a, V b, V x, V y) { return one_where_ge(a, b, x, y); }
INLINE V reciprocal(V x) { return one_reciprocal(x); }
INLINE V root(V x) { return one_root(x); }
#endif

/* Reciprocals of two and of three numbers at the price of one; one lane alone rather waits for the shortest way. */
#ifdef ALONE
INLINE void reciprocals2(V a, V b, V *ra, V *rb) { *ra = reciprocal(a), *rb = reciprocal(b); }
INLINE void reciprocals3(V a, V b, V c, V *ra, V *rb, V *rc) { reciprocals2(a, b, ra, rb), *rc = reciprocal(c); }
#else
INLINE void reciprocals2(V a, V b, V *ra, V *rb) {
    V r = reciprocal(a * b);
    *ra = r * b, *rb = r * a;
}
INLINE void reciprocals3(V a, V b, V c, V *ra, V *rb, V *rc) {
    V ab = a * b, r = reciprocal(ab * c), rab = r * c;
    *rc = r * ab, *ra = rab * b, *rb = rab * a;
}
#endif

#ifdef __cplusplus
#define EXPORT extern "C"
#else
#define EXPORT
#endif
#endif
