/* A controller in C: pins under an object go down, all others up. */
#include <shm_protocol/shm_protocol.h>
#include <stdio.h>

static int fail(int status, const char* what) {
  fprintf(stderr, "%s\n", what);
  return status;
}

/* The index of a float32 channel with one component, or -1. */
static int find(ssp_controller* table, uint32_t direction, const char* name) {
  ssp_channel_info info;
  int channel = ssp_controller_find(table, direction, name);
  int fits = ssp_controller_channel(table, channel, &info) == SSP_OK && info.dtype == SSP_F32 &&
             info.components == 1;
  return fits ? channel : -1;
}

int main(int argc, char** argv) {
  ssp_controller* table;
  if (ssp_controller_attach(argc > 1 ? argv[1] : "surface", 10000000000, NULL, &table) != SSP_OK)
    return fail(3, ssp_last_error());
  int hit = find(table, SSP_SENSOR, "proximity_hit");
  int height = find(table, SSP_ACTUATOR, "height");
  if (hit < 0 || height < 0) return fail(2, "no float32 proximity_hit or height");

  ssp_result result;
  while ((result = ssp_controller_await(table, SSP_FOREVER, NULL)) == SSP_OK) {
    size_t bytes;
    const float* in = ssp_controller_sensor(table, hit, &bytes);
    float* out = ssp_controller_actuator(table, height, NULL);
    for (size_t i = 0; i < bytes / sizeof *in; ++i) out[i] = in[i] > 0 ? 0.0f : 4.0f;
    if (ssp_controller_publish(table) != SSP_OK) break;
  }
  fprintf(stderr, "%s\n", ssp_text(result));
  ssp_controller_destroy(table);
  return result == SSP_SURFACE_CLOSED ? 0 : 3;
}
