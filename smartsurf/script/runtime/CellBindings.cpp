// cells: access to actuators and sensors for a script that acts as the controller.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr const char* kTypeName = "cells";

void require_cells_receiver(lua_State* L, const std::string& method) {
  if (luaL_testudata(L, 1, kTypeName) == nullptr)
    throw ScriptError(method + ": call it with a colon, " + method);
}

// Rows and columns are one-based in Lua and zero-based in C++.
int check_row(const ScriptContext& context, lua_State* L, int index, const std::string& method) {
  return static_cast<int>(check_integer(L, index, method + ": row", 1, context.spec.surface.rows)) - 1;
}

int check_column(const ScriptContext& context, lua_State* L, int index, const std::string& method) {
  return static_cast<int>(check_integer(L, index, method + ": column", 1, context.spec.surface.columns)) - 1;
}

std::string check_channel(lua_State* L, const std::vector<std::string>& known, const std::string& method) {
  const std::string name = check_string(L, 2, method + ": channel");
  for (const std::string& channel : known)
    if (channel == name) return name;
  const std::string hint = did_you_mean(name, known);
  const std::string all = known.empty() ? "; the surface has none" : "; known: " + join_names(known);
  throw ScriptError(method + ": no channel " + format_value(L, 2) + (hint.empty() ? all : hint));
}

std::vector<std::string> actuator_channel_names(const ScriptContext& context) {
  std::vector<std::string> names;
  for (const scene::ActuatorChannel& channel : context.spec.surface.actuator_channels())
    names.push_back(channel.name);
  return names;
}

float check_target(lua_State* L, int index, const std::string& name) {
  const double value = check_number(L, index, name);
  if (std::abs(value) > 1e6) throw_invalid_value(L, index, name, "in [-1000000, 1000000]");
  return static_cast<float>(value);
}

int target(ScriptContext& context, lua_State* L) {
  const std::string method = "cells:target";
  require_running(context, method);
  require_cells_receiver(L, method);
  const std::string channel = check_channel(L, actuator_channel_names(context), method);
  const int row = check_row(context, L, 3, method), column = check_column(context, L, 4, method);
  context.simulation->set_target(channel, row, column, check_target(L, 5, method + ": value"));
  return 0;
}

// Appends the `count` numbers of the list at `index` to target_scratch.
void append_targets(ScriptContext& context, lua_State* L, int index, const std::string& name, int count) {
  if (lua_rawlen(L, index) != static_cast<lua_Unsigned>(count))
    throw ScriptError(name + ": a list of " + std::to_string(lua_rawlen(L, index)) + " values: must be " +
                      std::to_string(count));
  for (int i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, i);
    if (lua_type(L, -1) != LUA_TNUMBER || !(std::abs(lua_tonumber(L, -1)) <= 1e6))
      check_target(L, -1, name + "[" + std::to_string(i) + "]");  // throws with the element's name
    context.target_scratch.push_back(static_cast<float>(lua_tonumber(L, -1)));
    lua_pop(L, 1);
  }
}

// Sets all cells from a flat list of rows × columns values, row by row from the north, or from a list of
// rows.
int targets(ScriptContext& context, lua_State* L) {
  const std::string method = "cells:targets";
  require_running(context, method);
  require_cells_receiver(L, method);
  const std::string channel = check_channel(L, actuator_channel_names(context), method);
  const scene::SurfaceSpec& surface = context.spec.surface;
  const std::string requirement = "a list of " + std::to_string(surface.cell_count()) + " numbers, or of " +
                                  std::to_string(surface.rows) + " rows";
  if (lua_type(L, 3) != LUA_TTABLE) throw_invalid_value(L, 3, method + ": values", requirement);
  context.interpreter->charge(L, static_cast<std::uint64_t>(surface.cell_count()));
  context.target_scratch.clear();
  lua_rawgeti(L, 3, 1);
  const bool by_rows = lua_type(L, -1) == LUA_TTABLE;
  lua_pop(L, 1);
  if (!by_rows) {
    append_targets(context, L, 3, method + ": values", surface.cell_count());
  } else {
    if (lua_rawlen(L, 3) != static_cast<lua_Unsigned>(surface.rows))
      throw ScriptError(method + ": values: " + std::to_string(lua_rawlen(L, 3)) + " rows: must be " +
                        requirement);
    for (int row = 1; row <= surface.rows; ++row) {
      const std::string name = method + ": values[" + std::to_string(row) + "]";
      lua_rawgeti(L, 3, row);
      if (lua_type(L, -1) != LUA_TTABLE) throw_invalid_value(L, -1, name, "a list of numbers");
      append_targets(context, L, lua_gettop(L), name, surface.columns);
      lua_pop(L, 1);
    }
  }
  context.simulation->set_targets(channel, context.target_scratch);
  return 0;
}

// True if `channel` is the built-in occupancy mask. A surface without empty cells has none, and a sensor may
// use its name.
bool is_occupancy_mask(const ScriptContext& context, const std::string& channel) {
  if (channel != scene::kOccupancyChannel) return false;
  const std::vector<std::string> sensors = context.spec.surface.sensor_channels();
  return std::ranges::find(sensors, channel) == sensors.end();
}

// Pushes one number per component of the channel.
template <typename Read>
int push_cell_reading(ScriptContext& context, lua_State* L, const std::string& method, Read read) {
  require_running(context, method);
  require_cells_receiver(L, method);
  std::vector<std::string> names;
  for (const scene::SensorChannel& c : context.channels) names.push_back(c.name);
  const std::string channel = check_channel(L, names, method);
  const int row = check_row(context, L, 3, method), column = check_column(context, L, 4, method);
  if (is_occupancy_mask(context, channel)) {
    lua_pushnumber(L, context.spec.surface.is_empty(row, column) ? 0.0 : 1.0);
    return 1;
  }
  const int components =
      std::ranges::find(context.channels, channel, &scene::SensorChannel::name)->components;
  if (lua_checkstack(L, components) == 0)
    throw ScriptError(method + ": there is no room for " + std::to_string(components) + " values");
  for (int k = 0; k < components; ++k) lua_pushnumber(L, static_cast<double>(read(channel, row, column, k)));
  return components;
}

int sense(ScriptContext& context, lua_State* L) {
  return push_cell_reading(context, L, "cells:sense",
                           [&](const std::string& channel, int row, int column, int component) {
                             return context.simulation->sense(channel, row, column, component);
                           });
}

int truth(ScriptContext& context, lua_State* L) {
  return push_cell_reading(context, L, "cells:truth",
                           [&](const std::string& channel, int row, int column, int component) {
                             return context.simulation->read_ground_truth(channel, row, column, component);
                           });
}

void require_surface(const ScriptContext& context, const std::string& subject) {
  if (!context.declared_at.contains("surface"))
    throw ScriptError(subject + ": no surface{} is declared so far");
}

// Returns x, y of the cell's centre.
int centre(ScriptContext& context, lua_State* L) {
  const std::string method = "cells:centre";
  require_surface(context, method);
  require_cells_receiver(L, method);
  const int row = check_row(context, L, 2, method), column = check_column(context, L, 3, method);
  const Eigen::Vector2d xy = context.spec.surface.centre(row, column);
  lua_pushnumber(L, xy.x());
  lua_pushnumber(L, xy.y());
  return 2;
}

int rows(ScriptContext& context, lua_State* L) {
  require_surface(context, "cells.rows");
  lua_pushinteger(L, context.spec.surface.rows);
  return 1;
}

int columns(ScriptContext& context, lua_State* L) {
  require_surface(context, "cells.columns");
  lua_pushinteger(L, context.spec.surface.columns);
  return 1;
}

int pitch(ScriptContext& context, lua_State* L) {
  require_surface(context, "cells.pitch");
  lua_pushnumber(L, context.spec.surface.pitch);
  return 1;
}

}  // namespace

void bind_cells(lua_State* L) {
  constexpr std::array<luaL_Reg, 5> kMethods{{{"target", guarded<target>},
                                              {"targets", guarded<targets>},
                                              {"sense", guarded<sense>},
                                              {"truth", guarded<truth>},
                                              {"centre", guarded<centre>}}};
  constexpr std::array<luaL_Reg, 3> kProperties{
      {{"rows", guarded<rows>}, {"columns", guarded<columns>}, {"pitch", guarded<pitch>}}};
  register_userdata_type(L, kTypeName, kMethods, kProperties);
  lua_newuserdatauv(L, 0, 0);
  luaL_setmetatable(L, kTypeName);
  lua_setglobal(L, "cells");
}

}  // namespace smartsurf::script
