// Converts between the C interface and the C++ endpoints: results, errors, descriptions and arrays.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <utility>

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
  if (channel < 0 || static_cast<std::size_t>(channel) >= d.channels.size()) return nullptr;
  return &d.channels[static_cast<std::size_t>(channel)];
}

// Calls access.operator()<T>() for the element type of `dtype`; returns the address and the size in bytes.
template <class Access>
auto* address_of(DType dtype, std::size_t* bytes, Access&& access) noexcept {
  const auto give = [&](auto span) {
    if (bytes) *bytes = span.size_bytes();
    using Byte = std::conditional_t<std::is_const_v<typename decltype(span)::element_type>, const void, void>;
    return static_cast<Byte*>(span.data());
  };
  switch (dtype) {
    case DType::kU32:
      return give(access.template operator()<std::uint32_t>());
    case DType::kU8:
      return give(access.template operator()<std::uint8_t>());
    default:
      return give(access.template operator()<float>());
  }
}

// Checks the arguments and calls endpoint.write<T>() for the channel's element type.
template <class Endpoint>
ssp_result write(Endpoint& endpoint, int channel, Direction direction, std::size_t at, const void* values,
                 std::size_t bytes) noexcept {
  const Description& d = endpoint.description();
  const ChannelSpec* spec = find_channel(d, channel);
  if (!spec || spec->direction != direction) return wrong_channel();
  if (!values && bytes) return null_argument();
  const std::size_t element = spec->dtype == DType::kU8 ? 1 : 4, all = d.cells() * spec->components * element;
  if (at > all || bytes > all - at || at % element || bytes % element)
    return fail(SSP_E_ARGUMENT, "that place is not within the array, or not of whole elements");
  const auto write_as = [&]<class T>() {
    endpoint.template write<T>(channel, at / element, {static_cast<const T*>(values), bytes / element});
  };
  if (spec->dtype == DType::kF32) write_as.template operator()<float>();
  if (spec->dtype == DType::kU32) write_as.template operator()<std::uint32_t>();
  if (spec->dtype == DType::kU8) write_as.template operator()<std::uint8_t>();
  return SSP_OK;
}

// Calls endpoint.next_cells<T>() for the channel's element type; null if there are no cells.
template <class Handle>
const void* next(Handle* handle, int channel, Direction direction, const WaitOptions& options,
                 std::size_t* bytes) noexcept {
  if (!bytes) return nullptr;
  *bytes = 0;
  const ChannelSpec* spec = handle ? find_channel(handle->endpoint.description(), channel) : nullptr;
  if (!spec || spec->direction != direction) return nullptr;
  return address_of(spec->dtype, bytes,
                    [&]<class T>() { return handle->endpoint.template next_cells<T>(channel, options); });
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
  const auto& channels = handle->endpoint.description().channels;
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (static_cast<std::uint32_t>(channels[i].direction) == direction && channels[i].name == name)
      return static_cast<int>(i);
  return -1;
}

}  // namespace shm_protocol::c
