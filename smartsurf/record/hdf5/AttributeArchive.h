// Attributes of an HDF5 object, listed once for both directions: a function template calls archive(name,
// value) for each; with an AttributeWriter it stores the values, with an AttributeReader it replaces them.
// Internal to this module; both throw Hdf5Error.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class AttributeWriter {
 public:
  static constexpr bool kReads = false;
  explicit AttributeWriter(hid_t object) : object_(object) {}

  void operator()(const char* name, const std::string& text) const { write_attribute(object_, name, text); }
  void operator()(const char* name, const char* text) const = delete;  // would be a bool
  void operator()(const char* name, double number) const { write_attribute(object_, name, number); }
  void operator()(const char* name, std::uint64_t number) const { write_attribute(object_, name, number); }
  void operator()(const char* name, bool flag) const { write_attribute(object_, name, std::uint64_t{flag}); }
  template <std::size_t count>
  void operator()(const char* name, const std::array<double, count>& numbers) const {
    write_attribute(object_, name, H5T_NATIVE_DOUBLE, numbers.data(), count);
  }
  // Only if it has a value.
  template <class Value>
  void operator()(const char* name, const std::optional<Value>& value) const {
    if (value) (*this)(name, *value);
  }
  // A number from 1 to `maximum`.
  void count(const char* name, int number, std::uint64_t) const {
    write_attribute(object_, name, static_cast<std::uint64_t>(number));
  }
  // Older recordings lack it.
  template <class Value>
  void since(const char* name, const Value& value) const {
    (*this)(name, value);
  }

 private:
  hid_t object_;
};

class AttributeReader {
 public:
  static constexpr bool kReads = true;
  explicit AttributeReader(hid_t object) : object_(object) {}

  void operator()(const char* name, std::string& text) const { text = read_text_attribute(object_, name); }
  void operator()(const char* name, double& number) const {
    read_attribute(object_, name, H5T_NATIVE_DOUBLE, &number);
    if (!std::isfinite(number)) throw Hdf5Error(std::string("attribute ") + name + " is not finite");
  }
  void operator()(const char* name, std::uint64_t& number) const {
    read_attribute(object_, name, H5T_NATIVE_UINT64, &number);
  }
  void operator()(const char* name, bool& flag) const {
    double number = 0.0;
    (*this)(name, number);
    flag = number != 0.0;
  }
  template <std::size_t count>
  void operator()(const char* name, std::array<double, count>& numbers) const {
    read_attribute(object_, name, H5T_NATIVE_DOUBLE, numbers.data(), count);
  }
  template <class Value>
  void operator()(const char* name, std::optional<Value>& value) const {
    if (has_attribute(object_, name)) (*this)(name, value.emplace());
  }
  void count(const char* name, int& number, std::uint64_t maximum) const {
    std::uint64_t value = 0;
    (*this)(name, value);
    if (value < 1 || value > maximum)
      throw Hdf5Error(std::string("attribute ") + name + " = " + std::to_string(value) + " is not in 1 to " +
                      std::to_string(maximum));
    number = static_cast<int>(value);
  }
  template <class Value>
  void since(const char* name, Value& value) const {
    if (has_attribute(object_, name)) (*this)(name, value);
  }

 private:
  hid_t object_;
};

// The attributes of a sensor or actuator channel's dataset.
template <class Archive, class Channel>
void archive_channel(const Archive& a, Channel& channel) {
  a.since("unit", channel.unit);
  a.since("minimum", channel.minimum);
  a.since("maximum", channel.maximum);
  if constexpr (requires { channel.direction; }) {
    a("origin", channel.origin);
    a("direction", channel.direction);
  }
}

}  // namespace smartsurf::record
