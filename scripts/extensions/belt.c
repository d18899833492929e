// belt.c: an actuator, a belt in each cell that runs east. docs/extending.md explains extensions.
#include <math.h>
#include <smartsurf_plugin.h>
#include <stdio.h>
#include <stdlib.h>

enum { MAX_SPEED, MAX_ACCELERATION };
static const smartsurf_plugin_parameter parameters[] = {
    {.size = sizeof(smartsurf_plugin_parameter),
     .type = SMARTSURF_NUMBER,
     .name = "max_speed",
     .description = "of the belt, u/s",
     .default_value = {2, 0, 0},
     .minimum = 0.001,
     .maximum = 1e3},
    {.size = sizeof(smartsurf_plugin_parameter),
     .type = SMARTSURF_NUMBER,
     .name = "max_acceleration",
     .description = "of the belt, u/s²",
     .default_value = {20, 0, 0},
     .minimum = 0,
     .maximum = 1e6},
};
static const smartsurf_plugin_channel channels[] = {
    {sizeof(smartsurf_plugin_channel), 1, "speed", "u/s", -1, 1, 0, 0},
};

static int configure(const smartsurf_plugin_value* values, smartsurf_plugin_configuration* configuration) {
  configuration->channels[0].minimum = -values[MAX_SPEED].x;
  configuration->channels[0].maximum = values[MAX_SPEED].x;
  return 0;
}

typedef struct {
  const uint32_t* cells;
  uint32_t count;
  float acceleration;
} belts;

static void* create(const smartsurf_plugin_actuator_context* context) {
  belts* b = malloc(sizeof *b);
  if (b == NULL) {
    snprintf(context->message, 256, "out of memory");
    return NULL;
  }
  *b = (belts){context->cells, context->cell_count, (float)context->values[MAX_ACCELERATION].x};
  return b;
}

static void plan(void* instance, const smartsurf_plugin_motion* motion) {
  const belts* b = instance;
  const float step = b->acceleration * (float)motion->dt_s;
  for (uint32_t k = 0; k < b->count; ++k) {
    const uint32_t i = b->cells[k];
    const float missing = motion->targets[0][i] - motion->surface_velocity_x[i];
    motion->surface_velocity_x[i] += fmaxf(-step, fminf(missing, step));
  }
}

/* A belt's only state is the velocity of its surface, which the program saves. */
static uint64_t save(void* instance, void* bytes, uint64_t room) {
  return (void)instance, (void)bytes, (void)room, 0;
}
static int restore(void* instance, const void* bytes, uint64_t count) {
  return (void)instance, (void)bytes, count != 0;
}

static const smartsurf_plugin_actuator belt = {
    .size = sizeof belt,
    .flags = SMARTSURF_MOVES_SURFACE,
    .name = "belt",
    .parameters = parameters,
    .parameter_count = 2,
    .channels = channels,
    .channel_count = 1,
    .configure = configure,
    .create = create,
    .destroy = free,
    .plan = plan,
    .save = save,
    .restore = restore,
};
static const smartsurf_plugin plugin = {
    .size = sizeof plugin, .version = SMARTSURF_PLUGIN_VERSION, .actuators = &belt, .actuator_count = 1};

const smartsurf_plugin* smartsurf_plugin_get(void) { return &plugin; }
