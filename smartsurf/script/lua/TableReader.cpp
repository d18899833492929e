#include "smartsurf/script/lua/TableReader.h"

#include <algorithm>
#include <cmath>

#include "common/text/Suggestion.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxShownLength = 40;
constexpr int kMaxFields = 1000;  // of a table with named fields

struct TableKeys {
  std::vector<std::string> names;
  bool has_positional = false;  // has a key that is not a string
};

TableKeys collect_keys(lua_State* L, int index, const std::string& subject) {
  TableKeys found;
  int count = 0;
  lua_pushnil(L);
  while (lua_next(L, index) != 0) {
    lua_pop(L, 1);
    if (lua_type(L, -1) == LUA_TSTRING)
      found.names.emplace_back(lua_tostring(L, -1));
    else
      found.has_positional = true;
    if (++count > kMaxFields) throw ScriptError(subject + ": a table of more than 1000 fields");
  }
  std::sort(found.names.begin(), found.names.end());  // Lua's own order differs from run to run
  return found;
}

}  // namespace

std::string format_value(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TNIL:
    case LUA_TNONE:
      return "nil";
    case LUA_TBOOLEAN:
      return lua_toboolean(L, index) != 0 ? "true" : "false";
    case LUA_TNUMBER:
      return lua_isinteger(L, index) != 0 ? std::to_string(lua_tointeger(L, index))
                                          : format_value(lua_tonumber(L, index));
    case LUA_TSTRING: {
      std::size_t length = 0;
      const char* const text = lua_tolstring(L, index, &length);
      const std::string shown = to_single_line({text, std::min(length, kMaxShownLength)});
      return "'" + shown + (length > kMaxShownLength ? "...'" : "'");
    }
    default:
      return std::string("a ") + luaL_typename(L, index);
  }
}

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  const std::string closest = common::nearest_name(word, known);
  return closest.empty() ? "" : " (did you mean '" + closest + "'?)";
}

std::string join_names(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined;
}

std::vector<std::string> string_keys(lua_State* L, int table) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, table) != 0; lua_pop(L, 1))
    if (lua_type(L, -2) == LUA_TSTRING) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  return names;
}

void throw_invalid_value(lua_State* L, int index, const std::string& name, const std::string& requirement) {
  throw ScriptError(name + " = " + format_value(L, index) + ": must be " + requirement);
}

double check_number(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TNUMBER) throw_invalid_value(L, index, name, "a number");
  const double value = lua_tonumber(L, index);
  if (!std::isfinite(value)) throw_invalid_value(L, index, name, "finite");
  return value;
}

std::int64_t check_integer(lua_State* L, int index, const std::string& name, std::int64_t low,
                           std::int64_t high) {
  const auto fail = [&] {
    std::string requirement = "an integer";
    if (high != INT64_MAX)
      requirement += " from " + std::to_string(low) + " to " + std::to_string(high);
    else if (low != INT64_MIN)
      requirement += ", " + std::to_string(low) + " or more";
    throw_invalid_value(L, index, name, requirement);
  };
  if (lua_type(L, index) != LUA_TNUMBER) fail();
  int is_integer = 0;
  const lua_Integer value = lua_tointegerx(L, index, &is_integer);
  if (is_integer == 0 || value < low || value > high) fail();
  return value;
}

std::string check_string(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TSTRING) throw_invalid_value(L, index, name, "a string");
  std::size_t length = 0;
  const char* const text = lua_tolstring(L, index, &length);
  if (length > kMaxKeptBytes) throw_invalid_value(L, index, name, "at most 64 KiB");
  return {text, length};
}

std::vector<double> check_numbers(lua_State* L, int index, const std::string& name, int count,
                                  const std::string& requirement) {
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  index = lua_absindex(L, index);
  const TableKeys fields = collect_keys(L, index, name);
  const lua_Unsigned length = lua_rawlen(L, index);
  if (!fields.names.empty() || length != static_cast<lua_Unsigned>(count))
    throw ScriptError(name + " = a table of " + std::to_string(length) + " values" +
                      (fields.names.empty() ? "" : " with the name '" + fields.names.front() + "'") +
                      ": must be " + requirement);
  std::vector<double> values;
  for_each_element(L, index, name,
                   [&](int i, const std::string& element) { values.push_back(check_number(L, i, element)); });
  return values;
}

Eigen::Vector3d check_vector(lua_State* L, int index, const std::string& name) {
  const std::string requirement = "three numbers {x, y, z}";
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  index = lua_absindex(L, index);
  if (collect_keys(L, index, name).names.empty()) {
    const std::vector<double> v = check_numbers(L, index, name, 3, requirement);
    return {v[0], v[1], v[2]};
  }
  const TableReader fields(L, index, name, {"x", "y", "z"});
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  constexpr std::string_view kAxes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    fields.read_required(kAxes[i], v[i]);
  }
  return v;
}

namespace {

Eigen::Quaterniond from_axis_angle(const TableReader& fields, const std::string& name) {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double angle_rad = 0.0;
  fields.require("axis");
  fields.require("angle");
  fields.read("axis", axis);
  fields.read("angle", angle_rad);
  const double norm = axis.norm();
  if (!std::isfinite(norm) || norm < 1e-9) throw ScriptError(name + ".axis: must not be of length 0");
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis / norm));
}

// Extrinsic rotations about x, then y, then z.
Eigen::Quaterniond from_euler(const TableReader& fields) {
  double roll = 0.0, pitch = 0.0, yaw = 0.0;
  fields.read("roll", roll);
  fields.read("pitch", pitch);
  fields.read("yaw", yaw);
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

Eigen::Quaterniond normalized_quaternion(const Eigen::Vector4d& xyzw, const std::string& name) {
  const double norm = xyzw.norm();
  if (!std::isfinite(norm) || norm < 1e-9) throw ScriptError(name + ": a quaternion must not be of length 0");
  const Eigen::Vector4d q = xyzw / norm;
  return {q[3], q[0], q[1], q[2]};
}

Eigen::Quaterniond from_quaternion(const TableReader& fields, const std::string& name) {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  constexpr std::string_view kParts[] = {"x", "y", "z", "w"};
  for (int i = 0; i < 4; ++i) {
    fields.read_required(kParts[i], q[i]);
  }
  return normalized_quaternion(q, name);
}

}  // namespace

Eigen::Quaterniond check_orientation(lua_State* L, int index, const std::string& name) {
  const std::string requirement =
      "{x =, y =, z =, w =}, {axis = {x, y, z}, angle =} or {roll =, pitch =, yaw =}";
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  index = lua_absindex(L, index);
  const std::vector<std::string> names = collect_keys(L, index, name).names;
  if (names.empty()) {
    const std::vector<double> q = check_numbers(L, index, name, 4, requirement);
    return normalized_quaternion({q[0], q[1], q[2], q[3]}, name);
  }
  const auto has_name = [&](std::string_view n) {
    return std::find(names.begin(), names.end(), n) != names.end();
  };
  if (has_name("axis") || has_name("angle"))
    return from_axis_angle(TableReader(L, index, name, {"axis", "angle"}), name);
  if (has_name("roll") || has_name("pitch") || has_name("yaw"))
    return from_euler(TableReader(L, index, name, {"roll", "pitch", "yaw"}));
  return from_quaternion(TableReader(L, index, name, {"x", "y", "z", "w"}), name);
}

TableReader::TableReader(lua_State* L, int index, std::string table_name,
                         std::span<const std::string_view> known)
    : TableReader(L, index, std::move(table_name), std::vector<std::string>(known.begin(), known.end())) {}

TableReader::TableReader(lua_State* L, int index, std::string table_name,
                         const std::vector<std::string>& names)
    : L_(L), index_(lua_absindex(L, index)), table_name_(std::move(table_name)) {
  if (lua_type(L, index_) != LUA_TTABLE)
    throw ScriptError(table_name_ + ": takes a table of fields, " + table_name_ + "{" + names.front() +
                      " = ...}, not " + format_value(L, index_));
  const TableKeys fields = collect_keys(L, index_, table_name_);
  for (const std::string& name : fields.names) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const std::string hint = did_you_mean(name, names);
    throw ScriptError(table_name_ + ": unknown field '" + to_single_line(name.substr(0, kMaxShownLength)) +
                      "'" + (hint.empty() ? "; known: " + join_names(names) : hint));
  }
  if (fields.has_positional)
    throw ScriptError(table_name_ + ": a value without a field name; known: " + join_names(names));
}

bool TableReader::push_field(std::string_view field) const {
  lua_pushlstring(L_, field.data(), field.size());
  lua_rawget(L_, index_);
  return lua_type(L_, -1) != LUA_TNIL;
}

bool TableReader::has(std::string_view field) const {
  const bool present = push_field(field);
  lua_pop(L_, 1);
  return present;
}

void TableReader::require(std::string_view field) const {
  if (!has(field)) throw ScriptError(table_name_ + ": the field '" + std::string(field) + "' is missing");
}

}  // namespace smartsurf::script
