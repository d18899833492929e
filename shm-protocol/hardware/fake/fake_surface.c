/* Fake hardware: the surface role in plain C, using only the C interface, without physics. For testing
 * controllers, and as a template for hardware drivers. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <getopt.h>
#include <shm_protocol/shm_protocol.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "toy.h"

enum { kDone = 0, kFailed = 1, kWrongInput = 2 };

static const char kUsage[] =
    "usage: fake_surface [--shm NAME] [--size COLUMNSxROWS] [--period-ms N] [--mode time-step|passive] "
    "[--ticks N]\n"
    "A surface without physics: discs drift over its proximity sensors, and its pins follow their targets "
    "slowly.\n"
    "  --shm NAME       name for controllers to attach to [surface]\n"
    "  --size WxH       cells, 1 to 4096 each way [64x64]\n"
    "  --period-ms N    control period; time-step does not wait for it [16]\n"
    "  --mode MODE      time-step (waits for each answer) or passive (runs by the clock) [time-step]\n"
    "  --ticks N        end after N periods [never]\n"
    "  --without        run without a controller instead of waiting for one\n"
    "Exit status: 0 done; 1 failed; 2 wrong input; 128 + n after signal n.\n";

typedef struct Options {
  const char* name;
  uint32_t rows, columns, period_ms, mode;
  uint64_t ticks; /* 0: unlimited */
  int without;
} Options;

static ssp_stop* stop;
static volatile sig_atomic_t stop_signal;

/* A supervisor signals the process and its group: signals within half a second are one request. A later one
 * ends the process at once. */
static void on_signal(int number) {
  static struct timespec first;
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (stop_signal) {
    const int64_t elapsed_ns =
        (int64_t)(now.tv_sec - first.tv_sec) * 1000000000 + now.tv_nsec - first.tv_nsec;
    if (elapsed_ns >= 500000000) _exit(128 + number);
    return;
  }
  first = now;
  stop_signal = number;
  ssp_stop_raise(stop);
}

static int complain(int status, const char* what) {
  fprintf(stderr, "fake_surface: error: %s\n", what);
  return status;
}

static int whole_number(const char* text, uint64_t least, uint64_t most, uint64_t* value) {
  char* end = NULL;
  errno = 0;
  *value = strtoull(text, &end, 10);
  return errno == 0 && end != text && *end == '\0' && text[0] != '-' && *value >= least && *value <= most;
}

static int parse_size(const char* text, Options* o) {
  char tail;
  unsigned columns, rows;
  if (sscanf(text, "%4ux%4u%c", &columns, &rows, &tail) != 2) return 0;
  o->columns = columns;
  o->rows = rows;
  return columns >= 1 && columns <= 4096 && rows >= 1 && rows <= 4096;
}

static int parse(int argc, char** argv, Options* o) {
  static const struct option known[] = {
      {"shm", 1, NULL, 's'},   {"size", 1, NULL, 'z'},    {"period-ms", 1, NULL, 'p'}, {"mode", 1, NULL, 'm'},
      {"ticks", 1, NULL, 't'}, {"without", 0, NULL, 'w'}, {"help", 0, NULL, 'h'},      {NULL, 0, NULL, 0}};
  uint64_t number;
  int flag;
  while ((flag = getopt_long(argc, argv, "h", known, NULL)) != -1) {
    switch (flag) {
      case 's':
        o->name = optarg;
        break;
      case 'z':
        if (!parse_size(optarg, o)) return complain(kWrongInput, "--size takes WIDTHxHEIGHT, such as 64x64");
        break;
      case 'p':
        if (!whole_number(optarg, 1, 60000, &number))
          return complain(kWrongInput, "--period-ms takes 1 to 60000");
        o->period_ms = (uint32_t)number;
        break;
      case 'm':
        if (strcmp(optarg, "time-step") != 0 && strcmp(optarg, "passive") != 0)
          return complain(kWrongInput, "--mode takes time-step or passive");
        o->mode = optarg[0] == 't' ? SSP_MODE_TIME_STEP : SSP_MODE_PASSIVE;
        break;
      case 't':
        if (!whole_number(optarg, 1, UINT64_MAX, &o->ticks))
          return complain(kWrongInput, "--ticks takes a whole number");
        break;
      case 'w':
        o->without = 1;
        break;
      case 'h':
        fputs(kUsage, stdout);
        exit(fflush(stdout) == 0 ? kDone : kFailed);
      default:
        return kWrongInput;
    }
  }
  return optind == argc ? kDone : complain(kWrongInput, "there are flags only; see --help");
}

/* ---- surface ---- */

enum { kDistance, kHit, kPin, kHeight, kChannels };

static const ssp_channel_spec kSpecs[kChannels] = {
    {.name = "proximity_distance",
     .unit = "u",
     .direction = SSP_SENSOR,
     .dtype = SSP_F32,
     .maximum = TOY_RANGE},
    {.name = "proximity_hit", .direction = SSP_SENSOR, .dtype = SSP_F32, .maximum = 1.0},
    {.name = "pin_height", .unit = "u", .direction = SSP_SENSOR, .dtype = SSP_F32, .maximum = TOY_HIGHEST},
    {.name = "height", .unit = "u", .direction = SSP_ACTUATOR, .dtype = SSP_F32, .maximum = TOY_HIGHEST}};

typedef struct Table {
  Options o;
  ssp_surface* surface;
  float* pins; /* rows × columns */
} Table;

static void sense(Table* t, uint64_t tick) {
  float* distance = ssp_surface_sensor(t->surface, kDistance, NULL);
  float* hit = ssp_surface_sensor(t->surface, kHit, NULL);
  float* pin = ssp_surface_sensor(t->surface, kPin, NULL);
  size_t cell = 0;
  for (uint32_t row = 0; row < t->o.rows; ++row)
    for (uint32_t column = 0; column < t->o.columns; ++column, ++cell) {
      const int covered = toy_hit(t->o.rows, t->o.columns, tick, row, column);
      hit[cell] = covered ? 1.0f : 0.0f;
      distance[cell] = covered ? 0.5f : TOY_RANGE;
      pin[cell] = t->pins[cell];
    }
}

static void move(Table* t) {
  const float* target = ssp_surface_actuator(t->surface, kHeight, NULL);
  const size_t cells = (size_t)t->o.rows * t->o.columns;
  for (size_t cell = 0; cell < cells; ++cell) t->pins[cell] = toy_follow(t->pins[cell], target[cell]);
}

/* Waits until the frame is answered or there is no controller. */
static ssp_result answer(Table* t, uint64_t tick) {
  for (;;) {
    const ssp_result r = ssp_surface_await(t->surface, tick, SSP_FOREVER, stop);
    if (r == SSP_TORN) continue;
    if (r == SSP_CONTROLLER_DEAD || r == SSP_CONTROLLER_CLOSED)
      fprintf(stderr, "fake_surface: %s\n", ssp_text(r));
    if (r != SSP_NO_CONTROLLER && r != SSP_CONTROLLER_DEAD && r != SSP_CONTROLLER_CLOSED) return r;
    if (t->o.without) return SSP_OK;
    const ssp_result come = ssp_surface_await_controller(t->surface, SSP_FOREVER, stop);
    if (come != SSP_OK) return come;
  }
}

static void sleep_until(const struct timespec* start, uint64_t after_ns) {
  struct timespec until = *start;
  until.tv_sec += (time_t)(after_ns / 1000000000u);
  until.tv_nsec += (long)(after_ns % 1000000000u);
  if (until.tv_nsec >= 1000000000L) {
    until.tv_nsec -= 1000000000L;
    ++until.tv_sec;
  }
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

static ssp_result run(Table* t) {
  const uint64_t period_ns = (uint64_t)t->o.period_ms * 1000000u;
  struct timespec start;
  ssp_result r = SSP_OK;
  if (!t->o.without) r = ssp_surface_await_controller(t->surface, SSP_FOREVER, stop);
  clock_gettime(CLOCK_MONOTONIC, &start);
  for (uint64_t tick = 0; r == SSP_OK && !stop_signal && (t->o.ticks == 0 || tick < t->o.ticks); ++tick) {
    sense(t, tick);
    r = ssp_surface_publish(t->surface, tick, (double)tick * (double)period_ns * 1e-9, 0);
    if (r != SSP_OK) break;
    if (t->o.mode == SSP_MODE_TIME_STEP) {
      r = answer(t, tick);
    } else {
      sleep_until(&start, (tick + 1) * period_ns);
      ssp_surface_latest(t->surface); /* the result is irrelevant: the pins follow the frame in effect */
    }
    if (r == SSP_OK) move(t);
  }
  return r;
}

int main(int argc, char** argv) {
  Table t = {
      .o = {.name = "surface", .rows = 64, .columns = 64, .period_ms = 16, .mode = SSP_MODE_TIME_STEP}};
  const int wrong = parse(argc, argv, &t.o);
  if (wrong) return wrong;
  stop = ssp_stop_create();
  t.pins = calloc((size_t)t.o.rows * t.o.columns, sizeof *t.pins);
  if (!stop || !t.pins) return complain(kFailed, "there is not enough memory");
  struct sigaction action = {.sa_handler = on_signal};
  sigemptyset(&action.sa_mask);
  sigaddset(&action.sa_mask, SIGINT);
  sigaddset(&action.sa_mask, SIGTERM);
  sigaddset(&action.sa_mask, SIGHUP);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  sigaction(SIGHUP, &action, NULL);

  const ssp_surface_config config = {.name = t.o.name,
                                     .rows = t.o.rows,
                                     .columns = t.o.columns,
                                     .period_ns = (uint64_t)t.o.period_ms * 1000000u,
                                     .mode = t.o.mode,
                                     .channels = kSpecs,
                                     .channel_count = kChannels};
  ssp_result r = ssp_surface_create(&config, &t.surface);
  if (r != SSP_OK) return complain(r == SSP_E_SYSTEM ? kFailed : kWrongInput, ssp_last_error());
  fprintf(stderr, "fake_surface: waiting for controllers on '%s'\n", t.o.name);
  r = run(&t);
  ssp_surface_destroy(t.surface);
  ssp_stop_destroy(stop);
  free(t.pins);
  if (stop_signal) return 128 + stop_signal;
  return r == SSP_OK ? kDone : complain(kFailed, ssp_text(r));
}
