/* The C interface to the shared-memory protocol: surfaces, controllers and observers for programs in C, and
 * for any language that can call C. The library is libshm_protocol_c.so.
 *
 * Handles are opaque. Calls return an ssp_result: 0 is success, a positive value an expected outcome, a
 * negative value an error. ssp_text() names the result; after an error, ssp_last_error() returns a one-line
 * message. No call throws or terminates the process. One thread at a time may use a handle; different handles
 * are independent. create, attach, reconnect and ssp_list allocate; calls on the tick path do not.
 *
 * Ownership. A segment is the file /dev/shm/smartsurf.NAME. Each verb has the same effect in all roles:
 *
 *   create    surface: creates the segment and maps it
 *   attach    controller: maps the segment and claims the role; observer: maps it read-only
 *   close     ends the role, keeps the mapping: arrays stay readable until destroy. Surface: removes the
 *             file, the controller sees SSP_SURFACE_CLOSED. Controller: releases the claim, the surface sees
 *             SSP_CONTROLLER_CLOSED. An observer has no role to end
 *   destroy   closes if necessary, unmaps the segment, frees the handle and invalidates all pointers
 *   clean     removes the files of surfaces that died without close
 *
 * A process that exits without close is reported to its peer as SSP_SURFACE_DEAD or SSP_CONTROLLER_DEAD.
 *
 * A channel is identified by its number, 0 … channel_count − 1, which is the same for every process of the
 * session. An array is components × rows × columns: one plane per component, row 0 north, column 0 west. Its
 * element type is the channel's dtype; it is 64-byte aligned.
 *
 * Structures end in reserved words, so that fields can be added without changing their size: initialise input
 * structures with "= {0}".
 *
 *   ssp_controller* table;
 *   if (ssp_controller_attach("table", 10000000000, NULL, &table) != SSP_OK) die(ssp_last_error());
 *   int hit = ssp_controller_find(table, SSP_SENSOR, "proximity_hit");
 *   int height = ssp_controller_find(table, SSP_ACTUATOR, "height");
 *   while (ssp_controller_await(table, SSP_FOREVER, NULL) == SSP_OK) {
 *     compute(ssp_controller_sensor(table, hit, NULL), ssp_controller_actuator(table, height, NULL));
 *     ssp_controller_publish(table);
 *   }
 *   ssp_controller_destroy(table);
 */
#ifndef SHM_PROTOCOL_SHM_PROTOCOL_H
#define SHM_PROTOCOL_SHM_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>

#include "shm_protocol/layout.h" /* enum ssp_mode, ssp_state, ssp_direction, ssp_dtype */

#if defined(__GNUC__)
#define SSP_API __attribute__((visibility("default")))
#else
#define SSP_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define SSP_FOREVER INT64_C(-1) /* a timeout; 0 does not wait at all */

typedef enum ssp_result {
  SSP_OK = 0,
  /* outcomes */
  SSP_REPEATED = 1,      /* no newer frame; the previous one is kept */
  SSP_TORN = 2,          /* the frame changed while it was read, or is malformed; the previous one is kept */
  SSP_TIMEOUT = 3,       /* the deadline passed; nothing else happened */
  SSP_INTERRUPTED = 4,   /* the stop flag was raised */
  SSP_OUT_OF_TURN = 5,   /* time-step: the call would run ahead of the peer, or nothing was published yet */
  SSP_NO_CONTROLLER = 6, /* no controller is attached */
  SSP_CONTROLLER_DEAD = 7,   /* the controller exited without close (reported once) */
  SSP_CONTROLLER_CLOSED = 8, /* the controller closed (reported once) */
  SSP_SURFACE_DEAD = 9,      /* the surface exited without close */
  SSP_SURFACE_CLOSED = 10,   /* the surface is closing */
  /* errors */
  SSP_E_BAD_CONFIG = -1,       /* the caller's description or name is invalid */
  SSP_E_SURFACE_LIVES = -2,    /* create: a living surface owns the name; ssp_last_error_pid() */
  SSP_E_NOT_FOUND = -3,        /* attach: no such segment, or only one whose surface is dead or closing */
  SSP_E_CONTROLLER_LIVES = -4, /* attach: another controller is attached; ssp_last_error_pid() */
  SSP_E_WRONG_VERSION = -5,    /* another major version */
  SSP_E_CORRUPT = -6,          /* the header is inconsistent, or does not match the file size */
  SSP_E_FOREIGN = -7,          /* the file of this name is another user's or no segment of this protocol */
  SSP_E_LAYOUT_CHANGED = -8,   /* reconnect: the new surface has different channels or a different size */
  SSP_E_INTERRUPTED = -9,      /* the stop flag was raised while attaching */
  SSP_E_SYSTEM = -10,          /* a system call failed: no space in /dev/shm, no permission, … */
  SSP_E_ARGUMENT = -11,        /* a null pointer, or an invalid channel number */
  SSP_E_NO_MEMORY = -12,
  SSP_E_INTERNAL = -13 /* a bug in this library */
} ssp_result;

/* A short description of a result; never null. */
SSP_API const char* ssp_text(ssp_result);
/* The one-line message of this thread's last error, "" if there was none. Valid until this thread's next
 * failing call. */
SSP_API const char* ssp_last_error(void);
/* The process that held the resource in that error, or 0. */
SSP_API uint32_t ssp_last_error_pid(void);

/* The version of the byte layout that this library implements: major << 16 | minor. */
SSP_API uint32_t ssp_protocol_version(void);

/* Names of enumerators, as `shm_dump` prints them; "unknown" for others. */
SSP_API const char* ssp_mode_text(uint32_t mode);
SSP_API const char* ssp_state_text(uint32_t state);
SSP_API const char* ssp_direction_text(uint32_t direction);
SSP_API const char* ssp_dtype_text(uint32_t dtype);

/* A flag that ends waits with SSP_INTERRUPTED within 50 ms. A signal handler or any thread may raise it.
 * Every function that takes one accepts null. */
typedef struct ssp_stop ssp_stop;
SSP_API ssp_stop* ssp_stop_create(void); /* null if out of memory */
SSP_API void ssp_stop_raise(ssp_stop*);
SSP_API void ssp_stop_lower(ssp_stop*);
SSP_API void ssp_stop_destroy(ssp_stop*); /* null: no effect */

/* ---- descriptions and frames ---- */

typedef struct ssp_channel_spec {
  const char* name;    /* 1 to 31 of A-Z a-z 0-9 _ . -, no dot first; unique in its direction */
  const char* unit;    /* at most 15 characters; null or "": dimensionless */
  uint32_t direction;  /* SSP_SENSOR, SSP_ACTUATOR */
  uint32_t dtype;      /* SSP_F32, SSP_U32, SSP_U8 */
  uint32_t components; /* per cell, 1 … 64; 0 stands for 1 */
  uint32_t reserved0;
  double minimum, maximum; /* valid range, finite */
  double safe;             /* within the range; replaces NaN, and applies before there is a controller */
  uint64_t reserved[4];
} ssp_channel_spec;

typedef struct ssp_surface_config {
  const char* name; /* 1 to 48 of A-Z a-z 0-9 _ . -, no dot first; the file is /dev/shm/smartsurf.NAME */
  uint32_t rows, columns; /* 1 … 65536 each */
  double pitch;           /* distance between adjacent cells, in the surface's length unit; 0 stands for 1 */
  uint64_t period_ns;     /* control period, > 0 */
  uint32_t mode;          /* SSP_MODE_TIME_STEP, SSP_MODE_PASSIVE; 0 stands for time-step */
  uint32_t slots;         /* per ring: 4, 8, … 64; 0 stands for 4 */
  const ssp_channel_spec* channels;
  uint32_t channel_count;   /* 1 … 32, both directions together */
  uint32_t safe_when_alone; /* in effect after the controller died or left: 0 its last frame, 1 safe values */
  const float* positions;   /* [rows × columns][3]: x, y, z of each cell; null: a regular grid */
  uint64_t reserved[8];
} ssp_surface_config;

typedef struct ssp_description {
  char name[64];
  uint32_t version_major, version_minor;
  uint64_t session;     /* distinguishes runs under the same name */
  uint64_t layout_hash; /* equal for equal sizes and channels */
  uint32_t rows, columns;
  double pitch;
  uint64_t period_ns;
  uint32_t mode;
  uint32_t channel_count;
  uint32_t surface_pid;
  uint32_t reserved0;
  const float* positions; /* as in ssp_surface_config; valid as long as the handle (controller: until
                             reconnect) */
  uint64_t reserved[8];
} ssp_description;

typedef struct ssp_channel_info {
  char name[32];
  char unit[16];
  uint32_t direction, dtype, components;
  uint32_t reserved0;
  double minimum, maximum, safe;
  uint64_t bytes; /* of one array */
  uint64_t reserved[4];
} ssp_channel_info;

typedef struct ssp_frame_info {
  uint64_t frame; /* 1, 2, 3, … in the order of publication; 0: none yet */
  uint64_t tick;
  double time_s;
  uint64_t answers; /* actuator frames: the sensor frame answered */
  uint32_t status;  /* defined by the surface; 0: no fault */
  uint32_t reserved0;
  uint64_t reserved[5];
} ssp_frame_info;

typedef struct ssp_counters {
  uint64_t skipped;         /* peer frames that this side never read */
  uint64_t repeated;        /* polls that found no newer frame */
  uint64_t clamped;         /* peer values replaced: NaN, infinite or out of range */
  uint64_t deadline_misses; /* periods answered late; counted by hardware surfaces */
  uint64_t reserved[4];
} ssp_counters;

/* ---- surface ---- */

typedef struct ssp_surface ssp_surface;

/* Creates /dev/shm/smartsurf.NAME, reclaiming the segment of a dead surface. *out is null after an error. */
SSP_API ssp_result ssp_surface_create(const ssp_surface_config*, ssp_surface** out);
SSP_API void ssp_surface_close(ssp_surface*);   /* null: no effect */
SSP_API void ssp_surface_destroy(ssp_surface*); /* null: no effect */

SSP_API ssp_result ssp_surface_describe(const ssp_surface*, ssp_description*);
SSP_API ssp_result ssp_surface_channel(const ssp_surface*, int channel, ssp_channel_info*);
/* The channel's number, or −1. */
SSP_API int ssp_surface_find(const ssp_surface*, uint32_t direction, const char* name);

/* The sensor array that the next publish sends, in place in shared memory. Each publish moves it to another
 * slot, which holds the values of an old frame: write all of it. Null: not a sensor channel. `bytes` may be
 * null. */
SSP_API void* ssp_surface_sensor(ssp_surface*, int channel, size_t* bytes);
/* Copies `bytes` bytes into the same array from byte `at` on. Faster than writing in place for arrays of
 * 16 KiB and more: it uses non-temporal stores where they pay off, and the controller can read along if
 * writes ascend, 16 KiB to 64 KiB at a time. The values are final for this frame. SSP_E_ARGUMENT: outside the
 * array, or not whole elements. */
SSP_API ssp_result ssp_surface_write(ssp_surface*, int channel, size_t at, const void* values, size_t bytes);
/* Publishes the sensor frame and wakes the controller. Time-step: SSP_OUT_OF_TURN if the controller has not
 * answered the previous frame. */
SSP_API ssp_result ssp_surface_publish(ssp_surface*, uint64_t tick, double time_s, uint32_t status);
/* Time-step: waits for the answer to the last published frame, whose tick must be `tick`, and takes it:
 * SSP_OK, SSP_TIMEOUT, SSP_INTERRUPTED, SSP_TORN, SSP_OUT_OF_TURN, SSP_NO_CONTROLLER (at once),
 * SSP_CONTROLLER_DEAD, SSP_CONTROLLER_CLOSED. */
SSP_API ssp_result ssp_surface_await(ssp_surface*, uint64_t tick, int64_t timeout_ns, const ssp_stop*);
/* Time-step: the next chunk of an actuator channel of the answer being written, checked; see
 * ssp_controller_next. Only polls if the frame to be answered is not published yet. After null, call
 * ssp_surface_await: SSP_OK confirms that all chunks belong to the frame taken; after SSP_TORN the next call
 * restarts. */
SSP_API const void* ssp_surface_next(ssp_surface*, int channel, int64_t timeout_ns, const ssp_stop*,
                                     size_t* bytes);
/* Passive: takes the newest complete actuator frame without waiting: SSP_OK, SSP_REPEATED, SSP_TORN,
 * SSP_NO_CONTROLLER, SSP_CONTROLLER_DEAD, SSP_CONTROLLER_CLOSED. */
SSP_API ssp_result ssp_surface_latest(ssp_surface*);
/* Waits until a controller is attached: SSP_OK, SSP_TIMEOUT, SSP_INTERRUPTED. */
SSP_API ssp_result ssp_surface_await_controller(ssp_surface*, int64_t timeout_ns, const ssp_stop*);
/* The actuator array in effect, checked: within the channel's range and free of NaN. Valid until the next
 * await or latest. Null: not an actuator channel. */
SSP_API const void* ssp_surface_actuator(const ssp_surface*, int channel, size_t* bytes);
/* Metadata of the frame that ssp_surface_actuator returns; frame 0 for the safe values. */
SSP_API ssp_result ssp_surface_frame(const ssp_surface*, ssp_frame_info*);

/* SSP_STATE_RUNNING and SSP_STATE_PAUSED are informative only; SSP_STATE_CLOSING ends the controller's
 * waits. */
SSP_API ssp_result ssp_surface_set_state(ssp_surface*, uint32_t state);
/* Adds one to deadline_misses. */
SSP_API ssp_result ssp_surface_miss_deadline(ssp_surface*);
SSP_API uint32_t ssp_surface_controller_pid(const ssp_surface*);   /* 0: none */
SSP_API uint32_t ssp_surface_controller_state(const ssp_surface*); /* enum ssp_state */
SSP_API ssp_result ssp_surface_counters(const ssp_surface*, ssp_counters* surface, ssp_counters* controller);

/* ---- controller ---- */

typedef struct ssp_controller ssp_controller;

/* Waits up to timeout_ns for a surface of that name and claims the controller role. *out is null after an
 * error. */
SSP_API ssp_result ssp_controller_attach(const char* name, int64_t timeout_ns, const ssp_stop*,
                                         ssp_controller** out);
SSP_API void ssp_controller_close(ssp_controller*);   /* null: no effect */
SSP_API void ssp_controller_destroy(ssp_controller*); /* null: no effect */
/* After SSP_SURFACE_DEAD or SSP_SURFACE_CLOSED: waits for a new surface of the same name and attaches to it.
 * Invalidates all pointers. After an error only destroy, or another reconnect, is allowed. */
SSP_API ssp_result ssp_controller_reconnect(ssp_controller*, int64_t timeout_ns, const ssp_stop*);

SSP_API ssp_result ssp_controller_describe(const ssp_controller*, ssp_description*);
SSP_API ssp_result ssp_controller_channel(const ssp_controller*, int channel, ssp_channel_info*);
SSP_API int ssp_controller_find(const ssp_controller*, uint32_t direction, const char* name);

/* Waits for an unread sensor frame and takes the newest: SSP_OK, SSP_TIMEOUT, SSP_INTERRUPTED, SSP_TORN,
 * SSP_SURFACE_DEAD, SSP_SURFACE_CLOSED; time-step: SSP_OUT_OF_TURN if the last frame taken is still
 * unanswered. */
SSP_API ssp_result ssp_controller_await(ssp_controller*, int64_t timeout_ns, const ssp_stop*);
/* The same without waiting: SSP_REPEATED if there is no new frame. */
SSP_API ssp_result ssp_controller_latest(ssp_controller*);
/* The channel's array in the last sensor frame taken. Time-step: in place in shared memory; the surface does
 * not modify it before the frame is answered. Passive: a private copy of one complete frame. Valid until the
 * next await or latest. Null: not a sensor channel, or no frame was taken yet. */
SSP_API const void* ssp_controller_sensor(const ssp_controller*, int channel, size_t* bytes);
SSP_API ssp_result ssp_controller_frame(const ssp_controller*, ssp_frame_info*);
/* The actuator array that the next publish sends, in place in shared memory. Each publish moves it to another
 * slot, which holds the values of an old frame: write all of it. Null: not an actuator channel. */
SSP_API void* ssp_controller_actuator(ssp_controller*, int channel, size_t* bytes);
/* Copies into the same array, as ssp_surface_write does for the surface. */
SSP_API ssp_result ssp_controller_write(ssp_controller*, int channel, size_t at, const void* values,
                                        size_t bytes);
/* Time-step: the next chunk of a channel of the sensor frame being written, in place, as far as the surface
 * has written it with ssp_surface_write. Chunks ascend and hold at most 64 KiB. Blocks until a chunk is
 * available. Null: the channel is complete, or no more data arrived before the timeout or ever will. Then
 * call ssp_controller_await: SSP_OK confirms that all chunks belong to one complete frame, SSP_TORN that they
 * do not. The answer may be written in the meantime. `bytes` must not be null. */
SSP_API const void* ssp_controller_next(ssp_controller*, int channel, int64_t timeout_ns, const ssp_stop*,
                                        size_t* bytes);
/* Publishes the actuator frame as the answer to the last sensor frame taken. Time-step only: SSP_OUT_OF_TURN
 * if no unanswered frame was taken, SSP_TORN if the surface has abandoned that frame (await the next one). */
SSP_API ssp_result ssp_controller_publish(ssp_controller*);

SSP_API ssp_result ssp_controller_set_state(ssp_controller*, uint32_t state);
/* Checks the surface now: SSP_OK, SSP_SURFACE_CLOSED or SSP_SURFACE_DEAD. */
SSP_API ssp_result ssp_controller_surface_status(ssp_controller*);
SSP_API uint32_t ssp_controller_surface_state(const ssp_controller*); /* enum ssp_state */
SSP_API ssp_result ssp_controller_counters(const ssp_controller*, ssp_counters* surface,
                                           ssp_counters* controller);

/* ---- observer ---- */

/* Maps a segment read-only: it cannot slow or disturb surface and controller. */
typedef struct ssp_observer ssp_observer;

SSP_API ssp_result ssp_observer_attach(const char* name, int64_t timeout_ns, const ssp_stop*,
                                       ssp_observer** out);
SSP_API void ssp_observer_destroy(ssp_observer*); /* null: no effect */

SSP_API ssp_result ssp_observer_describe(const ssp_observer*, ssp_description*);
SSP_API ssp_result ssp_observer_channel(const ssp_observer*, int channel, ssp_channel_info*);
SSP_API int ssp_observer_find(const ssp_observer*, uint32_t direction, const char* name);

/* Copies the newest complete frame of one direction into the handle's memory: SSP_OK, SSP_REPEATED (none
 * newer than the last copy), SSP_TORN (overwritten on every retry; the previous frame is kept),
 * SSP_SURFACE_DEAD and SSP_SURFACE_CLOSED (no newer frame, and none will follow). */
SSP_API ssp_result ssp_observer_latest(ssp_observer*, uint32_t direction);
/* Polls once per millisecond for a newer frame. Returns as above, or SSP_TIMEOUT or SSP_INTERRUPTED. */
SSP_API ssp_result ssp_observer_await(ssp_observer*, uint32_t direction, int64_t timeout_ns, const ssp_stop*);
/* The channel's array in the last copied frame; zeros before the first frame. Valid until the next
 * latest or await in that direction changes it. Null: no such channel. */
SSP_API const void* ssp_observer_array(const ssp_observer*, int channel, size_t* bytes);
SSP_API ssp_result ssp_observer_frame(const ssp_observer*, uint32_t direction, ssp_frame_info*);

SSP_API uint32_t ssp_observer_surface_state(const ssp_observer*);    /* SSP_STATE_DEAD after a kill */
SSP_API uint32_t ssp_observer_controller_state(const ssp_observer*); /* SSP_STATE_NONE: none is attached */
SSP_API uint32_t ssp_observer_controller_pid(const ssp_observer*);   /* 0: none */
SSP_API ssp_result ssp_observer_counters(const ssp_observer*, ssp_counters* surface,
                                         ssp_counters* controller);

/* ---- segments in /dev/shm ---- */

enum ssp_ownership {
  SSP_LIVING = 0, /* its surface is running */
  SSP_ORPHAN = 1, /* its surface is dead; the segment may be removed */
  SSP_FOREIGN = 2 /* not a segment of this protocol, or not readable by this user; never removed */
};

typedef struct ssp_segment_info {
  char name[128]; /* the file is /dev/shm/smartsurf.NAME; NAME~… is under construction */
  uint64_t bytes;
  uint32_t ownership;
  uint32_t version_major, version_minor;
  uint32_t surface_pid;
  uint32_t controller_pid; /* 0: none, or dead */
  uint32_t reserved0;
  uint64_t reserved[4];
} ssp_segment_info;

/* Lists all segments, sorted by name. Writes up to `capacity` entries and sets *count to the total. `found`
 * may be null if capacity is 0. */
SSP_API ssp_result ssp_list(ssp_segment_info* found, size_t capacity, size_t* count);
/* Removes every orphan whose name begins with `prefix` (null or "": every orphan); the owner is checked under
 * a lock. Writes up to `capacity` entries to `removed` (may be null); *count is set to the number removed. */
SSP_API ssp_result ssp_clean(const char* prefix, ssp_segment_info* removed, size_t capacity, size_t* count);

SSP_ASSERT(sizeof(ssp_channel_spec) == 2 * sizeof(void*) + 72);
SSP_ASSERT(sizeof(ssp_channel_info) == 128);
SSP_ASSERT(sizeof(ssp_frame_info) == 80);
SSP_ASSERT(sizeof(ssp_counters) == 64);
SSP_ASSERT(sizeof(ssp_segment_info) == 192);

#ifdef __cplusplus
}
#endif

#endif
