// RAII handles and checked calls of HDF5. Internal to this module. Every function throws Hdf5Error (one line)
// if the library reports a failure.
#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace smartsurf::record {

class Hdf5Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Handle {
 public:
  using Closer = herr_t (*)(hid_t);
  Handle() = default;
  // Throws "WHAT (the library's reason)" if id is negative.
  Handle(hid_t id, Closer closer, const std::string& what);
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), closer_(other.closer_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(closer_, other.closer_);
    return *this;
  }
  // Closing may write buffered data; check_closed() reports a failure. Stays open where an error leaves no
  // memory.
  ~Handle() {
    if (id_ >= 0) close();
  }
  operator hid_t() const { return id_; }

 private:
  void close() noexcept;

  hid_t id_ = -1;
  Closer closer_ = nullptr;
};

// The library's type of a number in memory.
template <class Number>
hid_t native_type() {
  if constexpr (std::is_same_v<Number, float>)
    return H5T_NATIVE_FLOAT;
  else if constexpr (std::is_same_v<Number, double>)
    return H5T_NATIVE_DOUBLE;
  else if constexpr (std::is_same_v<Number, std::int8_t>)
    return H5T_NATIVE_INT8;
  else if constexpr (std::is_same_v<Number, std::int32_t>)
    return H5T_NATIVE_INT32;
  else if constexpr (std::is_same_v<Number, std::uint8_t>)
    return H5T_NATIVE_UINT8;
  else if constexpr (std::is_same_v<Number, std::uint16_t>)
    return H5T_NATIVE_UINT16;
  else if constexpr (std::is_same_v<Number, std::uint32_t>)
    return H5T_NATIVE_UINT32;
  else
    return H5T_NATIVE_UINT64;
}

// Throws "WHAT (the library's reason)" if status is negative.
void check(herr_t status, const std::string& what);
// Throws if a Handle of this thread could not be closed since the last call: its data are lost.
void check_closed();
// Throws std::bad_alloc unless `bytes` can be allocated beyond what the library takes for itself. HDF5 1.10
// crashes or ends the process where it gets no memory, so that it is entered only while there is some.
void require_memory(std::size_t bytes);
// Call before anything else. The library prints no errors (they are exceptions), runs nothing at exit and
// follows no links to other files.
void initialise_library();

// Variable-length UTF-8; fixed-length attributes are limited to 64 KiB.
Handle string_type();
// Chunked storage without timestamps, so that the same run gives the same bytes.
Handle chunked_properties(const std::vector<hsize_t>& chunk);
Handle create_dataset(hid_t parent, const char* name, hid_t type, hid_t space, hid_t properties);
// A dataset of this size with the values, row-major; without timestamps.
void write_dataset(hid_t parent, const char* name, std::span<const hsize_t> size, hid_t type,
                   const void* values);
Handle create_group(hid_t parent, const char* name);
// The name in a group for any name but an empty one, and back: what HDF5 does not take as part of a name is
// %2F (/), %00, %2E (of the name "."), and % before such digits %25.
std::string link_name(std::string_view name);
std::string name_of_link(std::string_view link);

void write_attribute(hid_t object, const char* name, const std::string& text);
void write_attribute(hid_t object, const char* name, hid_t type, const void* values, hsize_t count = 1);
void write_attribute(hid_t object, const char* name, double value);
void write_attribute(hid_t object, const char* name, std::uint64_t value);

// Both throw where the file cannot be read. Each part of a path `name` but the last must exist.
bool has_link(hid_t parent, const char* name);
bool has_attribute(hid_t object, const char* name);
std::string read_text_attribute(hid_t object, const char* name);
// Reads `count` numbers, converted to `type`; throws if the attribute holds more or fewer.
void read_attribute(hid_t object, const char* name, hid_t type, void* values, hsize_t count = 1);
std::vector<hsize_t> extents(hid_t dataset);

}  // namespace smartsurf::record
