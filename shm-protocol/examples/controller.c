/* A controller in C: pins under an object go down, all others up. */
#include <shm_protocol/shm_protocol.h>
#include <stdio.h>

int main(int argc, char** argv) {
  ssp_controller* table;
  if (ssp_controller_attach(argc > 1 ? argv[1] : "surface", 10000000000, NULL, &table) != SSP_OK)
    return fprintf(stderr, "%s\n", ssp_last_error()), 3;
  int hit = ssp_controller_find(table, SSP_SENSOR, "proximity_hit");
  int height = ssp_controller_find(table, SSP_ACTUATOR, "height");

  ssp_result result;
  while ((result = ssp_controller_await(table, SSP_FOREVER, NULL)) == SSP_OK) {
    size_t bytes;
    const float* in = ssp_controller_sensor(table, hit, &bytes);
    float* out = ssp_controller_actuator(table, height, NULL);
    if (!in || !out) return fprintf(stderr, "no proximity_hit or no height\n"), 2;
    for (size_t i = 0; i < bytes / sizeof *in; ++i) out[i] = in[i] > 0 ? 0.0f : 4.0f;
    if (ssp_controller_publish(table) != SSP_OK) break;
  }
  fprintf(stderr, "%s\n", ssp_text(result));
  ssp_controller_detach(table);
  return result == SSP_SURFACE_CLOSED ? 0 : 3;
}
