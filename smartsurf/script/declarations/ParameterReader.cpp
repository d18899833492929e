#include "smartsurf/script/declarations/ParameterReader.h"

#include <algorithm>

namespace smartsurf::script {
namespace {

using Type = scene::Parameter::Type;

std::vector<double> check_points(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, "a list of points {x, y, z}");
  std::vector<double> coordinates;
  for_each_element(L, index, name, [&](int i, const std::string& element) {
    const Eigen::Vector3d point = check_vector(L, i, element);
    coordinates.insert(coordinates.end(), point.begin(), point.end());
  });
  return coordinates;
}

std::vector<double> check_parameter_value(lua_State* L, int index, const std::string& name,
                                          const scene::Parameter& p) {
  switch (p.type) {
    case Type::kNumber:
      return {check_number(L, index, name)};
    case Type::kCount:
      return {static_cast<double>(check_integer(L, index, name, static_cast<std::int64_t>(p.minimum),
                                                static_cast<std::int64_t>(p.maximum)))};
    case Type::kFlag:
      if (lua_type(L, index) != LUA_TBOOLEAN) throw_invalid_value(L, index, name, "true or false");
      return {lua_toboolean(L, index) != 0 ? 1.0 : 0.0};
    case Type::kSize:
      if (lua_type(L, index) == LUA_TNUMBER) return std::vector<double>(2, check_number(L, index, name));
      return check_numbers(L, index, name, 2, "a number or {x, y}");
    case Type::kRange:
      return check_numbers(L, index, name, 2, "{lowest, highest}");
    case Type::kVector: {
      const Eigen::Vector3d v = check_vector(L, index, name);
      return {v.x(), v.y(), v.z()};
    }
    case Type::kChoice:
      return {static_cast<double>(check_choice(L, index, name, p.choices))};
    case Type::kPointList:
      return check_points(L, index, name);
  }
  return {};
}

// The table that holds the parameter; empty for a field of the actuator or sensor itself.
std::string group_of(const scene::Parameter& p) {
  const std::size_t dot = p.name.find('.');
  return dot == std::string::npos ? "" : p.name.substr(0, dot);
}

// The parameters of a group, named as the fields of its table.
std::vector<scene::Parameter> members_of(const std::string& group,
                                         std::span<const scene::Parameter> parameters) {
  std::vector<scene::Parameter> members;
  for (const scene::Parameter& p : parameters)
    if (group_of(p) == group) members.emplace_back(p).name.erase(0, group.size() + 1);
  return members;
}

}  // namespace

int check_choice(lua_State* L, int index, const std::string& name, const std::vector<std::string>& choices) {
  const std::string chosen = lua_type(L, index) == LUA_TSTRING ? check_string(L, index, name) : "";
  const auto it = std::ranges::find(choices, chosen);
  if (it == choices.end()) throw_invalid_value(L, index, name, "one of " + join_names(choices));
  return static_cast<int>(it - choices.begin());
}

std::vector<std::string> parameter_names(std::span<const scene::Parameter> parameters) {
  std::vector<std::string> names;
  for (const scene::Parameter& p : parameters) {
    const std::string group = group_of(p);
    if (group.empty())
      names.push_back(p.name);
    else if (std::ranges::find(names, group) == names.end())
      names.push_back(group);
  }
  return names;
}

void read_parameters(lua_State* L, const TableReader& fields, std::span<const scene::Parameter> parameters,
                     scene::ParameterValues& values) {
  for (const std::string& field : parameter_names(parameters))
    fields.visit(field, [&](int i, const std::string& name) {
      const auto single = std::ranges::find(parameters, field, &scene::Parameter::name);
      if (single != parameters.end()) {
        values[field] = check_parameter_value(L, i, name, *single);
        return;
      }
      const std::vector<scene::Parameter> members = members_of(field, parameters);
      scene::ParameterValues of_group;
      if (lua_type(L, i) != LUA_TTABLE)
        throw_invalid_value(L, i, name, "a table of " + join_names(parameter_names(members)));
      read_parameters(L, TableReader(L, i, name, parameter_names(members)), members, of_group);
      for (auto& [member, value] : of_group) values[field + "." + member] = std::move(value);
    });
}

}  // namespace smartsurf::script
