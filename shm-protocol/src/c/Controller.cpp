#include "Conversion.h"
#include "shm_protocol/ControllerEndpoint.h"

using namespace shm_protocol;

struct ssp_controller {
  ControllerEndpoint endpoint;
};

extern "C" {

ssp_result ssp_controller_attach(const char* name, int64_t timeout_ns, const ssp_stop* stop,
                                 ssp_controller** out) {
  return c::open(name, out,
                 [&] { return ControllerEndpoint::attach(name, c::to_attach_options(timeout_ns, stop)); });
}

void ssp_controller_close(ssp_controller* controller) {
  if (controller) controller->endpoint.close();
}
void ssp_controller_destroy(ssp_controller* controller) { delete controller; }

ssp_result ssp_controller_reconnect(ssp_controller* k, int64_t timeout_ns, const ssp_stop* stop) {
  if (!k) return c::null_argument();
  return c::guarded([&] {
    k->endpoint.reconnect(c::to_attach_options(timeout_ns, stop));
    return SSP_OK;
  });
}

ssp_result ssp_controller_describe(const ssp_controller* k, ssp_description* out) {
  return c::describe(k, out);
}
ssp_result ssp_controller_channel(const ssp_controller* k, int channel, ssp_channel_info* out) {
  return c::describe_channel(k, channel, out);
}
int ssp_controller_find(const ssp_controller* k, uint32_t direction, const char* name) {
  return c::find(k, direction, name);
}

ssp_result ssp_controller_await(ssp_controller* k, int64_t timeout_ns, const ssp_stop* stop) {
  return k ? c::to_result(k->endpoint.await_sensors(c::to_wait_options(timeout_ns, stop)))
           : c::null_argument();
}
ssp_result ssp_controller_latest(ssp_controller* k) {
  return k ? c::to_result(k->endpoint.latest_sensors()) : c::null_argument();
}

const void* ssp_controller_sensor(const ssp_controller* k, int channel, size_t* bytes) {
  const bool has_frame = k && k->endpoint.sensor_info().frame != 0;
  return c::array_of(has_frame ? k : nullptr, channel, Direction::kSensor, bytes,
                     [&]<class T>(T) { return k->endpoint.sensor<T>(channel); });
}
ssp_result ssp_controller_frame(const ssp_controller* k, ssp_frame_info* out) {
  if (!k || !out) return c::null_argument();
  c::fill(*out, k->endpoint.sensor_info());
  return SSP_OK;
}
void* ssp_controller_actuator(ssp_controller* k, int channel, size_t* bytes) {
  return c::array_of(k, channel, Direction::kActuator, bytes,
                     [&]<class T>(T) { return k->endpoint.actuator<T>(channel); });
}
ssp_result ssp_controller_write(ssp_controller* k, int channel, size_t at, const void* values, size_t bytes) {
  return c::write(k, channel, Direction::kActuator, at, values, bytes);
}
const void* ssp_controller_next(ssp_controller* k, int channel, int64_t timeout_ns, const ssp_stop* stop,
                                size_t* bytes) {
  return c::next(k, channel, Direction::kSensor, c::to_wait_options(timeout_ns, stop), bytes);
}
ssp_result ssp_controller_publish(ssp_controller* k) {
  return k ? c::to_result(k->endpoint.publish()) : c::null_argument();
}

ssp_result ssp_controller_set_state(ssp_controller* k, uint32_t state) { return c::set_state(k, state); }
ssp_result ssp_controller_surface_status(ssp_controller* k) {
  return k ? c::to_result(k->endpoint.surface_status()) : c::null_argument();
}
uint32_t ssp_controller_surface_state(const ssp_controller* k) {
  return k ? static_cast<uint32_t>(k->endpoint.surface_state()) : uint32_t{SSP_STATE_NONE};
}
ssp_result ssp_controller_counters(const ssp_controller* k, ssp_counters* surface, ssp_counters* controller) {
  if (!k) return c::null_argument();
  c::fill(surface, k->endpoint.surface_counters());
  c::fill(controller, k->endpoint.counters());
  return SSP_OK;
}

}  // extern "C"
