#include "Conversion.h"
#include "shm_protocol/ObserverEndpoint.h"

using namespace shm_protocol;

struct ssp_observer {
  ObserverEndpoint endpoint;
};

namespace {

bool is_direction(uint32_t direction) { return direction == SSP_SENSOR || direction == SSP_ACTUATOR; }

ssp_result wrong_direction() { return c::fail(SSP_E_ARGUMENT, "no such direction"); }

}  // namespace

extern "C" {

ssp_result ssp_observer_attach(const char* name, int64_t timeout_ns, const ssp_stop* stop,
                               ssp_observer** out) {
  return c::open(name, out,
                 [&] { return ObserverEndpoint::attach(name, c::to_attach_options(timeout_ns, stop)); });
}

void ssp_observer_destroy(ssp_observer* observer) { delete observer; }

ssp_result ssp_observer_describe(const ssp_observer* o, ssp_description* out) { return c::describe(o, out); }
ssp_result ssp_observer_channel(const ssp_observer* o, int channel, ssp_channel_info* out) {
  return c::describe_channel(o, channel, out);
}
int ssp_observer_find(const ssp_observer* o, uint32_t direction, const char* name) {
  return c::find(o, direction, name);
}

ssp_result ssp_observer_latest(ssp_observer* o, uint32_t direction) {
  if (!o) return c::null_argument();
  if (!is_direction(direction)) return wrong_direction();
  return c::to_result(o->endpoint.latest(static_cast<Direction>(direction)));
}
ssp_result ssp_observer_await(ssp_observer* o, uint32_t direction, int64_t timeout_ns, const ssp_stop* stop) {
  if (!o) return c::null_argument();
  if (!is_direction(direction)) return wrong_direction();
  return c::to_result(
      o->endpoint.await(static_cast<Direction>(direction), c::to_wait_options(timeout_ns, stop)));
}

const void* ssp_observer_array(const ssp_observer* o, int channel, size_t* bytes) {
  return c::array_of(o, channel, std::nullopt, bytes,
                     [&]<class T>(T) { return o->endpoint.array<T>(channel); });
}
ssp_result ssp_observer_frame(const ssp_observer* o, uint32_t direction, ssp_frame_info* out) {
  if (!o || !out) return c::null_argument();
  if (!is_direction(direction)) return wrong_direction();
  c::fill(*out, o->endpoint.info(static_cast<Direction>(direction)));
  return SSP_OK;
}

uint32_t ssp_observer_surface_state(const ssp_observer* o) {
  return o ? static_cast<uint32_t>(o->endpoint.surface_state()) : uint32_t{SSP_STATE_NONE};
}
uint32_t ssp_observer_controller_state(const ssp_observer* o) {
  return o ? static_cast<uint32_t>(o->endpoint.controller_state()) : uint32_t{SSP_STATE_NONE};
}
uint32_t ssp_observer_controller_pid(const ssp_observer* o) { return o ? o->endpoint.controller_pid() : 0; }
ssp_result ssp_observer_counters(const ssp_observer* o, ssp_counters* surface, ssp_counters* controller) {
  if (!o) return c::null_argument();
  c::fill(surface, o->endpoint.surface_counters());
  c::fill(controller, o->endpoint.controller_counters());
  return SSP_OK;
}

}  // extern "C"
