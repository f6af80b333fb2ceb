/* Registers of the STM32F405 that the port uses, after the reference manual RM0090; the processor's after PM0214. */
#ifndef MCKIBBEN_STM32F405_REGISTERS_H
#define MCKIBBEN_STM32F405_REGISTERS_H

#include <stdint.h>

#define AT(type, address) ((volatile struct type *)(uintptr_t)(address))
#define BIT(n) (1ul << (n))

struct rcc {
    uint32_t cr, pllcfgr, cfgr, cir, ahb1rstr, ahb2rstr, ahb3rstr, gap0, apb1rstr, apb2rstr, gap1[2];
    uint32_t ahb1enr, ahb2enr, ahb3enr, gap2, apb1enr, apb2enr;
};
#define RCC AT(rcc, 0x40023800ul)
#define FLASH_ACR (*(volatile uint32_t *)0x40023C00ul)

struct gpio {
    uint32_t moder, otyper, ospeedr, pupdr, idr, odr, bsrr, lckr, afr[2];
};
#define GPIOB AT(gpio, 0x40020400ul)
#define GPIOC AT(gpio, 0x40020800ul)

struct timer {
    uint32_t cr1, cr2, smcr, dier, sr, egr, ccmr[2], ccer, cnt, psc, arr, rcr, ccr[4], bdtr;
};
#define TIM2 AT(timer, 0x40000000ul)
#define TIM4 AT(timer, 0x40000800ul)
#define TIM8 AT(timer, 0x40010400ul)

struct adc {
    uint32_t sr, cr1, cr2, smpr1, smpr2, jofr[4], htr, ltr, sqr[3], jsqr, jdr[4], dr;
};
#define ADC1 AT(adc, 0x40012000ul)
#define ADC_CCR (*(volatile uint32_t *)0x40012304ul)

struct usart {
    uint32_t sr, dr, brr, cr1, cr2, cr3;
};
#define USART3 AT(usart, 0x40004800ul)
#define USART3_IRQ 39u

struct iwdg {
    uint32_t kr, pr, rlr, sr;
};
#define IWDG AT(iwdg, 0x40003000ul)

struct systick {
    uint32_t csr, load, val;
};
#define SYSTICK AT(systick, 0xE000E010ul)
#define NVIC_ISER(n) (*(volatile uint32_t *)(0xE000E100ul + 4ul * (n)))
#define NVIC_IPR(irq) (*(volatile uint8_t *)(0xE000E400ul + (irq)))
#define SCB_ICSR (*(volatile uint32_t *)0xE000ED04ul)
#define SCB_SHPR(exception) (*(volatile uint8_t *)(0xE000ED18ul + (exception) - 4u))

#endif
