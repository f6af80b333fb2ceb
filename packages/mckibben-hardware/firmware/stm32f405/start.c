#include "start.h"

#include <stdint.h>

#include "registers.h"

extern uint32_t stack_top[], data_from[], data_begin[], data_end[], bss_begin[], bss_end[];

void on_reset(void);

void on_reset(void)
{
    uint32_t *to, *from = data_from;
    for (to = data_begin; to != data_end; to++) {
        *to = *from++;
    }
    for (to = bss_begin; to != bss_end; to++) {
        *to = 0;
    }
    main();
    on_failure();
}

void wait_for_interrupt(void)
{
    __asm volatile("wfi" ::: "memory");
}

/* After the stack: reset, the processor's failures, and the two interrupts; the others are never enabled. */
__attribute__((section(".vectors"), used)) static void (*const vectors[16u + USART3_IRQ + 1u])(void) = {
    (void (*)(void))(uintptr_t)stack_top,
    on_reset, on_failure, on_failure, on_failure, on_failure, on_failure,
    [15] = on_systick,
    [16u + USART3_IRQ] = on_usart3,
};
