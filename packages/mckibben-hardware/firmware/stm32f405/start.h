/* The vector table's handlers, and the processor's sleep. */
#ifndef MCKIBBEN_STM32F405_START_H
#define MCKIBBEN_STM32F405_START_H

int main(void);
void on_systick(void);
void on_usart3(void);

/* The processor failed or the crystal stopped: outputs to rest, and wait for the watchdog. */
void on_failure(void);

/* Sleep until an interrupt, with interrupts masked: one that is pending ends it at once. */
void wait_for_interrupt(void);

#endif
