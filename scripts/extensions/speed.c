// speed.c: a sensor for the speed of the object above each cell. docs/extending.md explains extensions.
#include <math.h>
#include <smartsurf_plugin.h>
#include <stdio.h>
#include <stdlib.h>

enum { RANGE, DIRECTION };
static const smartsurf_plugin_parameter parameters[] = {
    {.size = sizeof(smartsurf_plugin_parameter),
     .type = SMARTSURF_NUMBER,
     .name = "range",
     .description = "length of the ray, u",
     .default_value = {8, 0, 0},
     .minimum = 0.001,
     .maximum = 1e6},
    {.size = sizeof(smartsurf_plugin_parameter),
     .type = SMARTSURF_VECTOR,
     .name = "direction",
     .description = "of the ray",
     .default_value = {0, 0, 1},
     .minimum = -1e6,
     .maximum = 1e6},
};
static const smartsurf_plugin_channel channels[] = {
    {sizeof(smartsurf_plugin_channel), 1, "", "u/s", 0, 100, 0, 0},
};

static int configure(const smartsurf_plugin_value* values, smartsurf_plugin_configuration* configuration) {
  const smartsurf_plugin_value d = values[DIRECTION];
  if (d.x != 0 || d.y != 0 || d.z != 0) return 0;
  snprintf(configuration->message, 256, "direction: must not be of length 0");
  return 1;
}

typedef struct {
  uint32_t cells, ray;
} speeds;

static void* create(const smartsurf_plugin_sensor_context* context) {
  speeds* s = malloc(sizeof *s);
  if (s == NULL) {
    snprintf(context->message, 256, "out of memory");
    return NULL;
  }
  const smartsurf_plugin_value d = context->values[DIRECTION];
  const smartsurf_plugin_ray ray = {.size = sizeof ray,
                                    .hits_pins = 1,
                                    .direction = {(float)d.x, (float)d.y, (float)d.z},
                                    .range = (float)context->values[RANGE].x};
  *s = (speeds){context->surface->rows * context->surface->columns, context->add_ray(context, &ray)};
  return s;
}

static void sense(void* instance, const smartsurf_plugin_scene* scene, float* const* readings) {
  const speeds* s = instance;
  const float* distance;
  const int32_t* object;
  scene->cast(scene, s->ray, &distance, &object);
  for (uint32_t i = 0; i < s->cells; ++i) {
    readings[0][i] = 0;
    if (object[i] < 0) continue;
    const float* v = &scene->objects->velocity[3 * object[i]];
    readings[0][i] = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  }
}

static const smartsurf_plugin_sensor speed = {
    .size = sizeof speed,
    .name = "speed",
    .parameters = parameters,
    .parameter_count = 2,
    .channels = channels,
    .channel_count = 1,
    .configure = configure,
    .create = create,
    .destroy = free,
    .sense = sense,
};
static const smartsurf_plugin plugin = {
    .size = sizeof plugin, .version = SMARTSURF_PLUGIN_VERSION, .sensors = &speed, .sensor_count = 1};

const smartsurf_plugin* smartsurf_plugin_get(void) { return &plugin; }
