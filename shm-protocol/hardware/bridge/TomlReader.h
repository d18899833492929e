// Reads TOML files; whatever is wrong is one line that names file, line, key and value. Internal to this
// folder.
#pragma once

#define TOML_EXCEPTIONS 1
#include <toml++/toml.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "common/text/Words.h"

namespace hardware {

// All functions throw std::invalid_argument. `where` begins the message, for example "board 'b1': ".
class TomlReader {
 public:
  explicit TomlReader(std::string file) : file_(std::move(file)) {}

  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw std::invalid_argument(file_ + ":" + std::to_string(line) + ": " + what);
  }
  static std::size_t line_of(const toml::node& node) { return node.source().begin.line; }

  template <class Keys = std::initializer_list<std::string_view>>
  void allow(const toml::table& table, const std::string& where, const Keys& keys) const {
    for (const auto& [key, value] : table) {
      if (std::ranges::find(keys, key.str()) != keys.end()) continue;
      fail(key.source().begin.line,
           where + "unknown key '" + std::string(key.str()) + "'; known are " + common::join(keys));
    }
  }

  template <class T>
  std::optional<T> get(const toml::table& table, const std::string& where, const char* key,
                       const char* kind) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    if (const auto value = node->value_exact<T>()) return *value;
    fail(line_of(*node), where + key + " must be " + kind);
  }

  template <class T>
  T need(const toml::table& table, const std::string& where, const char* key, const char* kind) const {
    if (const auto value = get<T>(table, where, key, kind)) return *value;
    fail(line_of(table), where + key + " is missing: " + kind);
  }

  std::optional<double> number(const toml::table& table, const std::string& where, const char* key,
                               const char* kind) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    if (node->is_number()) return *node->value<double>();
    fail(line_of(*node), where + key + " must be " + kind);
  }

  std::optional<std::pair<std::uint32_t, std::uint32_t>> pair(const toml::table& table,
                                                              const std::string& where, const char* key,
                                                              std::int64_t least) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    const toml::array* both = node->as_array();
    std::int64_t values[2] = {-1, -1};
    for (std::size_t i = 0; both && both->size() == 2 && i < 2; ++i)
      values[i] = (*both)[i].value_exact<std::int64_t>().value_or(-1);
    for (const std::int64_t v : values)
      if (v < least || v > 65535)
        fail(line_of(*node), where + key + " must be [row, column], whole numbers from " +
                                 std::to_string(least) + " to 65535");
    return std::pair{static_cast<std::uint32_t>(values[0]), static_cast<std::uint32_t>(values[1])};
  }

  // The file's content, of at most so many bytes.
  toml::table parse(std::size_t most_bytes) const {
    std::error_code none;
    if (!std::filesystem::is_regular_file(file_, none))
      throw std::invalid_argument(
          file_ + ": cannot be read: " + (none ? none.message() : std::string("it is no file")));
    if (const auto bytes = std::filesystem::file_size(file_, none); none || bytes > most_bytes)
      throw std::invalid_argument(file_ + ": has " + std::to_string(bytes) + " bytes, at most " +
                                  std::to_string(most_bytes) + " are read");
    try {
      const std::string text = read_text();
      check_keys(text);
      return toml::parse(text, file_);
    } catch (const toml::parse_error& e) {
      fail(e.source().begin.line, std::string(e.description()));
    }
  }

 private:
  static constexpr int kMaxParts = 100;

  std::string read_text() const {
    std::ifstream file(file_, std::ios::binary);
    if (!file) throw std::invalid_argument(file_ + ": cannot be read");
    return {std::istreambuf_iterator<char>(file), {}};
  }

  // toml++ calls itself for each part of a key, a.b.c, without limit.
  void check_keys(std::string_view text) const {
    std::size_t line = 1;
    int dots = 0;
    char before = '\n';
    for (const char c : text) {
      if (c == '.' && ++dots == kMaxParts)
        fail(line, "more than " + std::to_string(kMaxParts) + " dots in one key or text");
      if (std::string_view(",=[]{}\n").find(c) != std::string_view::npos || (c == '.' && before == '.'))
        dots = 0;
      if (c == '\n') ++line;
      before = c;
    }
  }

  std::string file_;
};

}  // namespace hardware
