/* A board of 2 x 4 cells for an ATmega2560 (Arduino Mega): eight hobby servos lift pins, eight load cells
 * with amplifiers feel what stands on them. docs/hardware.md has the wiring.
 *
 *   avr-gcc -mmcu=atmega2560 -DF_CPU=16000000UL -Os -std=gnu99 -I. servo_board.c device.c wire.c -o board.elf
 *
 * Timer 1 makes the pulses of the servos, one after the other within 20 ms, which is the control period.
 * Timer 0 counts milliseconds and runs the watchdog. Interrupts serve the line; the main loop waits only for
 * the load cells, 0.8 ms in each period. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "device.h"

#define ROWS 2
#define COLUMNS 4
#define CELLS (ROWS * COLUMNS)
#define PERIOD_US 20000UL
#define TICKS_PER_US (F_CPU / 8 / 1000000UL) /* of timer 1 */
#define HIGHEST 20.0f                        /* mm, at the longest pulse */
#define SHORTEST_US 1000U                    /* pulse at height 0 */
#define US_PER_RAW 4U                        /* raw heights are 0 to 250: pulses of 1 to 2 ms */
#define BAUD 115200UL

static uint8_t height[CELLS], height_next[CELLS];
static uint16_t force[CELLS];
static ssd_motion motion[CELLS];
// clang-format off
static ssd_channel channels[] = {
    {{.direction = SSW_SENSOR, .dtype = SSW_U16, .components = 1, .maximum = 20.46f, .scale = 0.02f,
      .name = "force", .unit = "N"}, force, 0},
    {{.direction = SSW_ACTUATOR, .dtype = SSW_U8, .components = 1, .maximum = HIGHEST, .scale = 0.08f,
      .name = "height", .unit = "mm"}, height, height_next}};
// clang-format on
static ssd_device device;

/* ---- the line: rings of bytes; indices wrap at 256 or 512 ---- */

static volatile uint8_t received[256], queued[512];
static volatile uint8_t received_in, received_out;
static volatile uint16_t queued_in, queued_out;

ISR(USART0_RX_vect) {
  const uint8_t byte = UDR0;
  if ((uint8_t)(received_in + 1) == received_out) return; /* full: a packet is lost, and its CRC tells */
  received[received_in] = byte;
  ++received_in;
}

ISR(USART0_UDRE_vect) {
  if (queued_out == queued_in) {
    UCSR0B &= (uint8_t)~_BV(UDRIE0);
    return;
  }
  UDR0 = queued[queued_out];
  queued_out = (queued_out + 1) % sizeof queued;
}

static int try_write(void* context, const uint8_t* bytes, size_t count) {
  uint16_t used, in = queued_in;
  size_t i;
  (void)context;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { used = (uint16_t)(in - queued_out) % sizeof queued; }
  if (used + count >= sizeof queued) return 0;
  for (i = 0; i < count; ++i, in = (in + 1) % sizeof queued) queued[in] = bytes[i];
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    queued_in = in;
    UCSR0B |= _BV(UDRIE0);
  }
  return 1;
}

static void start_line(void) {
  UCSR0A = _BV(U2X0);
  UBRR0 = (uint16_t)((F_CPU / 4 / BAUD - 1) / 2);
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

/* ---- servos: on PA0 to PA7, in the order of the cells ---- */

static volatile uint16_t pulse[CELLS]; /* ticks of timer 1; 0: no pulse, the servo has no power */
static volatile uint8_t period_over;
static uint16_t period_ticks = PERIOD_US * TICKS_PER_US;
static volatile uint8_t powered; /* servos have no power before the first frame */

/* A compare match ends a pulse and begins the next one; after the last, the rest of the period passes. */
ISR(TIMER1_COMPA_vect) {
  static uint8_t servo;
  static uint16_t passed;
  uint16_t wait;
  if (servo < CELLS) {
    wait = pulse[servo] ? pulse[servo] : SHORTEST_US * TICKS_PER_US;
    PORTA = pulse[servo] ? (uint8_t)(1 << servo) : 0;
    passed += wait;
    ++servo;
  } else {
    PORTA = 0;
    wait = period_ticks - passed;
    passed = 0;
    servo = 0;
    period_over = 1;
  }
  OCR1A += wait;
}

/* Pulses follow the active heights. Also called by interrupts. */
static void move_pins(void) {
  uint8_t i;
  for (i = 0; powered && i < CELLS; ++i) {
    const uint16_t us = SHORTEST_US + US_PER_RAW * height[i];
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { pulse[i] = us * TICKS_PER_US; }
  }
}

/* ---- time, watchdog, emergency stop ---- */

static volatile uint32_t milliseconds;

ISR(TIMER0_COMPA_vect) {
  ++milliseconds;
  if (ssd_watchdog(&device, 1000)) move_pins();
}

/* PE4 (pin 2), pulled up: a button that closes to ground. The edge stops at once. The main loop reads the
 * level, which counts at power-up and after SSW_ARM. */
ISR(INT4_vect) {
  ssd_stop(&device, SSW_STOP_BY_LINE);
  move_pins();
}

static uint32_t micros(void* context) {
  uint32_t ms;
  uint8_t count, pending;
  (void)context;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    ms = milliseconds;
    count = TCNT0;
    pending = TIFR0 & _BV(OCF0A);
  }
  if (pending && count < 125) ++ms; /* the interrupt has not run yet */
  return 1000 * ms + 4UL * count;
}

static void start_timers(void) {
  TCCR0A = _BV(WGM01); /* 16 MHz / 64 / 250 = 1 kHz */
  OCR0A = 249;
  TIMSK0 = _BV(OCIE0A);
  TCCR0B = _BV(CS01) | _BV(CS00);
  OCR1A = 1000;
  TIMSK1 = _BV(OCIE1A);
  TCCR1B = _BV(CS11); /* 2 MHz, free-running */
  PORTE |= _BV(PE4);
  EICRB = _BV(ISC41); /* falling edge */
  EIMSK = _BV(INT4);
}

/* ---- load cells: on A0 to A7, 0 to 5 V ---- */

static void read_forces(void) {
  uint8_t i;
  for (i = 0; i < CELLS; ++i) {
    ADMUX = _BV(REFS0) | i;
    ADCSRA |= _BV(ADSC);
    while (ADCSRA & _BV(ADSC)) { /* 104 µs */
    }
    force[i] = ADC;
  }
}

int main(void) {
  static const ssw_limits limits = {100.0f, 0.0f, 10.0f, 0}; /* mm/s; soft start at 10 mm/s */
  ssw_hello hello = {
      .rows = ROWS, .columns = COLUMNS, .period_us = PERIOD_US, .pitch = 30.0f, .name = "servo board"};
  DDRA = 0xFF;
  ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
  read_forces();
  hello.boot = 1UL + force[0] + 1024UL * force[1]; /* the lowest bits of the amplifiers are noise */
  ssd_init(&device, &hello, channels, 2, try_write, 0);
  device.micros = micros;
  device.board.queue = sizeof queued;
  ssd_limit(&device, 1, &limits, motion);
  start_line();
  start_timers();
  sei();
  for (;;) {
    while (received_out != received_in) ssd_receive(&device, received[received_out++]);
    if (!period_over) continue;
    period_over = 0;
    read_forces();
    if (!(PINE & _BV(PE4))) ssd_stop(&device, SSW_STOP_BY_LINE);
    ssd_period(&device);
    if (device.in_force != SSW_NONE) powered = 1;
    move_pins();
    period_ticks = (uint16_t)(ssd_period_us(&device) * TICKS_PER_US);
  }
}
