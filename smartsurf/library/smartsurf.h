/* SmartSurf as a library: an experiment in this process, stepped by its caller. C11; smartsurf.hpp wraps it
 * for C++.
 *
 *     smartsurf_options options = {.size = sizeof options, .file = "plate.lua"};
 *     smartsurf_environment* environment;
 *     if (smartsurf_create(&options, &environment) != SMARTSURF_OK) puts(smartsurf_error());
 *
 * Errors. A function that can fail returns a status; smartsurf_error() is its one line.
 * Pointers must not be null unless stated otherwise: a null pointer is refused.
 * Ownership. smartsurf_create() makes an environment and smartsurf_destroy() frees it, and with it all arrays
 * and strings that the library has returned for it. Arguments are copied.
 * Threads. An environment is used by one thread at a time; different ones are independent.
 * smartsurf_load_extension() may be called at any time.
 * Arrays. Grids are row-major, row 0 north, column 0 west: cell = row * columns + column. Vectors are x
 * (east), y (north), z (up); quaternions are x y z w. "u" is the unit of length of the experiment; time is in
 * s, angles are in rad.
 * Sizes. Every struct begins with `size`, which the caller sets to sizeof that struct; later versions append
 * members.
 * Determinism. Equal experiments, options, seeds and targets give equal bits, for any number of threads,
 * whatever the locale and the floating-point environment (rounding, subnormal numbers) of the caller. */
#ifndef SMARTSURF_H
#define SMARTSURF_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SMARTSURF_API __attribute__((visibility("default")))

typedef enum smartsurf_status {
  SMARTSURF_OK = 0,
  SMARTSURF_FAILED = 1, /* a resource that the system refuses, or a defect of this library */
  SMARTSURF_INVALID = 2 /* an error in the experiment, an argument or a file */
} smartsurf_status;

typedef struct smartsurf_environment smartsurf_environment;

/* "0.1.0". */
SMARTSURF_API const char* smartsurf_version(void);

/* The one-line message of this thread's last failed call; valid until its next failing call. */
SMARTSURF_API const char* smartsurf_error(void);

/* Loads an extension (smartsurf_plugin.h) for the rest of the process. Loading it again has no effect. */
SMARTSURF_API smartsurf_status smartsurf_load_extension(const char* path);

typedef struct smartsurf_options {
  size_t size;
  const char* file; /* path of the experiment, a Lua script; its folder is where the script finds its files */
  const char* text; /* the script itself; null: it is read from `file` */
  const char* const* set; /* NAME=VALUE of options that the script defines; may be null */
  size_t set_count;
  const uint64_t* seed; /* null: the script's */
  const char* engine;   /* "native" or "bullet"; null: the script's */
  int threads;          /* of the physics; 0 means 1 */
} smartsurf_options;

/* Loads the experiment and starts its first episode. */
SMARTSURF_API smartsurf_status smartsurf_create(const smartsurf_options* options,
                                                smartsurf_environment** environment);
/* Null is allowed. */
SMARTSURF_API void smartsurf_destroy(smartsurf_environment* environment);

/* ---- running */

typedef struct smartsurf_result {
  size_t size;
  double reward;  /* reward() of the script; 0 without one */
  int terminated; /* 1: success(), stop() or quit() of the script, now or before */
  int truncated;  /* 1: episode.seconds are over */
  int success;    /* 1: success() has said so or, at the end, stop() or the metric `success` */
} smartsurf_result;

/* Advances by one control period. result may be null. After a failure every call fails until reset or
 * restore. */
SMARTSURF_API smartsurf_status smartsurf_step(smartsurf_environment* environment, smartsurf_result* result);
/* Starts the next episode with that seed. */
SMARTSURF_API smartsurf_status smartsurf_reset(smartsurf_environment* environment, uint64_t seed);

/* Saves the whole state between two steps. *bytes is valid until the next call of this function with this
 * environment. */
SMARTSURF_API smartsurf_status smartsurf_save(smartsurf_environment* environment, const void** bytes,
                                              size_t* count);
/* Continues from a state of any environment of the same experiment, options, extensions and version, whose
 * script has read the same files while it loaded: with the same bits. Bytes that are damaged or of another
 * experiment change nothing. */
SMARTSURF_API smartsurf_status smartsurf_restore(smartsurf_environment* environment, const void* bytes,
                                                 size_t count);

/* ---- channels: the arrays of the surface. A reset changes them only if the script's surface depends on the
 * seed. Pointers are valid until the next step, reset or restore. */

typedef enum smartsurf_direction { SMARTSURF_SENSORS = 0, SMARTSURF_ACTUATORS = 1 } smartsurf_direction;

typedef struct smartsurf_channel {
  size_t size;
  const char* name;
  const char* unit;        /* "" = dimensionless */
  double minimum, maximum; /* of the values */
  int components;          /* numbers per cell; 1 for actuators */
  /* components × rows × columns: the readings or the targets after the latest step. */
  const float* values;
} smartsurf_channel;

/* 0 for a null environment and for another direction. */
SMARTSURF_API size_t smartsurf_channel_count(const smartsurf_environment* environment,
                                             smartsurf_direction direction);
/* Fills in the index-th channel. */
SMARTSURF_API smartsurf_status smartsurf_get_channel(const smartsurf_environment* environment,
                                                     smartsurf_direction direction, size_t index,
                                                     smartsurf_channel* channel);
/* Sets the targets of the index-th actuator channel for the coming steps: rows × columns values. Clamps them
 * to the channel's range; NaN becomes its safe value. */
SMARTSURF_API smartsurf_status smartsurf_set_targets(smartsurf_environment* environment, size_t index,
                                                     const float* targets, size_t count);

/* ---- the world after the latest step. Pointers are valid until the next step, reset or restore. */

typedef struct smartsurf_state {
  size_t size;
  int rows, columns;
  double pitch;        /* distance of neighbouring cells, u */
  double period_s;     /* of a step */
  uint64_t seed;       /* of the episode */
  uint64_t tick;       /* steps since its start */
  double time_s;       /* simulated time since then */
  uint64_t hash;       /* of all poses, velocities, heights and speeds; as in recordings */
  const float* height; /* rows × columns: z of each cell's top, u; -infinity for a missing cell */
  /* The objects, ascending by id. */
  size_t object_count;
  const uint32_t* id;            /* object_count */
  const float* position;         /* object_count × 3: of the origin, u */
  const float* orientation;      /* object_count × 4 */
  const float* velocity;         /* object_count × 3, u/s */
  const float* angular_velocity; /* object_count × 3, rad/s, about the world's axes */
} smartsurf_state;

SMARTSURF_API smartsurf_status smartsurf_get_state(const smartsurf_environment* environment,
                                                   smartsurf_state* state);

#ifdef __cplusplus
}
#endif

#endif
