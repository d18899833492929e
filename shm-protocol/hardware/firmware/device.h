/* The device's side of the byte protocol: what a firmware needs to be driven by surface_bridge.
 *
 * Portable C99 on top of wire.h; allocates nothing: the memory for each channel is the firmware's own. One
 * interrupt level or thread at a time may be in here.
 *
 *   static uint8_t hit[ROWS * COLUMNS], height[ROWS * COLUMNS], height_next[ROWS * COLUMNS];
 *   static ssd_channel channels[] = {
 *       {{.direction = SSW_SENSOR, .dtype = SSW_U8, .name = "proximity_hit", …}, hit, NULL},
 *       {{.direction = SSW_ACTUATOR, .dtype = SSW_U8, .name = "height", .scale = 0.02f, …}, height,
 * height_next}}; ssd_init(&device, &hello, channels, 2, uart_write, NULL); for (;;) { while (uart_has_byte())
 * ssd_receive(&device, uart_byte()); if (period_is_over()) {     // the device's own clock read_sensors(hit);
 *       ssd_period(&device);      // height is now what the pins have to go to
 *       move_pins(height);
 *     }
 *   }
 */
#ifndef SSD_DEVICE_H
#define SSD_DEVICE_H

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* After so many periods without any good packet of the host the safe values are taken. */
#define SSD_PATIENCE 16u

typedef struct ssd_channel {
  ssw_channel info; /* index is filled in by ssd_init */
  /* rows × columns × components elements of the dtype, each component a whole plane, row 0 north, in the
   * processor's own byte order. Sensors: what ssd_period sends. Actuators: the values in force. */
  void* values;
  void* next; /* actuators: as much again, where a frame is put together; sensors: null */
} ssd_channel;

/* Sends bytes to the host, all of them; it may wait. */
typedef void (*ssd_write)(void* context, const uint8_t* bytes, size_t count);

typedef struct ssd_device {
  ssw_hello hello;
  ssd_channel* channels;
  ssd_write write;
  void* context;
  ssw_receiver receiver;
  uint8_t sequence;
  int running;       /* SSW_START was seen */
  uint32_t tick;     /* of the sensor frame sent last */
  uint32_t in_force; /* tick that the frame in force answers; SSW_NONE: the safe values */
  uint32_t missed;   /* deadlines */
  uint32_t silent;   /* periods without a good packet */
  /* the actuator frame under way */
  uint32_t frame_tick; /* SSW_NONE: none */
  uint32_t frame_elements;
  uint32_t ready_tick; /* of the whole frame that waits in `next` for the end of the period; SSW_NONE: none */
} ssd_device;

/* `hello` without version and channels, which are filled in. The safe values are taken at once. */
void ssd_init(ssd_device*, const ssw_hello* hello, ssd_channel* channels, uint8_t count, ssd_write,
              void* context);
/* Takes a byte from the host. */
void ssd_receive(ssd_device*, uint8_t byte);
/* Ends a control period: the actuator frame that came during it, if one came whole, is put in force; then the
 * sensor frame of the next period is sent. */
void ssd_period(ssd_device*);
/* Tells the host of a fault, in at most 64 characters. */
void ssd_report(ssd_device*, const char* text);

#ifdef __cplusplus
}
#endif

#endif
