// An extension with an actuator and a sensor that use all of smartsurf_plugin.h.
#include <fenv.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "smartsurf/extension/smartsurf_plugin.h"

// As what libraries set that GCC links with -Ofast.
__attribute__((constructor)) static void change_arithmetic(void) { fesetround(FE_UPWARD); }

// ---- lifter: moves tops towards their targets, at most `steps`; pushes objects labelled 'light' east.
enum { MAX_HEIGHT, STEPS, PUSH };
static const smartsurf_plugin_parameter lifter_parameters[] = {
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "max_height", "u", {3, 0, 0}, 0.1, 10},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_COUNT, "steps", "", {NAN, 0, 0}, 1, 1e6},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_VECTOR, "push.force", "mass·u/s²", {0, 0, 0}, -100, 100},
};
static const smartsurf_plugin_channel lifter_channels[] = {
    {sizeof(smartsurf_plugin_channel), 1, "lift", "u", 0, 1, 0, 0},
};

typedef struct {
  smartsurf_plugin_actuator_context context;
  uint64_t steps;
} lifters;

static int configure_lifter(const smartsurf_plugin_value* values,
                            smartsurf_plugin_configuration* configuration) {
  configuration->channels[0].maximum = values[MAX_HEIGHT].x;
  configuration->max_height = values[MAX_HEIGHT].x;
  return 0;
}

static void* create_lifter(const smartsurf_plugin_actuator_context* context) {
  if (!isnan(context->values[STEPS].x) && context->values[STEPS].x == 13) {
    strcpy(context->message, "thirteen steps");
    return NULL;
  }
  lifters* l = malloc(sizeof *l);
  l->context = *context;
  l->steps = 0;
  return l;
}

static void snap_lifter(void* instance, const smartsurf_plugin_motion* motion) {
  const lifters* l = instance;
  for (uint32_t k = 0; k < l->context.cell_count; ++k)
    motion->height[l->context.cells[k]] = motion->targets[0][l->context.cells[k]];
}

static void plan_lifter(void* instance, const smartsurf_plugin_motion* motion) {
  lifters* l = instance;
  const double limit = l->context.values[STEPS].x;
  const int rests = !isnan(limit) && (double)l->steps >= limit;
  for (uint32_t k = 0; k < l->context.cell_count; ++k) {
    const uint32_t i = l->context.cells[k];
    const float missing = motion->targets[0][i] - motion->height[i];
    motion->speed[i] = rests ? 0 : fmaxf(-2, fminf(missing / (float)motion->dt_s, 2));
  }
  ++l->steps;
}

static void push_lifter(void* instance, double dt_s, const float* height,
                        const smartsurf_plugin_objects* objects, float* wrenches) {
  const lifters* l = instance;
  (void)dt_s, (void)height;
  for (uint32_t k = 0; k < objects->count; ++k) {
    if (strcmp(objects->label[objects->id[k]], "light") != 0 || objects->mass[k] == 0) continue;
    wrenches[6 * k] += (float)l->context.values[PUSH].x;
    wrenches[6 * k + 2] += (float)l->context.values[PUSH].z;
  }
}

static uint64_t save_lifter(void* instance, void* bytes, uint64_t room) {
  const lifters* l = instance;
  if (room >= sizeof l->steps) memcpy(bytes, &l->steps, sizeof l->steps);
  return sizeof l->steps;
}

static int restore_lifter(void* instance, const void* bytes, uint64_t count) {
  lifters* l = instance;
  if (count != sizeof l->steps) return 1;
  memcpy(&l->steps, bytes, sizeof l->steps);
  return 0;
}

// ---- presser: tops that rise or sink at `speed` with little force; output number `wrong` gets `value`.
enum { SPEED, FORCE, WRONG, VALUE, TOP };
static const smartsurf_plugin_parameter presser_parameters[] = {
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "speed", "u/s", {0, 0, 0}, -100, 100},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "force", "", {0.1, 0, 0}, 0, 100},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_COUNT, "wrong", "", {NAN, 0, 0}, 0, 7},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "value", "NaN if absent", {NAN, 0, 0}, -1, 0},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "highest", "u", {3, 0, 0}, -1e9, 1e9},
};

static int configure_presser(const smartsurf_plugin_value* values,
                             smartsurf_plugin_configuration* configuration) {
  configuration->max_height = values[TOP].x;
  return 0;
}

static void* create_presser(const smartsurf_plugin_actuator_context* context) {
  lifters* l = malloc(sizeof *l);
  *l = (lifters){.context = *context};
  return l;
}

static void plan_presser(void* instance, const smartsurf_plugin_motion* motion) {
  const lifters* l = instance;
  const smartsurf_plugin_value* values = l->context.values;
  float* const outputs[] = {motion->speed,        motion->surface_velocity_x, motion->surface_velocity_y,
                            motion->surface_spin, motion->force_limit,        motion->no_load_speed,
                            motion->height};
  for (uint32_t k = 0; k < l->context.cell_count; ++k) {
    const uint32_t i = l->context.cells[k];
    motion->speed[i] = (float)values[SPEED].x;
    motion->force_limit[i] = (float)values[FORCE].x;
    motion->no_load_speed[i] = 1;
  }
  const double wrong = values[WRONG].x;
  if (wrong < 7) outputs[(int)wrong][l->context.cells[9]] = (float)values[VALUE].x;
}

static void press(void* instance, double dt_s, const float* height, const smartsurf_plugin_objects* objects,
                  float* wrenches) {
  const lifters* l = instance;
  (void)dt_s, (void)height;
  if (l->context.values[WRONG].x == 7) wrenches[6 * (objects->count - 1) + 4] = NAN;
}

// ---- rester: tops that rest, whatever speed it writes.
static void plan_rester(void* instance, const smartsurf_plugin_motion* motion) {
  const lifters* l = instance;
  motion->speed[l->context.cells[9]] = (float)l->context.values[0].x;
}

// ---- census: the average force on each cell; the number of spheres; values that the program must replace.
static const smartsurf_plugin_channel census_channels[] = {
    {sizeof(smartsurf_plugin_channel), 1, "", "mass*u/s^2", 0, 1e6, 0, 0},
    {sizeof(smartsurf_plugin_channel), 1, "_spheres", "", 0, 100, 0, SMARTSURF_EXACT},
    {sizeof(smartsurf_plugin_channel), 2, "_odd", "", -1, 1, 0.5, SMARTSURF_EXACT},
};

// Prepares a ray and casts ray `cast`, if that is given. save() returns `bytes`, and one more for 13.
enum { CAST, ORIGIN, DIRECTION, REACH, BYTES };
static const smartsurf_plugin_parameter census_parameters[] = {
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_COUNT, "cast", "", {NAN, 0, 0}, 0, 100},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_VECTOR, "origin", "u", {0, 0, 0}, -1e30, 1e30},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_VECTOR, "direction", "", {0, 0, 1}, -1e30, 1e30},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "reach", "u", {5, 0, 0}, -1e30, 1e30},
    {sizeof(smartsurf_plugin_parameter), SMARTSURF_NUMBER, "bytes", "", {0, 0, 0}, 0, 1e18},
};

// Stands for what a script cannot give.
static float number(double given) { return given == 7777 ? NAN : given == 8888 ? INFINITY : (float)given; }

typedef struct {
  uint32_t cells;
  double cast;
  uint64_t bytes;
} census;

static void* create_census(const smartsurf_plugin_sensor_context* context) {
  census* c = malloc(sizeof *c);
  c->cells = context->surface->rows * context->surface->columns;
  const smartsurf_plugin_value* const values = context->values;
  c->cast = values[CAST].x;
  c->bytes = (uint64_t)values[BYTES].x;
  if (c->cast == 13) {
    strcpy(context->message, "\xE9\x1B[31m\xC3\xA9");  // Latin-1, an escape sequence, UTF-8
    free(c);
    return NULL;
  }
  const smartsurf_plugin_value from = values[ORIGIN], to = values[DIRECTION];
  const smartsurf_plugin_ray ray = {.size = sizeof ray,
                                    .origin = {number(from.x), number(from.y), number(from.z)},
                                    .direction = {number(to.x), number(to.y), number(to.z)},
                                    .range = number(values[REACH].x)};
  if (!isnan(c->cast)) context->add_ray(context, &ray);
  return c;
}

static uint64_t save_census(void* instance, void* bytes, uint64_t room) {
  const census* c = instance;
  if (room >= c->bytes && room > 0) memset(bytes, 1, c->bytes);
  return c->bytes + (room == 13);
}

static int restore_census(void* instance, const void* bytes, uint64_t count) {
  (void)bytes;
  return count != ((const census*)instance)->bytes;
}

static void sense_census(void* instance, const smartsurf_plugin_scene* scene, float* const* readings) {
  const census* c = instance;
  const uint32_t cells = c->cells;
  const float* distance;
  const int32_t* object;
  if (!isnan(c->cast)) scene->cast(scene, (uint32_t)c->cast, &distance, &object);
  float spheres = 0;
  for (uint32_t k = 0; k < scene->objects->count; ++k)
    if (scene->objects->shape[scene->objects->id[k]] == SMARTSURF_SPHERE) ++spheres;
  for (uint32_t i = 0; i < cells; ++i) {
    readings[0][i] = scene->impulse == NULL ? -1 : scene->impulse[i] / (float)scene->period_s;
    readings[1][i] = spheres;
    readings[2][i] = NAN;
    readings[2][cells + i] = !isnan(c->cast) && object[i] >= 0 ? -distance[i] / 5 : 1e9F;
  }
}

static const smartsurf_plugin_actuator actuators[] = {
    {
        .size = sizeof(smartsurf_plugin_actuator),
        .name = "rester",
        .parameters = presser_parameters,
        .parameter_count = 1,
        .channels = lifter_channels,
        .channel_count = 1,
        .create = create_presser,
        .destroy = free,
        .plan = plan_rester,
    },
    {
        .size = sizeof(smartsurf_plugin_actuator),
        .flags =
            SMARTSURF_MOVES_TOPS | SMARTSURF_MOVES_SURFACE | SMARTSURF_LIMITS_FORCE | SMARTSURF_EXERTS_FORCES,
        .name = "presser",
        .parameters = presser_parameters,
        .parameter_count = 5,
        .channels = lifter_channels,
        .channel_count = 1,
        .configure = configure_presser,
        .create = create_presser,
        .destroy = free,
        .plan = plan_presser,
        .add_forces = press,
        .save = save_lifter,
        .restore = restore_lifter,
    },
    {
        .size = sizeof(smartsurf_plugin_actuator),
        .flags = SMARTSURF_MOVES_TOPS | SMARTSURF_EXERTS_FORCES,
        .name = "lifter",
        .parameters = lifter_parameters,
        .parameter_count = 3,
        .channels = lifter_channels,
        .channel_count = 1,
        .configure = configure_lifter,
        .create = create_lifter,
        .destroy = free,
        .snap = snap_lifter,
        .plan = plan_lifter,
        .add_forces = push_lifter,
        .save = save_lifter,
        .restore = restore_lifter,
    }};
static const smartsurf_plugin_sensor sensors[] = {{
    .size = sizeof(smartsurf_plugin_sensor),
    .flags = SMARTSURF_NEEDS_IMPULSES,
    .name = "census",
    .parameters = census_parameters,
    .parameter_count = 5,
    .channels = census_channels,
    .channel_count = 3,
    .mask_channel = 2,
    .create = create_census,
    .destroy = free,
    .sense = sense_census,
    .save = save_census,
    .restore = restore_census,
}};
static const smartsurf_plugin plugin = {.size = sizeof plugin,
                                        .version = SMARTSURF_PLUGIN_VERSION,
                                        .actuators = actuators,
                                        .actuator_count = 3,
                                        .sensors = sensors,
                                        .sensor_count = 1};

const smartsurf_plugin* smartsurf_plugin_get(void) { return &plugin; }
