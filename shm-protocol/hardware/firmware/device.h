/* The device's side of the byte protocol, for firmware driven by surface_bridge.
 *
 * Portable C99 on top of wire.h. Does not allocate: the firmware provides the memory of each channel. Call it
 * from one thread or interrupt level, except ssd_watchdog and ssd_stop, which interrupts call: they write
 * nothing to the line and use no floating point, so that the safe values depend on nothing else.
 *
 *   static uint8_t hit[ROWS * COLUMNS], height[ROWS * COLUMNS], height_next[ROWS * COLUMNS];
 *   static ssd_channel channels[] = {
 *       {{.direction = SSW_SENSOR, .dtype = SSW_U8, .name = "proximity_hit", …}, hit, NULL},
 *       {{.direction = SSW_ACTUATOR, .dtype = SSW_U8, .name = "height", .scale = 0.02f, …}, height,
 *        height_next}};
 *   ssd_init(&device, &hello, channels, 2, uart_try_write, NULL);
 *   for (;;) {
 *     while (uart_has_byte()) ssd_receive(&device, uart_byte());
 *     if (period_is_over()) {     // the device's own clock
 *       read_sensors(hit);
 *       if (stop_line_is_pressed()) ssd_stop(&device, SSW_STOP_BY_LINE);
 *       ssd_period(&device);      // height now holds the new targets
 *       move_pins(height);
 *       start_period(ssd_period_us(&device));
 *     }
 *   }
 *   void timer_interrupt(void) {  // each millisecond
 *     if (ssd_watchdog(&device, 1000)) move_pins(height);
 *   }
 *   void stop_line_interrupt(void) { ssd_stop(&device, SSW_STOP_BY_LINE), move_pins(height); }
 */
#ifndef SSD_DEVICE_H
#define SSD_DEVICE_H

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Number of periods without a valid packet from the host after which the safe values are applied. */
#define SSD_PATIENCE 16u
/* Periods that an element may move at a stretch while others wait for their turn (ssw_limits.most_moving). */
#define SSD_TURN 16u

typedef struct ssd_channel {
  ssw_channel info; /* index is filled in by ssd_init */
  /* components × rows × columns elements of the dtype, one plane per component, row 0 north, in native byte
   * order. Sensors: sent by ssd_period. Actuators: the active values. */
  void* values;
  void* next; /* actuators: a buffer of the same size in which a frame is assembled; sensors: null */
} ssd_channel;

/* The motion of one element under limits, in raw units. */
typedef struct ssd_motion {
  float target, at, speed; /* speed: per period */
  uint8_t turn;            /* periods that it has moved at a stretch; 0: it does not move */
} ssd_motion;

/* Queues the whole packet for the host and returns 1, or, if the queue has no room, queues nothing and
 * returns 0. Must not wait. */
typedef int (*ssd_try_write)(void* context, const uint8_t* bytes, size_t count);
/* The device's clock in µs, modulo 2^32. */
typedef uint32_t (*ssd_micros)(void* context);

/* What the library keeps of a channel. */
typedef struct ssd_state {
  ssw_limits limits;
  ssd_motion* motion;    /* null: no limits */
  uint16_t flags;        /* SSW_VECTOR, SSW_AXIAL_VECTOR */
  uint8_t safe[4];       /* the safe value, in native byte order */
  float lowest, highest; /* raw */
  uint32_t cursor;       /* element that moves next */
  uint32_t soft_periods; /* that the soft start may still take */
} ssd_state;

typedef struct ssd_device {
  ssw_hello hello;
  ssw_hello2
      board; /* id, program_hash, delays, links, queue: set them after ssd_init; the rest is filled in */
  ssd_channel* channels;
  ssd_state state[SSW_MAX_CHANNELS];
  ssd_try_write write;
  ssd_micros micros;      /* null: the device cannot follow the table's clock */
  const uint8_t* mask;    /* null: all cells exist */
  const float* positions; /* x, y, z of each cell; null: a grid of the pitch */
  void* context;
  ssw_receiver receiver;
  uint8_t sequence;      /* of the next packet to the host */
  uint8_t last_received; /* sequence of the host's last packet */
  uint8_t has_sent;      /* a sensor frame, which a period without an answer leaves unanswered */
  int running;           /* SSW_START was seen */
  int version;           /* that the host speaks */
  uint32_t tick;         /* of the last sensor frame sent, if has_sent */
  uint32_t in_force;     /* tick that the active frame answers; SSW_NONE: the safe values */
  uint32_t missed;       /* missed deadlines */
  uint32_t silent;       /* periods without a valid packet */
  uint32_t dropped;      /* sensor frames for which the queue had no room */
  uint32_t clamped, limited;
  uint32_t flags; /* of the last sensor frame */
  /* the actuator frame being received */
  uint32_t frame_tick; /* SSW_NONE: none */
  uint32_t frame_elements;
  uint32_t ready_tick; /* of the complete frame pending in `next` until the period ends; SSW_NONE: none */
  /* shared with interrupts */
  volatile uint8_t fed;     /* a valid packet arrived since the last ssd_watchdog */
  volatile uint8_t tripped; /* an interrupt applied the safe values */
  volatile uint8_t stopped; /* an emergency stop is in effect */
  volatile uint32_t stop_reason;
  uint32_t quiet_us; /* since the last valid packet, as ssd_watchdog counts */
  uint8_t expired;   /* the watchdog has applied the safe values since the last valid packet */
  /* the table's clock */
  uint32_t period_started;                    /* at µs */
  uint32_t table_tick_offset;                 /* the table's tick − tick */
  int32_t correction_us, rate_ppb, remainder; /* remainder: of a µs, in 1e-9 */
} ssd_device;

/* Fills in version and channels of `hello`. Applies the safe values immediately. */
void ssd_init(ssd_device*, const ssw_hello* hello, ssd_channel* channels, uint8_t count, ssd_try_write,
              void* context);
/* Limits an actuator channel on the device. `motion`: one per element. Call after ssd_init. */
void ssd_limit(ssd_device*, uint8_t channel, const ssw_limits*, ssd_motion* motion);
/* Processes one byte from the host. */
void ssd_receive(ssd_device*, uint8_t byte);
/* Ends a control period: activates the actuator frame received during it, if complete, moves the actuators
 * that have limits, and sends the sensor frame of the next period, or drops it if the queue is full. */
void ssd_period(ssd_device*);
/* The length of the period that has begun, as the table's clock demands. Call once after each ssd_period. */
uint32_t ssd_period_us(ssd_device*);
/* The table's tick of the current period; the device's own until the host has sent SSW_SYNC. */
uint32_t ssd_table_tick(const ssd_device*);
/* Counts time without a valid packet from the host. Returns 1 if it has applied the safe values. For a timer
 * interrupt. */
int ssd_watchdog(ssd_device*, uint32_t elapsed_us);
/* Emergency stop: applies the safe values, which stay until the host sends SSW_ARM. For a line's interrupt,
 * and before each ssd_period while the line is pressed: an edge tells nothing at power-up and after SSW_ARM.
 */
void ssd_stop(ssd_device*, uint32_t reason);
/* Reports a fault to the host, in at most 64 characters. */
void ssd_report(ssd_device*, const char* text);

#ifdef __cplusplus
}
#endif

#endif
