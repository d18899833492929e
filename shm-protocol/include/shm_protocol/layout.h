/* The byte layout of a surface's shared-memory segment: the contract between a surface and a controller.
 *
 * C11 and C++. All fields are little-endian, fixed-width and naturally aligned; there are no pointers.
 * PROTOCOL.md specifies the meaning, the writer and the write order of each field; the offsets asserted below
 * match its byte map. Words that both processes access while running are accessed atomically.
 */
#ifndef SHM_PROTOCOL_LAYOUT_H
#define SHM_PROTOCOL_LAYOUT_H

#include <stddef.h>
#include <stdint.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error \
    "the layout is little-endian; a big-endian machine needs byte swaps that this implementation does not do"
#endif

#ifdef __cplusplus
#define SSP_ASSERT(condition) static_assert(condition, #condition)
extern "C" {
#else
#define SSP_ASSERT(condition) _Static_assert(condition, #condition)
#endif

/* "SMRTSURF" as eight bytes in memory. */
#define SSP_MAGIC UINT64_C(0x4652555354524D53)

#define SSP_VERSION_MAJOR 2u
#define SSP_VERSION_MINOR 0u
#define SSP_VERSION ((SSP_VERSION_MAJOR << 16) | SSP_VERSION_MINOR)

#define SSP_LINE 128u /* bytes with one writer: two cache lines, because prefetchers load them in pairs */
#define SSP_ARRAY_ALIGNMENT 64u /* alignment of each channel's array within a slot */
#define SSP_MAX_CHANNELS 32u
#define SSP_MIN_SLOTS 4u
#define SSP_MAX_SLOTS 64u
#define SSP_TIME_STEP_SLOTS 2u /* slots used in time-step mode: frame n is in slot n mod 2 */
#define SSP_CPU_UNKNOWN UINT32_C(0xFFFFFFFF)

/* A process word identifies a process even after its pid is reused: (start time << 22) | pid, where the start
 * time is field 22 of /proc/PID/stat (clock ticks since boot). 0 is "no process". A single word allows a
 * claim by one compare-and-swap. */
#define SSP_PID_BITS 22u

enum ssp_mode { SSP_MODE_TIME_STEP = 1, SSP_MODE_PASSIVE = 2 };

enum ssp_state {
  SSP_STATE_NONE = 0,
  SSP_STATE_LOADING = 1,
  SSP_STATE_READY = 2,
  SSP_STATE_RUNNING = 3,
  SSP_STATE_PAUSED = 4,
  SSP_STATE_CLOSING = 5,
  SSP_STATE_DEAD = 6 /* inferred by a peer from the process word, or stored by it; never by the owner */
};

enum ssp_direction { SSP_SENSOR = 1, SSP_ACTUATOR = 2 };
enum ssp_dtype { SSP_F32 = 1, SSP_U32 = 2, SSP_U8 = 3 };

/* Line 0. Written once by the surface. The fields magic to surface_process keep their offset and meaning in
 * every future version, so that any program can identify the owner of a segment. */
typedef struct ssp_identity {
  uint64_t magic;
  uint32_t version; /* stored last: nonzero is the ready signal */
  uint32_t header_bytes;
  uint64_t segment_bytes;
  uint64_t surface_process;
  uint64_t session; /* random, nonzero: distinguishes runs under the same name */
  uint64_t layout_hash;
  uint64_t dt_ns; /* control period */
  uint32_t mode;
  uint32_t reserved0;
  char name[64]; /* NUL-terminated */
} ssp_identity;

/* Line 1. Written once by the surface; covered by layout_hash. */
typedef struct ssp_geometry {
  uint32_t rows;
  uint32_t columns;
  double pitch;
  uint32_t channel_count;
  uint32_t channel_bytes; /* stride of the channel directory */
  uint64_t channels_offset;
  uint32_t sensor_slots; /* a power of two */
  uint32_t actuator_slots;
  uint64_t sensor_ring_offset;
  uint64_t sensor_slot_bytes;
  uint64_t actuator_ring_offset;
  uint64_t actuator_slot_bytes;
  uint32_t slot_header_bytes;
  uint32_t position_components; /* 3 if positions are present, else 0 */
  uint64_t positions_offset;    /* f32[rows × columns][3]: x, y, z of each cell; 0: a regular grid */
  uint64_t occupancy_offset;    /* reserved; 0: every cell exists */
  uint64_t orientations_offset; /* reserved; 0: every cell is upright */
  uint64_t reserved[3];
} ssp_geometry;

/* Lines 2 and 3: state and counters of one side. Written by that side only. */
typedef struct ssp_side {
  uint32_t state;
  uint32_t reserved0;
  uint64_t skipped;         /* peer frames that this side never read */
  uint64_t repeated;        /* polls that found no newer frame */
  uint64_t clamped;         /* peer values replaced because they were NaN, infinite or out of range */
  uint64_t deadline_misses; /* control periods answered late; counted by hardware surfaces */
  uint64_t reserved[11];
} ssp_side;

/* Line 4: the controller's identity. The only line with several writers; all of them use compare-and-swap or
 * fetch-and-add. */
typedef struct ssp_claim {
  uint64_t controller_process;
  uint32_t attached; /* counts claims; a futex word */
  uint32_t detached; /* counts orderly detachments */
  uint64_t reserved[14];
} ssp_claim;

/* Lines 5 and 6: the newest frame of one side. Written by that side only; `word` last. */
typedef struct ssp_publication {
  uint32_t word; /* low 32 bits of `frame`; 0: none yet; a futex word */
  uint32_t cpu;  /* CPU that the writer ran on */
  uint64_t frame;
  uint64_t tick;
  double time_s;
  uint64_t answers; /* actuators: the sensor frame answered; sensors: 0 */
  uint32_t status;
  uint32_t reserved0;
  uint64_t reserved[10];
} ssp_publication;

/* Lines 7 and 8: nonzero while a side sleeps on its peer's publication word. Written by the sleeper only. */
typedef struct ssp_waiting {
  uint32_t flag;
  uint32_t reserved0;
  uint64_t reserved[15];
} ssp_waiting;

/* Lines 9 and 10: the writer's progress within a large frame. Written by that side only; readers may ignore
 * it. */
typedef struct ssp_progress {
  uint64_t ready; /* low 24 bits of the frame being written << 40 | final bytes, from the start of the slot */
  uint64_t reserved[15];
} ssp_progress;

typedef struct ssp_header {
  ssp_identity identity;
  ssp_geometry geometry;
  ssp_side surface;
  ssp_side controller;
  ssp_claim claim;
  ssp_publication sensors;
  ssp_publication actuators;
  ssp_waiting controller_waiting; /* the controller sleeps on sensors.word */
  ssp_waiting surface_waiting;    /* the surface sleeps on actuators.word or claim.attached */
  ssp_progress sensor_progress;
  ssp_progress actuator_progress;
  uint8_t reserved[4096 - 11 * 128];
} ssp_header;

/* One entry of the channel directory. Written once by the surface; covered by layout_hash. */
typedef struct ssp_channel {
  char name[32]; /* NUL-terminated */
  uint32_t direction;
  uint32_t dtype;
  uint32_t components;
  uint32_t reserved0;
  char unit[16]; /* NUL-terminated */
  double minimum;
  double maximum;
  double safe;
  uint64_t offset; /* of the array, from the start of a slot */
  uint64_t bytes;  /* rows × columns × components × size of the dtype */
  uint64_t reserved[3];
} ssp_channel;

/* The first line of every slot; the arrays follow. Written by the ring's writer only. */
typedef struct ssp_slot {
  uint64_t sequence; /* 2·frame − 1 while the frame is being written, 2·frame once it is complete */
  uint64_t frame;    /* 1, 2, 3, … in the order of publication */
  uint64_t tick;
  double time_s;
  uint64_t answers;
  uint32_t status;
  uint32_t reserved0;
  uint64_t reserved[10];
} ssp_slot;

SSP_ASSERT(sizeof(double) == 8);
SSP_ASSERT(offsetof(ssp_identity, magic) == 0);
SSP_ASSERT(offsetof(ssp_identity, version) == 8);
SSP_ASSERT(offsetof(ssp_identity, header_bytes) == 12);
SSP_ASSERT(offsetof(ssp_identity, segment_bytes) == 16);
SSP_ASSERT(offsetof(ssp_identity, surface_process) == 24);
SSP_ASSERT(offsetof(ssp_identity, session) == 32);
SSP_ASSERT(offsetof(ssp_identity, layout_hash) == 40);
SSP_ASSERT(offsetof(ssp_identity, dt_ns) == 48);
SSP_ASSERT(offsetof(ssp_identity, mode) == 56);
SSP_ASSERT(offsetof(ssp_identity, name) == 64);
SSP_ASSERT(sizeof(ssp_identity) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_geometry, rows) == 0);
SSP_ASSERT(offsetof(ssp_geometry, columns) == 4);
SSP_ASSERT(offsetof(ssp_geometry, pitch) == 8);
SSP_ASSERT(offsetof(ssp_geometry, channel_count) == 16);
SSP_ASSERT(offsetof(ssp_geometry, channel_bytes) == 20);
SSP_ASSERT(offsetof(ssp_geometry, channels_offset) == 24);
SSP_ASSERT(offsetof(ssp_geometry, sensor_slots) == 32);
SSP_ASSERT(offsetof(ssp_geometry, actuator_slots) == 36);
SSP_ASSERT(offsetof(ssp_geometry, sensor_ring_offset) == 40);
SSP_ASSERT(offsetof(ssp_geometry, sensor_slot_bytes) == 48);
SSP_ASSERT(offsetof(ssp_geometry, actuator_ring_offset) == 56);
SSP_ASSERT(offsetof(ssp_geometry, actuator_slot_bytes) == 64);
SSP_ASSERT(offsetof(ssp_geometry, slot_header_bytes) == 72);
SSP_ASSERT(offsetof(ssp_geometry, position_components) == 76);
SSP_ASSERT(offsetof(ssp_geometry, positions_offset) == 80);
SSP_ASSERT(offsetof(ssp_geometry, occupancy_offset) == 88);
SSP_ASSERT(offsetof(ssp_geometry, orientations_offset) == 96);
SSP_ASSERT(sizeof(ssp_geometry) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_side, state) == 0);
SSP_ASSERT(offsetof(ssp_side, skipped) == 8);
SSP_ASSERT(offsetof(ssp_side, repeated) == 16);
SSP_ASSERT(offsetof(ssp_side, clamped) == 24);
SSP_ASSERT(offsetof(ssp_side, deadline_misses) == 32);
SSP_ASSERT(sizeof(ssp_side) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_claim, controller_process) == 0);
SSP_ASSERT(offsetof(ssp_claim, attached) == 8);
SSP_ASSERT(offsetof(ssp_claim, detached) == 12);
SSP_ASSERT(sizeof(ssp_claim) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_publication, word) == 0);
SSP_ASSERT(offsetof(ssp_publication, cpu) == 4);
SSP_ASSERT(offsetof(ssp_publication, frame) == 8);
SSP_ASSERT(offsetof(ssp_publication, tick) == 16);
SSP_ASSERT(offsetof(ssp_publication, time_s) == 24);
SSP_ASSERT(offsetof(ssp_publication, answers) == 32);
SSP_ASSERT(offsetof(ssp_publication, status) == 40);
SSP_ASSERT(sizeof(ssp_publication) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_waiting, flag) == 0);
SSP_ASSERT(sizeof(ssp_waiting) == SSP_LINE);
SSP_ASSERT(offsetof(ssp_progress, ready) == 0);
SSP_ASSERT(sizeof(ssp_progress) == SSP_LINE);

SSP_ASSERT(offsetof(ssp_header, identity) == 0);
SSP_ASSERT(offsetof(ssp_header, geometry) == 128);
SSP_ASSERT(offsetof(ssp_header, surface) == 256);
SSP_ASSERT(offsetof(ssp_header, controller) == 384);
SSP_ASSERT(offsetof(ssp_header, claim) == 512);
SSP_ASSERT(offsetof(ssp_header, sensors) == 640);
SSP_ASSERT(offsetof(ssp_header, actuators) == 768);
SSP_ASSERT(offsetof(ssp_header, controller_waiting) == 896);
SSP_ASSERT(offsetof(ssp_header, surface_waiting) == 1024);
SSP_ASSERT(offsetof(ssp_header, sensor_progress) == 1152);
SSP_ASSERT(offsetof(ssp_header, actuator_progress) == 1280);
SSP_ASSERT(offsetof(ssp_header, reserved) == 1408);
SSP_ASSERT(sizeof(ssp_header) == 4096);

SSP_ASSERT(offsetof(ssp_channel, name) == 0);
SSP_ASSERT(offsetof(ssp_channel, direction) == 32);
SSP_ASSERT(offsetof(ssp_channel, dtype) == 36);
SSP_ASSERT(offsetof(ssp_channel, components) == 40);
SSP_ASSERT(offsetof(ssp_channel, unit) == 48);
SSP_ASSERT(offsetof(ssp_channel, minimum) == 64);
SSP_ASSERT(offsetof(ssp_channel, maximum) == 72);
SSP_ASSERT(offsetof(ssp_channel, safe) == 80);
SSP_ASSERT(offsetof(ssp_channel, offset) == 88);
SSP_ASSERT(offsetof(ssp_channel, bytes) == 96);
SSP_ASSERT(sizeof(ssp_channel) == 128);

SSP_ASSERT(offsetof(ssp_slot, sequence) == 0);
SSP_ASSERT(offsetof(ssp_slot, frame) == 8);
SSP_ASSERT(offsetof(ssp_slot, tick) == 16);
SSP_ASSERT(offsetof(ssp_slot, time_s) == 24);
SSP_ASSERT(offsetof(ssp_slot, answers) == 32);
SSP_ASSERT(offsetof(ssp_slot, status) == 40);
SSP_ASSERT(sizeof(ssp_slot) == SSP_LINE);

#ifdef __cplusplus
}
#endif

#endif
