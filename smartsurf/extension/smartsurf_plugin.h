/* The C interface of extensions: shared objects that add actuators and sensors to SmartSurf.
 *
 *     smartsurf run --load ./belt.so experiment.lua
 *
 * An extension exports one function with C linkage, smartsurf_plugin_get, which returns a table of constant
 * data that lives as long as the process. docs/extending.md has complete examples.
 *
 * Sizes. Every struct begins with `size`, which its author sets to sizeof that struct. Later versions of this
 * header may append members; a program reads those that both sides know, and takes the missing ones for 0.
 * All elements of an array of structs have the same size.
 * Arrays. Grids are row-major, row 0 north, column 0 west: cell = row * columns + column. Vectors are x
 * (east), y (north), z (up). Quaternions are x y z w. "u" is the unit of length of the experiment; angles are
 * in rad. All numbers that an extension writes must be finite, unless their comment says more: a motion or a
 * force that is not ends the run.
 * Memory. A pointer that is passed to a function is valid during that call, unless its comment says more.
 * plan, add_forces and sense run in every step and should not allocate.
 * Threads. Different instances may be called at the same time; one instance is called by one thread at a
 * time.
 * Errors. C++ exceptions must not leave a function. `message` has room for 256 bytes: one line,
 * NUL-terminated.
 * Determinism. Equal calls must give equal bits, or recordings cannot be run again: no clocks, no addresses,
 * no random numbers without a seed of their own. */
#ifndef SMARTSURF_PLUGIN_H
#define SMARTSURF_PLUGIN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SMARTSURF_PLUGIN_VERSION 1

/* ---- parameters and channels: the fields of the Lua table, and the arrays exchanged in each tick */

enum smartsurf_plugin_parameter_type {
  SMARTSURF_NUMBER = 0,
  SMARTSURF_COUNT = 1, /* an integer */
  SMARTSURF_FLAG = 2,  /* false or true: 0 or 1 */
  SMARTSURF_SIZE = 3,  /* {x, y}; a single number in a script sets both */
  SMARTSURF_RANGE = 4, /* {minimum, maximum}: x and y */
  SMARTSURF_VECTOR = 5 /* {x, y, z} */
};

/* A parameter's value. Parameters of one number have it in x. x is NaN if an optional parameter is absent. */
typedef struct smartsurf_plugin_value {
  double x, y, z;
} smartsurf_plugin_value;

typedef struct smartsurf_plugin_parameter {
  uint32_t size;
  uint32_t type;           /* smartsurf_plugin_parameter_type */
  const char* name;        /* "max_speed", or "group.name": the field `name` of the table `group` */
  const char* description; /* one clause, with the unit */
  smartsurf_plugin_value default_value; /* x = NaN: the parameter is optional */
  double minimum, maximum;              /* of each number, inclusive */
} smartsurf_plugin_parameter;

enum smartsurf_plugin_channel_flags {
  SMARTSURF_EXACT = 1 /* a class or a mask, not a quantity: no noise, drift, calibration or quantization */
};

typedef struct smartsurf_plugin_channel {
  uint32_t size;
  uint32_t components; /* numbers per cell: 1 to 64 for a sensor, 1 for an actuator */
  const char* name;    /* of an actuator's channel; for a sensor what is appended to its name, "" or "_hit" */
  const char* unit;    /* "" = dimensionless */
  double minimum, maximum;
  /* The safe value (called `safe` in the protocol): target before the first command, and of a dead cell. For
   * a sensor, the reading of a cell that senses nothing. */
  double neutral;
  uint32_t flags; /* smartsurf_plugin_channel_flags */
} smartsurf_plugin_channel;

/* What configure() may change. On entry it is as the tables say. */
typedef struct smartsurf_plugin_configuration {
  uint32_t size;
  uint32_t channel_count;
  smartsurf_plugin_channel* channels; /* minimum, maximum, neutral, components and flags may be changed */
  /* Actuators only: the least and greatest z of the cells' tops above their base, u, in [-1e6, 1e6]. On entry
   * both are the parameter `height`, at which the tops rest. */
  double min_height, max_height;
  char* message;
} smartsurf_plugin_configuration;

/* ---- what instances see */

/* The cells of the surface. Valid as long as the instance. */
typedef struct smartsurf_plugin_surface {
  uint32_t size;
  uint32_t rows, columns;
  float pitch;                /* distance of neighbouring cells, u */
  float top_x, top_y;         /* edge lengths of a cell's top, u */
  const float *x, *y, *angle; /* rows × columns: centre of each cell, u, and its rotation about z */
} smartsurf_plugin_surface;

enum smartsurf_plugin_shape {
  SMARTSURF_SPHERE = 0,   /* dimensions: radius */
  SMARTSURF_BOX = 1,      /* edge lengths */
  SMARTSURF_CYLINDER = 2, /* radius, height */
  SMARTSURF_CAPSULE = 3,  /* radius, height with the caps */
  SMARTSURF_CONE = 4,     /* radius of the base, height */
  SMARTSURF_SOLID = 5     /* edge lengths of the bounding box */
};

/* The objects, ascending by id, and everything that has ever been created. For add_forces() the poses are
 * extrapolated with the velocities to the mean start time of the step's substeps. */
typedef struct smartsurf_plugin_objects {
  uint32_t size;
  uint32_t count;
  const uint32_t* id;            /* count */
  const float* position;         /* count × 3: of the origin, u */
  const float* orientation;      /* count × 4 */
  const float* velocity;         /* count × 3, u/s */
  const float* angular_velocity; /* count × 3, rad/s, about the world's axes */
  const float* mass;             /* count; 0 for an immovable object. Null for sensors */
  uint32_t catalogue_count;
  const uint32_t* shape;    /* by id: smartsurf_plugin_shape */
  const float* dimensions;  /* by id × 3, u */
  const float* colour;      /* by id × 3: sRGB in 0 … 1 */
  const float* magnetism;   /* by id × 4: pole, and moment in the object's frame */
  const char* const* label; /* by id; "" without one */
} smartsurf_plugin_objects;

/* ---- an actuator */

enum smartsurf_plugin_actuator_flags {
  SMARTSURF_MOVES_TOPS = 1,    /* writes speed; the program then advances height */
  SMARTSURF_MOVES_SURFACE = 2, /* writes surface_velocity_x, surface_velocity_y and surface_spin */
  /* Needs SMARTSURF_MOVES_TOPS. Writes force_limit and no_load_speed: under a greater load a cell yields,
   * down to min_height, where the frame carries the load. One that cannot rise from there waits for 0.1 s
   * before it tries again. */
  SMARTSURF_LIMITS_FORCE = 4,
  SMARTSURF_EXERTS_FORCES = 8 /* has add_forces */
};

typedef struct smartsurf_plugin_actuator_context {
  uint32_t size;
  uint32_t cell_count;
  const smartsurf_plugin_surface* surface;
  /* Values of the actuator's parameters, in their order; valid as long as the instance. */
  const smartsurf_plugin_value* values;
  const uint32_t* cells; /* the actuator's cells, ascending; valid as long as the instance */
  const float* height;   /* rows × columns: z of the tops at rest, u */
  char* message;         /* why create() returns null */
} smartsurf_plugin_actuator_context;

/* The motion of the cells in the coming physics step. Arrays have rows × columns entries; an actuator reads
 * and writes those of its own cells only. What it wrote in the last step is still there, except `speed` of
 * cells with a force limit: the physics lowers it to that which the load allows, and min_height bounds it. */
typedef struct smartsurf_plugin_motion {
  uint32_t size;
  uint32_t targets_changed; /* 1 if any target may differ from that of the last step */
  double dt_s;
  const float* const* targets; /* by channel: rows × columns, within the channel's range */
  const float* impulse;        /* normal impulse on each cell in the last step, mass·u/s */
  float* height;               /* z of the tops, u; to be written by snap() only */
  float* speed;                /* upward speed of the tops, u/s; must stay 0 without SMARTSURF_MOVES_TOPS */
  /* Velocity of the top's surface, u/s; null unless SMARTSURF_MOVES_SURFACE. */
  float *surface_velocity_x, *surface_velocity_y;
  float* surface_spin; /* of it about z, rad/s; likewise */
  /* Greatest upward force at rest, mass·u/s², at least 0; infinite, as before it is first written: unlimited.
   * Null unless SMARTSURF_LIMITS_FORCE. */
  float* force_limit;
  float* no_load_speed; /* speed at which that force has fallen to 0, u/s, greater than 0; likewise */
} smartsurf_plugin_motion;

typedef struct smartsurf_plugin_actuator {
  uint32_t size;
  uint32_t flags; /* smartsurf_plugin_actuator_flags */
  const char* name;
  const smartsurf_plugin_parameter* parameters; /* its own; top, length, height and latency come with them */
  uint32_t parameter_count;
  uint32_t channel_count;
  const smartsurf_plugin_channel* channels;

  /* Adapts the channels to the parameters' values, or refuses the values: returns non-zero with a clause in
   * `message`, "max_speed: must be less than …". Must not depend on anything else. May be null. */
  int (*configure)(const smartsurf_plugin_value* values, smartsurf_plugin_configuration* configuration);
  /* Returns a new instance. Null is a failure, with the reason in context->message. */
  void* (*create)(const smartsurf_plugin_actuator_context* context);
  void (*destroy)(void* instance);
  /* Moves the cells to their targets at once, before the first step. May be null. */
  void (*snap)(void* instance, const smartsurf_plugin_motion* motion);
  /* Writes the motion of the coming step. */
  void (*plan)(void* instance, const smartsurf_plugin_motion* motion);
  /* Adds to the wrench of each object, count × 6: force, mass·u/s², and torque, mass·u²/s², about its origin,
   * along the world's axes. `height`: as in smartsurf_plugin_motion. Null unless SMARTSURF_EXERTS_FORCES. */
  void (*add_forces)(void* instance, double dt_s, const float* height,
                     const smartsurf_plugin_objects* objects, float* wrenches);
  /* Saves what changes in an instance during a run, except the motion of its cells, which the program saves:
   * returns the number of bytes, and writes them if there is room for that many. */
  uint64_t (*save)(void* instance, void* bytes, uint64_t room);
  /* Restores what save() wrote; non-zero if the bytes are not of that kind. If save or restore is null, the
   * state of a simulation with this actuator cannot be saved. */
  int (*restore)(void* instance, const void* bytes, uint64_t count);
} smartsurf_plugin_actuator;

/* ---- a sensor */

enum smartsurf_plugin_sensor_flags {
  SMARTSURF_NEEDS_IMPULSES = 1 /* reads smartsurf_plugin_scene::impulse */
};

/* A ray from every cell, the same for all in the cell's own frame. */
typedef struct smartsurf_plugin_ray {
  uint32_t size;
  uint32_t hits_pins; /* 1: pins block the ray */
  float origin[3];    /* from the centre of the cell's top, u */
  float direction[3]; /* of any length but 0 */
  float range;        /* u */
} smartsurf_plugin_ray;

typedef struct smartsurf_plugin_sensor_context smartsurf_plugin_sensor_context;
struct smartsurf_plugin_sensor_context {
  uint32_t size;
  const smartsurf_plugin_surface* surface;
  /* Values of the sensor's parameters, in their order; valid as long as the instance. */
  const smartsurf_plugin_value* values;
  /* Prepares a ray that sense() casts. Returns its number: 0, 1, … */
  uint32_t (*add_ray)(const smartsurf_plugin_sensor_context* context, const smartsurf_plugin_ray* ray);
  char* message; /* why create() returns null */
};

/* The state of the world at the end of a tick. */
typedef struct smartsurf_plugin_scene smartsurf_plugin_scene;
struct smartsurf_plugin_scene {
  uint32_t size;
  uint64_t tick;
  double time_s, period_s; /* simulated time, and the duration of a tick */
  const smartsurf_plugin_objects* objects;
  const float* height; /* rows × columns: z of the tops, u; -infinity for a missing cell */
  /* Rows × columns: normal impulse during the tick, mass·u/s. Null unless it is needed. */
  const float* impulse;
  /* Casts a ray from every cell. Sets two arrays of rows × columns, which are valid until the ray is cast
   * again: the distance to what it hits first, in [0, range], u; and the k of that object among the `count`
   * of `objects`, -1 for a pin or nothing. A ray that add_ray() has not returned ends the run with an error.
   */
  void (*cast)(const smartsurf_plugin_scene* scene, uint32_t ray, const float** distance,
               const int32_t** object);
};

typedef struct smartsurf_plugin_sensor {
  uint32_t size;
  uint32_t flags; /* smartsurf_plugin_sensor_flags */
  const char* name;
  /* Its own; noise, latency and the other errors come with them. */
  const smartsurf_plugin_parameter* parameters;
  uint32_t parameter_count;
  uint32_t channel_count;
  const smartsurf_plugin_channel* channels;
  /* 1 + the number of the channel that is not 0 in cells that detect something; 0: every cell always
   * measures. */
  uint32_t mask_channel;

  int (*configure)(const smartsurf_plugin_value* values, smartsurf_plugin_configuration* configuration);
  void* (*create)(const smartsurf_plugin_sensor_context* context);
  void (*destroy)(void* instance);
  /* Writes the true values, by channel: components × rows × columns. The program clamps them to the channel's
   * range, and replaces NaN by its neutral value. */
  void (*sense)(void* instance, const smartsurf_plugin_scene* scene, float* const* readings);
  /* Like an actuator's save() and restore(), for state that the world's does not determine. Both may be null.
   * restore() is called after a sense() of the restored world, in which the impulses are 0. */
  uint64_t (*save)(void* instance, void* bytes, uint64_t room);
  int (*restore)(void* instance, const void* bytes, uint64_t count);
} smartsurf_plugin_sensor;

/* ---- the extension */

typedef struct smartsurf_plugin {
  uint32_t size;
  uint32_t version; /* SMARTSURF_PLUGIN_VERSION */
  const smartsurf_plugin_actuator* actuators;
  const smartsurf_plugin_sensor* sensors;
  uint32_t actuator_count, sensor_count;
} smartsurf_plugin;

/* The one function that an extension exports. Called once. */
__attribute__((visibility("default"))) const smartsurf_plugin* smartsurf_plugin_get(void);

#ifdef __cplusplus
}
#endif

#endif
