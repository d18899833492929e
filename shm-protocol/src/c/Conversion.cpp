#include "Conversion.h"

#include <algorithm>
#include <cstdio>

namespace shm_protocol::c {
namespace {

thread_local char last_message[512] = "";
thread_local std::uint32_t last_pid = 0;

// ErrorCode k maps to the ssp_result −1 − k.
constexpr ssp_result to_result(ErrorCode code) noexcept {
  return static_cast<ssp_result>(-1 - static_cast<int>(code));
}
static_assert(to_result(ErrorCode::kBadConfig) == SSP_E_BAD_CONFIG &&
              to_result(ErrorCode::kSurfaceLives) == SSP_E_SURFACE_LIVES &&
              to_result(ErrorCode::kNotFound) == SSP_E_NOT_FOUND &&
              to_result(ErrorCode::kControllerLives) == SSP_E_CONTROLLER_LIVES &&
              to_result(ErrorCode::kWrongVersion) == SSP_E_WRONG_VERSION &&
              to_result(ErrorCode::kCorrupt) == SSP_E_CORRUPT &&
              to_result(ErrorCode::kForeign) == SSP_E_FOREIGN &&
              to_result(ErrorCode::kLayoutChanged) == SSP_E_LAYOUT_CHANGED &&
              to_result(ErrorCode::kInterrupted) == SSP_E_INTERRUPTED &&
              to_result(ErrorCode::kSystem) == SSP_E_SYSTEM);

template <std::size_t N>
void copy_text(char (&to)[N], const std::string& from) noexcept {
  const std::size_t length = std::min(from.size(), N - 1);
  std::memcpy(to, from.data(), length);
  std::memset(to + length, 0, N - length);
}

}  // namespace

ssp_result fail(ssp_result code, const char* what, std::uint32_t pid) noexcept {
  std::snprintf(last_message, sizeof last_message, "%s", what);
  last_pid = pid;
  return code;
}

ssp_result fail_with_current_exception() noexcept {
  try {
    throw;
  } catch (const Error& e) {
    return fail(to_result(e.code()), e.what(), e.pid());
  } catch (const std::bad_alloc&) {
    return fail(SSP_E_NO_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return fail(SSP_E_INTERNAL, e.what());
  } catch (...) {
    return fail(SSP_E_INTERNAL, "unknown exception");
  }
}

void fill(ssp_description& out, const Description& d) noexcept {
  out = {};
  copy_text(out.name, d.name);
  out.version_major = d.version_major;
  out.version_minor = d.version_minor;
  out.session = d.session;
  out.layout_hash = d.layout_hash;
  out.rows = d.rows;
  out.columns = d.columns;
  out.pitch = d.pitch;
  out.period_ns = d.period_ns;
  out.mode = static_cast<std::uint32_t>(d.mode);
  out.channel_count = static_cast<std::uint32_t>(d.channels.size());
  out.surface_pid = d.surface_pid;
  out.positions = d.positions.empty() ? nullptr : d.positions.front().data();
}

void fill(ssp_channel_info& out, const Description& d, const ChannelSpec& c) noexcept {
  out = {};
  copy_text(out.name, c.name);
  copy_text(out.unit, c.unit);
  out.direction = static_cast<std::uint32_t>(c.direction);
  out.dtype = static_cast<std::uint32_t>(c.dtype);
  out.components = c.components;
  out.minimum = c.minimum;
  out.maximum = c.maximum;
  out.safe = c.safe;
  out.bytes = std::uint64_t{d.cells()} * c.components * element_bytes(c.dtype);
}

void fill(ssp_frame_info& out, const FrameInfo& f) noexcept {
  out = {};
  out.frame = f.frame;
  out.tick = f.tick;
  out.time_s = f.time_s;
  out.answers = f.answers;
  out.status = f.status;
}

void fill(ssp_counters* out, const Counters& c) noexcept {
  if (!out) return;
  *out = {};
  out->skipped = c.skipped;
  out->repeated = c.repeated;
  out->clamped = c.clamped;
  out->deadline_misses = c.deadline_misses;
}

}  // namespace shm_protocol::c

using namespace shm_protocol;

// A Status maps to the ssp_result of the same value.
static_assert(static_cast<int>(Status::kOk) == SSP_OK &&
              static_cast<int>(Status::kRepeated) == SSP_REPEATED &&
              static_cast<int>(Status::kTorn) == SSP_TORN &&
              static_cast<int>(Status::kTimeout) == SSP_TIMEOUT &&
              static_cast<int>(Status::kInterrupted) == SSP_INTERRUPTED &&
              static_cast<int>(Status::kOutOfTurn) == SSP_OUT_OF_TURN &&
              static_cast<int>(Status::kNoController) == SSP_NO_CONTROLLER &&
              static_cast<int>(Status::kControllerDead) == SSP_CONTROLLER_DEAD &&
              static_cast<int>(Status::kControllerClosed) == SSP_CONTROLLER_CLOSED &&
              static_cast<int>(Status::kSurfaceDead) == SSP_SURFACE_DEAD &&
              static_cast<int>(Status::kSurfaceClosed) == SSP_SURFACE_CLOSED);

extern "C" {

// A program in C may pass any number, which its enumeration holds.
__attribute__((no_sanitize("enum"))) const char* ssp_text(ssp_result result) {
  static constexpr const char* kErrors[] = {"impossible description or name",
                                            "a living surface owns the name",
                                            "no such surface",
                                            "another controller is attached",
                                            "another major version of the protocol",
                                            "corrupt header",
                                            "not a segment of this protocol",
                                            "the new surface has another layout",
                                            "interrupted while attaching",
                                            "the operating system refused",
                                            "wrong argument",
                                            "out of memory",
                                            "defect of the library"};
  if (result >= 0) return text(static_cast<Status>(result));
  return result >= SSP_E_INTERNAL ? kErrors[-1 - result] : "unknown";
}

const char* ssp_last_error(void) { return c::last_message; }
uint32_t ssp_last_error_pid(void) { return c::last_pid; }
uint32_t ssp_protocol_version(void) { return SSP_VERSION; }

const char* ssp_mode_text(uint32_t mode) {
  return mode == SSP_MODE_TIME_STEP || mode == SSP_MODE_PASSIVE ? text(static_cast<Mode>(mode)) : "unknown";
}
const char* ssp_state_text(uint32_t state) { return text(static_cast<State>(state)); }
const char* ssp_direction_text(uint32_t direction) {
  return direction == SSP_SENSOR || direction == SSP_ACTUATOR ? text(static_cast<Direction>(direction))
                                                              : "unknown";
}
const char* ssp_dtype_text(uint32_t dtype) {
  return dtype >= SSP_F32 && dtype <= SSP_U8 ? text(static_cast<DType>(dtype)) : "unknown";
}

ssp_stop* ssp_stop_create(void) { return new (std::nothrow) ssp_stop; }
void ssp_stop_raise(ssp_stop* stop) {
  if (stop) stop->raised.store(true, std::memory_order_relaxed);
}
void ssp_stop_lower(ssp_stop* stop) {
  if (stop) stop->raised.store(false, std::memory_order_relaxed);
}
void ssp_stop_destroy(ssp_stop* stop) { delete stop; }

}  // extern "C"
