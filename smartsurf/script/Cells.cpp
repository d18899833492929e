// cells: the surface's actuators and sensors, for a script that plays the controller.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "smartsurf/scene/Occupancy.h"
#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr const char* kType = "cells";

void require_cells(lua_State* L, const std::string& method) {
  if (luaL_testudata(L, 1, kType) == nullptr) throw Problem(method + ": call it with a colon, " + method);
}

// Rows and columns count from 1 in Lua, from 0 elsewhere.
int row_at(const Session& session, lua_State* L, int index, const std::string& method) {
  return static_cast<int>(integer_at(L, index, method + ": row", 1, session.spec.surface.rows)) - 1;
}

int column_at(const Session& session, lua_State* L, int index, const std::string& method) {
  return static_cast<int>(integer_at(L, index, method + ": column", 1, session.spec.surface.columns)) - 1;
}

std::string channel_at(lua_State* L, const std::vector<std::string>& known, const std::string& method) {
  const std::string name = text_at(L, 2, method + ": channel");
  for (const std::string& channel : known)
    if (channel == name) return name;
  const std::string near = suggestion(name, known);
  const std::string all = known.empty() ? "; the surface has none" : "; known: " + list_of(known);
  throw Problem(method + ": no channel " + show(L, 2) + (near.empty() ? all : near));
}

std::vector<std::string> actuator_channels(const Session& session) {
  std::vector<std::string> names;
  for (const scene::ActuatorChannel& channel : session.spec.surface.actuator_channels())
    names.push_back(channel.name);
  return names;
}

float target_value(lua_State* L, int index, const std::string& name) {
  const double value = number_at(L, index, name);
  if (std::abs(value) > 1e6) must_be(L, index, name, "in [-1000000, 1000000]");
  return static_cast<float>(value);
}

int target(Session& session, lua_State* L) {
  const std::string method = "cells:target";
  require_running(session, method);
  require_cells(L, method);
  const std::string channel = channel_at(L, actuator_channels(session), method);
  const int row = row_at(session, L, 3, method), column = column_at(session, L, 4, method);
  session.host->target(channel, row, column, target_value(L, 5, method + ": value"));
  return 0;
}

// Appends the `count` numbers of the list at `index`.
void append_list(Session& session, lua_State* L, int index, const std::string& name, int count) {
  if (lua_rawlen(L, index) != static_cast<lua_Unsigned>(count))
    throw Problem(name + ": a list of " + std::to_string(lua_rawlen(L, index)) + " values: must be " +
                  std::to_string(count));
  for (int i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, i);
    if (lua_type(L, -1) != LUA_TNUMBER || !(std::abs(lua_tonumber(L, -1)) <= 1e6))
      target_value(L, -1,
                   name + "[" + std::to_string(i) + "]");  // the same check, with the name for the message
    session.targets.push_back(static_cast<float>(lua_tonumber(L, -1)));
    lua_pop(L, 1);
  }
}

// All cells: one list of rows × columns values, row by row from the north, or a list of rows.
int targets(Session& session, lua_State* L) {
  const std::string method = "cells:targets";
  require_running(session, method);
  require_cells(L, method);
  const std::string channel = channel_at(L, actuator_channels(session), method);
  const scene::SurfaceSpec& surface = session.spec.surface;
  const std::string rule = "a list of " + std::to_string(surface.cells()) + " numbers, or of " +
                           std::to_string(surface.rows) + " rows";
  if (lua_type(L, 3) != LUA_TTABLE) must_be(L, 3, method + ": values", rule);
  session.interpreter->charge(L, static_cast<std::uint64_t>(surface.cells()));
  session.targets.clear();
  lua_rawgeti(L, 3, 1);
  const bool by_rows = lua_type(L, -1) == LUA_TTABLE;
  lua_pop(L, 1);
  if (!by_rows) {
    append_list(session, L, 3, method + ": values", surface.cells());
  } else {
    if (lua_rawlen(L, 3) != static_cast<lua_Unsigned>(surface.rows))
      throw Problem(method + ": values: " + std::to_string(lua_rawlen(L, 3)) + " rows: must be " + rule);
    for (int row = 1; row <= surface.rows; ++row) {
      const std::string name = method + ": values[" + std::to_string(row) + "]";
      lua_rawgeti(L, 3, row);
      if (lua_type(L, -1) != LUA_TTABLE) must_be(L, -1, name, "a list of numbers");
      append_list(session, L, lua_gettop(L), name, surface.columns);
      lua_pop(L, 1);
    }
  }
  session.host->targets(channel, session.targets);
  return 0;
}

// The channel that says which cells are there; where all are, a sensor may be called so.
bool is_mask(const Session& session, const std::string& channel) {
  if (channel != scene::kOccupancy) return false;
  const std::vector<std::string> sensors = session.spec.surface.sensor_channels();
  return std::ranges::find(sensors, channel) == sensors.end();
}

// As many numbers as the channel has components.
template <typename Read>
int read_cell(Session& session, lua_State* L, const std::string& method, Read read) {
  require_running(session, method);
  require_cells(L, method);
  std::vector<std::string> names;
  for (const scene::SensorChannel& c : session.channels) names.push_back(c.name);
  const std::string channel = channel_at(L, names, method);
  const int row = row_at(session, L, 3, method), column = column_at(session, L, 4, method);
  if (is_mask(session, channel)) {
    lua_pushnumber(L, session.spec.surface.is_empty(row, column) ? 0.0 : 1.0);
    return 1;
  }
  const int components =
      std::ranges::find(session.channels, channel, &scene::SensorChannel::name)->components;
  for (int k = 0; k < components; ++k) lua_pushnumber(L, static_cast<double>(read(channel, row, column, k)));
  return components;
}

int sense(Session& session, lua_State* L) {
  return read_cell(session, L, "cells:sense",
                   [&](const std::string& channel, int row, int column, int component) {
                     return session.host->sense(channel, row, column, component);
                   });
}

int truth(Session& session, lua_State* L) {
  return read_cell(session, L, "cells:truth",
                   [&](const std::string& channel, int row, int column, int component) {
                     return session.host->truth(channel, row, column, component);
                   });
}

void require_surface(const Session& session, const std::string& what) {
  if (!session.declared_at.contains("surface")) throw Problem(what + ": no surface{} is declared so far");
}

// x, y of the cell's centre.
int centre(Session& session, lua_State* L) {
  const std::string method = "cells:centre";
  require_surface(session, method);
  require_cells(L, method);
  const int row = row_at(session, L, 2, method), column = column_at(session, L, 3, method);
  const Eigen::Vector2d xy = session.spec.surface.centre(row, column);
  lua_pushnumber(L, xy.x());
  lua_pushnumber(L, xy.y());
  return 2;
}

int property(Session& session, lua_State* L) {
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  const scene::SurfaceSpec& surface = session.spec.surface;
  if (name == "rows" || name == "columns" || name == "pitch") require_surface(session, "cells." + name);
  if (name == "rows")
    lua_pushinteger(L, surface.rows);
  else if (name == "columns")
    lua_pushinteger(L, surface.columns);
  else if (name == "pitch")
    lua_pushnumber(L, surface.pitch);
  else
    lua_pushnil(L);
  return 1;
}

}  // namespace

void bind_cells(lua_State* L) {
  constexpr std::array<luaL_Reg, 5> kMethods{{{"target", guarded<target>},
                                              {"targets", guarded<targets>},
                                              {"sense", guarded<sense>},
                                              {"truth", guarded<truth>},
                                              {"centre", guarded<centre>}}};
  make_type(L, kType, kMethods, guarded<property>);
  lua_newuserdatauv(L, 0, 0);
  luaL_setmetatable(L, kType);
  lua_setglobal(L, "cells");
}

}  // namespace smartsurf::script
