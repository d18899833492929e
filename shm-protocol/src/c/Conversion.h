// Converts between the C interface and the C++ endpoints: results, errors, descriptions and arrays.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "shm_protocol/Array.h"
#include "shm_protocol/Description.h"
#include "shm_protocol/Error.h"
#include "shm_protocol/Wait.h"
#include "shm_protocol/shm_protocol.h"

struct ssp_stop {
  std::atomic<bool> raised{false};
};

namespace shm_protocol::c {

// Stores the message for ssp_last_error() and returns `code`.
ssp_result fail(ssp_result code, const char* what, std::uint32_t pid = 0) noexcept;
// Converts the current exception to a result and stores its message.
ssp_result fail_with_current_exception() noexcept;
inline ssp_result null_argument() noexcept { return fail(SSP_E_ARGUMENT, "a pointer is null"); }
inline ssp_result wrong_channel() noexcept { return fail(SSP_E_ARGUMENT, "no such channel"); }

inline ssp_result to_result(Status s) noexcept { return static_cast<ssp_result>(s); }

// Runs `body` and converts exceptions to results.
template <class Body>
ssp_result guarded(Body&& body) noexcept {
  try {
    return std::forward<Body>(body)();
  } catch (...) {
    return fail_with_current_exception();
  }
}

inline std::chrono::nanoseconds to_timeout(std::int64_t ns) noexcept {
  return ns < 0 ? WaitOptions::kForever : std::chrono::nanoseconds(ns);
}
inline WaitOptions to_wait_options(std::int64_t timeout_ns, const ssp_stop* stop) noexcept {
  return {to_timeout(timeout_ns), stop ? &stop->raised : nullptr};
}
inline AttachOptions to_attach_options(std::int64_t timeout_ns, const ssp_stop* stop) noexcept {
  return {to_timeout(timeout_ns), stop ? &stop->raised : nullptr};
}

void fill(ssp_description&, const Description&) noexcept;
void fill(ssp_channel_info&, const Description&, const ChannelSpec&) noexcept;
void fill(ssp_frame_info&, const FrameInfo&) noexcept;
void fill(ssp_counters*, const Counters&) noexcept;  // null: no effect

// Null if there is no such channel.
inline const ChannelSpec* find_channel(const Description& d, int channel) noexcept {
  return channel >= 0 && channel < std::ssize(d.channels) ? &d.channels[channel] : nullptr;
}

// Returns the address of the array that access(T{}), of the channel's element type T, gives, and its size in
// bytes. Null, and 0 bytes, unless it is a channel of that direction.
template <class Handle, class Access>
auto* array_of(Handle* handle, int channel, std::optional<Direction> direction, std::size_t* bytes,
               Access&& access) noexcept {
  if (bytes) *bytes = 0;
  const auto give = [&](auto element) {
    const auto span = access(element);
    if (bytes) *bytes = span.size_bytes();
    using Byte = std::conditional_t<std::is_const_v<typename decltype(span)::element_type>, const void, void>;
    return static_cast<Byte*>(span.data());
  };
  const ChannelSpec* spec = handle ? find_channel(handle->endpoint.description(), channel) : nullptr;
  if (!spec || (direction && spec->direction != *direction)) return decltype(give(float{})){nullptr};
  return with_element_type(spec->dtype, give);
}

// Checks the arguments and calls endpoint.write<T>() for the channel's element type.
template <class Handle>
ssp_result write(Handle* handle, int channel, Direction direction, std::size_t at, const void* values,
                 std::size_t bytes) noexcept {
  if (!handle) return null_argument();
  const Description& d = handle->endpoint.description();
  const ChannelSpec* spec = find_channel(d, channel);
  if (!spec || spec->direction != direction) return wrong_channel();
  if (!values && bytes) return null_argument();
  const std::size_t element = element_bytes(spec->dtype), all = d.cells() * spec->components * element;
  if (at > all || bytes > all - at || at % element || bytes % element)
    return fail(SSP_E_ARGUMENT, "that place is not within the array, or not of whole elements");
  with_element_type(spec->dtype, [&]<class T>(T) {
    handle->endpoint.template write<T>(channel, at / element,
                                       {static_cast<const T*>(values), bytes / element});
  });
  return SSP_OK;
}

// Calls endpoint.next_cells<T>() for the channel's element type; null if there are no cells.
template <class Handle>
const void* next(Handle* handle, int channel, Direction direction, const WaitOptions& options,
                 std::size_t* bytes) noexcept {
  if (!bytes) return nullptr;
  return array_of(handle, channel, direction, bytes,
                  [&]<class T>(T) { return handle->endpoint.template next_cells<T>(channel, options); });
}

template <class Handle>
ssp_result set_state(Handle* handle, std::uint32_t state) noexcept {
  if (!handle) return null_argument();
  if (state < SSP_STATE_LOADING || state > SSP_STATE_CLOSING) return fail(SSP_E_ARGUMENT, "no such state");
  handle->endpoint.set_state(static_cast<State>(state));
  return SSP_OK;
}

// Creates or attaches an endpoint: *out is null after an error.
template <class Handle, class Argument, class Open>
ssp_result open(const Argument* argument, Handle** out, Open&& make_endpoint) noexcept {
  if (!out) return null_argument();
  *out = nullptr;
  if (!argument) return null_argument();
  return guarded([&] {
    *out = new Handle{make_endpoint()};
    return SSP_OK;
  });
}

// Common to the three roles.
template <class Handle>
ssp_result describe(const Handle* handle, ssp_description* out) noexcept {
  if (!handle || !out) return null_argument();
  fill(*out, handle->endpoint.description());
  return SSP_OK;
}
template <class Handle>
ssp_result describe_channel(const Handle* handle, int channel, ssp_channel_info* out) noexcept {
  if (!handle || !out) return null_argument();
  const Description& d = handle->endpoint.description();
  const ChannelSpec* spec = find_channel(d, channel);
  if (!spec) return wrong_channel();
  fill(*out, d, *spec);
  return SSP_OK;
}
template <class Handle>
int find(const Handle* handle, std::uint32_t direction, const char* name) noexcept {
  if (!handle || !name) return -1;
  return handle->endpoint.description().channel(static_cast<Direction>(direction), name);
}

}  // namespace shm_protocol::c
