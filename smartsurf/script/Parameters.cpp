#include "smartsurf/script/Parameters.h"

#include <algorithm>

namespace smartsurf::script {
namespace {

using Type = scene::Parameter::Type;

double choice_at(lua_State* L, int index, const std::string& name, const std::vector<std::string>& choices) {
  const std::string chosen = lua_type(L, index) == LUA_TSTRING ? text_at(L, index, name) : "";
  const auto it = std::ranges::find(choices, chosen);
  if (it == choices.end()) must_be(L, index, name, "one of " + list_of(choices));
  return static_cast<double>(it - choices.begin());
}

std::vector<double> points_at(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, "a list of points {x, y, z}");
  std::vector<double> flat;
  const auto count = static_cast<lua_Integer>(lua_rawlen(L, index));
  for (lua_Integer i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, i);
    const Eigen::Vector3d point = vector_at(L, lua_gettop(L), name + "[" + std::to_string(i) + "]");
    flat.insert(flat.end(), point.begin(), point.end());
    lua_pop(L, 1);
  }
  return flat;
}

std::vector<double> value_at(lua_State* L, int index, const std::string& name, const scene::Parameter& p) {
  switch (p.type) {
    case Type::kNumber:
      return {number_at(L, index, name)};
    case Type::kCount:
      return {static_cast<double>(
          integer_at(L, index, name, static_cast<std::int64_t>(p.low), static_cast<std::int64_t>(p.high)))};
    case Type::kFlag:
      if (lua_type(L, index) != LUA_TBOOLEAN) must_be(L, index, name, "true or false");
      return {lua_toboolean(L, index) != 0 ? 1.0 : 0.0};
    case Type::kSize:
      if (lua_type(L, index) == LUA_TNUMBER) return std::vector<double>(2, number_at(L, index, name));
      return numbers_at(L, index, name, 2, "a number or {x, y}");
    case Type::kRange:
      return numbers_at(L, index, name, 2, "{lowest, highest}");
    case Type::kVector: {
      const Eigen::Vector3d v = vector_at(L, index, name);
      return {v.x(), v.y(), v.z()};
    }
    case Type::kChoice:
      return {choice_at(L, index, name, p.choices)};
    case Type::kPoints:
      return points_at(L, index, name);
  }
  return {};
}

}  // namespace

std::vector<std::string> names_of(std::span<const scene::Parameter> parameters) {
  std::vector<std::string> names;
  for (const scene::Parameter& p : parameters) names.push_back(p.name);
  return names;
}

void read_parameters(lua_State* L, const Fields& fields, std::span<const scene::Parameter> parameters,
                     scene::ParameterValues& values) {
  for (const scene::Parameter& p : parameters)
    fields.with(p.name, [&](int i, const std::string& name) { values[p.name] = value_at(L, i, name, p); });
}

}  // namespace smartsurf::script
