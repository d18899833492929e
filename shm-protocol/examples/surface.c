/* A surface in C: no physics, only a spot that moves over the cells; it checks the controller's answers. */
#include <shm_protocol/shm_protocol.h>
#include <stdio.h>
#include <string.h>

enum { ROWS = 8, COLUMNS = 8, CELLS = ROWS * COLUMNS };

static int fail(const char* what) {
  fprintf(stderr, "surface: %s\n", what);
  return 1;
}

int main(int argc, char** argv) {
  ssp_channel_spec channels[2] = {
      {.name = "proximity_hit", .direction = SSP_SENSOR, .dtype = SSP_F32, .maximum = 1.0},
      {.name = "height", .unit = "u", .direction = SSP_ACTUATOR, .dtype = SSP_F32, .maximum = 6.0}};
  ssp_surface_config config = {.name = argc > 1 ? argv[1] : "surface",
                               .rows = ROWS,
                               .columns = COLUMNS,
                               .period_ns = 16666667,
                               .channels = channels,
                               .channel_count = 2};
  ssp_surface* surface;
  if (ssp_surface_create(&config, &surface) != SSP_OK) return fail(ssp_last_error());
  if (ssp_surface_await_controller(surface, 20000000000, NULL) != SSP_OK) return fail("nobody came");

  ssp_result result = SSP_OK;
  for (uint64_t tick = 0; tick < 500 && result == SSP_OK; ++tick) {
    float* hit = ssp_surface_sensor(surface, 0, NULL);
    memset(hit, 0, CELLS * sizeof *hit);
    hit[tick % CELLS] = 1;
    if (ssp_surface_publish(surface, tick, (double)tick / 60, 0) != SSP_OK) return fail("publish");
    if ((result = ssp_surface_await(surface, tick, SSP_FOREVER, NULL)) != SSP_OK) break;
    const float* height = ssp_surface_actuator(surface, 1, NULL);
    for (int i = 0; i < CELLS; ++i)
      if (height[i] != (i == (int)(tick % CELLS) ? 0.0f : 4.0f)) return fail("a wrong height");
  }
  if (result != SSP_OK) fail(ssp_text(result));
  ssp_surface_destroy(surface);
  return result == SSP_OK ? 0 : 3;
}
