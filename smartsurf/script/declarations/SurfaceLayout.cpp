// The layout fields of surface{}: actuators, cells, mask, layout, positions, modules, base, tilt.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>

#include "smartsurf/scene/CellOverlap.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

// Called once per cell; `index` is the stack index of its value, `name` describes the cell in messages.
using CellVisitor = std::function<void(int row, int column, int index, const std::string& name)>;

std::string cell_description(const std::string& name, int row, int column) {
  return name + " at (" + std::to_string(row + 1) + ", " + std::to_string(column + 1) + ")";
}

// Visits a pattern of characters, one string per row, which repeats over the surface. '.' and ' ' are nil.
void visit_pattern(lua_State* L, int index, const std::string& name, const scene::SurfaceSpec& s,
                   const CellVisitor& visit) {
  std::vector<std::string> rows;
  for_each_element(L, index, name, [&](int i, const std::string& element) {
    rows.push_back(check_string(L, i, element));
    if (rows.back().empty() || rows.back().size() != rows.front().size())
      throw ScriptError(element + ": " + std::to_string(rows.back().size()) +
                        " characters: must be as many as in the first row, " +
                        std::to_string(rows.front().size()));
  });
  const int height = static_cast<int>(rows.size()), width = static_cast<int>(rows.front().size());
  if (s.rows % height != 0 || s.columns % width != 0)
    throw ScriptError(name + ": a pattern of " + std::to_string(height) + " × " + std::to_string(width) +
                      " does not repeat evenly on " + std::to_string(s.rows) + " × " +
                      std::to_string(s.columns) + " cells");
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      const char key = rows[r % height][c % width];
      if (key == '.' || key == ' ')
        lua_pushnil(L);
      else
        lua_pushlstring(L, &key, 1);
      visit(r, c, lua_gettop(L), cell_description(name, r, c));
      lua_pop(L, 1);
    }
}

void visit_function(lua_State* L, int index, const std::string& name, const scene::SurfaceSpec& s,
                    const CellVisitor& visit) {
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      lua_pushvalue(L, index);
      lua_pushinteger(L, r + 1);
      lua_pushinteger(L, c + 1);
      lua_call(L, 2, 1);
      visit(r, c, lua_gettop(L), cell_description(name, r, c));
      lua_pop(L, 1);
    }
}

void visit_rows(lua_State* L, int index, const std::string& name, const scene::SurfaceSpec& s,
                const CellVisitor& visit) {
  if (lua_rawlen(L, index) != static_cast<lua_Unsigned>(s.rows))
    throw ScriptError(name + ": " + std::to_string(lua_rawlen(L, index)) + " rows: must be " +
                      std::to_string(s.rows));
  for (int r = 0; r < s.rows; ++r) {
    lua_rawgeti(L, index, r + 1);
    const std::string row_name = name + "[" + std::to_string(r + 1) + "]";
    if (lua_type(L, -1) != LUA_TTABLE || lua_rawlen(L, -1) != static_cast<lua_Unsigned>(s.columns))
      throw_invalid_value(L, -1, row_name, "a list of " + std::to_string(s.columns) + " values");
    for (int c = 0; c < s.columns; ++c) {
      lua_rawgeti(L, -1, c + 1);
      visit(r, c, lua_gettop(L), cell_description(name, r, c));
      lua_pop(L, 1);
    }
    lua_pop(L, 1);
  }
}

// Visits one value per cell, given as a function of row and column, a list of rows or a pattern of
// characters.
void visit_cells(ScriptContext& context, lua_State* L, int index, const std::string& name,
                 const scene::SurfaceSpec& s, const CellVisitor& visit) {
  index = lua_absindex(L, index);
  context.interpreter->charge(L, static_cast<std::uint64_t>(s.cell_count()));
  if (lua_type(L, index) == LUA_TFUNCTION) return visit_function(L, index, name, s, visit);
  if (lua_type(L, index) != LUA_TTABLE || lua_rawlen(L, index) == 0)
    throw_invalid_value(L, index, name,
                        "a function of row and column, a list of rows, or a pattern of strings");
  lua_rawgeti(L, index, 1);
  const bool pattern = lua_type(L, -1) == LUA_TSTRING;
  lua_pop(L, 1);
  (pattern ? visit_pattern : visit_rows)(L, index, name, s, visit);
}

std::vector<std::string> actuator_names(const NamedActuators& actuators) {
  std::vector<std::string> names;
  for (const NamedActuator& a : actuators) names.push_back(a.name);
  return names;
}

// The actuator of a cell, given by its letter, its number, or true if there is only one. nil and false are
// empty cells.
std::int8_t check_actuator_index(lua_State* L, int index, const std::string& name,
                                 const std::vector<std::string>& names) {
  if (lua_isnil(L, index) || (lua_isboolean(L, index) && !lua_toboolean(L, index))) return scene::kEmptyCell;
  if (lua_isboolean(L, index) && names.size() == 1) return 0;
  std::string key;
  if (lua_isinteger(L, index)) key = std::to_string(lua_tointeger(L, index));
  if (lua_type(L, index) == LUA_TSTRING) key = lua_tostring(L, index);
  const auto it = std::ranges::find(names, key);
  if (it == names.end())
    throw_invalid_value(L, index, name, "one of " + join_names(names) + ", or nil for an empty cell");
  return static_cast<std::int8_t>(it - names.begin());
}

void append_hex_poses(scene::SurfaceSpec& s) {
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c)
      s.cell_poses.push_back(scene::hexagonal_pose(s.rows - 1 - r, c, s.pitch));
}

scene::CellPose check_cell_pose(lua_State* L, int index, const std::string& name) {
  const std::string requirement = "{x, y} or {x, y, angle}";
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  scene::CellPose pose;
  if (lua_rawlen(L, index) > 0) {
    const int count = lua_rawlen(L, index) == 3 ? 3 : 2;
    const std::vector<double> v = check_numbers(L, index, name, count, requirement);
    return {v[0], v[1], count == 3 ? v[2] : 0.0};
  }
  const TableReader fields(L, index, name, {"x", "y", "angle"});
  fields.require("x");
  fields.require("y");
  fields.read("x", pose.x);
  fields.read("y", pose.y);
  fields.read("angle", pose.angle);
  return pose;
}

// Reads cell poses in row-major order; false is an empty cell. Without rows and columns, the surface has one
// row.
void read_positions(lua_State* L, int index, const std::string& name, bool has_size, scene::SurfaceSpec& s,
                    std::vector<bool>& occupied) {
  if (lua_type(L, index) != LUA_TTABLE || lua_rawlen(L, index) == 0)
    throw_invalid_value(L, index, name, "a list of {x, y, angle}");
  const auto count = static_cast<lua_Integer>(lua_rawlen(L, index));
  if (!has_size) {
    if (count > 4096) throw ScriptError(name + ": more than 4096 cells in one row: give rows and columns");
    s.rows = 1;
    s.columns = static_cast<int>(count);
  }
  if (count > s.cell_count())
    throw ScriptError(name + ": " + std::to_string(count) +
                      " positions: must be at most rows × columns = " + std::to_string(s.cell_count()));
  s.cell_poses.assign(s.cell_count(), {});
  occupied.assign(s.cell_poses.size(), false);
  lua_Integer cell = 0;
  for_each_element(L, index, name, [&](int i, const std::string& element) {
    occupied[cell] = !(lua_isboolean(L, i) && !lua_toboolean(L, i));
    if (occupied[cell]) s.cell_poses[cell] = check_cell_pose(L, i, element);
    ++cell;
  });
}

// Modules of rows × columns cells, placed side by side on a grid.
struct ModuleLayout {
  int rows = 0, columns = 0;     // cells per module
  double gap = 0.0;              // between adjacent modules, u
  std::vector<std::string> map;  // one character per module: its actuator, '#' or empty ('.' or ' ')
};

ModuleLayout check_modules(lua_State* L, int index, const std::string& name) {
  const TableReader fields(L, index, name, {"size", "map", "gap"});
  fields.require("size");
  fields.require("map");
  ModuleLayout m;
  fields.visit("size", [&](int i, const std::string& size_name) {
    const auto size = check_numbers(L, i, size_name, 2, "{rows, columns} of one module");
    for (const double v : size)
      if (v != std::floor(v) || v < 1 || v > 4096)
        throw_invalid_value(L, i, size_name, "{rows, columns}, integers from 1 to 4096");
    m.rows = static_cast<int>(size[0]);
    m.columns = static_cast<int>(size[1]);
  });
  fields.visit("map", [&](int i, const std::string& map_name) {
    const std::string requirement = "a list of strings, one character per module, '.' for none";
    if (lua_type(L, i) != LUA_TTABLE || lua_rawlen(L, i) == 0)
      throw_invalid_value(L, i, map_name, requirement);
    for_each_element(L, i, map_name, [&](int k, const std::string& element) {
      m.map.push_back(check_string(L, k, element));
      if (m.map.back().empty() || m.map.back().size() != m.map.front().size())
        throw_invalid_value(L, i, map_name, requirement);
    });
  });
  fields.read("gap", m.gap);
  if (m.gap < 0.0) throw ScriptError(name + ".gap = " + format_value(m.gap) + ": must be 0 or more");
  return m;
}

void layout_modules(const ModuleLayout& m, const std::string& name, bool has_size,
                    const std::vector<std::string>& names, scene::SurfaceSpec& s) {
  const auto module_rows = static_cast<int>(m.map.size()),
             module_columns = static_cast<int>(m.map.front().size());
  if (m.rows * module_rows > 4096 || m.columns * module_columns > 4096)
    throw ScriptError(name + ": more than 4096 rows or columns");
  if (has_size && (s.rows != m.rows * module_rows || s.columns != m.columns * module_columns))
    throw ScriptError(name + ": the modules have " + std::to_string(m.rows * module_rows) + " rows and " +
                      std::to_string(m.columns * module_columns) +
                      " columns together; leave out surface.rows and surface.columns");
  s.rows = m.rows * module_rows;
  s.columns = m.columns * module_columns;
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      const char key = m.map[r / m.rows][c / m.columns];
      const auto it = std::ranges::find(names, std::string(1, key));
      if (key != '.' && key != ' ' && key != '#' && it == names.end())
        throw ScriptError(name + ".map: '" + std::string(1, key) + "': must be one of " + join_names(names) +
                          ", # or .");
      const bool is_empty = key == '.' || key == ' ';
      const auto actuator_index = static_cast<std::int8_t>(it == names.end() ? 0 : it - names.begin());
      s.actuator_of_cell.push_back(is_empty ? scene::kEmptyCell : actuator_index);
      const int module_from_south = module_rows - 1 - r / m.rows;
      if (m.gap > 0.0)
        s.cell_poses.push_back(
            {c * s.pitch + c / m.columns * m.gap, (s.rows - 1 - r) * s.pitch + module_from_south * m.gap, 0});
    }
}

void read_tilt(lua_State* L, int index, const std::string& name, scene::SurfaceSpec& s) {
  const auto degrees = check_numbers(L, index, name, 2, "{degrees about x, degrees about y}");
  for (const double d : degrees)
    if (std::abs(d) > 90.0)
      throw ScriptError(name + ": " + format_value(d) + " degrees: must be in [-90, 90]");
  s.tilt_rad = Eigen::Vector2d(degrees[0], degrees[1]) * std::numbers::pi / 180.0;
}

// All actuators share one top size: that of the first actuator that sets it, else the default, in pitches.
void set_actuators(const NamedActuators& actuators, scene::SurfaceSpec& s) {
  const double default_top = scene::PinSpec{}.top_x * s.pitch;
  s.pin.top_x = s.pin.top_y = default_top;
  std::vector<double> top{default_top, default_top};
  const auto with_top =
      std::ranges::find_if(actuators, [](const NamedActuator& a) { return a.spec.has("top"); });
  if (with_top != actuators.end()) top = with_top->spec.numbers("top");
  for (const NamedActuator& a : actuators) s.actuators.emplace_back(a.spec).values.try_emplace("top", top);
}

// The cell as the script gives it: "positions[3] = {1, 2}", or "cell (2, 3)".
std::string placed_cell(const scene::SurfaceSpec& s, int cell, bool has_positions) {
  if (!has_positions)
    return "cell (" + std::to_string(cell / s.columns + 1) + ", " + std::to_string(cell % s.columns + 1) +
           ")";
  const scene::CellPose& p = s.cell_poses[cell];
  return "positions[" + std::to_string(cell + 1) + "] = {" + format_value(p.x) + ", " + format_value(p.y) +
         (p.angle != 0.0 ? ", " + format_value(p.angle) : "") + "}";
}

void check_overlap(const scene::SurfaceSpec& s, bool has_positions) {
  const auto overlap = scene::find_overlap(s);
  if (!overlap) return;
  char depth[32];
  std::snprintf(depth, sizeof depth, "%.3g", overlap->depth);
  throw ScriptError("surface." + placed_cell(s, overlap->first, has_positions) + " and " +
                    placed_cell(s, overlap->second, has_positions) + " overlap by " + depth +
                    " u: must not overlap with tops of " + format_value(s.pin.top_x) + " × " +
                    format_value(s.pin.top_y) + " u");
}

}  // namespace

void read_layout(ScriptContext& context, lua_State* L, const TableReader& fields, scene::SurfaceSpec& s) {
  const bool has_size = fields.has("rows") || fields.has("columns");
  int layout_count = 0;
  for (const char* const field : {"layout", "positions", "modules"}) layout_count += fields.has(field);
  if (layout_count > 1) throw ScriptError("surface: give only one of layout, positions and modules");
  if (fields.has("actuator") && fields.has("actuators"))
    throw ScriptError("surface: give actuator or actuators, not both");

  NamedActuators actuators;
  for (const char* const field : {"actuator", "actuators"})
    fields.visit(field, [&](int i, const std::string& name) {
      actuators = field == std::string_view("actuators") ? check_actuators(context, L, i, name)
                                                         : check_single_actuator(context, L, i, name);
    });
  set_actuators(actuators, s);
  const std::vector<std::string> names =
      actuators.empty() ? std::vector<std::string>{"1"} : actuator_names(actuators);

  std::vector<bool> occupied;
  fields.visit("layout", [&](int i, const std::string& name) {
    const std::string layout = lua_type(L, i) == LUA_TSTRING ? lua_tostring(L, i) : "";
    if (layout != "hex" && layout != "rectangular") throw_invalid_value(L, i, name, "'rectangular' or 'hex'");
    if (layout == "hex") append_hex_poses(s);
  });
  fields.visit("positions",
               [&](int i, const std::string& name) { read_positions(L, i, name, has_size, s, occupied); });
  fields.visit("modules", [&](int i, const std::string& name) {
    layout_modules(check_modules(L, i, name), name, has_size, names, s);
  });

  auto cells = [&]() -> std::vector<std::int8_t>& {
    if (s.actuator_of_cell.empty()) s.actuator_of_cell.assign(s.cell_count(), 0);
    return s.actuator_of_cell;
  };
  if (names.size() > 1 && !fields.has("cells") && !fields.has("modules"))
    throw ScriptError("surface.actuators: " + std::to_string(names.size()) +
                      " actuators need surface.cells to assign them");
  fields.visit("cells", [&](int i, const std::string& name) {
    visit_cells(context, L, i, name, s, [&](int r, int c, int value, const std::string& cell) {
      std::int8_t& which = cells()[s.index(r, c)];
      const std::int8_t requested = check_actuator_index(L, value, cell, names);
      if (which != scene::kEmptyCell) which = requested;
    });
  });
  fields.visit("mask", [&](int i, const std::string& name) {
    visit_cells(context, L, i, name, s, [&](int r, int c, int value, const std::string&) {
      if (!lua_toboolean(L, value)) cells()[s.index(r, c)] = scene::kEmptyCell;
    });
  });
  for (std::size_t i = 0; i < occupied.size(); ++i)
    if (!occupied[i]) cells()[i] = scene::kEmptyCell;
  if (!s.actuator_of_cell.empty() &&
      std::ranges::all_of(s.actuator_of_cell, [](std::int8_t a) { return a == scene::kEmptyCell; }))
    throw ScriptError("surface: all cells are empty: cells, mask and positions exclude every cell");
  fields.visit("base", [&](int i, const std::string& name) {
    s.base_heights.assign(s.cell_count(), 0.0F);
    visit_cells(context, L, i, name, s, [&](int r, int c, int value, const std::string& cell) {
      s.base_heights[s.index(r, c)] = static_cast<float>(check_number(L, value, cell));
    });
  });
  fields.visit("tilt", [&](int i, const std::string& name) { read_tilt(L, i, name, s); });
  derive_pin_spec(s);
  check_overlap(s, fields.has("positions"));
}

}  // namespace smartsurf::script
