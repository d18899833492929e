// Reads typed values from Lua tables and reports errors by dotted name, for example
// "surface.border.height = 'high': must be a number". Internal to this module.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// The longest string that is kept outside Lua's heap, whose limit does not hold for it.
constexpr std::size_t kMaxKeptBytes = 65536;

// The value at `index` as shown in messages: 3, 'text', true, nil, a table.
std::string format_value(lua_State* L, int index);
// " (did you mean 'radius'?)", or "" if no known name is close.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& known);
std::string join_names(const std::vector<std::string>& names);
// The keys of a table that are strings, ascending. `table`: an absolute index.
std::vector<std::string> string_keys(lua_State* L, int table);
// Throws ScriptError("NAME = VALUE: must be REQUIREMENT").
[[noreturn]] void throw_invalid_value(lua_State* L, int index, const std::string& name,
                                      const std::string& requirement);

// Convert the value at `index`. All throw ScriptError, which begins with `name`, if it does not match.
double check_number(lua_State* L, int index, const std::string& name);  // finite
// In [low, high].
std::int64_t check_integer(lua_State* L, int index, const std::string& name, std::int64_t low,
                           std::int64_t high);
std::string check_string(lua_State* L, int index, const std::string& name);  // of at most kMaxKeptBytes
// {x, y, z} or {x = …, y = …, z = …}
Eigen::Vector3d check_vector(lua_State* L, int index, const std::string& name);
// {x = …, y = …, z = …, w = …}, {x, y, z, w}, {axis = {x, y, z}, angle = …} or {roll = …, pitch = …, yaw = …}
Eigen::Quaterniond check_orientation(lua_State* L, int index, const std::string& name);
// A colour name, '#rrggbb', {r, g, b} or {r = …, g = …, b = …} with components in [0, 1]
scene::Colour check_colour(lua_State* L, int index, const std::string& name);
// A list of exactly `count` numbers.
std::vector<double> check_numbers(lua_State* L, int index, const std::string& name, int count,
                                  const std::string& requirement);

// These choose the conversion by the type of `value`.
inline void check_value(lua_State* L, int index, const std::string& name, double& value) {
  value = check_number(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, std::optional<double>& value) {
  value = check_number(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, std::string& value) {
  value = check_string(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, Eigen::Vector3d& value) {
  value = check_vector(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, Eigen::Quaterniond& value) {
  value = check_orientation(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, scene::Colour& value) {
  value = check_colour(L, index, name);
}
inline void check_value(lua_State* L, int index, const std::string& name, bool& value) {
  if (lua_type(L, index) != LUA_TBOOLEAN) throw_invalid_value(L, index, name, "true or false");
  value = lua_toboolean(L, index) != 0;
}

// Calls visit(stack index, "NAME[i]") for each element of the list at `index`, with the element on top of the
// stack.
template <typename Visit>
void for_each_element(lua_State* L, int index, const std::string& name, Visit visit) {
  const auto count = static_cast<lua_Integer>(lua_rawlen(L, index));
  for (lua_Integer i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, i);
    visit(lua_gettop(L), name + "[" + std::to_string(i) + "]");
    lua_pop(L, 1);
  }
}

// The named fields of the table at `index`. The constructor throws ScriptError for unknown and positional
// fields. read() leaves the value unchanged if the field is absent.
class TableReader {
 public:
  TableReader(lua_State* L, int index, std::string table_name, std::initializer_list<std::string_view> known)
      : TableReader(L, index, std::move(table_name), std::span(known.begin(), known.size())) {}
  TableReader(lua_State* L, int index, std::string table_name, std::span<const std::string_view> known);
  TableReader(lua_State* L, int index, std::string table_name, const std::vector<std::string>& known);

  bool has(std::string_view field) const;
  void require(std::string_view field) const;
  template <typename T>
  void read(std::string_view field, T& value) const {
    visit(field, [&](int i, const std::string& name) { check_value(L_, i, name, value); });
  }
  void read(std::string_view field, int& value, std::int64_t low, std::int64_t high) const {
    visit(field, [&](int i, const std::string& name) {
      value = static_cast<int>(check_integer(L_, i, name, low, high));
    });
  }
  template <typename T>
  void read_required(std::string_view field, T& value) const {
    require(field);
    read(field, value);
  }
  // Calls visit(stack index, dotted name) if the field is present.
  template <typename Visit>
  void visit(std::string_view field, Visit visit) const {
    if (push_field(field)) visit(lua_gettop(L_), qualified_name(field));
    lua_pop(L_, 1);
  }

 private:
  // Pushes the field's raw value, nil if absent. Returns whether it is present.
  bool push_field(std::string_view field) const;
  std::string qualified_name(std::string_view field) const { return table_name_ + "." + std::string(field); }

  lua_State* L_;
  int index_;
  std::string table_name_;
};

}  // namespace smartsurf::script
