#include "smartsurf/script/Fields.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::script {
namespace {

constexpr std::size_t kLongestShown = 40;
constexpr int kMostFields = 1000;  // of a table that is read by names; more is a mistake

struct NamedFields {
  std::vector<std::string> names;
  bool positional = false;  // or keyed by something that is no name
};

NamedFields fields_of(lua_State* L, int index, const std::string& what) {
  NamedFields found;
  int count = 0;
  lua_pushnil(L);
  while (lua_next(L, index) != 0) {
    lua_pop(L, 1);
    if (lua_type(L, -1) == LUA_TSTRING)
      found.names.emplace_back(lua_tostring(L, -1));
    else
      found.positional = true;
    if (++count > kMostFields) throw Problem(what + ": a table of more than 1000 fields");
  }
  std::sort(found.names.begin(), found.names.end());  // Lua's own order differs from run to run
  return found;
}

}  // namespace

std::string show(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TNIL:
    case LUA_TNONE:
      return "nil";
    case LUA_TBOOLEAN:
      return lua_toboolean(L, index) != 0 ? "true" : "false";
    case LUA_TNUMBER:
      return lua_isinteger(L, index) != 0 ? std::to_string(lua_tointeger(L, index))
                                          : show(lua_tonumber(L, index));
    case LUA_TSTRING: {
      std::size_t length = 0;
      const char* const text = lua_tolstring(L, index, &length);
      const std::string whole = one_line({text, std::min(length, kLongestShown)});
      return "'" + whole + (length > kLongestShown ? "...'" : "'");
    }
    default:
      return std::string("a ") + luaL_typename(L, index);
  }
}

std::string suggestion(const std::string& word, const std::vector<std::string>& known) {
  if (word.size() > 100) return "";  // the distance costs length²
  const std::string nearest = scene::nearest_name(word, known);
  return nearest.empty() ? "" : " (did you mean '" + nearest + "'?)";
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

void must_be(lua_State* L, int index, const std::string& name, const std::string& rule) {
  throw Problem(name + " = " + show(L, index) + ": must be " + rule);
}

double number_at(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TNUMBER) must_be(L, index, name, "a number");
  const double value = lua_tonumber(L, index);
  if (!std::isfinite(value)) must_be(L, index, name, "finite");
  return value;
}

std::int64_t integer_at(lua_State* L, int index, const std::string& name, std::int64_t low,
                        std::int64_t high) {
  const auto refuse = [&] {
    std::string rule = "an integer";
    if (high != INT64_MAX)
      rule += " from " + std::to_string(low) + " to " + std::to_string(high);
    else if (low != INT64_MIN)
      rule += ", " + std::to_string(low) + " or more";
    must_be(L, index, name, rule);
  };
  if (lua_type(L, index) != LUA_TNUMBER) refuse();
  int exact = 0;
  const lua_Integer value = lua_tointegerx(L, index, &exact);
  if (exact == 0 || value < low || value > high) refuse();
  return value;
}

std::string text_at(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TSTRING) must_be(L, index, name, "a text in quotes");
  std::size_t length = 0;
  const char* const text = lua_tolstring(L, index, &length);
  return {text, length};
}

std::vector<double> numbers_at(lua_State* L, int index, const std::string& name, int count,
                               const std::string& rule) {
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, rule);
  index = lua_absindex(L, index);
  const NamedFields fields = fields_of(L, index, name);
  const lua_Unsigned length = lua_rawlen(L, index);
  if (!fields.names.empty() || length != static_cast<lua_Unsigned>(count))
    throw Problem(name + " = a table of " + std::to_string(length) + " values" +
                  (fields.names.empty() ? "" : " with the name '" + fields.names.front() + "'") +
                  ": must be " + rule);
  std::vector<double> values;
  for (int i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, i);
    values.push_back(number_at(L, -1, name + "[" + std::to_string(i) + "]"));
    lua_pop(L, 1);
  }
  return values;
}

Eigen::Vector3d vector_at(lua_State* L, int index, const std::string& name) {
  const std::string rule = "three numbers {x, y, z}";
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, rule);
  index = lua_absindex(L, index);
  if (fields_of(L, index, name).names.empty()) {
    const std::vector<double> v = numbers_at(L, index, name, 3, rule);
    return {v[0], v[1], v[2]};
  }
  const Fields fields(L, index, name, {"x", "y", "z"});
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  constexpr std::string_view kAxes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    fields.require(kAxes[i]);
    fields.read(kAxes[i], v[i]);
  }
  return v;
}

namespace {

Eigen::Quaterniond from_axis(const Fields& fields, const std::string& name) {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double angle_rad = 0.0;
  fields.require("axis");
  fields.require("angle");
  fields.read("axis", axis);
  fields.read("angle", angle_rad);
  const double norm = axis.norm();
  if (!std::isfinite(norm) || norm < 1e-9) throw Problem(name + ".axis: must not be of length 0");
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis / norm));
}

// Turns about the fixed x, then the fixed y, then the fixed z axis.
Eigen::Quaterniond from_euler(const Fields& fields) {
  double roll = 0.0, pitch = 0.0, yaw = 0.0;
  fields.read("roll", roll);
  fields.read("pitch", pitch);
  fields.read("yaw", yaw);
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

Eigen::Quaterniond unit(const Eigen::Vector4d& xyzw, const std::string& name) {
  const double norm = xyzw.norm();
  if (!std::isfinite(norm) || norm < 1e-9) throw Problem(name + ": a quaternion must not be of length 0");
  const Eigen::Vector4d q = xyzw / norm;
  return {q[3], q[0], q[1], q[2]};
}

Eigen::Quaterniond from_quaternion(const Fields& fields, const std::string& name) {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  constexpr std::string_view kParts[] = {"x", "y", "z", "w"};
  for (int i = 0; i < 4; ++i) {
    fields.require(kParts[i]);
    fields.read(kParts[i], q[i]);
  }
  return unit(q, name);
}

}  // namespace

Eigen::Quaterniond orientation_at(lua_State* L, int index, const std::string& name) {
  const std::string rule = "{x =, y =, z =, w =}, {axis = {x, y, z}, angle =} or {roll =, pitch =, yaw =}";
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, rule);
  index = lua_absindex(L, index);
  const std::vector<std::string> names = fields_of(L, index, name).names;
  if (names.empty()) {
    const std::vector<double> q = numbers_at(L, index, name, 4, rule);
    return unit({q[0], q[1], q[2], q[3]}, name);
  }
  const auto named = [&](std::string_view n) {
    return std::find(names.begin(), names.end(), n) != names.end();
  };
  if (named("axis") || named("angle")) return from_axis(Fields(L, index, name, {"axis", "angle"}), name);
  if (named("roll") || named("pitch") || named("yaw"))
    return from_euler(Fields(L, index, name, {"roll", "pitch", "yaw"}));
  return from_quaternion(Fields(L, index, name, {"x", "y", "z", "w"}), name);
}

Fields::Fields(lua_State* L, int index, std::string what, std::span<const std::string_view> known)
    : Fields(L, index, std::move(what), std::vector<std::string>(known.begin(), known.end())) {}

Fields::Fields(lua_State* L, int index, std::string what, const std::vector<std::string>& names)
    : L_(L), index_(lua_absindex(L, index)), what_(std::move(what)) {
  if (lua_type(L, index_) != LUA_TTABLE)
    throw Problem(what_ + ": takes a table of fields, " + what_ + "{" + names.front() + " = ...}, not " +
                  show(L, index_));
  const NamedFields fields = fields_of(L, index_, what_);
  for (const std::string& name : fields.names) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const std::string near = suggestion(name, names);
    throw Problem(what_ + ": unknown field '" + one_line(name.substr(0, kLongestShown)) + "'" +
                  (near.empty() ? "; known: " + list_of(names) : near));
  }
  if (fields.positional) throw Problem(what_ + ": a value without a field name; known: " + list_of(names));
}

bool Fields::push(std::string_view field) const {
  lua_pushlstring(L_, field.data(), field.size());
  lua_rawget(L_, index_);
  return lua_type(L_, -1) != LUA_TNIL;
}

bool Fields::has(std::string_view field) const {
  const bool there = push(field);
  lua_pop(L_, 1);
  return there;
}

void Fields::require(std::string_view field) const {
  if (!has(field)) throw Problem(what_ + ": the field '" + std::string(field) + "' is missing");
}

void Fields::read(std::string_view field, double& value) const {
  with(field, [&](int i, const std::string& name) { value = number_at(L_, i, name); });
}

void Fields::read(std::string_view field, std::optional<double>& value) const {
  with(field, [&](int i, const std::string& name) { value = number_at(L_, i, name); });
}

void Fields::read(std::string_view field, int& value, std::int64_t low, std::int64_t high) const {
  with(field,
       [&](int i, const std::string& name) { value = static_cast<int>(integer_at(L_, i, name, low, high)); });
}

void Fields::read(std::string_view field, bool& value) const {
  with(field, [&](int i, const std::string& name) {
    if (lua_type(L_, i) != LUA_TBOOLEAN) must_be(L_, i, name, "true or false");
    value = lua_toboolean(L_, i) != 0;
  });
}

void Fields::read(std::string_view field, std::string& value) const {
  with(field, [&](int i, const std::string& name) { value = text_at(L_, i, name); });
}

void Fields::read(std::string_view field, Eigen::Vector3d& value) const {
  with(field, [&](int i, const std::string& name) { value = vector_at(L_, i, name); });
}

void Fields::read(std::string_view field, Eigen::Quaterniond& value) const {
  with(field, [&](int i, const std::string& name) { value = orientation_at(L_, i, name); });
}

void Fields::read(std::string_view field, scene::Colour& value) const {
  with(field, [&](int i, const std::string& name) { value = colour_at(L_, i, name); });
}

}  // namespace smartsurf::script
