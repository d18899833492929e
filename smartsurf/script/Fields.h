// Reads Lua values as typed ones, and says precisely what is wrong with them. Internal to the room.
//
// Names in messages are dotted: "surface.border.height = 'high': must be a number".
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
#include "smartsurf/script/Interpreter.h"

namespace smartsurf::script {

// The value at `index` as a message shows it: 3, 'text', true, nil, a table.
std::string show(lua_State* L, int index);
// " (did you mean 'radius'?)" or "".
std::string suggestion(const std::string& word, const std::vector<std::string>& known);
std::string list_of(const std::vector<std::string>& names);
// Throws the Problem "NAME = VALUE: must be RULE".
[[noreturn]] void must_be(lua_State* L, int index, const std::string& name, const std::string& rule);

// Each throws Problem, naming `name`, unless the value at `index` is what is asked for.
double number_at(lua_State* L, int index, const std::string& name);  // finite
std::int64_t integer_at(lua_State* L, int index, const std::string& name, std::int64_t low,
                        std::int64_t high);
std::string text_at(lua_State* L, int index, const std::string& name);
// {x, y, z} or {x = …, y = …, z = …}
Eigen::Vector3d vector_at(lua_State* L, int index, const std::string& name);
// {x = …, y = …, z = …, w = …}, {x, y, z, w}, {axis = {x, y, z}, angle = …} or {roll = …, pitch = …, yaw = …}
Eigen::Quaterniond orientation_at(lua_State* L, int index, const std::string& name);
// A name, '#rrggbb', {r, g, b} or {r = …, g = …, b = …}
scene::Colour colour_at(lua_State* L, int index, const std::string& name);
// `count` numbers in a list, and nothing else.
std::vector<double> numbers_at(lua_State* L, int index, const std::string& name, int count,
                               const std::string& rule);

// The named fields of the table at `index`. The constructor refuses unknown and positional ones. An absent
// field leaves the caller's value as it is.
class Fields {
 public:
  Fields(lua_State* L, int index, std::string what, std::initializer_list<std::string_view> known)
      : Fields(L, index, std::move(what), std::span(known.begin(), known.size())) {}
  Fields(lua_State* L, int index, std::string what, std::span<const std::string_view> known);
  Fields(lua_State* L, int index, std::string what, const std::vector<std::string>& known);

  bool has(std::string_view field) const;
  void require(std::string_view field) const;
  void read(std::string_view field, double& value) const;
  void read(std::string_view field, std::optional<double>& value) const;
  void read(std::string_view field, int& value, std::int64_t low, std::int64_t high) const;
  void read(std::string_view field, bool& value) const;
  void read(std::string_view field, std::string& value) const;
  void read(std::string_view field, Eigen::Vector3d& value) const;
  void read(std::string_view field, Eigen::Quaterniond& value) const;
  void read(std::string_view field, scene::Colour& value) const;
  // Calls visit(stack index, dotted name) with the value where the field is there.
  template <typename Visit>
  void with(std::string_view field, Visit visit) const {
    if (push(field)) visit(lua_gettop(L_), dotted(field));
    lua_pop(L_, 1);
  }

 private:
  // Leaves the field's raw value on the stack, nil where absent; whether it is there.
  bool push(std::string_view field) const;
  std::string dotted(std::string_view field) const { return what_ + "." + std::string(field); }

  lua_State* L_;
  int index_;
  std::string what_;
};

}  // namespace smartsurf::script
