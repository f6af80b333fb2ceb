#include "peripherals.h"

#include "registers.h"

#define WAIT 40000ul /* passes, 15 ms before the clock is up; what works ends sooner */

enum mode { INPUT = 0, OUTPUT = 1, ALTERNATE = 2, ANALOGUE = 3 };

static uint16_t encoder_before;
static int32_t edges;

static int wait_for(volatile uint32_t *from, uint32_t mask, uint32_t value)
{
    uint32_t left;
    for (left = WAIT; left != 0; left--) {
        if ((*from & mask) == value) {
            return 1;
        }
    }
    return 0;
}

static void pin_mode(volatile struct gpio *port, unsigned pin, enum mode mode)
{
    port->moder = (port->moder & ~(3ul << (2u * pin))) | ((uint32_t)mode << (2u * pin));
}

static void pin_function(volatile struct gpio *port, unsigned pin, uint32_t function)
{
    volatile uint32_t *afr = &port->afr[pin / 8u];
    *afr = (*afr & ~(15ul << (4u * (pin % 8u)))) | (function << (4u * (pin % 8u)));
    pin_mode(port, pin, ALTERNATE);
}

/* 168 MHz from the crystal, or from the internal oscillator where there is none; whether it is the crystal. */
static int clock_begin(void)
{
    int crystal;
    uint32_t source = 0, divider = 16u;
    RCC->cr |= BIT(16); /* HSEON */
    crystal = wait_for(&RCC->cr, BIT(17), BIT(17));
    if (crystal) {
        source = BIT(22);
        divider = CRYSTAL_MHZ;
        RCC->cr |= BIT(19); /* a crystal that stops later is a non-maskable interrupt */
    }
    FLASH_ACR = BIT(10) | BIT(9) | BIT(8) | 5u; /* caches, prefetch, five wait states */
    RCC->pllcfgr = (7u << 24) | source | (336u << 6) | divider; /* 1 MHz by 336, and by two */
    RCC->cr |= BIT(24);
    if (!wait_for(&RCC->cr, BIT(25), BIT(25))) {
        return 0;
    }
    RCC->cfgr = (4u << 13) | (5u << 10); /* APB2 by two, APB1 by four */
    RCC->cfgr |= 2u;
    return wait_for(&RCC->cfgr, 3u << 2, 2u << 2) && crystal;
}

static void converter_begin(void)
{
    uint32_t left;
    ADC_CCR = BIT(23) | BIT(16);            /* reference on; 84 MHz by four */
    ADC1->cr1 = BIT(8);                     /* scan */
    ADC1->smpr1 = (7ul << 21) | 4u | (4u << 3) | (4u << 6); /* 480 cycles for channel 17, 84 for 10 to 12 */
    ADC1->jsqr = (3ul << 20) | (17ul << 15) | (12ul << 10) | (11ul << 5) | 10ul;
    ADC1->cr2 = BIT(0);
    for (left = 2000u; left != 0; left--) { /* 10 us, until converter and reference have settled */
        (void)ADC1->sr;
    }
}

static void encoder_begin(void)
{
    TIM4->smcr = 3u;                                                   /* counts each edge of both */
    TIM4->ccmr[0] = 1u | (3u << 4) | (1u << 8) | (3u << 12);           /* a level holds for 8 samples, 95 ns */
    TIM4->arr = 0xFFFFu;
    TIM4->cr1 = 1u;
}

static void pwm_begin(void)
{
    TIM8->arr = PWM_TOP;                                               /* a count is that part of 4096 */
    TIM8->ccmr[1] = (6u << 4) | BIT(3) | (6u << 12) | BIT(11);         /* mode 1, taken over at the next cycle */
    TIM8->ccr[2] = 0;
    TIM8->ccr[3] = MOTOR_REST;
    TIM8->ccer = BIT(8) | BIT(12);
    TIM8->bdtr = BIT(15);
    TIM8->egr = 1u;
    TIM8->cr1 = BIT(7) | 1u;
}

const char *peripherals_begin(void)
{
    uint16_t counts[CHANNELS + 1u];
    int crystal = clock_begin();
    unsigned pin;
    RCC->ahb1enr |= BIT(1) | BIT(2);                                    /* ports B and C */
    RCC->apb1enr |= BIT(2) | BIT(18);                                   /* TIM4, USART3 */
    RCC->apb2enr |= BIT(1) | BIT(8);                                    /* TIM8, ADC1 */
    (void)RCC->apb2enr;
    for (pin = 0; pin < CHANNELS; pin++) {
        pin_mode(GPIOC, pin, ANALOGUE);
    }
    GPIOC->pupdr |= (2ul << (2u * PIN_VALVE)) | (2ul << (2u * PIN_MOTOR)); /* down */
    GPIOB->pupdr = (GPIOB->pupdr & ~((3ul << (2u * PIN_A)) | (3ul << (2u * PIN_B)) | (3ul << (2u * PIN_RX)))) |
                   (1ul << (2u * PIN_A)) | (1ul << (2u * PIN_B)) | (1ul << (2u * PIN_RX)); /* up */
    pin_function(GPIOB, PIN_A, 2u);
    pin_function(GPIOB, PIN_B, 2u);
    pin_function(GPIOB, PIN_TX, 7u);
    pin_function(GPIOB, PIN_RX, 7u);
    encoder_begin();
    converter_begin();
    pwm_begin();
    if (!crystal) {
        return "crystal does not oscillate";
    }
    converter_start();
    if (!wait_for(&ADC1->sr, BIT(2), BIT(2))) {
        return "converter does not come to an end";
    }
    converter_read(counts);
    if (counts[CHANNELS] < REFERENCE_LEAST || counts[CHANNELS] > REFERENCE_MOST) {
        return "supply is not 3.3 V";
    }
    if (GPIOC->idr & (BIT(PIN_VALVE) | BIT(PIN_MOTOR))) {
        return "valve or motor is not low";
    }
    return 0;
}

void outputs_begin(void)
{
    GPIOC->bsrr = BIT(PIN_LAMP);
    GPIOB->bsrr = BIT(PIN_ALIVE + 16u) | BIT(PIN_SHUT + 16u);
    pin_mode(GPIOC, PIN_LAMP, OUTPUT);
    pin_mode(GPIOB, PIN_ALIVE, OUTPUT);
    pin_mode(GPIOB, PIN_SHUT, OUTPUT);
    pin_function(GPIOC, PIN_VALVE, 3u);
    pin_function(GPIOC, PIN_MOTOR, 3u);
    IWDG->kr = 0xCCCCu; /* on, until the power goes */
    IWDG->kr = 0x5555u;
    IWDG->pr = 0;       /* 32 kHz by four; 17 to 47 kHz */
    IWDG->rlr = 119u;
    IWDG->kr = 0xAAAAu;
}

void sampling_begin(uint32_t period)
{
    (void)period;
    encoder_before = (uint16_t)TIM4->cnt;
    edges = 0;
}

/* Less than 32768 edges come in a period. */
void converter_start(void)
{
    uint16_t count = (uint16_t)TIM4->cnt;
    ADC1->sr = 0;
    ADC1->cr2 = BIT(22) | BIT(0); /* JSWSTART */
    edges += (int16_t)(uint16_t)(count - encoder_before);
    encoder_before = count;
}

int converter_ready(void)
{
    return (ADC1->sr & BIT(2)) != 0; /* JEOC */
}

void converter_read(uint16_t counts[CHANNELS + 1u])
{
    unsigned i;
    for (i = 0; i <= CHANNELS; i++) {
        counts[i] = (uint16_t)ADC1->jdr[i];
    }
}

int32_t encoder_latched(void)
{
    return edges;
}

void outputs_write(uint16_t valve, uint16_t motor, int opened)
{
    TIM8->ccr[2] = valve;
    TIM8->ccr[3] = motor;
    GPIOB->bsrr = opened ? BIT(PIN_SHUT + 16u) : BIT(PIN_SHUT);
}

void alive_toggle(void)
{
    GPIOB->bsrr = GPIOB->odr & BIT(PIN_ALIVE) ? BIT(PIN_ALIVE + 16u) : BIT(PIN_ALIVE);
}

void alive_stop(void)
{
    GPIOB->bsrr = BIT(PIN_ALIVE + 16u);
}

void lamp_write(int on)
{
    GPIOC->bsrr = on ? BIT(PIN_LAMP + 16u) : BIT(PIN_LAMP);
}

void watchdog_feed(void)
{
    IWDG->kr = 0xAAAAu;
}
