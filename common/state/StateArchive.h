// Saves the state of objects as bytes, and restores it.
//
// A class lists its state once, in `void archive(StateArchive&)`, for both directions. Values without
// pointers are copied bit by bit, so that a restored simulation continues with the same bits. The bytes are
// for the same program on the same kind of machine. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/error/UserError.h"

namespace common {

class StateArchive {
 public:
  // Appends to `out`.
  explicit StateArchive(std::string& out) : out_(&out) {}
  // Reads from `in`. Throws UserError when it ends early.
  explicit StateArchive(std::string_view in) : in_(in) {}

  bool saves() const { return out_ != nullptr; }
  bool at_end() const { return in_.empty(); }

  // Saves or restores the values, in this order.
  template <class... T>
  void operator()(T&... values) {
    (process(values), ...);
  }
  // Saves a value, or reads it and returns it.
  template <class T>
  T value(T v) {
    process(v);
    return v;
  }
  void bytes(void* data, std::size_t size) {
    if (size == 0) return;
    if (saves()) {
      out_->append(static_cast<const char*>(data), size);
      return;
    }
    if (size > in_.size()) throw UserError("the saved state ends early");
    std::memcpy(data, in_.data(), size);
    in_.remove_prefix(size);
  }

 private:
  template <class T>
  static constexpr bool has_archive = requires(T& t, StateArchive& a) {
    t.archive(a);
  };
  template <class T>
  static constexpr bool is_optional = requires {
    requires std::is_same_v<T, std::optional<typename T::value_type>>;
  };
  // Copied bit by bit. Excludes pointers and optional values; a struct that contains one needs archive().
  template <class T>
  static constexpr bool is_flat =
      !has_archive<T> && !is_optional<T> && std::is_trivially_destructible_v<T> && !std::is_pointer_v<T>;

  template <class T>
  static constexpr bool is_number = std::is_arithmetic_v<T> || std::is_enum_v<T>;

  template <class T>
  requires is_flat<T>
  void process(T& v) {
    if constexpr (!is_number<T>) {
      if (saves()) return save_without_padding(v);
    }
    bytes(static_cast<void*>(&v), sizeof v);
  }
  // Equal values give equal bytes, where the compiler can clear the bytes between members (GCC).
  template <class T>
  void save_without_padding(T v) {
#if __has_builtin(__builtin_clear_padding)
    __builtin_clear_padding(&v);
#endif
    bytes(static_cast<void*>(&v), sizeof v);
  }
  template <class T>
  requires has_archive<T>
  void process(T& v) { v.archive(*this); }
  void process(std::string& v) {
    resize(v);
    bytes(v.data(), v.size());
  }
  template <class T>
  void process(std::vector<T>& v) {
    resize(v);
    if constexpr (is_number<T>)
      bytes(static_cast<void*>(v.data()), v.size() * sizeof(T));
    else
      for (T& element : v) process(element);
  }
  template <class T, std::size_t n>
  requires(!is_flat<std::array<T, n>>) void process(std::array<T, n>& v) {
    for (T& element : v) process(element);
  }
  template <class T>
  void process(std::optional<T>& v) {
    if (!value(v.has_value()))
      v.reset();
    else if (!v)
      v.emplace();
    if (v) process(*v);
  }
  template <class A, class B>
  requires(!is_flat<std::pair<A, B>>) void process(std::pair<A, B>& v) {
    process(v.first);
    process(v.second);
  }
  template <class List>
  void resize(List& list) {
    const auto size = value(static_cast<std::uint64_t>(list.size()));
    if (saves()) return;
    // Every element takes at least one byte.
    if (size > in_.size()) throw UserError("the saved state ends early");
    list.resize(size);
  }

  std::string* out_ = nullptr;
  std::string_view in_;
};

}  // namespace common
