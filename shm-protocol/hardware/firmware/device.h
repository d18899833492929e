/* The device's side of the byte protocol, for firmware driven by surface_bridge.
 *
 * Portable C99 on top of wire.h. Does not allocate: the firmware provides the memory of each channel. Not
 * reentrant: call it from one thread or interrupt level at a time.
 *
 *   static uint8_t hit[ROWS * COLUMNS], height[ROWS * COLUMNS], height_next[ROWS * COLUMNS];
 *   static ssd_channel channels[] = {
 *       {{.direction = SSW_SENSOR, .dtype = SSW_U8, .name = "proximity_hit", …}, hit, NULL},
 *       {{.direction = SSW_ACTUATOR, .dtype = SSW_U8, .name = "height", .scale = 0.02f, …}, height,
 *        height_next}};
 *   ssd_init(&device, &hello, channels, 2, uart_write, NULL);
 *   for (;;) {
 *     while (uart_has_byte()) ssd_receive(&device, uart_byte());
 *     if (period_is_over()) {     // the device's own clock
 *       read_sensors(hit);
 *       ssd_period(&device);      // height now holds the new targets
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

/* Number of periods without a valid packet from the host after which the safe values are applied. */
#define SSD_PATIENCE 16u

typedef struct ssd_channel {
  ssw_channel info; /* index is filled in by ssd_init */
  /* components × rows × columns elements of the dtype, one plane per component, row 0 north, in native byte
   * order. Sensors: sent by ssd_period. Actuators: the active values. */
  void* values;
  void* next; /* actuators: a buffer of the same size in which a frame is assembled; sensors: null */
} ssd_channel;

/* Sends all bytes to the host; may block. */
typedef void (*ssd_write)(void* context, const uint8_t* bytes, size_t count);

typedef struct ssd_device {
  ssw_hello hello;
  ssd_channel* channels;
  ssd_write write;
  void* context;
  ssw_receiver receiver;
  uint8_t sequence;
  int running;       /* SSW_START was seen */
  uint32_t tick;     /* of the last sensor frame sent */
  uint32_t in_force; /* tick that the active frame answers; SSW_NONE: the safe values */
  uint32_t missed;   /* missed deadlines */
  uint32_t silent;   /* periods without a valid packet */
  /* the actuator frame being received */
  uint32_t frame_tick; /* SSW_NONE: none */
  uint32_t frame_elements;
  uint32_t ready_tick; /* of the complete frame pending in `next` until the period ends; SSW_NONE: none */
} ssd_device;

/* Fills in version and channels of `hello`. Applies the safe values immediately. */
void ssd_init(ssd_device*, const ssw_hello* hello, ssd_channel* channels, uint8_t count, ssd_write,
              void* context);
/* Processes one byte from the host. */
void ssd_receive(ssd_device*, uint8_t byte);
/* Ends a control period: activates the actuator frame received during it, if complete, and sends the sensor
 * frame of the next period. */
void ssd_period(ssd_device*);
/* Reports a fault to the host, in at most 64 characters. */
void ssd_report(ssd_device*, const char* text);

#ifdef __cplusplus
}
#endif

#endif
