/* The byte protocol between a hardware surface and its host: packets, checksum and framing.
 *
 * Portable C99; needs memcpy and memmove, does not allocate, has no global state. Shared by the firmware and
 * the host's bridge. hardware/BYTE-PROTOCOL.md specifies every byte.
 */
#ifndef SSW_WIRE_H
#define SSW_WIRE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SSW_VERSION 1u   /* HELLO */
#define SSW_VERSION_2 2u /* HELLO2 */

/* A packet is type, sequence, tick, payload, CRC-32, followed by a zero byte. At most 254 bytes, so that COBS
 * adds exactly one byte. */
#define SSW_HEADER 6u
#define SSW_CRC 4u
#define SSW_MAX_PACKET 254u
#define SSW_MAX_PAYLOAD (SSW_MAX_PACKET - SSW_HEADER - SSW_CRC)
#define SSW_MAX_ENCODED (SSW_MAX_PACKET + 1u) /* without the zero bytes around it */

#define SSW_MAX_CHANNELS 8u
#define SSW_NONE UINT32_C(0xFFFFFFFF) /* no tick */

enum ssw_type {
  /* device to host */
  SSW_HELLO = 0x01,       /* describes the device */
  SSW_CHANNEL = 0x02,     /* describes one channel */
  SSW_SENSOR_DATA = 0x03, /* a chunk of a sensor frame */
  SSW_SENSOR_END = 0x04,  /* end of the frame */
  SSW_HELLO2 = 0x05,      /* version 2: describes the board */
  SSW_CHANNEL2 = 0x06,    /* describes one channel and its limits */
  SSW_CELLS = 0x07,       /* which cells exist, or where they are */
  SSW_CLOCK = 0x08,       /* answers SYNC */
  SSW_STATUS = 0x09,      /* emergency stop and counters */
  /* host to device */
  SSW_DESCRIBE = 0x11,      /* requests HELLO and all CHANNELs */
  SSW_START = 0x12,         /* start or continue sending sensor frames */
  SSW_ACTUATOR_DATA = 0x13, /* a chunk of an actuator frame */
  SSW_ACTUATOR_END = 0x14,  /* end of the frame: use it */
  SSW_STOP = 0x15,          /* stop sending and hold the safe values */
  SSW_DESCRIBE2 = 0x16,     /* version 2: requests HELLO2, CHANNEL2 and CELLS */
  SSW_SYNC = 0x17,          /* the table's tick, and a correction of the board's clock */
  SSW_STOP_NOW = 0x18,      /* emergency stop, until SSW_ARM */
  SSW_ARM = 0x19,           /* releases the emergency stop */
  /* both directions */
  SSW_HEARTBEAT = 0x20, /* liveness only */
  SSW_ERROR = 0x21,     /* a code and a text */
  /* board to board */
  SSW_EDGE = 0x30 /* reserved for programs that run on the boards */
};

enum ssw_direction { SSW_SENSOR = 1, SSW_ACTUATOR = 2 };
enum ssw_dtype { SSW_F32 = 1, SSW_U16 = 2, SSW_U8 = 3 };

/* Flags of SSW_SENSOR_END. */
#define SSW_MISSED 1u      /* the previous period ended without its actuator frame */
#define SSW_SAFE 2u        /* the device holds its safe values */
#define SSW_STOPPED 4u     /* an emergency stop is in effect */
#define SSW_LIMITED 8u     /* a limit held back an actuator in the previous period */
#define SSW_SOFT_START 16u /* the actuators approach their first targets at the soft-start speed */

/* Codes of SSW_ERROR. */
enum ssw_error { SSW_E_VERSION = 1, SSW_E_HARDWARE = 2 };

typedef struct ssw_packet {
  uint8_t type;
  uint8_t sequence; /* counts the sender's packets */
  uint32_t tick;
  const uint8_t* payload;
  size_t payload_bytes;
} ssw_packet;

/* CRC-32 (IEEE 802.3: reflected, polynomial EDB88320, initially and finally inverted). */
uint32_t ssw_crc32(const uint8_t* bytes, size_t count);

/* Consistent overhead byte stuffing. encode: `to` holds count + count / 254 + 1 bytes and must not overlap
 * `from`; returns the number of bytes written, none of which is zero. decode: `to` may equal `from`; returns
 * the number of bytes written, or 0 for invalid input. */
size_t ssw_cobs_encode(const uint8_t* from, size_t count, uint8_t* to);
size_t ssw_cobs_decode(const uint8_t* from, size_t count, uint8_t* to);

/* Little-endian on every processor. */
void ssw_put_u16(uint8_t* to, uint16_t value);
void ssw_put_u32(uint8_t* to, uint32_t value);
void ssw_put_f32(uint8_t* to, float value); /* IEEE 754 */
uint16_t ssw_get_u16(const uint8_t* from);
uint32_t ssw_get_u32(const uint8_t* from);
float ssw_get_f32(const uint8_t* from);

/* Writes the packet, framed by zero bytes, to `to`, which holds SSW_MAX_ENCODED + 2 bytes. Returns the number
 * of bytes written, or 0 if the payload is too long. */
size_t ssw_write(const ssw_packet* packet, uint8_t* to);

/* Finds packets in a noisy byte stream: the first complete packet after a zero byte is always found. */
typedef struct ssw_receiver {
  uint8_t bytes[SSW_MAX_ENCODED];
  size_t count;
  int overlong;     /* the run exceeds a packet and is discarded up to the next zero byte */
  uint32_t packets; /* valid packets */
  uint32_t damaged; /* runs of bytes between zeros that were not valid packets */
} ssw_receiver;

void ssw_receiver_init(ssw_receiver*);
/* Processes the next byte. Returns 1 if a packet is complete; it is valid until the next call. */
int ssw_receive(ssw_receiver*, uint8_t byte, ssw_packet*);

/* SSW_HELLO's payload. */
#define SSW_HELLO_BYTES 34u
typedef struct ssw_hello {
  uint8_t version, channels;
  uint16_t rows, columns;
  uint32_t period_us;
  float pitch;
  uint32_t boot; /* changes at every start of the device */
  char name[16]; /* NUL-padded; not terminated if it has 16 characters */
} ssw_hello;

/* SSW_CHANNEL's payload. value = offset + scale × raw; f32 channels have scale 1 and offset 0. */
#define SSW_CHANNEL_BYTES 72u
typedef struct ssw_channel {
  uint8_t index, direction, dtype, components;
  float minimum, maximum, safe; /* values, not raw */
  float scale, offset;
  char name[32]; /* NUL-padded */
  char unit[16];
} ssw_channel;

void ssw_put_hello(const ssw_hello*, uint8_t to[SSW_HELLO_BYTES]);
void ssw_put_channel(const ssw_channel*, uint8_t to[SSW_CHANNEL_BYTES]);
/* Returns 1 if the payload has the right length; the caller validates the contents. */
int ssw_get_hello(const ssw_packet*, ssw_hello*);
int ssw_get_channel(const ssw_packet*, ssw_channel*);

/* SSW_SENSOR_DATA and SSW_ACTUATOR_DATA: channel, zero, number of the first element (u32), elements. */
#define SSW_DATA_HEADER 6u
#define SSW_MAX_DATA (SSW_MAX_PAYLOAD - SSW_DATA_HEADER)
/* SSW_SENSOR_END: elements of the frame (u32), flags (u32), missed deadlines (u32), tick of the active frame
 * (u32). */
#define SSW_SENSOR_END_BYTES 16u
/* SSW_ACTUATOR_END: elements of the frame (u32). */
#define SSW_ACTUATOR_END_BYTES 4u

/* SSW_HELLO2's payload. */
#define SSW_HELLO2_BYTES 66u
typedef struct ssw_hello2 {
  ssw_hello hello;
  char id[16];           /* of this board, NUL-padded */
  uint32_t abilities;    /* below */
  uint32_t program_hash; /* of the program on the board; 0: none */
  uint16_t sense_delay_us, actuate_delay_us;
  uint8_t links;  /* to neighbours */
  uint16_t queue; /* bytes that the board queues for the host; 0: unknown */
} ssw_hello2;

/* Abilities of a board. */
#define SSW_CAN_SYNC 1u      /* follows SSW_SYNC and answers with SSW_CLOCK */
#define SSW_HAS_MASK 2u      /* describes with SSW_CELLS which cells exist */
#define SSW_HAS_POSITIONS 4u /* describes with SSW_CELLS where the cells are */

/* Limits of an actuator channel, in its unit. 0: no limit. */
typedef struct ssw_limits {
  float slew;           /* per second */
  float acceleration;   /* per second² */
  float soft_start;     /* speed after the safe values were in effect, per second */
  uint16_t most_moving; /* elements that may move in the same period */
} ssw_limits;

/* SSW_CHANNEL2's payload. */
#define SSW_CHANNEL2_BYTES 88u
typedef struct ssw_channel2 {
  ssw_channel channel;
  ssw_limits limits;
  uint16_t flags; /* below */
} ssw_channel2;

/* Flags of a channel: how components 0, 1 and 2 (east, north, up) change if the board is turned or mirrored.
 */
#define SSW_VECTOR 1u       /* a vector: force, slip */
#define SSW_AXIAL_VECTOR 2u /* an axial vector: torque, roll and pitch */

void ssw_put_hello2(const ssw_hello2*, uint8_t to[SSW_HELLO2_BYTES]);
void ssw_put_channel2(const ssw_channel2*, uint8_t to[SSW_CHANNEL2_BYTES]);
int ssw_get_hello2(const ssw_packet*, ssw_hello2*);
int ssw_get_channel2(const ssw_packet*, ssw_channel2*);

/* SSW_CELLS: number of the first cell (u16), kind (u8), zero, then one element per cell: a byte (1: the cell
 * exists) or x, y, z (f32, from the centre of the board's north-west cell, x east, y north). */
#define SSW_CELLS_HEADER 4u
enum ssw_cells_kind { SSW_MASK = 0, SSW_POSITIONS = 1 };

/* SSW_SYNC: times in µs, modulo 2^32. */
#define SSW_SYNC_BYTES 16u
#define SSW_KEEP INT32_MIN /* as correction: correction and rate remain as they are */
typedef struct ssw_sync {
  uint32_t t1;           /* the host's clock when it sent this packet */
  uint32_t table_tick;   /* of the period that the board is in */
  int32_t correction_us; /* by which the coming periods are to be longer, altogether */
  int32_t rate_ppb;      /* by which each period is to be longer, in 1e-9 of it */
} ssw_sync;
void ssw_put_sync(const ssw_sync*, uint8_t to[SSW_SYNC_BYTES]);
int ssw_get_sync(const ssw_packet*, ssw_sync*);

#define SSW_CLOCK_BYTES 20u
typedef struct ssw_clock {
  uint32_t t1;             /* as in the SSW_SYNC that this answers */
  uint32_t received, sent; /* the board's clock */
  uint32_t tick;           /* the board's period when it sent this packet */
  uint32_t into_us;        /* time since that period began */
} ssw_clock;
void ssw_put_clock(const ssw_clock*, uint8_t to[SSW_CLOCK_BYTES]);
int ssw_get_clock(const ssw_packet*, ssw_clock*);

/* SSW_STOP_NOW and SSW_ARM: the reason of the stop (u32, not 0). SSW_ARM releases a stop of the same reason
 * only, or, with SSW_NONE, any. */
#define SSW_STOP_NOW_BYTES 4u
enum ssw_stop_reason { SSW_STOP_BY_HOST = 1, SSW_STOP_BY_LINE = 2 };

#define SSW_STATUS_BYTES 20u
typedef struct ssw_status {
  uint32_t flags;       /* as in SSW_SENSOR_END */
  uint32_t stop_reason; /* 0: no emergency stop */
  uint32_t dropped;     /* sensor frames for which the queue had no room */
  uint32_t clamped;     /* values beyond the range, replaced */
  uint32_t limited;     /* elements that a limit held back, counted in each period */
} ssw_status;
void ssw_put_status(const ssw_status*, uint8_t to[SSW_STATUS_BYTES]);
int ssw_get_status(const ssw_packet*, ssw_status*);

size_t ssw_dtype_bytes(uint8_t dtype); /* 0: there is no such type */

/* The raw numbers of a u8 or u16 channel; u8 if dtype is another. */
typedef struct ssw_raw_range {
  float lowest,
      highest; /* raw numbers whose values lie in the channel's range; lowest > highest: none does */
} ssw_raw_range;
float ssw_most_raw(uint8_t dtype);
/* A limit that is a raw number but for the rounding of f32 is one. */
ssw_raw_range ssw_get_raw_range(const ssw_channel*);
/* By how many raw numbers the rounding of f32 may shift a value. */
float ssw_raw_error(const ssw_channel*, float value);

#ifdef __cplusplus
}
#endif

#endif
