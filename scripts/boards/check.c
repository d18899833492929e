/* Runs a program on one tile for some ticks with frames from a generator, and prints a hash of all actuator
 * frames: equal on every machine. Also what a tick took, in cycles (AVR) or instructions (Cortex-M in QEMU
 * with -icount shift=0), and 0 elsewhere. scripts/boards/emulate compiles it for the host and for boards;
 * boards.h names the program. */
#include <stdint.h>

#include "boards.h"

enum { TICKS = 6, CELLS = TILE_ROWS * TILE_COLUMNS };

static TILE_STATE state;
static uint32_t seed = 1, hash = 2166136261UL;

static uint32_t next_number(void) {
  seed = seed * 1664525UL + 1013904223UL;
  return seed >> 16;
}

/* Hits are 0 or 1, other sensors multiples of 1/8 from -4 to 4. */
static void fill(float* frame, int is_hit) {
  int i;
  for (i = 0; i < CELLS; ++i) {
    const uint32_t number = next_number();
    frame[i] = is_hit ? (float)(number % 3 == 0) : (float)((int)(number % 65) - 32) * 0.125f;
  }
}

static void add_to_hash(const float* frame) {
  int i, k;
  for (i = 0; i < CELLS; ++i) {
    union {
      float value;
      uint32_t bits;
    } cell;
    cell.value = frame[i];
    if (cell.value != cell.value) cell.bits = 0x7FC00000UL;
    for (k = 0; k < 4; ++k) hash = (hash ^ ((cell.bits >> (8 * k)) & 255)) * 16777619UL;
  }
}

static void begin(void* context, TILE_STATE* s, uint32_t tick) {
  (void)context, (void)s, (void)tick;
#define FILL(member, is_hit) fill(s->member, is_hit);
  SENSORS(FILL)
#if USES_CLOCK
  {
    const double clock[3] = {(double)tick, (double)tick * 0.015625, 0.015625};
    SET_CLOCK(s, clock)
  }
#endif
}

static void end(void* context, TILE_STATE* s, uint32_t tick) {
  (void)context, (void)tick;
#define ADD(member) add_to_hash(s->member);
  ACTUATORS(ADD)
}

static int send_edge(void* context, int side, uint16_t round, const uint8_t* bytes, uint16_t count) {
  (void)context, (void)side, (void)round, (void)bytes, (void)count;
  return TILE_GIVEN_UP;
}
static int receive_edge(void* context, int side, uint16_t round, uint8_t* bytes, uint16_t count) {
  (void)context, (void)side, (void)round, (void)bytes, (void)count;
  return TILE_GIVEN_UP;
}

/* ---- the machine: a console, and a count of what has run ---- */

#if defined(__AVR__)
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

static void print(const char* text) {
  UCSR0B = 1 << TXEN0;
  for (; *text != 0; ++text) {
    while ((UCSR0A & (1 << UDRE0)) == 0) continue;
    UDR0 = (uint8_t)*text;
  }
}
static void start_count(void) {
  TCCR1B = 0;
  TCNT1 = 0;
  TCCR1B = (1 << CS11) | (1 << CS10); /* every 64 cycles */
}
static uint32_t count(void) { return (uint32_t)TCNT1 * 64; }
static void stop(void) {
  cli();
  sleep_enable();
  sleep_cpu();
}
#elif defined(__ARM_ARCH)
static void call_host(int what, const void* with) {
  register int r0 __asm__("r0") = what;
  register const void* r1 __asm__("r1") = with;
  __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}
static void print(const char* text) { call_host(4, text); }
#define SYSTICK ((volatile uint32_t*)0xE000E010UL)
static void start_count(void) {
  SYSTICK[1] = 0xFFFFFF;
  SYSTICK[2] = 0;
  SYSTICK[0] = 5;
}
/* The processor clock of the MPS2 has 25 MHz. */
static uint32_t count(void) { return (0xFFFFFF - SYSTICK[2]) * 40; }
static void stop(void) { call_host(0x18, (const void*)0x20026UL); }

int main(void);
static void reset(void) {
  *(volatile uint32_t*)0xE000ED88UL |= 0xFUL << 20; /* the FPU */
  __asm__ volatile("dsb\n isb");
  main();
}
__attribute__((section(".vectors"), used)) static const void* const vectors[2] = {(const void*)0x20400000UL,
                                                                                  (const void*)reset};
void* memset(void* to, int value, __SIZE_TYPE__ bytes) {
  unsigned char* at = to;
  while (bytes-- > 0) *at++ = (unsigned char)value;
  return to;
}
void* memcpy(void* to, const void* from, __SIZE_TYPE__ bytes) {
  unsigned char* at = to;
  const unsigned char* of = from;
  while (bytes-- > 0) *at++ = *of++;
  return to;
}
#else
#include <stdio.h>
static void print(const char* text) { fputs(text, stdout); }
static void start_count(void) {}
static uint32_t count(void) { return 0; }
static void stop(void) {}
#endif

static void print_number(uint32_t value) {
  char text[10];
  int i;
  for (i = 7; i >= 0; --i, value >>= 4) text[i] = "0123456789abcdef"[value & 15];
  text[8] = ' ';
  text[9] = 0;
  print(text);
}

int main(void) {
  const TILE_LINKS links = {0, begin, send_edge, receive_edge, end};
  int ticks = 0, status = TILE_DONE;
  uint32_t longest = 0;
  const int ready = TILE_INIT(&state, &links, 0, 0, TILE_ROWS, TILE_COLUMNS);
  while (ready == TILE_OK && ticks < TICKS && status == TILE_DONE) {
    start_count();
    status = TILE_RUN(&state);
    if (ticks++ > 0 && count() > longest) longest = count(); /* the first tick prepares the program */
  }
  print_number(ready == TILE_OK ? hash : 0);
  print_number(longest);
  print("\n");
  stop();
  return 0;
}
