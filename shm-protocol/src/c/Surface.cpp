#include "shm_protocol/SurfaceEndpoint.h"

#include "Conversion.h"

using namespace shm_protocol;

struct ssp_surface {
  SurfaceEndpoint endpoint;
};

namespace {

std::string text_or_empty(const char* text) { return text ? text : ""; }

ChannelSpec spec_of(const ssp_channel_spec& c) {
  ChannelSpec spec;
  spec.name = text_or_empty(c.name);
  spec.unit = text_or_empty(c.unit);
  spec.direction = static_cast<Direction>(c.direction);
  spec.dtype = static_cast<DType>(c.dtype);
  spec.components = c.components ? c.components : 1;
  spec.minimum = c.minimum;
  spec.maximum = c.maximum;
  spec.safe = c.safe;
  return spec;
}

SurfaceConfig config_of(const ssp_surface_config& c) {
  SurfaceConfig config;
  config.name = text_or_empty(c.name);
  config.rows = c.rows;
  config.columns = c.columns;
  if (c.pitch != 0.0) config.pitch = c.pitch;
  config.period_ns = c.period_ns;
  if (c.mode) config.mode = static_cast<Mode>(c.mode);
  if (c.slots) config.slots = c.slots;
  config.hold_last_frame = !c.safe_when_alone;
  if (c.channel_count > SSP_MAX_CHANNELS || (c.channel_count && !c.channels))
    throw Error(ErrorCode::kBadConfig,
                "channels: there are " + std::to_string(c.channel_count) + "; must be 1 to 32, and given");
  for (std::uint32_t i = 0; i < c.channel_count; ++i) config.channels.push_back(spec_of(c.channels[i]));
  // Check the size first: an invalid cell count would read beyond the positions.
  if (c.positions && c.rows >= 1 && c.rows <= 65536 && c.columns >= 1 && c.columns <= 65536) {
    config.positions.resize(std::size_t{c.rows} * c.columns);
    std::memcpy(config.positions.data(), c.positions, config.positions.size() * sizeof(float[3]));
  }
  return config;
}

}  // namespace

extern "C" {

ssp_result ssp_surface_create(const ssp_surface_config* config, ssp_surface** out) {
  return c::open(config, out, [&] { return SurfaceEndpoint::create(config_of(*config)); });
}

void ssp_surface_close(ssp_surface* surface) {
  if (surface) surface->endpoint.close();
}
void ssp_surface_destroy(ssp_surface* surface) { delete surface; }

ssp_result ssp_surface_describe(const ssp_surface* s, ssp_description* out) { return c::describe(s, out); }
ssp_result ssp_surface_channel(const ssp_surface* s, int channel, ssp_channel_info* out) {
  return c::describe_channel(s, channel, out);
}
int ssp_surface_find(const ssp_surface* s, uint32_t direction, const char* name) {
  return c::find(s, direction, name);
}

void* ssp_surface_sensor(ssp_surface* s, int channel, size_t* bytes) {
  return c::array_of(s, channel, Direction::kSensor, bytes,
                     [&]<class T>(T) { return s->endpoint.sensor<T>(channel); });
}

ssp_result ssp_surface_write(ssp_surface* s, int channel, size_t at, const void* values, size_t bytes) {
  return c::write(s, channel, Direction::kSensor, at, values, bytes);
}
ssp_result ssp_surface_publish(ssp_surface* s, uint64_t tick, double time_s, uint32_t status) {
  return s ? c::to_result(s->endpoint.publish(tick, time_s, status)) : c::null_argument();
}
ssp_result ssp_surface_await(ssp_surface* s, uint64_t tick, int64_t timeout_ns, const ssp_stop* stop) {
  return s ? c::to_result(s->endpoint.await_actuators(tick, c::to_wait_options(timeout_ns, stop)))
           : c::null_argument();
}
const void* ssp_surface_next(ssp_surface* s, int channel, int64_t timeout_ns, const ssp_stop* stop,
                             size_t* bytes) {
  return c::next(s, channel, Direction::kActuator, c::to_wait_options(timeout_ns, stop), bytes);
}
ssp_result ssp_surface_latest(ssp_surface* s) {
  return s ? c::to_result(s->endpoint.latest_actuators()) : c::null_argument();
}
ssp_result ssp_surface_await_controller(ssp_surface* s, int64_t timeout_ns, const ssp_stop* stop) {
  return s ? c::to_result(s->endpoint.await_controller(c::to_wait_options(timeout_ns, stop)))
           : c::null_argument();
}

const void* ssp_surface_actuator(const ssp_surface* s, int channel, size_t* bytes) {
  return c::array_of(s, channel, Direction::kActuator, bytes,
                     [&]<class T>(T) { return s->endpoint.actuator<T>(channel); });
}
ssp_result ssp_surface_frame(const ssp_surface* s, ssp_frame_info* out) {
  if (!s || !out) return c::null_argument();
  c::fill(*out, s->endpoint.actuator_info());
  return SSP_OK;
}

ssp_result ssp_surface_set_state(ssp_surface* s, uint32_t state) { return c::set_state(s, state); }
ssp_result ssp_surface_miss_deadline(ssp_surface* s) {
  if (!s) return c::null_argument();
  s->endpoint.miss_deadline();
  return SSP_OK;
}
uint32_t ssp_surface_controller_pid(const ssp_surface* s) { return s ? s->endpoint.controller_pid() : 0; }
uint32_t ssp_surface_controller_state(const ssp_surface* s) {
  return s ? static_cast<uint32_t>(s->endpoint.controller_state()) : uint32_t{SSP_STATE_NONE};
}
ssp_result ssp_surface_counters(const ssp_surface* s, ssp_counters* surface, ssp_counters* controller) {
  if (!s) return c::null_argument();
  c::fill(surface, s->endpoint.counters());
  c::fill(controller, s->endpoint.controller_counters());
  return SSP_OK;
}

}  // extern "C"
