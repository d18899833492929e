/* Runs servo_board.c on an ATmega2560 in simavr, in real time, behind a pseudo-terminal whose name it prints.
 *
 *   servo_board_simavr board.elf [pressed]
 *
 * The load cells feel the pins: cell i gets 20 mV for each raw height of its servo's pulse (1 ms: 0, 4 us
 * each), and 100 mV if there is no pulse. SIGUSR1 presses the button of the stop line, which "pressed" does
 * before power-up, and SIGUSR2 releases it. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
/* simavr's */
#include <avr_adc.h>
#include <avr_extint.h>
#include <avr_ioport.h>
#include <parts/uart_pty.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define CELLS 8

static avr_cycle_count_t rose[CELLS];
static avr_irq_t* adc;
static volatile sig_atomic_t pressed;

static void on_signal(int number) { pressed = number == SIGUSR1; }

static void drive_stop_line(avr_t* avr, int is_high) {
  avr_ioport_external_t external = {.name = 'E', .mask = 1 << 4, .value = (unsigned)is_high << 4};
  avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('E'), &external); /* stronger than the pull-up */
  avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('E'), 4), (uint32_t)is_high);
}

static void on_pin(struct avr_irq_t* irq, uint32_t value, void* param) {
  avr_t* avr = param;
  const uint32_t i = irq->irq;
  if (value) {
    rose[i] = avr->cycle;
    return;
  }
  const double us = (double)(avr->cycle - rose[i]) / 16.0;
  const double mv = (us - 1000.0) / 4.0 * 20.0;
  avr_raise_irq(adc + ADC_IRQ_ADC0 + i, mv > 0 ? (uint32_t)(mv + 0.5) : 0);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char** argv) {
  elf_firmware_t firmware;
  static uart_pty_t line;
  pressed = argc == 3 && strcmp(argv[2], "pressed") == 0;
  if (argc != 2 + pressed) return fprintf(stderr, "usage: servo_board_simavr board.elf [pressed]\n"), 2;
  memset(&firmware, 0, sizeof firmware);
  if (elf_read_firmware(argv[1], &firmware) != 0) return fprintf(stderr, "cannot read %s\n", argv[1]), 2;
  avr_t* avr = avr_make_mcu_by_name("atmega2560");
  if (!avr) return fprintf(stderr, "simavr has no atmega2560\n"), 1;
  avr_init(avr);
  avr->frequency = 16000000;
  avr_load_firmware(avr, &firmware);
  avr->vcc = avr->avcc = avr->aref = 5000;
  adc = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, 0);
  for (int i = 0; i < CELLS; ++i) {
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('A'), i), on_pin, avr);
    avr_raise_irq(adc + ADC_IRQ_ADC0 + i, 100);
  }
  avr_extint_set_strict_lvl_trig(avr, 4, 0); /* else a low line stands still before its edge is chosen */
  drive_stop_line(avr, !pressed);
  signal(SIGUSR1, on_signal);
  signal(SIGUSR2, on_signal);
  uart_pty_init(avr, &line);
  uart_pty_connect(&line, '0');
  printf("device %s\n", line.pty.slavename);
  fflush(stdout);
  int is_low = pressed;
  const double start = now();
  for (avr_cycle_count_t next = 0;;) {
    const int state = avr_run(avr);
    if (state == cpu_Done || state == cpu_Crashed) return fprintf(stderr, "the program ended\n"), 1;
    if (avr->cycle < next) continue;
    next = avr->cycle + 8000; /* 0.5 ms */
    if (is_low != pressed) drive_stop_line(avr, !(is_low = pressed));
    const double ahead = (double)avr->cycle / 16e6 - (now() - start);
    if (ahead > 0) nanosleep(&(struct timespec){0, (long)(1e9 * (ahead < 0.01 ? ahead : 0.01))}, NULL);
  }
}
